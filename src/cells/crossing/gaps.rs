//! Steep drops of the ground -> gaps: how wide they are, and the ground with them bridged.
//!
//! In: a lattice of heights, the continuous ground, limits. Out: per node the width of the narrowest gap that it lies in or is a lip of;
//! the lattice's ground is raised to the line between the lips, so that a gap is judged by its width alone. A gap begins where the ground
//! falls by more than a step within a wheel's reach, and ends where it has come back to that level, less than the rover's length away;
//! both lips are found by halving on the ground itself, not on the nodes. A drop without a far lip is a step down. A gap is as wide as
//! its shortest crossing along the lattice's rows, columns and diagonals: a wheel that rolls along a slot does not fall in. A lip is as the
//! gap beside it. Bodies have no
//! part in it: what lies between two rocks is ground. Polynomials have no such drops and are not asked. Not modelled: the wheel's width.

use super::headings::Axis;
use super::lattice::Lattice;
use super::params::Limits;
use super::placement::Placement;
use crate::geometry::DVec2;
use crate::scene::{Ground, Scene};

/// Halvings of a node's distance: 0.1 m / 2^44 is below 1e-14 m.
const HALVINGS: u32 = 44;

/// Widths of gaps, metres; infinite where there is none. Reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    /// One a node, or none at all where the lattice has no gap.
    pub width_m: Vec<f64>,
    filled_m: Vec<f64>,
    /// Lips, each with the node of the gap beside it.
    lips: Vec<[usize; 2]>,
    lip_widths_m: Vec<f64>,
}

/// A gap seen from one lip, in nodes along a heading.
struct Crossing {
    near: usize,
    far: usize,
    width_m: f64,
}

impl Gaps {
    pub(super) fn find(
        &mut self,
        scene: &Scene,
        placement: &Placement,
        limits: &Limits,
        axes: &[Axis; 4],
        lattice: &mut Lattice,
    ) {
        self.width_m.clear();
        if matches!(scene.ground, Ground::Polynomial(_)) || !may_fall(lattice, limits.step_m, axes[0].reach) {
            return;
        }
        self.width_m.resize(lattice.ground_m.len(), f64::INFINITY);
        self.filled_m.clone_from(&lattice.ground_m);
        self.lips.clear();
        for axis in axes {
            for sign in [1, -1] {
                let heading = [sign * axis.cols, sign * axis.rows];
                for row in 0..lattice.side {
                    for col in 0..lattice.side {
                        let line = Line { lattice, row, col, heading, spacing_m: axis.length_m };
                        if let Some(crossing) = line.crossing(scene, placement, limits, axis.reach) {
                            self.bridge(&line, &crossing);
                        }
                    }
                }
            }
        }
        // All widths beside lips are read before any lip takes one: a lip may lie beside another gap's.
        self.lip_widths_m.clear();
        self.lip_widths_m.extend(self.lips.iter().map(|&[_, beside]| self.width_m[beside]));
        for (&[lip, _], &width_m) in self.lips.iter().zip(&self.lip_widths_m) {
            self.width_m[lip] = self.width_m[lip].min(width_m);
        }
        std::mem::swap(&mut lattice.ground_m, &mut self.filled_m);
    }

    fn bridge(&mut self, line: &Line, crossing: &Crossing) {
        let Crossing { near, far, width_m } = *crossing;
        let ends = [near, far].map(|place| line.height_m(place).unwrap_or(f64::NEG_INFINITY));
        let lips = [[near, near + 1], [far, far - 1]].map(|pair| pair.map(|place| line.number(place)));
        self.lips.extend(lips.into_iter().filter_map(|[lip, beside]| Some([lip?, beside?])));
        for place in near + 1..far {
            let Some(at) = line.number(place) else { continue };
            self.width_m[at] = self.width_m[at].min(width_m);
            let share = (place - near) as f64 / (far - near) as f64;
            self.filled_m[at] = self.filled_m[at].max(ends[0] + (ends[1] - ends[0]) * share);
        }
    }
}

/// Whether any two nodes within reach can differ by more than a step: a bound by neighbours.
fn may_fall(lattice: &Lattice, step_m: f64, reach: usize) -> bool {
    let side = lattice.side;
    let mut most = 0.0_f64;
    for (row, heights) in lattice.ground_m.chunks_exact(side).enumerate() {
        let north = &lattice.ground_m[(row + 1).min(side - 1) * side..][..side];
        for col in 0..side - 1 {
            let (east, north) = ((heights[col + 1] - heights[col]).abs(), (north[col] - heights[col]).abs());
            most = if east > most { east } else { most };
            most = if north > most { north } else { most };
        }
    }
    // A diagonal neighbour is two neighbours away.
    most * reach.max(2) as f64 > step_m
}

/// Nodes from one of them along a heading.
struct Line<'a> {
    lattice: &'a Lattice,
    row: usize,
    col: usize,
    heading: [i64; 2],
    spacing_m: f64,
}

impl Line<'_> {
    /// The number of a node; `None` beyond the lattice.
    fn number(&self, place: usize) -> Option<usize> {
        let [cols, rows] = self.heading.map(|step| step * place as i64);
        let (row, col) = (self.row as i64 + rows, self.col as i64 + cols);
        let nodes = 0..self.lattice.side as i64;
        (nodes.contains(&row) && nodes.contains(&col)).then(|| row as usize * self.lattice.side + col as usize)
    }

    fn height_m(&self, place: usize) -> Option<f64> {
        self.number(place).map(|at| self.lattice.ground_m[at])
    }

    /// The gap whose near lip is the line's first node.
    fn crossing(&self, scene: &Scene, placement: &Placement, limits: &Limits, reach: usize) -> Option<Crossing> {
        let top_m = self.height_m(0)?;
        // The last node before the fall is the lip.
        if self.height_m(1)? >= top_m {
            return None;
        }
        let level_m = top_m - limits.step_m;
        let is_below = |place: usize| self.height_m(place).is_some_and(|height_m| height_m < level_m);
        let below = (1..=reach).find(|&place| is_below(place))?;
        let last = (limits.length_m / self.spacing_m) as usize + below;
        let far =
            (below + 1..=last).take_while(|&place| self.number(place).is_some()).find(|&place| !is_below(place))?;
        let lip_m = |outside: usize, inside: usize| {
            let [mut outside, mut inside] = [outside, inside].map(|place| place as f64);
            let start_m = self.lattice.node_m(self.row, self.col);
            let step = self.heading.map(|step| step as f64 * self.lattice.spacing_m);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (outside + inside);
                let at = placement.world(start_m + DVec2::from_array(step) * middle);
                let place = if scene.ground_below_m(at.x, at.y) < level_m { &mut inside } else { &mut outside };
                *place = middle;
            }
            outside * self.spacing_m
        };
        let width_m = lip_m(far, far - 1) - lip_m(below - 1, below);
        (width_m < limits.length_m).then_some(Crossing { near: below - 1, far, width_m })
    }
}
