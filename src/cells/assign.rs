//! A measured range and an estimated pose -> where the point lies in the map, and its cell or why it has none.
//!
//! Source: Hewitt et al. 2017, "Cell grid": points go to the global frame with the *estimated* pose, then into cells.
//! Frames: ranges along unit directions in `sensor`, points in `map`. A point's distance is horizontal, from the sensor of
//! its own sweep. Features and the `points` table both go through here, so that they cannot disagree.

use crate::geometry::{CellIndex, DVec3, GridSpec, Transform};

/// Sends the points of one sweep to the grid.
#[derive(Clone, Copy, Debug)]
pub struct CellAssigner {
    pub grid: GridSpec,
    /// Points farther than this are left out, metres, horizontally.
    pub max_range_m: f64,
    map_from_sensor: Transform,
}

/// A point in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    pub point_m: DVec3,
    /// Horizontal distance from the sensor, metres.
    pub distance_m: f64,
    pub cell: Result<CellIndex, Unplaced>,
}

/// A point in the map that has not been asked yet whether it has a cell: plain numbers, worked out for many points side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Located {
    pub point_m: DVec3,
    pub distance_m: f64,
    /// Means something where the point is on the grid.
    pub index: CellIndex,
    pub on_grid: bool,
}

/// Why a point is in no cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplaced {
    BeyondRange,
    /// Not finite, or so far off that its index is not an `i32`.
    OffGrid,
}

impl CellAssigner {
    /// For the sweep whose sensor is believed to be there.
    pub fn of_sensor(grid: GridSpec, max_range_m: f64, map_from_sensor: Transform) -> CellAssigner {
        CellAssigner { grid, max_range_m, map_from_sensor }
    }

    /// Where a range along a unit direction of the sensor frame lies.
    #[inline(always)]
    pub fn place(&self, direction: DVec3, range_m: f64) -> MapPoint {
        self.place_point(direction * range_m)
    }

    /// Where a point of the sensor frame lies.
    #[inline(always)]
    pub fn place_point(&self, in_sensor_m: DVec3) -> MapPoint {
        self.placed(self.locate(in_sensor_m))
    }

    /// The same for a point whose place in the map is known.
    pub fn place_in_map(&self, point_m: DVec3) -> MapPoint {
        self.placed(self.located(point_m - self.map_from_sensor.translation_m, point_m))
    }

    /// A point of the sensor frame in the map.
    #[inline(always)]
    pub(super) fn locate(&self, in_sensor_m: DVec3) -> Located {
        let offset = self.map_from_sensor.direction(in_sensor_m);
        self.located(offset, offset + self.map_from_sensor.translation_m)
    }

    #[inline(always)]
    fn located(&self, offset: DVec3, point_m: DVec3) -> Located {
        let distance_m = (offset.x * offset.x + offset.y * offset.y).sqrt();
        // A NaN or infinite x or y has no index; z has to be asked.
        let (index, on_grid) = self.grid.cell_or_not(point_m.x, point_m.y);
        Located { point_m, distance_m, index, on_grid: on_grid & point_m.z.is_finite() }
    }

    /// The cell of a point, or why it has none.
    #[inline(always)]
    pub(super) fn cell(&self, distance_m: f64, index: CellIndex, on_grid: bool) -> Result<CellIndex, Unplaced> {
        if distance_m > self.max_range_m {
            return Err(Unplaced::BeyondRange);
        }
        on_grid.then_some(index).ok_or(Unplaced::OffGrid)
    }

    #[inline(always)]
    fn placed(&self, Located { point_m, distance_m, index, on_grid }: Located) -> MapPoint {
        MapPoint { point_m, distance_m, cell: self.cell(distance_m, index, on_grid) }
    }
}
