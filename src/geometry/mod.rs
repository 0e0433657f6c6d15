//! Poses, rays and the cell grid: the nouns every stage shares.
//!
//! Frames: `world` (truth) and `map` (what slam believes) share the yard's corner as origin; `rover` has x forward,
//! y left, z up; `sensor` is mounted on the rover. Transforms read `a_from_b`, so that products cancel by eye.
//! Angles: yaw counter-clockwise from +x in (-pi, pi]; nose-down pitch is positive; roll is right-side-down positive
//! (right-handed about x). All f64, SI.
//!
//! ```
//! use marsyard::geometry::{DVec3, GridSpec, Pose};
//!
//! // A quarter turn to the left, 2 m up: what lies 1 m ahead lies 1 m along the parent's y.
//! let pose = Pose { position_m: DVec3::new(3.0, 4.0, 2.0), yaw_rad: std::f64::consts::FRAC_PI_2, ..Pose::default() };
//! let world_from_rover = pose.transform();
//! let ahead = world_from_rover.point(DVec3::X);
//! assert!((ahead - DVec3::new(3.0, 5.0, 2.0)).length() < 1e-15);
//! assert!((world_from_rover.inverse().point(ahead) - DVec3::X).length() < 1e-15);
//! // A cell's number is that of its lower left corner; its centre lies in it.
//! let grid = GridSpec { size_m: 0.1 };
//! let cell = grid.cell(3.05, -0.05).expect("a finite point");
//! assert_eq!((cell.col, cell.row), (30, -1));
//! assert_eq!(grid.cell_or_not(grid.centre_m(cell).0, grid.centre_m(cell).1), (cell, true));
//! ```

mod grid;
mod pose;

pub use glam::{DMat3, DVec2, DVec3};
pub use grid::{CellIndex, GridSpec};
pub use pose::{Pose, Transform};
