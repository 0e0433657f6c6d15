//! A rover's figures -> a model of boxes, wheels and rods, to be met by rays. For pictures only: no stage collides with it.
//!
//! Frame: `rover`. Every wheel is set down on the ground below its axle, so the model stands on it however the chassis bends.

use super::colour::{Colour, Palette};
use super::top::axles;
use crate::drive::Rover;
use crate::drive::rover::Chassis;
use crate::geometry::{DVec2, DVec3, Pose, Transform};
use crate::scene::Scene;

/// Where a ray met the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub range_m: f64,
    /// Outward, world.
    pub normal: DVec3,
    /// Which part: see [`Model::colour`].
    pub part: usize,
}

enum Part {
    Block {
        low: DVec3,
        high: DVec3,
    },
    /// A cylinder along y with flat ends.
    Wheel {
        centre: DVec3,
        radius: f64,
        half_width: f64,
    },
    /// A rod with round ends.
    Rod {
        from: DVec3,
        to: DVec3,
        radius: f64,
    },
}

/// A rover standing in the yard.
pub(super) struct Model {
    parts: Vec<(Part, Colour)>,
    world_from_rover: Transform,
    rover_from_world: Transform,
    /// The box around all parts, rover frame: nearly all rays of a picture miss it.
    low_m: DVec3,
    high_m: DVec3,
}

impl Model {
    pub(super) fn new(
        rover: &Rover,
        pose: &Pose,
        rover_from_sensor: &Transform,
        scene: &Scene,
        palette: &Palette,
    ) -> Model {
        let world_from_rover = pose.transform();
        let rover_from_world = world_from_rover.inverse();
        let radius = rover.wheel_diameter_m / 2.0;
        let set_down = |axle: DVec2| {
            let at = world_from_rover.point(axle.extend(0.0));
            let ground_m = scene.ground_below_m(at.x, at.y);
            rover_from_world.point(DVec3::new(at.x, at.y, ground_m + radius))
        };
        let wheels: Vec<DVec3> = axles(&rover.chassis).into_iter().map(set_down).collect();
        let mut parts = Vec::new();
        for &centre in &wheels {
            parts.push((
                Part::Wheel { centre, radius, half_width: 0.36 * radius.min(0.2) + 0.1 * radius },
                palette.wheel,
            ));
            parts.push((
                Part::Wheel { centre, radius: 0.45 * radius, half_width: 0.36 * radius.min(0.2) + 0.13 * radius },
                palette.rover_metal,
            ));
        }
        let half = DVec2::new(rover.length_m, rover.width_m) / 2.0;
        let floor_m = 1.15 * rover.wheel_diameter_m;
        let body_m = 0.16 * rover.length_m.min(1.5 * rover.width_m);
        let block = |x: f64, y: f64, low: f64, high: f64| Part::Block {
            low: DVec3::new(-x, -y, low),
            high: DVec3::new(x, y, high),
        };
        parts.push((block(0.66 * half.x, 0.52 * half.y, floor_m, floor_m + body_m), palette.rover_body));
        let deck_m = floor_m + body_m;
        parts.push((block(0.72 * half.x, 0.66 * half.y, deck_m, deck_m + 0.012), palette.rover_deck));
        let rod = 0.11 * radius + 0.008;
        parts.extend(
            suspension(&rover.chassis, &wheels, floor_m)
                .into_iter()
                .map(|(from, to)| (Part::Rod { from, to, radius: rod }, palette.rover_metal)),
        );
        let head = rover_from_sensor.translation_m;
        let foot =
            DVec3::new(head.x.clamp(-0.6 * half.x, 0.6 * half.x), head.y.clamp(-0.5 * half.y, 0.5 * half.y), deck_m);
        if head.z > deck_m {
            parts.push((Part::Rod { from: foot, to: head, radius: 0.018 }, palette.rover_metal));
        }
        let size = DVec3::new(0.045, 0.045, 0.04);
        parts.push((Part::Block { low: head - size, high: head + size }, palette.wheel));
        parts.push((
            Part::Rod { from: head + DVec3::Z * 0.05, to: head + DVec3::Z * 0.07, radius: 0.04 },
            palette.estimated_path,
        ));
        let (low_m, high_m) = parts
            .iter()
            .map(|(part, _)| part.bounds())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)));
        Model { parts, world_from_rover, rover_from_world, low_m, high_m }
    }

    pub(super) fn colour(&self, part: usize) -> Colour {
        self.parts[part].1
    }

    /// The first part that a ray (unit direction) meets within `max_m`.
    pub(super) fn first_hit(&self, origin: DVec3, dir: DVec3, max_m: f64) -> Option<Met> {
        let (o, d) = (self.rover_from_world.point(origin), self.rover_from_world.direction(dir));
        let (to_low, to_high) = ((self.low_m - o) / d, (self.high_m - o) / d);
        let (enter, leave) = (to_low.min(to_high).max_element(), to_low.max(to_high).min_element());
        // A ray along a side of the box gives NaN, and is asked of the parts.
        if enter > leave || leave < 0.0 || enter > max_m {
            return None;
        }
        let mut best: Option<Met> = None;
        for (number, (part, _)) in self.parts.iter().enumerate() {
            let limit = best.map_or(max_m, |b| b.range_m);
            if let Some((range_m, normal)) = part.first_hit(o, d)
                && range_m > 1e-6
                && range_m < limit
            {
                best = Some(Met { range_m, normal, part: number });
            }
        }
        best.map(|met| Met { normal: self.world_from_rover.direction(met.normal), ..met })
    }
}

/// Rods between the wheels: rockers and bogies, or the beams of a rigid frame. `wheels` are as [`axles`] lists them: right, left.
fn suspension(chassis: &Chassis, wheels: &[DVec3], floor_m: f64) -> Vec<(DVec3, DVec3)> {
    let mut rods = Vec::new();
    for side in 0..2 {
        let wheel = |axle: usize| wheels[2 * axle + side];
        match chassis {
            Chassis::Rigid(_) => {
                rods.push((wheel(0), wheel(1)));
                let middle = (wheel(0) + wheel(1)) / 2.0;
                rods.push((middle, DVec3::new(middle.x, 0.3 * middle.y, floor_m + 0.03)));
            }
            Chassis::RockerBogie(rocker) => {
                let y = wheel(0).y;
                let pivot = DVec3::new(rocker.rocker_pivot_x_m, 0.72 * y, rocker.rocker_pivot_z_m.max(floor_m));
                // The bogie rides on its own wheels.
                let mean_wheel = (wheel(1) + wheel(2)) / 2.0;
                let bogie = DVec3::new(rocker.bogie_pivot_x_m, 0.8 * y, mean_wheel.z + 0.5 * rocker.bogie_pivot_z_m);
                let rocker_elbow = DVec3::new(wheel(0).x, 0.8 * y, pivot.z);
                rods.push((pivot, rocker_elbow));
                rods.push((rocker_elbow, wheel(0)));
                rods.push((pivot, bogie));
                rods.push((bogie, wheel(1)));
                rods.push((bogie, wheel(2)));
                rods.push((pivot, DVec3::new(pivot.x, 0.2 * y, pivot.z)));
            }
        }
    }
    rods
}

impl Part {
    /// Its least and greatest coordinates.
    fn bounds(&self) -> (DVec3, DVec3) {
        match *self {
            Part::Block { low, high } => (low, high),
            Part::Wheel { centre, radius, half_width } => {
                let half = DVec3::new(radius, half_width, radius);
                (centre - half, centre + half)
            }
            Part::Rod { from, to, radius } => (from.min(to) - radius, from.max(to) + radius),
        }
    }

    /// Range and outward normal.
    fn first_hit(&self, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        match *self {
            Part::Block { low, high } => {
                let (to_low, to_high) = ((low - o) / d, (high - o) / d);
                let (near, far) = (to_low.min(to_high), to_low.max(to_high));
                let (enter, leave) = (near.max_element(), far.min_element());
                let axis = if enter == near.x {
                    DVec3::X
                } else if enter == near.y {
                    DVec3::Y
                } else {
                    DVec3::Z
                };
                (enter <= leave && enter > 0.0).then(|| (enter, -axis * d.dot(axis).signum()))
            }
            Part::Wheel { centre, radius, half_width } => {
                let (p, flat) = (o - centre, DVec3::new(1.0, 0.0, 1.0));
                let (a, b) = ((d * flat).length_squared(), (p * flat).dot(d));
                let tread = quadratic(a, b, (p * flat).length_squared() - radius * radius)
                    .map(|t| (t, (p + d * t) * flat / radius))
                    .filter(|&(t, _)| (p.y + d.y * t).abs() <= half_width);
                let t = (-half_width * d.y.signum() - p.y) / d.y;
                let disc = (t > 0.0 && ((p + d * t) * flat).length() <= radius).then(|| (t, -DVec3::Y * d.y.signum()));
                [tread, disc].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
            }
            Part::Rod { from, to, radius } => {
                let axis = (to - from).try_normalize()?;
                let across = |v: DVec3| v - axis * v.dot(axis);
                let (p, q) = (across(o - from), across(d));
                let side = quadratic(q.length_squared(), p.dot(q), p.length_squared() - radius * radius)
                    .map(|t| (t, (p + q * t) / radius))
                    .filter(|&(t, _)| (0.0..=(to - from).length()).contains(&(o + d * t - from).dot(axis)));
                let end = |c: DVec3| {
                    let t = quadratic(1.0, (o - c).dot(d), (o - c).length_squared() - radius * radius)?;
                    Some((t, (o + d * t - c) / radius))
                };
                [side, end(from), end(to)].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
            }
        }
    }
}

/// The smaller root of a t^2 + 2 b t + c = 0, if it is positive.
pub(super) fn quadratic(a: f64, b: f64, c: f64) -> Option<f64> {
    let root = b * b - a * c;
    let t = (-b - root.sqrt()) / a;
    (root >= 0.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rays_meet_parts_where_paper_says() {
        let close = |got: Option<(f64, DVec3)>, range: f64, normal: DVec3| {
            let (t, n) = got.expect("a hit");
            assert!((t - range).abs() < 1e-12 && (n - normal).length() < 1e-12, "{t} {n}");
        };
        let block = Part::Block { low: DVec3::splat(-1.0), high: DVec3::splat(1.0) };
        close(block.first_hit(DVec3::new(-3.0, 0.2, 0.3), DVec3::X), 2.0, -DVec3::X);
        let wheel = Part::Wheel { centre: DVec3::ZERO, radius: 0.5, half_width: 0.1 };
        close(wheel.first_hit(DVec3::new(-2.0, 0.05, 0.3), DVec3::X), 1.6, DVec3::new(-0.8, 0.0, 0.6));
        close(wheel.first_hit(DVec3::new(0.2, 1.0, 0.1), -DVec3::Y), 0.9, DVec3::Y);
        let rod = Part::Rod { from: DVec3::ZERO, to: DVec3::Z, radius: 0.25 };
        close(rod.first_hit(DVec3::new(-1.0, 0.0, 0.5), DVec3::X), 0.75, -DVec3::X);
        close(rod.first_hit(DVec3::new(0.0, 0.0, 3.0), -DVec3::Z), 1.75, DVec3::Z);
        assert!(rod.first_hit(DVec3::new(-1.0, 0.3, 0.5), DVec3::X).is_none());
    }
}
