//! Where the map lies in the world, in the plane.
//!
//! In: where the kept sweep's sensor truly was, and where it is believed to have been. Out: the turn and shift that take a place of the
//! map to the ground that the points there truly lie on. Deviation: errors of roll, pitch and height move points by less than a cell of
//! a decimetre within ten metres, and are not undone.

use crate::geometry::{DVec2, Transform};

/// Takes places of the map to the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    map_m: DVec2,
    world_m: DVec2,
    /// Cosine and sine.
    pub turn: DVec2,
}

impl Placement {
    pub(super) fn of(world_from_sensor: &Transform, map_from_sensor: &Transform) -> Placement {
        let world_from_map = world_from_sensor.rotation * map_from_sensor.rotation.transpose();
        Placement {
            map_m: map_from_sensor.translation_m.truncate(),
            world_m: world_from_sensor.translation_m.truncate(),
            turn: world_from_map.x_axis.truncate().normalize(),
        }
    }

    pub(super) fn world(&self, map_m: DVec2) -> DVec2 {
        self.world_m + self.turn.rotate(map_m - self.map_m)
    }

    pub(super) fn map(&self, world_m: DVec2) -> DVec2 {
        self.map_m + DVec2::new(self.turn.x, -self.turn.y).rotate(world_m - self.world_m)
    }

    /// A place of the map that lies at one of the world, and the yaw between them.
    #[cfg(test)]
    pub(super) fn turned(map_m: DVec2, world_m: DVec2, yaw_rad: f64) -> Placement {
        let (sin, cos) = crate::math::sin_cos(yaw_rad);
        Placement { map_m, world_m, turn: DVec2::new(cos, sin) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{DVec3, Pose};

    #[test]
    fn exact_a_point_seen_by_the_sensor_comes_back_to_where_it_is() {
        let pose = |x, y, yaw_rad| Pose { position_m: DVec3::new(x, y, 0.3), yaw_rad, ..Pose::default() };
        let (truth, believed) = (pose(4.0, 5.0, 0.7), pose(4.2, 4.9, 0.75));
        let (world, map) = (truth.transform(), believed.transform());
        let placement = Placement::of(&world, &map);
        for point in [DVec3::new(3.0, -1.0, -0.3), DVec3::new(-2.0, 4.0, 0.1)] {
            let there = placement.world(map.point(point).truncate());
            assert!((there - world.point(point).truncate()).length() < 1e-12);
            assert!((placement.map(there) - map.point(point).truncate()).length() < 1e-12);
        }
    }
}
