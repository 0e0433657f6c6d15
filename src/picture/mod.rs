//! A scene and what was made in it -> pictures and point clouds, as bytes.
//!
//! In: a [`View`], what one kept sweep was made of. Out: PNG ([`top_view`], [`Perspective`], [`scan_view`]; figure 8 of Hewitt
//! et al. 2017; [`cell_map`] for cells that a model judged, figures 10 to 14) and PLY ([`labelled_cloud`]). Writes no files. Cells are shaded as in the paper: light traversable, dark
//! untraversable.

mod canvas;
mod classified;
mod colour;
mod map;
mod model;
mod noise;
mod perspective;
mod ply;
mod relief;
mod scan;
#[cfg(test)]
mod tests;
mod top;

pub(crate) use classified::{ShadedCell, Shades, cell_map};
pub(crate) use perspective::{Overlay, Perspective};
pub(crate) use ply::labelled_cloud;
pub(crate) use scan::scan_view;
pub(crate) use top::top_view;

use crate::cells::Cells;
use crate::drive::Rover;
use crate::geometry::{DVec2, Pose, Transform};
use crate::scene::Scene;
use crate::sweep::Sweep;

/// What a picture shows: one kept sweep and the drive up to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    /// What the picture is of, for its title: "quickstart, scene 7, scan 3".
    pub title: &'a str,
    pub scene: &'a Scene,
    pub rover: &'a Rover,
    /// True poses up to the sweep; the last is where it was taken.
    pub truth: &'a [Pose],
    /// Estimated poses up to the sweep; the last is the one its cells were made with.
    pub estimates: &'a [Pose],
    pub rover_from_sensor: Transform,
    /// Sensor coordinates -> the map of the cells.
    pub map_from_sensor: Transform,
    /// That map was levelled by a plane, and lies anywhere.
    pub levelled: bool,
    pub sweep: &'a Sweep,
    /// By slot: it hangs over free height and is in no cell; empty where no rule says so.
    pub hanging: &'a [bool],
    pub cells: &'a Cells,
    /// Side of a cell.
    pub cell_size_m: f64,
}

impl View<'_> {
    fn true_pose(&self) -> Pose {
        self.truth.last().copied().unwrap_or_default()
    }

    fn estimated_pose(&self) -> Pose {
        self.estimates.last().copied().unwrap_or_default()
    }

    /// Where the rover stands among the cells as they are drawn.
    fn pose_among_cells(&self) -> Pose {
        if self.levelled { self.true_pose() } else { self.estimated_pose() }
    }

    /// Where a place of the cells' map is drawn: there, as if the map were the yard; that of a levelled map where it truly lies.
    fn place_m(&self, map_m: DVec2) -> DVec2 {
        if !self.levelled {
            return map_m;
        }
        let world_from_map = self.world_from_sensor() * self.map_from_sensor.inverse();
        world_from_map.point(map_m.extend(0.0)).truncate()
    }

    /// Whether a slot met a body, solid or porous; a patch is a kind of ground.
    fn on_object(&self, slot: usize) -> bool {
        let bodies = self.scene.obstacles.len() + self.scene.volumes.len();
        usize::try_from(self.sweep.truth[slot].object).is_ok_and(|id| id < bodies)
    }

    fn world_from_sensor(&self) -> Transform {
        self.true_pose().transform() * self.rover_from_sensor
    }
}
