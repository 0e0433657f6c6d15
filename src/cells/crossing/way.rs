//! A heading that bounds leave open -> the rover set down along its way through the cell, until nothing is left between two stands.
//!
//! In: the contact solver, ground and bodies, half the way to the next cell's middle. Out: how the rover stands in the cell's middle, and
//! the range of its slope along the heading; nothing where a stand on the way is beyond a limit. Stands are 2.5 cm apart at first, with
//! the belly as much longer, so that nothing slips between two plates. Where all of them keep as far from every limit as they differ
//! among each other, that is all; else ways between two stands are halved until the two do, or lie 4 mm apart: then half of what they
//! differ by is kept. On a plane stands do not differ, and limits are exact. Frame: world. Not modelled: what differs between two stands
//! by more than they show.

use super::params::Limits;
use super::pose::Demand;
use crate::drive::{GroundContact, plate_clearance_m};
use crate::geometry::{DVec2, Pose};
use crate::math;
use crate::scene::{Obstacle, Scene};

/// Stands are this far apart at most, and are halved down to this.
const FIRST_M: f64 = 0.025;
const FINEST_M: f64 = 0.004;

/// A rover on its way through a cell.
pub(super) struct Driven<'a> {
    pub scene: &'a Scene,
    pub contact: &'a GroundContact<'a>,
    pub limits: &'a Limits,
    /// Half the length and half the width of the rover's outline.
    pub outline_m: DVec2,
    pub bodies: &'a [&'a Obstacle],
    pub middle_m: DVec2,
    pub yaw_rad: f64,
    /// How far the way goes to both sides.
    pub half_m: f64,
}

/// The rover at one place of its way.
#[derive(Clone, Copy)]
struct Stand {
    way_m: f64,
    demand: Demand,
    /// Slope along the heading.
    rise: f64,
    /// What is left of each limit.
    left: [f64; LIMITS],
}

/// Tilt, side slip, belly.
const LIMITS: usize = 3;

impl Driven<'_> {
    /// The stand in the middle, and the least and the greatest slope along the heading.
    pub(super) fn through(&self) -> Option<(Demand, [f64; 2])> {
        let spaces = 2 * (self.half_m / FIRST_M).ceil() as usize;
        let space_m = 2.0 * self.half_m / spaces as f64;
        // The middle is what bars most headings, and is asked with the belly as long as it is; then how it stands there is known.
        let upright = self.upright(0.0)?;
        let middle = self.over_ground(0.0, upright, 0.0)?;
        let stand = |k: usize| match 2 * k == spaces {
            true => self.over_ground(0.0, upright, space_m),
            false => self.stand(k as f64 * space_m - self.half_m, space_m),
        };
        let stands: Option<Vec<Stand>> = (0..=spaces).map(stand).collect();
        let stands = stands?;
        let reserve = differences(&stands);
        let is_kept = stands.windows(2).all(|pair| self.is_kept_between(&pair[0], &pair[1], &reserve));
        let slope =
            |pick: fn(f64, f64) -> f64, none: f64| stands.iter().fold(none, |rise, stand| pick(rise, stand.rise));
        is_kept.then(|| (middle.demand, [slope(f64::min, f64::INFINITY), slope(f64::max, f64::NEG_INFINITY)]))
    }

    /// Whether the limits are kept between two stands, each of which keeps them: by this reserve, or by less where more stands are made.
    fn is_kept_between(&self, a: &Stand, b: &Stand, reserve: &[f64; LIMITS]) -> bool {
        let keeps =
            |reserve: &[f64; LIMITS], share: f64| (0..LIMITS).all(|k| a.left[k].min(b.left[k]) >= share * reserve[k]);
        let way_m = b.way_m - a.way_m;
        if keeps(reserve, 1.0) {
            return true;
        }
        if way_m <= FINEST_M {
            return keeps(&differences(&[*a, *b]), 0.5);
        }
        let Some(between) = self.stand(0.5 * (a.way_m + b.way_m), way_m) else { return false };
        let reserve = differences(&[*a, between, *b]);
        self.is_kept_between(a, &between, &reserve) && self.is_kept_between(&between, b, &reserve)
    }

    /// The rover at a place of its way, its belly longer by `swept_m`; `None` where it cannot stand within its limits.
    fn stand(&self, way_m: f64, swept_m: f64) -> Option<Stand> {
        self.over_ground(way_m, self.upright(way_m)?, swept_m)
    }

    /// How the wheels stand there, within the limits of tilt and side slip, nothing asked of the belly yet: it is the dearest to ask about.
    fn upright(&self, way_m: f64) -> Option<(Pose, Demand)> {
        let (sin, cos) = math::sin_cos(self.yaw_rad);
        let at = self.middle_m + DVec2::new(cos, sin) * way_m;
        let pose = self.contact.stand_among(self.bodies, [at.x, at.y, self.yaw_rad], None).ok()?.pose;
        let upright = demand_of(&pose, self.limits.belly_m);
        upright.is_within(self.limits).then_some((pose, upright))
    }

    /// A stand of which only the belly is not known, its belly longer by `swept_m`; `None` where it touches.
    fn over_ground(&self, way_m: f64, (pose, upright): (Pose, Demand), swept_m: f64) -> Option<Stand> {
        let belly_m = self.limits.belly_m;
        let plate_m = self.outline_m + DVec2::new(0.5 * swept_m, 0.0);
        let clearance_m = plate_clearance_m(plate_m, belly_m, self.scene, self.bodies, &pose)?;
        let Limits { tilt, side_slip, .. } = *self.limits;
        let left = [tilt - math::tan(upright.tilt_rad), side_slip - upright.side_slope, clearance_m];
        Some(Stand { way_m, demand: Demand { clearance_m, ..upright }, rise: -math::tan(pose.pitch_rad), left })
    }
}

/// What a stand takes up of which only the belly is not known.
fn demand_of(pose: &Pose, clearance_m: f64) -> Demand {
    let (cos_pitch, cos_roll) = (math::cos(pose.pitch_rad), math::cos(pose.roll_rad));
    let side_slope = math::sin(pose.roll_rad).abs() / (cos_pitch * cos_roll);
    let tilt_rad = math::acos((cos_pitch * cos_roll).clamp(-1.0, 1.0));
    Demand { tilt_rad, side_slope, clearance_m }
}

/// How far what is left of each limit differs among stands.
fn differences(stands: &[Stand]) -> [f64; LIMITS] {
    std::array::from_fn(|k| {
        let all = || stands.iter().map(|stand| stand.left[k]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    })
}
