//! The true yard and a rover's limits -> can the rover cross this cell, and by how much: the labels of `cells.labels.rover`.
//!
//! In: the cells of a kept sweep, the scene, where the sensor was and was believed to be, a rover and its limits. Out: per cell a
//! [`Crossing`] (signed distance to the nearest limit, and which one), and the label: untraversable where the distance is negative, or
//! where what the cell names is a plant that is marked untraversable. Source: the clearance of the real rover as the label, ACE
//! of JPL's MLNav (Otsu et al. 2020; arXiv 2203.04563), of the cell and not of the pose: what a costmap wants that grows
//! obstacles by the rover's outline itself.
//!
//! Squares of cells are judged one after another on a lattice (`lattice`, `bodies`), whose gaps are found and bridged first (`gaps`); then
//! each row of nodes is asked what it demands of the rover along eight headings (`headings`, `kernel`), and each cell takes the worst of its
//! nodes. Frames: cells in `map`, ground in `world` (`placement`). Deviations and what is not modelled: whether the cell can be reached
//! (the floor of a hole wider than the rover is long is passable inside its ring); the wheel's width; what ground does under weight; places
//! outside the yard, where the edge's height holds. Wheels of a rover astride a cell stand on the ground, so that the belly bars all of a body
//! that stands higher than its clearance, be it broad enough to drive on.

mod assess;
mod bodies;
mod bounds;
#[cfg(test)]
mod brute;
#[cfg(test)]
mod drive_tests;
#[cfg(test)]
mod figure;
mod gaps;
mod headings;
mod kernel;
mod lattice;
mod limit;
mod outlines;
pub(super) mod params;
mod patch;
mod placement;
mod pose;
#[cfg(test)]
mod pose_brute;
#[cfg(test)]
mod pose_tests;
#[cfg(test)]
mod tests;
mod tracks;
mod way;

use super::{CellRow, CellTruth, Cells, Label};
use crate::drive::Rover;
use crate::geometry::{CellIndex, DVec3, GridSpec, Transform};
use crate::scene::Scene;
use assess::Assessor;
pub(crate) use assess::Scratch;
pub use limit::{Crossing, Limit};
use params::RoverRule;
use placement::Placement;
use pose::PoseAssessor;
pub use pose::{PoseTruth, PoseWorst};

/// A rover's rule, and the sweep whose cells it is asked about.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub rule: &'a RoverRule,
    pub rover: &'a Rover,
    /// A cell's side.
    pub size_m: f64,
    pub scene: &'a Scene,
    pub world_from_sensor: &'a Transform,
    pub map_from_sensor: &'a Transform,
}

/// Judges each cell by the rover, and labels it.
///
/// # Panics
/// Where a limit is neither in the rule nor in the rover's file: `config` refuses that.
pub(crate) fn judge(asked: &Asked, cells: &mut Cells, scratch: &mut Scratch) {
    let Asked { rule, rover, size_m, scene, world_from_sensor, map_from_sensor } = *asked;
    let limits = rule.limits(rover).expect("config refuses a rover's rule with a limit that nobody gives");
    let assessor = Assessor::new(limits, size_m, scene, Placement::of(world_from_sensor, map_from_sensor));
    let poses = rule.pose.then(|| PoseAssessor::new(rover, limits, scene));
    assessor.with_poses(poses).assess(cells, scratch);
}

/// The same for cells of a map that a fitted plane levels (`cells.frame`), which is tilted by as much as the ground: each cell is judged
/// where it truly lies, as the cell of the world's level grid around its centre at its mean height, at most half a cell away.
pub(crate) fn judge_of_plane(asked: &Asked, cells: &mut Cells, scratch: &mut Scratch) {
    let Asked { size_m, world_from_sensor, map_from_sensor, .. } = *asked;
    let world_from_map = *world_from_sensor * map_from_sensor.inverse();
    let (grid, width) = (GridSpec { size_m }, cells.features.len().checked_div(cells.rows.len()).unwrap_or(0));
    let place = |(row, features): (&CellRow, &[f32])| {
        let (x_m, y_m) = grid.centre_m(row.index);
        // The mean height is the first feature; the rover stands at the map's origin.
        let place_m = world_from_map.point(DVec3::new(x_m, y_m, f64::from(features[0])));
        grid.cell(place_m.x, place_m.y)
    };
    let places: Vec<Option<CellIndex>> =
        cells.rows.iter().zip(cells.features.chunks_exact(width.max(1))).map(place).collect();
    let mut indices: Vec<CellIndex> = places.iter().copied().flatten().collect();
    indices.sort_unstable();
    indices.dedup();
    let level =
        |index| CellRow { index, label: None, points: 0, range_m: 0.0, neighbour_mask: 0, truth: CellTruth::default() };
    let mut level = Cells { rows: indices.into_iter().map(level).collect(), ..Cells::default() };
    let level_asked =
        Asked { world_from_sensor: &Transform::IDENTITY, map_from_sensor: &Transform::IDENTITY, ..*asked };
    judge(&level_asked, &mut level, scratch);
    for (row, place) in cells.rows.iter_mut().zip(places) {
        let at = place.and_then(|index| level.rows.binary_search_by_key(&index, |there| there.index).ok());
        row.truth.crossing = at.and_then(|at| level.rows[at].truth.crossing);
        row.label = row.truth.crossing.map(|_| Label::untraversable_if(row.truth.bars_rover()));
    }
}
