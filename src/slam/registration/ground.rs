//! The ground around a stop -> planes that were fitted to it piece by piece, on a grid.
//!
//! In: the means of small cells of ground, in levelled axes, metres. Out: [`GroundMap`]: at nodes [`NODE_M`] apart the plane of least squares through
//! a square of five nodes' side, where that square holds enough cells, spreads both ways and is a plane to two centimetres. Of the ground each stop
//! sees the rings that its own beams draw: nearest points would lie ring on ring and tell that the rover stands still. A plane over a metre tells of
//! the ground between the rings; narrower ones err more than they tell (docs/localise.md). Source: planes of the cells of a grid in the place of
//! points, as the normal distributions of Biber & Strasser 2003; deviation: cells overlap, and only the plane is kept. Not modelled: relief that is
//! smaller.

use super::surface::FARTHEST_M;
use crate::geometry::DVec3;

/// From one node to the next, metres.
const NODE_M: f64 = 0.2;
/// A plane is fitted to so many nodes' squares on all sides of its own.
const REACH: usize = 2;
/// Fewer cells tell no plane.
const LEAST_CELLS: f64 = 8.0;
/// Standard deviation of the cells about their mean along the narrower way, metres; those of a whole square have 0.29. Rings of one line tell no slope across
/// them, and a square seen in part lies where the beams end, which moves with the rover.
const LEAST_WIDTH_M: f64 = 0.2;
/// Standard deviation of the cells about the plane, metres: more is an edge or a bush.
const MOST_REST_M: f64 = 0.02;

/// The ground's planes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GroundMap {
    /// Column and row of the first node, counted from the origin.
    first: [i64; 2],
    width: usize,
    rows: usize,
    /// Row by row.
    planes: Vec<Option<GroundPlane>>,
    count: usize,
}

/// A piece of ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GroundPlane {
    pub place_m: DVec3,
    /// Upwards.
    pub normal: DVec3,
}

/// Sums over cells of 1, x, y, x^2, xy, y^2, z, xz, yz and z^2.
#[derive(Clone, Copy, Debug, Default)]
struct Moments([f64; 10]);

impl GroundMap {
    /// Of the means of cells; those that are not finite, or too far off, are left out.
    pub(super) fn of(cells_m: impl Iterator<Item = DVec3>) -> GroundMap {
        let is_near = |cell_m: &DVec3| cell_m.is_finite() && cell_m.abs().max_element() < FARTHEST_M;
        let node = |cell_m: DVec3| [cell_m.x, cell_m.y].map(|t_m| (t_m / NODE_M).floor() as i64);
        let cells: Vec<([i64; 2], DVec3)> = cells_m.filter(is_near).map(|cell_m| (node(cell_m), cell_m)).collect();
        let Some(&(some, _)) = cells.first() else { return GroundMap::default() };
        let (mut first, mut last) = (some, some);
        for (node, _) in &cells {
            for axis in 0..2 {
                (first[axis], last[axis]) = (first[axis].min(node[axis]), last[axis].max(node[axis]));
            }
        }
        let [width, rows] = [0, 1].map(|axis| (last[axis] - first[axis]) as usize + 1);
        let mut moments = vec![Moments::default(); width * rows];
        for ([column, row], cell_m) in cells {
            moments[(row - first[1]) as usize * width + (column - first[0]) as usize].add(cell_m);
        }
        let planes: Vec<_> = along_columns(&along_rows(&moments, width), width).iter().map(Moments::plane).collect();
        let count = planes.iter().flatten().count();
        GroundMap { first, width, rows, planes, count }
    }

    /// How many planes there are.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Row by row.
    pub(super) fn planes(&self) -> impl Iterator<Item = &GroundPlane> {
        self.planes.iter().flatten()
    }

    /// The plane of the node that a place lies at.
    #[inline(always)]
    pub(super) fn at(&self, place_m: DVec3) -> Option<&GroundPlane> {
        // In floats: a place may be far off, or no number.
        let column = (place_m.x / NODE_M).floor() - self.first[0] as f64;
        let row = (place_m.y / NODE_M).floor() - self.first[1] as f64;
        let is_inside = column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.rows as f64;
        if is_inside { self.planes[row as usize * self.width + column as usize].as_ref() } else { None }
    }
}

impl Moments {
    #[inline(always)]
    fn add(&mut self, at_m: DVec3) {
        let DVec3 { x, y, z } = at_m;
        self.add_all(&Moments([1.0, x, y, x * x, x * y, y * y, z, x * z, y * z, z * z]));
    }

    #[inline(always)]
    fn add_all(&mut self, other: &Moments) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum += value;
        }
    }

    /// The plane of least squares, if the cells tell one.
    fn plane(&self) -> Option<GroundPlane> {
        let [count, x, y, xx, xy, yy, z, xz, yz, zz] = self.0;
        if count < LEAST_CELLS {
            return None;
        }
        let [x, y, z] = [x / count, y / count, z / count];
        let (xx, xy, yy) = (xx / count - x * x, xy / count - x * y, yy / count - y * y);
        let (xz, yz, zz) = (xz / count - x * z, yz / count - y * z, zz / count - z * z);
        let narrower = 0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        if narrower < LEAST_WIDTH_M * LEAST_WIDTH_M {
            return None;
        }
        let determinant = xx * yy - xy * xy;
        let (east, north) = ((xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant);
        let rest = zz - east * xz - north * yz;
        let normal = DVec3::new(-east, -north, 1.0).normalize();
        (rest < MOST_REST_M * MOST_REST_M).then_some(GroundPlane { place_m: DVec3::new(x, y, z), normal })
    }
}

/// The sums over a row's neighbours on both sides.
fn along_rows(moments: &[Moments], width: usize) -> Vec<Moments> {
    let mut sums = Vec::with_capacity(moments.len());
    for row in moments.chunks_exact(width) {
        sums.extend(
            (0..width).map(|column| total(&row[column.saturating_sub(REACH)..(column + REACH + 1).min(width)])),
        );
    }
    sums
}

/// The sums over a column's neighbours on both sides.
fn along_columns(moments: &[Moments], width: usize) -> Vec<Moments> {
    let rows = moments.len() / width;
    let mut sums = vec![Moments::default(); moments.len()];
    for (row, sums) in sums.chunks_exact_mut(width).enumerate() {
        for other in row.saturating_sub(REACH)..(row + REACH + 1).min(rows) {
            for (sum, value) in sums.iter_mut().zip(&moments[other * width..]) {
                sum.add_all(value);
            }
        }
    }
    sums
}

fn total(moments: &[Moments]) -> Moments {
    let mut total = Moments::default();
    moments.iter().for_each(|value| total.add_all(value));
    total
}

#[cfg(test)]
mod tests;
