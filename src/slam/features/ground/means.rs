//! Points and the ground fitted under them -> the mean of each cell of ground.
//!
//! In: points by cell, levelled, sensor at the origin, metres. Out: the means of cells of ground, by which sweeps are laid on one another; cells in which something
//! stands up, or a point lies as deep as noise, are left out whole. Only a grid that was asked for it keeps sums.

use super::{GroundGrid, LOW_M};
use crate::geometry::DVec3;

impl GroundGrid {
    /// One that keeps the means of its cells.
    pub(in crate::slam::features) fn with_means(self) -> GroundGrid {
        GroundGrid { sums: vec![[0.0; 4]; self.highest_m.len()], ..self }
    }

    pub(in crate::slam::features) fn keeps_means(&self) -> bool {
        !self.sums.is_empty()
    }

    /// Adds a point to the mean of its cell.
    #[inline(always)]
    pub(in crate::slam::features) fn add(&mut self, cell: u32, place_m: DVec3) {
        let DVec3 { x, y, z } = place_m;
        for (sum, value) in self.sums[cell as usize].iter_mut().zip([1.0, x, y, z]) {
            *sum += value;
        }
    }

    /// The means of the cells in which nothing stands higher than that above the fitted ground, nor lies as deep below it as noise does.
    pub(in crate::slam::features) fn means_m(&self, most_m: f64) -> impl Iterator<Item = DVec3> {
        // Of no cell, the last entry, nothing stands.
        let standing_m = &self.standing_m;
        standing_m.iter().zip(&self.sums).enumerate().filter_map(move |(cell, (&standing_m, &[count, x, y, z]))| {
            // From the highest point down to the lowest.
            let deepest_m = standing_m - (self.highest_m[cell] - self.cells.lowest_m[cell]);
            (standing_m <= most_m && deepest_m >= -LOW_M).then(|| DVec3::new(x, y, z) / count)
        })
    }
}

#[cfg(test)]
mod tests;
