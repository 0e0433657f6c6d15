//! The last sweeps of a drive, as long as a later scan's cells may still need their points.

use std::collections::VecDeque;

use crate::cells::WindowScan;
use crate::geometry::Transform;
use crate::slam::Estimate;
use crate::sweep::{self, Sweep};

/// A sweep and where it was made.
struct Swept {
    sweep: Sweep,
    estimate: Estimate,
    map_from_sensor: Transform,
    world_from_sensor: Transform,
}

impl Swept {
    fn as_scan(&self) -> WindowScan<'_> {
        let Swept { sweep, estimate, map_from_sensor, world_from_sensor } = self;
        WindowScan { sweep, estimate, map_from_sensor: *map_from_sensor, world_from_sensor: *world_from_sensor }
    }
}

/// At most so many sweeps, oldest first.
pub(super) struct SweepWindow {
    sweeps: VecDeque<Swept>,
    most: usize,
}

impl SweepWindow {
    pub(super) fn new(most: usize) -> SweepWindow {
        SweepWindow { sweeps: VecDeque::new(), most }
    }

    /// Lets the oldest sweep go where the window is full, so that the next one is made in its memory.
    pub(super) fn make_room(&mut self, scratch: &mut sweep::Scratch) {
        if self.sweeps.len() == self.most
            && let Some(oldest) = self.sweeps.pop_front()
        {
            scratch.reuse(oldest.sweep);
        }
    }

    pub(super) fn push(&mut self, sweep: Sweep, estimate: Estimate, mount: &Transform, world_from_sensor: Transform) {
        let map_from_sensor = estimate.pose.transform() * *mount;
        self.sweeps.push_back(Swept { sweep, estimate, map_from_sensor, world_from_sensor });
    }

    pub(super) fn scans(&self) -> Vec<WindowScan<'_>> {
        self.sweeps.iter().map(Swept::as_scan).collect()
    }

    /// The sweep made last.
    pub(super) fn newest(&self) -> Option<&Sweep> {
        self.sweeps.back().map(|swept| &swept.sweep)
    }

    /// Gives all memory back.
    pub(super) fn clear(self, scratch: &mut sweep::Scratch) {
        self.sweeps.into_iter().for_each(|swept| scratch.reuse(swept.sweep));
    }
}
