//! Chassis angles -> wheel centres in the rover frame.
//!
//! Rigid: the wheels do not move. Rocker-bogie (Tarokh & McDermott 2005): the differential turns the left rocker by beta
//! and the right one by -beta about the pivot; each bogie turns by rho about its pivot on the rocker. Positive angles are
//! nose down, as pitch. Links are rigid, pivots have no play and no stops.

use super::rover::{Chassis, RigidChassis, RockerBogieChassis, Rover};
use crate::geometry::{DVec2, DVec3};
use crate::math;

pub(super) const MAX_WHEELS: usize = 6;
/// beta, rho left, rho right.
pub(super) const ANGLES: usize = 3;
/// Rockers and bogies.
pub(super) const LINKS: usize = 4;

/// The wheels of one rover.
#[derive(Clone, Debug)]
pub(super) struct Linkage {
    chassis: Chassis,
    pub wheel_radius_m: f64,
}

/// Wheel centres, rover frame, and their derivatives by each angle; wheels that the chassis lacks stay at zero.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wheels {
    pub centres_m: [DVec3; MAX_WHEELS],
    pub by_angle: [[DVec3; ANGLES]; MAX_WHEELS],
}

impl Linkage {
    pub(super) fn new(rover: &Rover) -> Linkage {
        Linkage { chassis: rover.chassis.clone(), wheel_radius_m: rover.wheel_radius_m() }
    }

    pub(super) fn wheel_count(&self) -> usize {
        match self.chassis {
            Chassis::Rigid(_) => 4,
            Chassis::RockerBogie(_) => 6,
        }
    }

    /// Whether the chassis can set every wheel on any ground.
    pub(super) fn articulated(&self) -> bool {
        matches!(self.chassis, Chassis::RockerBogie(_))
    }

    /// The wheels at beta, rho left and rho right.
    pub(super) fn place(&self, angles: &[f64; ANGLES]) -> Wheels {
        let mut wheels = Wheels::default();
        self.each_wheel(&links_rad(angles).map(Turn::about_y), |wheel, centre_m, by_angle| {
            (wheels.centres_m[wheel], wheels.by_angle[wheel]) = (centre_m, by_angle);
        });
        wheels
    }

    /// The wheels' centres alone, for those who search without derivatives; the turns are those of [`links_rad`].
    #[inline(always)]
    pub(super) fn centres_m(&self, turns: &[Turn; LINKS]) -> [DVec3; MAX_WHEELS] {
        let mut centres_m = [DVec3::ZERO; MAX_WHEELS];
        self.each_wheel(turns, |wheel, centre_m, _| centres_m[wheel] = centre_m);
        centres_m
    }

    /// Calls `set(wheel, centre, its derivatives by the angles)`; inlined, so that what the caller drops is not computed.
    #[inline(always)]
    fn each_wheel(&self, turns: &[Turn; LINKS], set: impl FnMut(usize, DVec3, [DVec3; ANGLES])) {
        match &self.chassis {
            Chassis::Rigid(chassis) => rigid(chassis, self.wheel_radius_m, set),
            Chassis::RockerBogie(chassis) => rocker_bogie(chassis, self.wheel_radius_m, turns, set),
        }
    }
}

/// What the height of a wheel's contact makes of the rover's stand, for small turns: the stand of any chassis is a sum over its wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct WheelShare {
    /// Where the level rover's wheel stands, ahead and to the left.
    pub place_m: DVec2,
    /// Of the slope ahead and of the slope to the left, per metre; of the height at the rover's origin.
    pub ahead: f64,
    pub left: f64,
    pub up: f64,
}

impl Rover {
    /// One share a wheel, in the order of the linkage.
    pub(crate) fn wheel_shares(&self) -> Vec<WheelShare> {
        match &self.chassis {
            Chassis::Rigid(chassis) => {
                let (x, y) = (0.5 * chassis.wheelbase_m, 0.5 * chassis.track_m);
                let share =
                    |(x, y)| WheelShare { place_m: DVec2::new(x, y), ahead: 0.25 / x, left: 0.25 / y, up: 0.25 };
                [(x, y), (x, -y), (-x, y), (-x, -y)].map(share).to_vec()
            }
            Chassis::RockerBogie(chassis) => {
                let RockerBogieChassis { rocker_wheel_x_m, bogie_front_x_m, bogie_rear_x_m, .. } = *chassis;
                let front = (chassis.bogie_pivot_x_m - bogie_rear_x_m) / (bogie_front_x_m - bogie_rear_x_m);
                let rocker_m = chassis.bogie_pivot_x_m - rocker_wheel_x_m;
                // Of a side's slope: the bogie's pivot above the rocker's wheel, over the length between them.
                let slopes = [-1.0 / rocker_m, front / rocker_m, (1.0 - front) / rocker_m];
                let places_m = [rocker_wheel_x_m, bogie_front_x_m, bogie_rear_x_m];
                let share = |side: f64, wheel: usize| {
                    let pivot_m = chassis.rocker_pivot_x_m - rocker_wheel_x_m;
                    let pivot = slopes[wheel] * pivot_m + if wheel == 0 { 1.0 } else { 0.0 };
                    let ahead = 0.5 * slopes[wheel];
                    WheelShare {
                        place_m: DVec2::new(places_m[wheel], 0.5 * side * chassis.track_m),
                        ahead,
                        left: side * pivot / chassis.track_m,
                        up: 0.5 * pivot - ahead * chassis.rocker_pivot_x_m,
                    }
                };
                [1.0, -1.0].into_iter().flat_map(|side| (0..3).map(move |wheel| share(side, wheel))).collect()
            }
        }
    }

    /// Height of the highest pivot, or axle, above the wheels' plane.
    pub(crate) fn highest_pivot_m(&self) -> f64 {
        match &self.chassis {
            Chassis::Rigid(_) => self.wheel_radius_m(),
            Chassis::RockerBogie(chassis) => chassis.rocker_pivot_z_m.max(chassis.bogie_pivot_z_m),
        }
    }

    /// The shortest of the lengths over which heights of wheels turn a link.
    pub(crate) fn shortest_lever_m(&self) -> f64 {
        match &self.chassis {
            Chassis::Rigid(chassis) => chassis.wheelbase_m.min(chassis.track_m),
            Chassis::RockerBogie(chassis) => {
                let bogie_m = chassis.bogie_front_x_m - chassis.bogie_rear_x_m;
                bogie_m.min(chassis.bogie_pivot_x_m - chassis.rocker_wheel_x_m).abs().min(chassis.track_m)
            }
        }
    }
}

#[inline(always)]
fn rigid(chassis: &RigidChassis, radius_m: f64, mut set: impl FnMut(usize, DVec3, [DVec3; ANGLES])) {
    let (x, y) = (0.5 * chassis.wheelbase_m, 0.5 * chassis.track_m);
    for (wheel, (sx, sy)) in [(x, y), (x, -y), (-x, y), (-x, -y)].into_iter().enumerate() {
        set(wheel, DVec3::new(sx, sy, radius_m), [DVec3::ZERO; ANGLES]);
    }
}

#[inline(always)]
fn rocker_bogie(
    chassis: &RockerBogieChassis,
    radius_m: f64,
    turns: &[Turn; LINKS],
    mut set: impl FnMut(usize, DVec3, [DVec3; ANGLES]),
) {
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        let y = 0.5 * sign * chassis.track_m;
        let pivot = DVec3::new(chassis.rocker_pivot_x_m, y, chassis.rocker_pivot_z_m);
        let bogie_pivot = DVec3::new(chassis.bogie_pivot_x_m, y, chassis.bogie_pivot_z_m);
        let (rocker, bogie) = (turns[side], turns[2 + side]);

        let arm = DVec3::new(chassis.rocker_wheel_x_m, y, radius_m) - pivot;
        set(3 * side, pivot + rocker.of(arm), [rocker.rate(arm) * sign, DVec3::ZERO, DVec3::ZERO]);

        let bogie_at = pivot + rocker.of(bogie_pivot - pivot);
        let bogie_by_beta = rocker.rate(bogie_pivot - pivot) * sign;
        for (place, x) in [(1, chassis.bogie_front_x_m), (2, chassis.bogie_rear_x_m)] {
            let arm = DVec3::new(x, y, radius_m) - bogie_pivot;
            let mut by_angle = [bogie_by_beta + bogie.rate(arm) * sign, DVec3::ZERO, DVec3::ZERO];
            by_angle[1 + side] = bogie.rate(arm);
            set(3 * side + place, bogie_at + bogie.of(arm), by_angle);
        }
    }
}

/// How far each link is turned against the chassis: rockers left and right, bogies left and right.
#[inline(always)]
pub(super) fn links_rad(&[beta, rho_left, rho_right]: &[f64; ANGLES]) -> [f64; LINKS] {
    [beta, -beta, beta + rho_left, rho_right - beta]
}

/// A turn about the y axis, nose down positive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub sin: f64,
    pub cos: f64,
}

impl Turn {
    fn about_y(angle_rad: f64) -> Turn {
        let (sin, cos) = math::sin_cos(angle_rad);
        Turn { sin, cos }
    }

    fn of(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.x * self.cos + v.z * self.sin, v.y, v.z * self.cos - v.x * self.sin)
    }

    /// Derivative of `of` by the angle.
    fn rate(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.z * self.cos - v.x * self.sin, 0.0, -v.x * self.cos - v.z * self.sin)
    }
}
