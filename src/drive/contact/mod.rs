//! Position, heading and ground -> how the rover stands.
//!
//! In: x, y and yaw in the world, and a guess. Out: z, pitch, roll and the linkage's angles, with which the wheels touch.
//! A wheel touches at one point along the local normal; its residual is e = (c_z - f(c_xy)) / sqrt(1 + |grad f|^2) - r for
//! a wheel of radius r with its centre at c. A rocker-bogie has six wheels and six unknowns: every e is 0. A rigid chassis
//! has four wheels and three unknowns: the sum of e^2 is least. Source: Tarokh & McDermott 2005; Hewitt et al. 2017,
//! "Rover model". The pose's origin is the chassis centre projected onto the wheel-contact plane. Not modelled: wheel width,
//! sinkage, play, weight (a rigid rover's fourth wheel does not lift off, it shares the error), and the belly.

mod gauss_newton;
mod nelder_mead;
mod residual;
#[cfg(test)]
mod tests;

use super::linkage::Linkage;
use super::params::ContactSolver;
use super::rolled::Rolling;
use super::surface::Surface;
use super::{Contact, DriveError, Rover};
use crate::geometry::{DVec2, DVec3, Pose};
use crate::math;
use crate::scene::{Ground, Obstacle, Scene};
use residual::{Problem, UNKNOWNS, Unknowns};

/// Beyond this tilt, or linkage angle, a rover lies rather than stands, radians (60 degrees).
const TIP_OVER_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// What a wheel of an articulated chassis may lack of touching, metres; more where the tolerance is coarse.
const TOUCH_M: f64 = 1e-6;
/// A search may end this many tolerances from its solution.
const TOUCH_TOLERANCES: f64 = 100.0;

/// A rover that stands on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPose {
    pub pose: Pose,
    pub contact: Contact,
}

/// Sets one rover on the ground of one scene.
#[derive(Clone, Debug)]
pub struct GroundContact<'a> {
    linkage: Linkage,
    surface: Surface<'a>,
    solver: ContactSolver,
    tolerance: Option<f64>,
    /// Whether wheels roll over solid bodies too.
    over_bodies: bool,
    /// Bodies farther than this from the rover's place, seen from above, touch neither wheel nor belly.
    reach_m: f64,
}

impl<'a> GroundContact<'a> {
    /// With the solver's own tolerance.
    pub fn new(rover: &Rover, scene: &'a Scene, solver: ContactSolver) -> GroundContact<'a> {
        let reach_m = rover.turning_radius_m().max(rover.wheelbase_m() + rover.track_m()) + rover.wheel_diameter_m;
        GroundContact {
            linkage: Linkage::new(rover),
            surface: Surface::new(scene),
            solver,
            tolerance: None,
            over_bodies: false,
            reach_m,
        }
    }

    /// The same, on the solid bodies as well as on the ground (`rolled`).
    pub fn over_bodies(self, over_bodies: bool) -> GroundContact<'a> {
        GroundContact { over_bodies, ..self }
    }

    /// The bodies that may touch a rover at a place; none where it does not feel them.
    pub(crate) fn bodies_near(&self, place_m: DVec2, more_m: f64) -> Vec<&'a Obstacle> {
        let all = if self.over_bodies { &self.surface.scene().obstacles[..] } else { &[] };
        all.iter().filter(|body| !body.is_beyond(place_m, self.reach_m + more_m)).collect()
    }

    /// The same, its solutions as near as this, metres and radians; `None` = the solver's own tolerance.
    pub fn within(self, tolerance: Option<f64>) -> GroundContact<'a> {
        GroundContact { tolerance, ..self }
    }

    /// The rover at (x, y) with this heading. `near` is a stance close by (the step before), to start from.
    pub fn stand(
        &self,
        x_m: f64,
        y_m: f64,
        yaw_rad: f64,
        near: Option<&ContactPose>,
    ) -> Result<ContactPose, DriveError> {
        self.stand_among(&self.bodies_near(DVec2::new(x_m, y_m), 0.0), [x_m, y_m, yaw_rad], near)
    }

    /// The same among bodies that hold all those that are near.
    pub(crate) fn stand_among(
        &self,
        bodies: &[&Obstacle],
        [x_m, y_m, yaw_rad]: [f64; 3],
        near: Option<&ContactPose>,
    ) -> Result<ContactPose, DriveError> {
        let no = |reason: &str| DriveError::NoContact { x_m, y_m, reason: reason.to_string() };
        // A smooth ground without bodies is felt alike by both contacts: the plain one is exact, and quicker.
        let is_rolled =
            self.over_bodies && !(bodies.is_empty() && matches!(self.surface.ground(), Ground::Polynomial(_)));
        let surface = if is_rolled {
            let (sin, cos) = math::sin_cos(yaw_rad);
            let ahead = DVec2::new(cos, sin);
            self.surface.with(Rolling { bodies, ahead, radius_m: self.linkage.wheel_radius_m })
        } else {
            self.surface
        };
        let problem = Problem::new(&self.linkage, &surface, x_m, y_m, yaw_rad);
        let plane = problem.plane().ok_or_else(|| no("a wheel is outside the yard"))?;
        // A guess from the step before may reach over the edge or lie worse than the plane does.
        let start = near
            .map(unknowns_of)
            .filter(|guess| problem.cost(guess).is_some_and(|cost| problem.cost(&plane).is_none_or(|flat| cost < flat)))
            .unwrap_or(plane);
        let (found, iterations) = match self.solver {
            ContactSolver::GaussNewton => gauss_newton::solve(&problem, start, self.tolerance),
            ContactSolver::NelderMead => nelder_mead::solve(&problem, start, self.tolerance),
            ContactSolver::PlaneFit => (plane, 1),
        };
        let residuals = problem.residuals(&found).ok_or_else(|| no("a wheel is outside the yard"))?;
        let residual_m = residuals.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
        let upright = math::cos(found[1]) * math::cos(found[2]);
        let bent = found[3..].iter().any(|angle| angle.abs() > TIP_OVER_RAD);
        // `upright` is the z component of the rover's z axis; written so that NaN fails too.
        if bent || !(upright >= math::cos(TIP_OVER_RAD) && found[1].abs() <= TIP_OVER_RAD) {
            return Err(no("the ground is so steep that the rover would tip over"));
        }
        let touch_m = self.tolerance.map_or(TOUCH_M, |tolerance| TOUCH_M.max(TOUCH_TOLERANCES * tolerance));
        if self.linkage.articulated() && self.solver != ContactSolver::PlaneFit && residual_m > touch_m {
            return Err(no("its wheels cannot all touch the ground"));
        }
        let [z_m, pitch_rad, roll_rad, rocker_rad, bogie_left_rad, bogie_right_rad] = found;
        Ok(ContactPose {
            pose: Pose { position_m: DVec3::new(x_m, y_m, z_m), roll_rad, pitch_rad, yaw_rad },
            contact: Contact { rocker_rad, bogie_left_rad, bogie_right_rad, residual_m, iterations },
        })
    }

    /// Signed distance of each wheel from touching, metres: what the solvers bring to zero.
    pub fn residuals_m(&self, stance: &ContactPose) -> Option<Vec<f64>> {
        let position = stance.pose.position_m;
        let problem = Problem::new(&self.linkage, &self.surface, position.x, position.y, stance.pose.yaw_rad);
        Some(problem.residuals(&unknowns_of(stance))?[..self.linkage.wheel_count()].to_vec())
    }
}

fn unknowns_of(stance: &ContactPose) -> Unknowns {
    let ContactPose { pose, contact } = stance;
    let unknowns: [f64; UNKNOWNS] = [
        pose.position_m.z,
        pose.pitch_rad,
        pose.roll_rad,
        contact.rocker_rad,
        contact.bogie_left_rad,
        contact.bogie_right_rad,
    ];
    unknowns
}
