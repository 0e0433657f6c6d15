//! Poses, rays and the cell grid: the nouns every stage shares.
//!
//! Frames: `world` (truth) and `map` (what slam believes) share the yard's corner as origin; `rover` has x forward,
//! y left, z up; `sensor` is mounted on the rover. Transforms read `a_from_b`, so that products cancel by eye.
//! Angles: yaw counter-clockwise from +x in (-pi, pi]; nose-down pitch is positive; roll is right-side-down positive
//! (right-handed about x). All f64, SI.

mod grid;
mod pose;

pub use glam::{DMat3, DVec2, DVec3};
pub use grid::{CellIndex, GridSpec};
pub use pose::{Pose, Transform};
