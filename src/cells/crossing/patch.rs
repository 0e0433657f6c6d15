//! A cell and the plane through it -> how far ground and bodies around it stand off that plane, and their range within any box.
//!
//! In: a lattice, the plane, how far to look, the side of the boxes that will be asked for. Out: [`Patch`]: the lattice's nodes around the cell with the
//! plane taken off (vertical metres), and the least and the most of every square of `window` nodes, by doubling: so that the eight headings of a
//! cell ask for six boxes each without walking through them. Larger boxes are covered by windows that overlap. Plain differences
//! and larger-ofs, no order of lanes matters. Frame: map. Not modelled: nodes within gaps and without a height: any box that holds one is
//! unbounded.

use super::bounds::Plane;
use super::pose::Square;
use crate::geometry::DVec2;
use crate::wide::{LANES, Work, widest};

/// Nodes around one cell; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Patch {
    /// Nodes a row, a whole number of lanes, and rows.
    cols: usize,
    rows: usize,
    /// Column and row in the lattice of the first node.
    first: [usize; 2],
    /// Where columns and rows lie, from the cell's middle.
    east_m: Vec<f64>,
    north_m: Vec<f64>,
    /// Ground and top off the plane; of a node without a height the top is infinite.
    ground_m: Vec<f64>,
    top_m: Vec<f64>,
    /// The least of the ground and the most of the tops in the `window` x `window` nodes from each node on.
    window: usize,
    least_m: Vec<f64>,
    most_m: Vec<f64>,
    /// As `most_m`, of the ground without bodies.
    bare_m: Vec<f64>,
    passed_m: Vec<f64>,
}

impl Patch {
    /// Takes the nodes around a place, `reach` to each side.
    pub(super) fn fill(&mut self, square: &Square, plane: &Plane, middle_m: DVec2, reach: usize, window: usize) {
        let lattice = square.lattice;
        let wanted = 2 * reach + 2;
        let cols = wanted.next_multiple_of(LANES);
        let middle = lattice.node_at(middle_m);
        // What fills up the lanes lies to the east, as far as the lattice goes.
        let first =
            [middle[0].saturating_sub(reach).min(lattice.side.saturating_sub(cols)), middle[1].saturating_sub(reach)];
        let rows = wanted.min(lattice.side - first[1]);
        (self.cols, self.rows, self.first, self.window) = (cols, rows, first, window);
        let along = |first: usize, count: usize, middle: f64, node: &dyn Fn(usize) -> f64, out: &mut Vec<f64>| {
            out.clear();
            out.extend((first..first + count).map(|number| node(number) - middle));
        };
        along(first[0], cols, middle_m.x, &|col| lattice.node_m(0, col).x, &mut self.east_m);
        along(first[1], rows, middle_m.y, &|row| lattice.node_m(row, 0).y, &mut self.north_m);
        for list in [&mut self.ground_m, &mut self.top_m, &mut self.least_m, &mut self.most_m, &mut self.bare_m] {
            list.clear();
            list.resize(cols * rows, 0.0);
        }
        self.passed_m.resize(cols * rows, 0.0);
        widest(Fill { patch: self, square, plane });
        for (list, is_most) in [(&mut self.least_m, false), (&mut self.most_m, true), (&mut self.bare_m, true)] {
            for stride in [1, cols] {
                widest(Windows { list, passed: &mut self.passed_m, stride, window, is_most });
            }
        }
    }

    /// The least ground and the highest top off the plane within a box of the lattice's columns and rows, both ends included; of the ground
    /// alone where no body counts.
    pub(super) fn range_m(&self, from: [usize; 2], to: [usize; 2], has_bodies: bool) -> [f64; 2] {
        let most_m = if has_bodies { &self.most_m } else { &self.bare_m };
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for row in self.windows(from[1] - self.first[1], to[1] - self.first[1]) {
            for col in self.windows(from[0] - self.first[0], to[0] - self.first[0]) {
                let at = row * self.cols + col;
                range = [range[0].min(self.least_m[at]), range[1].max(most_m[at])];
            }
        }
        range
    }

    /// Where windows begin that together cover the nodes from one to another; they overlap where the last would reach beyond.
    fn windows(&self, from: usize, to: usize) -> impl Iterator<Item = usize> + use<> {
        let last = (to + 1).saturating_sub(self.window).max(from);
        (from..last).step_by(self.window).chain([last])
    }

    /// The same of a few nodes, asked one by one; gaps do not count.
    pub(super) fn own_range_m(&self, nodes: [[usize; 2]; 4], has_bodies: bool) -> [f64; 2] {
        let top_m = if has_bodies { &self.top_m } else { &self.ground_m };
        nodes.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low_m, high_m], [col, row]| {
            let at = (row - self.first[1]) * self.cols + col - self.first[0];
            [low_m.min(self.ground_m[at]), high_m.max(top_m[at])]
        })
    }

    /// The highest top above a plane within a rectangle.
    pub(super) fn highest_under(&self, under: &Under) -> f64 {
        widest(Highest { patch: self, under })
    }
}

/// A rectangle around the cell's middle, and a plane over it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Under {
    /// Along the rectangle and across it, by the way east and north.
    pub ahead: DVec2,
    pub left: DVec2,
    pub half_m: DVec2,
    /// Share of a vertical metre that stands off the cell's plane.
    pub up: f64,
    /// The plane's height at the middle, and its slopes ahead and to the left.
    pub rise_m: f64,
    pub pitch: f64,
    pub roll: f64,
}

struct Fill<'a, 'b> {
    patch: &'a mut Patch,
    square: &'a Square<'b>,
    plane: &'a Plane,
}

impl Work for Fill<'_, '_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let Fill { patch, square, plane } = self;
        let (cols, lattice) = (patch.cols, square.lattice);
        for row in 0..patch.rows {
            let from = (patch.first[1] + row) * lattice.side + patch.first[0];
            let (ground, top) = (&lattice.pit_m[from..from + cols], &lattice.peak_m[from..from + cols]);
            let here = row * cols..(row + 1) * cols;
            let (out_ground, out_top) = (&mut patch.ground_m[here.clone()], &mut patch.top_m[here.clone()]);
            let base_m = plane.height_m + plane.slope.y * patch.north_m[row];
            let ways = ground.iter().zip(top).zip(&patch.east_m);
            for (((ground, top), east_m), (out_ground, out_top)) in
                ways.zip(out_ground.iter_mut().zip(out_top.iter_mut()))
            {
                let plane_m = base_m + plane.slope.x * east_m;
                *out_ground = ground - plane_m;
                let off_m = top - plane_m;
                *out_top = if off_m < f64::INFINITY { off_m } else { f64::INFINITY };
            }
            let (least, most) = (&mut patch.least_m[here.clone()], &mut patch.most_m[here.clone()]);
            let bare = &mut patch.bare_m[here];
            let ridge = &lattice.ridge_m[from..from + cols];
            for ((ridge, east_m), bare) in ridge.iter().zip(&patch.east_m).zip(&mut *bare) {
                let off_m = ridge - (base_m + plane.slope.x * east_m);
                *bare = if off_m < f64::INFINITY { off_m } else { f64::INFINITY };
            }
            least.copy_from_slice(out_ground);
            most.copy_from_slice(out_top);
            if let Some(widths) = square.gaps.width_m.get(from..from + cols) {
                for list in [most, bare] {
                    for (most, width_m) in list.iter_mut().zip(widths) {
                        *most = if width_m.is_infinite() { *most } else { f64::INFINITY };
                    }
                }
            }
        }
    }
}

/// The least or the most of `window` values, `stride` apart, from each on; beyond the list's end what there is.
struct Windows<'a> {
    list: &'a mut Vec<f64>,
    passed: &'a mut Vec<f64>,
    stride: usize,
    window: usize,
    is_most: bool,
}

impl Work for Windows<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let Windows { list, passed, stride, window, is_most } = self;
        let mut covered = 1;
        while covered < window {
            let step = covered.min(window - covered) * stride;
            let kept = list.len() - step;
            let pairs = list.iter().zip(&list[step..]);
            for (out, (a, b)) in passed.iter_mut().zip(pairs) {
                *out = if (a < b) == is_most { *b } else { *a };
            }
            list[..kept].copy_from_slice(&passed[..kept]);
            covered += step / stride;
        }
    }
}

struct Highest<'a> {
    patch: &'a Patch,
    under: &'a Under,
}

impl Work for Highest<'_> {
    type Out = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Highest { patch, under } = self;
        let Under { ahead, left, half_m, up, rise_m, pitch, roll } = *under;
        let mut highest = [f64::NEG_INFINITY; LANES];
        for row in 0..patch.rows {
            let north_m = patch.north_m[row];
            let (ahead_m, left_m) = (ahead.y * north_m, left.y * north_m);
            let here = row * patch.cols..(row + 1) * patch.cols;
            let blocks = patch.top_m[here].chunks_exact(LANES).zip(patch.east_m.chunks_exact(LANES));
            for (top, east) in blocks {
                for l in 0..LANES {
                    let (x_m, y_m) = (ahead.x * east[l] + ahead_m, left.x * east[l] + left_m);
                    let is_under = (x_m.abs() <= half_m.x) & (y_m.abs() <= half_m.y);
                    let above_m = top[l] * up - rise_m - pitch * x_m - roll * y_m;
                    let above_m = if is_under { above_m } else { f64::NEG_INFINITY };
                    highest[l] = if above_m > highest[l] { above_m } else { highest[l] };
                }
            }
        }
        highest.into_iter().fold(f64::NEG_INFINITY, |a, b| if b > a { b } else { a })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_windows_and_the_extremes_of_every_box() {
        let (cols, rows) = (16, 11);
        let value = |k: usize| ((k * 7919) % 101) as f64;
        for window in [1, 2, 3, 4, 7] {
            for is_most in [false, true] {
                let mut list: Vec<f64> = (0..cols * rows).map(value).collect();
                let mut passed = vec![0.0; list.len()];
                for stride in [1, cols] {
                    Windows { list: &mut list, passed: &mut passed, stride, window, is_most }.run();
                }
                for row in 0..=rows - window {
                    for col in 0..=cols - window {
                        let inside = (0..window * window).map(|k| value((row + k / window) * cols + col + k % window));
                        let pick = |a: f64, b: f64| if is_most { a.max(b) } else { a.min(b) };
                        assert_eq!(
                            list[row * cols + col],
                            inside.reduce(pick).expect("a node"),
                            "{window} {row} {col}"
                        );
                    }
                }
            }
        }
    }
}
