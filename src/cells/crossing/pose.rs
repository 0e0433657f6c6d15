//! A cell and eight headings -> can the rover stand there: the truth of the pose, `cells.labels.rover.pose`.
//!
//! In: a lattice (gaps bridged, bodies raised), limits, the contact solver on ground and bodies. Out: [`PoseTruth`]: a bit a heading, a cost, and the
//! worst tilt and the least clearance of the passable headings. Heading k looks along k times 45 degrees of the map, counter-clockwise from
//! its x axis; the rover's origin is over the cell's middle. A heading is passable where no wheel stands within its reach of a step or gap beyond
//! the limit along the heading (`steps`, at the nodes under the level rover's wheels, as the truth of the cell has them), the rover stands
//! with all wheels in the yard, its tilt and the slope across it are within the limits, and nothing reaches its belly, a plate of its outline.
//!
//! Source: ACE (Otsu et al. 2020): heights' ranges under each wheel and under the belly bound the stand first (`bounds`); the solver is asked
//! only where the bounds leave the verdict open. Deviation: what bounds decide has the middle of the bounds as tilt and clearance.
//! Frames: headings and cells in `map`, the stand in `world`. Not modelled: how the rover comes there, and what lies between two cells' middles.

use super::bounds::{Bounds, Verdict};
use super::gaps::Gaps;
use super::headings::Axis;
use super::lattice::Lattice;
use super::params::Limits;
use super::patch::Patch;
use super::placement::Placement;
use crate::drive::params::ContactSolver;
use crate::drive::{GroundContact, Rover, clearance_m};
use crate::geometry::{DVec2, Pose};
use crate::math;
use crate::scene::{Obstacle, Scene};

/// Headings, a bit each.
const HEADINGS: usize = 8;

/// How a rover stands that is centred in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseTruth {
    /// Bit k set: it can stand there looking along k times 45 degrees of the map.
    pub headings: u8,
    /// The mean over the headings of the largest share of a limit that is taken up; 1 for a heading that is not passable.
    pub cost: f32,
    /// The worst tilt and the least clearance under the belly of the passable headings; `None` where no heading is.
    pub worst: Option<PoseWorst>,
}

/// What a rover meets at worst by a passable heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseWorst {
    pub tilt_rad: f32,
    pub clearance_m: f32,
}

/// What one heading takes up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Demand {
    pub tilt_rad: f64,
    /// Rise over run across the heading.
    pub side_slope: f64,
    pub clearance_m: f64,
}

/// Judges poses on one scene.
pub(super) struct PoseAssessor<'a> {
    scene: &'a Scene,
    rover: &'a Rover,
    limits: Limits,
    contact: GroundContact<'a>,
    bounds: Bounds,
    /// Off, the solver is asked at every heading: what the bounds are checked against.
    pub has_bounds: bool,
}

/// A square of the map and the truths of its cells that poses read.
pub(super) struct Square<'a> {
    pub lattice: &'a Lattice,
    pub gaps: &'a Gaps,
    pub axes: &'a [Axis; 4],
    pub placement: &'a Placement,
}

impl Demand {
    /// Of a stand of which only the belly is not known: as far above all as it stands.
    fn of(pose: &Pose, belly_m: f64) -> Demand {
        let (cos_pitch, cos_roll) = (math::cos(pose.pitch_rad), math::cos(pose.roll_rad));
        let side_slope = math::sin(pose.roll_rad).abs() / (cos_pitch * cos_roll);
        let tilt_rad = math::acos((cos_pitch * cos_roll).clamp(-1.0, 1.0));
        Demand { tilt_rad, side_slope, clearance_m: belly_m }
    }

    pub(super) fn is_within(&self, limits: &Limits) -> bool {
        // Written so that NaN fails.
        math::tan(self.tilt_rad) <= limits.tilt && self.side_slope <= limits.side_slip && self.clearance_m >= 0.0
    }

    fn share(&self, limits: &Limits, step_share: f64) -> f64 {
        let tilt = math::tan(self.tilt_rad) / limits.tilt;
        let belly = 1.0 - self.clearance_m / limits.belly_m;
        tilt.max(self.side_slope / limits.side_slip).max(belly).max(step_share).clamp(0.0, 1.0)
    }
}

impl<'a> PoseAssessor<'a> {
    pub(super) fn new(rover: &'a Rover, limits: Limits, scene: &'a Scene) -> PoseAssessor<'a> {
        let contact = GroundContact::new(rover, scene, ContactSolver::GaussNewton).over_bodies(true);
        PoseAssessor { scene, rover, limits, contact, bounds: Bounds::new(rover), has_bounds: true }
    }

    /// How far from a cell's middle a pose reads the lattice, metres.
    pub(super) fn reach_m(&self) -> f64 {
        self.bounds.reach_m()
    }

    /// The truth of the pose over a place of the map.
    pub(super) fn assess(&self, square: &Square, middle_m: DVec2, patch: &mut Patch) -> PoseTruth {
        let at = square.placement.world(middle_m);
        let ground = self.bounds.ground(square, middle_m);
        if self.has_bounds {
            let [reach, window] = self.bounds.patch_nodes(square.lattice.spacing_m);
            patch.fill(square, &ground, middle_m, reach, window);
        }
        let mut bodies: Option<Vec<&Obstacle>> = None;
        let mut truth = PoseTruth { headings: 0, cost: 0.0, worst: None };
        let mut cost = 0.0;
        let mut worst: Option<Demand> = None;
        for heading in 0..HEADINGS {
            let demand = self.step_share(square, middle_m, heading).filter(|&share| share <= 1.0).and_then(|share| {
                let bound = self
                    .has_bounds
                    .then(|| self.bounds.verdict(square, patch, &ground, middle_m, heading, &self.limits));
                let demand = match bound {
                    Some(Verdict::Passable(demand)) if self.is_inside(at) => Some(demand),
                    Some(Verdict::Barred) => None,
                    _ => {
                        let bodies = bodies.get_or_insert_with(|| self.contact.bodies_near(at, 0.0));
                        self.stand(bodies, at, self.yaw_rad(square.placement, heading))
                    }
                };
                demand.filter(|demand| demand.is_within(&self.limits)).map(|demand| (demand, share))
            });
            let Some((demand, step_share)) = demand else {
                cost += 1.0;
                continue;
            };
            truth.headings |= 1 << heading;
            cost += demand.share(&self.limits, step_share);
            let so_far = worst.get_or_insert(demand);
            so_far.tilt_rad = so_far.tilt_rad.max(demand.tilt_rad);
            so_far.clearance_m = so_far.clearance_m.min(demand.clearance_m);
        }
        truth.cost = (cost / HEADINGS as f64) as f32;
        let narrow =
            |worst: Demand| PoseWorst { tilt_rad: worst.tilt_rad as f32, clearance_m: worst.clearance_m as f32 };
        PoseTruth { worst: worst.map(narrow), ..truth }
    }

    /// Whether every wheel of a rover at a place is in the yard, whatever its heading and tilt.
    fn is_inside(&self, at: DVec2) -> bool {
        let reach_m = self.bounds.reach_m();
        at.min_element() >= reach_m && at.max_element() <= self.scene.extent_m - reach_m
    }

    fn yaw_rad(&self, placement: &Placement, heading: usize) -> f64 {
        let turn_rad = math::atan2(placement.turn.y, placement.turn.x);
        math::wrap_angle(turn_rad + heading as f64 * std::f64::consts::FRAC_PI_4)
    }

    /// What the solver says; `None` where the rover cannot stand within its limits.
    fn stand(&self, bodies: &[&Obstacle], at: DVec2, yaw_rad: f64) -> Option<Demand> {
        let pose = self.contact.stand_among(bodies, [at.x, at.y, yaw_rad], None).ok()?.pose;
        let belly_m = self.limits.belly_m;
        // The belly is the dearest to ask about, and is asked last.
        let upright = Demand::of(&pose, belly_m);
        if !upright.is_within(&self.limits) {
            return None;
        }
        clearance_m(self.rover, belly_m, self.scene, bodies, &pose).map(|clearance_m| Demand { clearance_m, ..upright })
    }

    /// The largest share of the step and gap limits that a wheel takes up along the heading; `None` where a node has no height.
    fn step_share(&self, square: &Square, middle_m: DVec2, heading: usize) -> Option<f64> {
        let Square { lattice, axes, .. } = square;
        let axis = &axes[heading % 4];
        let ahead = DVec2::new(axis.cols as f64, axis.rows as f64).normalize() * if heading < 4 { 1.0 } else { -1.0 };
        let mut most = 0.0_f64;
        for place in self.bounds.level_places_m() {
            // A place between two nodes stands on both: headings turned by a quarter take the turned nodes.
            for [col, row] in lattice.nodes_at(middle_m + ahead.rotate(place)) {
                most = most.max(self.step_share_at(square, axis, col, row)?);
            }
        }
        Some(most)
    }

    /// The same of one node.
    fn step_share_at(&self, square: &Square, axis: &Axis, col: usize, row: usize) -> Option<f64> {
        let Square { lattice, gaps, .. } = square;
        let own = row * lattice.side + col;
        let step = axis.rows * lattice.side as i64 + axis.cols;
        let top = |nodes: i64| lattice.top_m[(own as i64 + nodes * step) as usize];
        if !top(0).is_finite() {
            return None;
        }
        let reach = axis.reach as i64;
        // As the truth of the cell has it, less the slope; here what both sides of the wheel's own reach share of it.
        let [up_m, down_m] = [top(reach) - top(0), top(0) - top(-reach)];
        let smaller_m = if up_m.abs() < down_m.abs() { up_m } else { down_m };
        let shared_m = if up_m * down_m > 0.0 { smaller_m } else { 0.0 };
        let mut most_m = 0.0_f64;
        for nodes in 1..=reach {
            let sloped_m = shared_m * nodes as f64 / reach as f64;
            for met_m in [top(nodes) - top(0) - sloped_m, top(0) - top(-nodes) - sloped_m] {
                most_m = most_m.max(met_m.abs());
            }
        }
        let width_m = gaps.width_m.get(own).copied().filter(|width_m| width_m.is_finite()).unwrap_or(0.0);
        Some((most_m / self.limits.step_m).max(width_m / self.limits.gap_m))
    }
}
