//! A place and a heading -> the rover set down there, and refused where it may not stand.
//!
//! In: the contact solver and, where the drive is over bodies (`drive.over_bodies`), the limits of the rover's file. Out: a stance, or why there is
//! none. Without limits every stance of the solver counts: the default, and all that it costs. With them a stance counts up to the rover's
//! tilt, and while nothing reaches its belly. Frame: world. Not modelled: side slip, since a drive knows no soil.

use super::belly::clearance_m;
use super::contact::{ContactPose, GroundContact};
use super::limits::RoverLimits;
use super::{DriveError, DriveParams, Rover};
use crate::geometry::{DVec2, Pose};
use crate::math;
use crate::scene::Scene;

/// Sets one rover down along its way through one scene.
pub(super) struct Footing<'a> {
    contact: GroundContact<'a>,
    /// `None` where whatever the wheels can touch will do.
    kept: Option<Kept<'a>>,
}

/// What every stance keeps.
#[derive(Clone, Copy)]
struct Kept<'a> {
    rover: &'a Rover,
    limits: &'a RoverLimits,
    scene: &'a Scene,
}

impl<'a> Footing<'a> {
    /// By these limits, over bodies; by none, over the ground alone.
    pub(super) fn new(params: &'a DriveParams, scene: &'a Scene, limits: Option<&'a RoverLimits>) -> Footing<'a> {
        let rover = &*params.rover;
        let contact = GroundContact::new(rover, scene, params.contact).within(params.contact_tolerance_m);
        let kept = limits.map(|limits| Kept { rover, limits, scene });
        Footing { contact: contact.over_bodies(kept.is_some()), kept }
    }

    /// As [`GroundContact::stand`].
    pub(super) fn stand(
        &self,
        x_m: f64,
        y_m: f64,
        yaw_rad: f64,
        near: Option<&ContactPose>,
    ) -> Result<ContactPose, DriveError> {
        let Some(kept) = &self.kept else { return self.contact.stand(x_m, y_m, yaw_rad, near) };
        let bodies = self.contact.bodies_near(DVec2::new(x_m, y_m), 0.0);
        let stance = self.contact.stand_among(&bodies, [x_m, y_m, yaw_rad], near)?;
        let Kept { rover, limits, scene } = *kept;
        let no = |reason: String| Err(DriveError::NoContact { x_m, y_m, reason });
        let is_upright = upright(&stance.pose) >= math::cos(limits.max_tilt_deg.to_radians());
        if !is_upright {
            return no(format!("it would tilt by more than {} degrees", limits.max_tilt_deg));
        }
        if clearance_m(rover, rover.belly_clearance_m(), scene, &bodies, &stance.pose).is_none() {
            return no("its belly would touch".to_string());
        }
        Ok(stance)
    }
}

/// Cosine of the tilt.
fn upright(pose: &Pose) -> f64 {
    math::cos(pose.pitch_rad) * math::cos(pose.roll_rad)
}
