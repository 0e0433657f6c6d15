//! A measured range and an estimated pose -> where the point lies in the map, and its cell or why it has none.
//!
//! Source: Hewitt et al. 2017, "Cell inputs": points go to the global frame with the *estimated* pose, then into cells.
//! Frames: ranges along unit directions in `sensor`, points in `map`. A point's distance is horizontal, from the sensor of
//! its own sweep. Features and the `points` table both go through here, so that they cannot disagree.

use crate::geometry::{CellIndex, DVec3, GridSpec, Pose, Transform};

/// Sends the points of one sweep to the grid.
#[derive(Clone, Copy, Debug)]
pub struct Placer {
    pub grid: GridSpec,
    /// Points farther than this are left out, metres, horizontally.
    pub max_range_m: f64,
    map_from_sensor: Transform,
}

/// A point in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    pub point_m: DVec3,
    /// Horizontal distance from the sensor, metres.
    pub distance_m: f64,
    pub cell: Result<CellIndex, Unplaced>,
}

/// Why a point is in no cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplaced {
    BeyondRange,
    /// Not finite, or so far off that its index is not an `i32`.
    OffGrid,
}

impl Placer {
    /// For the sweep taken where `rover` is believed to stand (in the map).
    pub fn new(grid: GridSpec, max_range_m: f64, rover: &Pose, rover_from_sensor: &Transform) -> Placer {
        Placer::of_sensor(grid, max_range_m, rover.transform() * *rover_from_sensor)
    }

    /// For the sweep whose sensor is believed to be there.
    pub fn of_sensor(grid: GridSpec, max_range_m: f64, map_from_sensor: Transform) -> Placer {
        Placer { grid, max_range_m, map_from_sensor }
    }

    /// Where a range along a unit direction of the sensor frame lies.
    #[inline(always)]
    pub fn place(&self, direction: DVec3, range_m: f64) -> Placed {
        self.place_point(direction * range_m)
    }

    /// Where a point of the sensor frame lies.
    #[inline(always)]
    pub fn place_point(&self, in_sensor_m: DVec3) -> Placed {
        let offset = self.map_from_sensor.direction(in_sensor_m);
        self.placed(offset, offset + self.map_from_sensor.translation_m)
    }

    /// The same for a point whose place in the map is known.
    pub fn place_in_map(&self, point_m: DVec3) -> Placed {
        self.placed(point_m - self.map_from_sensor.translation_m, point_m)
    }

    #[inline(always)]
    fn placed(&self, offset: DVec3, point_m: DVec3) -> Placed {
        let distance_m = (offset.x * offset.x + offset.y * offset.y).sqrt();
        let cell = if distance_m > self.max_range_m {
            Err(Unplaced::BeyondRange)
        } else {
            // A NaN or infinite x or y has no index; z has to be asked.
            self.grid.cell(point_m.x, point_m.y).filter(|_| point_m.z.is_finite()).ok_or(Unplaced::OffGrid)
        };
        Placed { point_m, distance_m, cell }
    }
}
