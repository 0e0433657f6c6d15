//! A ray over the cells of a raster: where it enters and leaves each, and the exact crossing of a bilinear cell.
//!
//! In: a ray in cells (x and y in cell sides from node (0, 0), z and times in metres) and a cell's four heights. Out: the time of
//! the first crossing. Everything here is a function of the ray and the cell alone, so that every way to find the cell gives
//! the same bits; and without branches, so that sixteen rays can go side by side.

use super::newton::{larger, smaller};

/// One axis of a ray: `place + rate * t`, in cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub place: f64,
    pub rate: f64,
    /// 1 / rate (1 where the ray runs along the other axis).
    pub inverse: f64,
    /// From a cell's number to the border at which the ray enters it, and leaves it: 0, 1 or infinite.
    pub enters: f64,
    pub leaves: f64,
}

impl Axis {
    #[inline(always)]
    pub(super) fn new(place: f64, rate: f64) -> Axis {
        let (forward, still) = (rate > 0.0, rate == 0.0);
        let far = |end: f64, moving: f64| if still { end } else { moving };
        Axis {
            place,
            rate,
            inverse: if still { 1.0 } else { 1.0 / rate },
            enters: far(f64::NEG_INFINITY, if forward { 0.0 } else { 1.0 }),
            leaves: far(f64::INFINITY, if forward { 1.0 } else { 0.0 }),
        }
    }

    /// When the ray enters a cell.
    #[inline(always)]
    pub(super) fn enters_at(&self, cell: f64) -> f64 {
        (cell + self.enters - self.place) * self.inverse
    }

    /// When it leaves it: the very time at which it enters the next.
    #[inline(always)]
    pub(super) fn leaves_at(&self, cell: f64) -> f64 {
        (cell + self.leaves - self.place) * self.inverse
    }

    /// From a cell to the next along the ray.
    #[inline(always)]
    pub(super) fn step(&self) -> f64 {
        if self.rate > 0.0 { 1.0 } else { -1.0 }
    }

    /// The part of [from, to] in which the ray is within [low, high]; empty (from > to) where it never is.
    #[inline(always)]
    pub(super) fn clip(&self, [low, high]: [f64; 2], from: f64, to: f64) -> (f64, f64) {
        let (a, b) = ((low - self.place) * self.inverse, (high - self.place) * self.inverse);
        let (near, far) = if self.rate > 0.0 { (a, b) } else { (b, a) };
        let within = self.place >= low && self.place <= high;
        let beside = if within { f64::INFINITY } else { f64::NEG_INFINITY };
        let (near, far) = if self.rate == 0.0 { (f64::NEG_INFINITY, beside) } else { (near, far) };
        (larger(near, from), smaller(far, to))
    }
}

/// A ray in cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellRay {
    pub x: Axis,
    pub y: Axis,
    pub z: f64,
    pub dz: f64,
    /// The part of the ray over the yard and within reach.
    pub from: f64,
    pub to: f64,
    /// 1 for a ray that comes from above the ground, -1 from below.
    pub side: f64,
}

impl CellRay {
    /// Time of the first crossing in cell (col, row) of corner heights south-west, south-east, north-west, north-east;
    /// infinite where there is none.
    #[inline(always)]
    pub(super) fn crossing(&self, col: f64, row: f64, [sw, se, nw, ne]: [f64; 4]) -> f64 {
        let from = larger(self.from, larger(self.x.enters_at(col), self.y.enters_at(row)));
        let to = smaller(self.to, smaller(self.x.leaves_at(col), self.y.leaves_at(row)));
        let x = self.x.rate.mul_add(from, self.x.place - col);
        let y = self.y.rate.mul_add(from, self.y.place - row);
        let (east, north, twist) = (se - sw, nw - sw, (ne - nw) - (se - sw));
        // z - h along the ray, as a quadratic in the time from the entry.
        let height = twist.mul_add(x * y, north.mul_add(y, east.mul_add(x, sw)));
        let gap = self.side * (self.dz.mul_add(from, self.z) - height);
        let turn = x.mul_add(self.y.rate, y * self.x.rate);
        let rise = twist.mul_add(turn, north.mul_add(self.y.rate, east * self.x.rate));
        let slope = self.side * (self.dz - rise);
        let bend = self.side * twist * self.x.rate * self.y.rate;
        // The first root of gap + slope s - bend s^2, in the form that adds where the other cancels; NaN or negative: none.
        let root = slope.mul_add(slope, 4.0 * bend * gap).sqrt();
        let rising = slope > 0.0;
        let step = if rising { slope + root } else { 2.0 * gap } / if rising { 2.0 * bend } else { root - slope };
        // At or past the surface at the entry: the crossing rounded onto the border between two cells.
        let step = if gap <= 0.0 { if slope < 0.0 { 0.0 } else { f64::NAN } } else { step };
        if step >= 0.0 && step <= to - from { from + step } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_part_of_a_ray_between_two_borders() {
        // From 5 at half a cell a second back: at 3 after 4 s, at 1 after 8 s. And forward, at rest within, and at rest beside.
        assert_eq!(Axis::new(5.0, -0.5).clip([1.0, 3.0], 0.0, 100.0), (4.0, 8.0));
        assert_eq!(Axis::new(5.0, 0.25).clip([6.0, 7.0], 0.0, 100.0), (4.0, 8.0));
        assert_eq!(Axis::new(5.0, 0.25).clip([6.0, 7.0], 5.0, 6.0), (5.0, 6.0));
        assert_eq!(Axis::new(5.0, 0.0).clip([4.0, 6.0], 1.0, 2.0), (1.0, 2.0));
        let (from, to) = Axis::new(5.0, 0.0).clip([6.0, 7.0], 1.0, 2.0);
        assert!(from > to);
    }
}
