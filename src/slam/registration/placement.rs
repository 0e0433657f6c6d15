//! Where one surface lies in another's axes, and the small steps between such placements.
//!
//! In: a [`Motion`], steps of x, y, z (metres) and three turns (radians). Out: a rotation and a place. Turns are about the older surface's axes.

use super::Motion;
use crate::geometry::{DMat3, DVec3};
use crate::math;
use crate::slam::matrix::Vector;

/// Where the newer surface lies in the older's axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub turn: DMat3,
    pub place_m: DVec3,
}

impl Placement {
    pub(super) fn of(motion: &Motion) -> Placement {
        let (sin, cos) = math::sin_cos(motion.mean[2]);
        let turn = DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z);
        Placement { turn, place_m: DVec3::new(motion.mean[0], motion.mean[1], motion.climb_m) }
    }

    /// The shift and the small turn that lead from another placement here.
    pub(super) fn from(&self, other: &Placement) -> Vector<6> {
        let shift = self.place_m - other.place_m;
        let apart = self.turn * other.turn.transpose();
        let turn = 0.5
            * DVec3::new(
                apart.y_axis.z - apart.z_axis.y,
                apart.z_axis.x - apart.x_axis.z,
                apart.x_axis.y - apart.y_axis.x,
            );
        [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
    }

    pub(super) fn shift(&mut self, step: &Vector<6>) {
        self.place_m += DVec3::new(step[0], step[1], step[2]);
        self.turn = rotation(DVec3::new(step[3], step[4], step[5])) * self.turn;
    }

    pub(super) fn heading_rad(&self) -> f64 {
        math::atan2(self.turn.x_axis.y, self.turn.x_axis.x)
    }
}

/// The rotation about a vector by its length (Rodrigues).
fn rotation(by_rad: DVec3) -> DMat3 {
    let angle_rad = by_rad.length();
    let Some(axis) = by_rad.try_normalize() else { return DMat3::IDENTITY };
    let (sin, cos) = math::sin_cos(angle_rad);
    let of = |v: DVec3| v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos));
    DMat3::from_cols(of(DVec3::X), of(DVec3::Y), of(DVec3::Z))
}
