//! A square of the map -> heights of the true ground and of what stands on it, at nodes of a fine lattice.
//!
//! In: a scene, where the map lies in the world, a range of nodes. Out: [`Lattice`]: for each node the ground's height, and the top of
//! ground and solid bodies. Node (i, j) stands in the middle of its square, at ((i + 1/2) h, (j + 1/2) h) of the map; an even share of a
//! cell's nodes lie in each of its quarters, so that yards turned by 90 degrees are judged alike. A polynomial is worked out row by row
//! from its Taylor series about the square's middle (a line through a polynomial is a polynomial of one variable). Outside the yard the
//! edge's height holds. Not modelled: grass, bushes and crowns, which are not solid.

use super::placement::Placement;
use crate::geometry::DVec2;
use crate::scene::polynomial::term_count;
use crate::scene::{Ground, MAX_DEGREE, Polynomial, Scene};
use crate::wide::{Work, widest};

/// Heights at `side` x `side` nodes; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice {
    pub spacing_m: f64,
    /// Number of the first column and row.
    pub first: [i64; 2],
    pub side: usize,
    /// Row by row from the south.
    pub ground_m: Vec<f64>,
    /// The ground, or a body where one stands higher.
    pub top_m: Vec<f64>,
    /// The least of the ground and the most of the tops in each node's square, a raster's own nodes among them; made by `spread`.
    pub pit_m: Vec<f64>,
    pub peak_m: Vec<f64>,
    /// As the peaks, of the ground alone.
    pub ridge_m: Vec<f64>,
    from_middle_m: Vec<f64>,
}

type Series = [f64; MAX_DEGREE + 1];

impl Lattice {
    /// Takes the heights of the ground; `bodies` makes the tops of it.
    pub(super) fn sample(
        &mut self,
        scene: &Scene,
        placement: &Placement,
        spacing_m: f64,
        first: [i64; 2],
        side: usize,
    ) {
        (self.spacing_m, self.first, self.side) = (spacing_m, first, side);
        self.ground_m.clear();
        self.ground_m.resize(side * side, 0.0);
        match &scene.ground {
            Ground::Polynomial(polynomial) => self.sample_polynomial(polynomial, scene, placement),
            Ground::Raster(_) => (0..side).for_each(|row| self.sample_row(row, scene, placement)),
        }
    }

    /// The coordinate of a column or row of the whole map's lattice.
    pub(super) fn coordinate_m(&self, number: i64) -> f64 {
        (number as f64 + 0.5) * self.spacing_m
    }

    /// Where a node lies in the map.
    pub(super) fn node_m(&self, row: usize, col: usize) -> DVec2 {
        DVec2::new(self.coordinate_m(self.first[0] + col as i64), self.coordinate_m(self.first[1] + row as i64))
    }

    /// Column and row of the node in whose square a place of the map lies, kept within the lattice.
    pub(super) fn node_at(&self, place_m: DVec2) -> [usize; 2] {
        let last = self.side as i64 - 1;
        let node =
            |along_m: f64, first: i64| ((along_m / self.spacing_m).floor() as i64 - first).clamp(0, last) as usize;
        [node(place_m.x, self.first[0]), node(place_m.y, self.first[1])]
    }

    /// The same; a place on the border between squares lies in those on both sides, so four times, some of them alike.
    pub(super) fn nodes_at(&self, place_m: DVec2) -> [[usize; 2]; 4] {
        let hair_m = 1e-6 * self.spacing_m;
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .map(|side| self.node_at(place_m + hair_m * DVec2::from(side)))
    }

    /// Takes pits and peaks off ground and tops, and a raster's own nodes, between which its ground neither rises nor falls further.
    pub(super) fn spread(&mut self, scene: &Scene, placement: &Placement) {
        self.pit_m.clone_from(&self.ground_m);
        self.peak_m.clone_from(&self.top_m);
        self.ridge_m.clone_from(&self.ground_m);
        let Ground::Raster(raster) = &scene.ground else { return };
        let last = self.side - 1;
        let corners = [(0, 0), (0, last), (last, 0), (last, last)]
            .map(|(row, col)| (placement.world(self.node_m(row, col)) - raster.origin_m) / raster.spacing_m);
        let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min);
        let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max);
        let span =
            |low: f64, high: f64, count: usize| low.max(0.0) as usize..((high + 2.0).max(0.0) as usize).min(count);
        for row in span(low.y, high.y, raster.rows) {
            for col in span(low.x, high.x, raster.cols) {
                let world_m = raster.origin_m + DVec2::new(col as f64, row as f64) * raster.spacing_m;
                let [col_here, row_here] = self.node_at(placement.map(world_m));
                let at = row_here * self.side + col_here;
                let height_m = raster.heights_m[row * raster.cols + col];
                self.pit_m[at] = self.pit_m[at].min(height_m);
                for peak_m in [&mut self.peak_m[at], &mut self.ridge_m[at]] {
                    *peak_m = if height_m <= *peak_m { *peak_m } else { height_m };
                }
            }
        }
    }

    fn sample_row(&mut self, row: usize, scene: &Scene, placement: &Placement) {
        for col in 0..self.side {
            let at = placement.world(self.node_m(row, col));
            self.ground_m[row * self.side + col] = scene.ground_below_m(at.x, at.y);
        }
    }

    fn sample_polynomial(&mut self, polynomial: &Polynomial, scene: &Scene, placement: &Placement) {
        let side = self.side;
        let middle_m = 0.5 * (self.node_m(0, 0) + self.node_m(side - 1, side - 1));
        let middle = placement.world(middle_m);
        let mut taylor = [0.0; (MAX_DEGREE + 1) * (MAX_DEGREE + 2) / 2];
        let taylor = &mut taylor[..term_count(polynomial.degree)];
        polynomial.taylor_into(middle.x, middle.y, taylor);
        let mut from_middle_m = std::mem::take(&mut self.from_middle_m);
        from_middle_m.clear();
        from_middle_m.extend((0..side).map(|col| self.node_m(0, col).x - middle_m.x));
        for row in 0..side {
            let ends = [0, side - 1].map(|col| placement.world(self.node_m(row, col)));
            if !ends.iter().all(|end| scene.contains(end.x, end.y)) {
                self.sample_row(row, scene, placement);
                continue;
            }
            let north_m = self.node_m(row, 0).y - middle_m.y;
            let series = along_row(taylor, polynomial.degree, placement.turn, north_m);
            let out = &mut self.ground_m[row * side..(row + 1) * side];
            widest(RowHeights { series: &series[..=polynomial.degree], x_m: &from_middle_m, out });
        }
        self.from_middle_m = from_middle_m;
    }
}

/// The polynomial along a row of the map, `north_m` from the middle of its Taylor series, in powers of the way to the east.
fn along_row(taylor: &[f64], degree: usize, turn: DVec2, north_m: f64) -> Series {
    // The world's offsets from the middle: dx = at.x + turn.x u, dy = at.y + turn.y u.
    let at = DVec2::new(-turn.y, turn.x) * north_m;
    let times = |series: &mut Series, constant: f64, slope: f64| {
        for m in (1..=degree).rev() {
            series[m] = series[m] * constant + series[m - 1] * slope;
        }
        series[0] *= constant;
    };
    let mut out = [0.0; MAX_DEGREE + 1];
    let mut end = taylor.len();
    for k in (0..=degree).rev() {
        let row = &taylor[end - (degree + 1 - k)..end];
        end -= row.len();
        let mut inner = [0.0; MAX_DEGREE + 1];
        for &t in row.iter().rev() {
            times(&mut inner, at.y, turn.y);
            inner[0] += t;
        }
        times(&mut out, at.x, turn.x);
        out.iter_mut().zip(inner).for_each(|(out, inner)| *out += inner);
    }
    out
}

/// A polynomial of one variable at many places.
struct RowHeights<'a> {
    series: &'a [f64],
    x_m: &'a [f64],
    out: &'a mut [f64],
}

impl Work for RowHeights<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let RowHeights { series, x_m, out } = self;
        let (last, rest) = series.split_last().expect("a polynomial has a constant");
        out.fill(*last);
        for &c in rest.iter().rev() {
            for (out, x) in out.iter_mut().zip(x_m) {
                *out = *out * x + c;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};

    #[test]
    fn equal_rows_of_a_turned_map_and_the_ground_itself() {
        let stream = Streams { seed: 3, scene: 0, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise);
        for (degree, yaw_rad) in [(0, 0.0), (1, 0.3), (5, 0.0), (5, 0.02), (12, -1.1)] {
            let coefficients = (0..term_count(degree) as u64).map(|i| 0.1 * stream.normal(i)).collect();
            let scene = Scene::bare(20.0, Ground::Polynomial(Polynomial::new(20.0, degree, coefficients)));
            let placement = Placement::turned(DVec2::new(9.0, 8.0), DVec2::new(9.1, 7.8), yaw_rad);
            let mut lattice = Lattice::default();
            // The last square hangs over the yard's edge.
            for first in [[100, 120], [160, 160], [330, 380]] {
                lattice.sample(&scene, &placement, 0.05, first, 60);
                for (row, col) in [(0, 0), (59, 59), (30, 7), (11, 45)] {
                    let at = placement.world(lattice.node_m(row, col));
                    let there_m = scene.ground_below_m(at.x, at.y);
                    let found_m = lattice.ground_m[row * 60 + col];
                    assert!((found_m - there_m).abs() < 1e-11, "degree {degree}: {found_m} {there_m}");
                }
            }
        }
    }
}
