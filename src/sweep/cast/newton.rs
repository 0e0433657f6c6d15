//! First hits of many rays from one point on a polynomial ground: the fast path of a sweep.
//!
//! In: the Taylor coefficients of the ground about the sensor and unit directions. Out: the range of each first crossing.
//! Along a ray the height is a power series whose k-th coefficient is a homogeneous form of the direction; its curvature
//! is bounded by Bernstein coefficients on the piece that lies ahead (see `series`), and Newton steps bounded by it approach
//! the first root from this side, quadratically. Rays go in blocks of [`LANES`], lane by lane the same arithmetic with
//! fused multiply-adds throughout: a ray's result depends on no neighbour and on no instruction set.

use super::series::{MAX_DEGREE, Series};
use crate::geometry::DVec3;

/// Rays in a block.
pub const LANES: usize = 16;
/// One number a ray of the block.
pub type Lanes = [f64; LANES];
/// Steps before a stubborn ray (a near tangency) is left to the scalar solver.
const STEPS: usize = 12;

/// The ground about a sensor, and how far this expansion serves.
#[derive(Clone)]
pub struct Near {
    pub degree: usize,
    /// `table[k][j]` goes with X^(k-j) Y^j, metres.
    pub table: [Series; MAX_DEGREE + 1],
    /// Height of the sensor above the expansion's zero, metres.
    pub z_m: f64,
    /// Ranges up to which the expansion is exact to a tenth of a picometre.
    pub reach_m: f64,
    /// Certified heights of the ground within the reach.
    pub lowest_m: f64,
    pub highest_m: f64,
    /// The yard as seen from the sensor: least and greatest x, then y.
    pub square_m: [f64; 4],
    /// Clearance that counts as arrival.
    pub arrival_m: f64,
}

/// A block's outcome.
pub struct Block {
    /// Range of the hit; infinite where there is none.
    pub range_m: Lanes,
    /// Where the expansion's part of the ray ends.
    pub end_m: Lanes,
    /// How far a ray came that did not settle; NaN for the others.
    pub stuck_m: Lanes,
    /// Clearance along each ray as a power series, coefficient by coefficient.
    pub series: [Lanes; MAX_DEGREE + 1],
}

impl Block {
    pub fn new() -> Block {
        let series = [[0.0; LANES]; MAX_DEGREE + 1];
        Block { range_m: [0.0; LANES], end_m: [0.0; LANES], stuck_m: [0.0; LANES], series }
    }
}

/// Solves one block of rays up to `max_m`.
#[inline(always)]
pub fn solve<const N: usize>(near: &Near, dirs: &[DVec3; LANES], max_m: f64, block: &mut Block) {
    let p = &mut block.series;
    let (mut t, mut bound) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        let (dx, dy, dz) = (dirs[l].x, dirs[l].y, dirs[l].z);
        let inverse = |d: f64| 1.0 / if d == 0.0 { 1e-300 } else { d };
        let (ix, iy, iz) = (inverse(dx), inverse(dy), inverse(dz));
        // The part of the ray over the yard and between the lowest and the highest ground.
        let [west, east, south, north] = near.square_m;
        let out_x = larger(west * ix, east * ix);
        let out_y = larger(south * iy, north * iy);
        let (a, b) = ((near.lowest_m - near.z_m) * iz, (near.highest_m - near.z_m) * iz);
        let end = smaller(smaller(max_m, larger(a, b)), smaller(out_x, out_y));
        let end = smaller(end, near.reach_m);
        let start = larger(0.0, smaller(a, b));
        // NaN marks a ray that is done.
        t[l] = if start <= end { start } else { f64::NAN };
        block.end_m[l] = end;
        block.range_m[l] = f64::INFINITY;

        // Height along the ray: forms of the direction, degree by degree, in ascending powers of y.
        let mut powers = [1.0; MAX_DEGREE + 1];
        for k in 1..=N {
            powers[k] = powers[k - 1] * dy;
        }
        p[0][l] = near.z_m - near.table[0][0];
        for k in 1..=N {
            let mut sum = near.table[k][0];
            for j in 1..=k {
                sum = sum.mul_add(dx, near.table[k][j] * powers[j]);
            }
            p[k][l] = if k == 1 { dz - sum } else { -sum };
        }

        // Bernstein coefficients of -g'' on [0, end].
        let m = N - 2;
        let mut b = [0.0; MAX_DEGREE + 1];
        let (mut power, mut size) = (1.0, 0.0);
        for k in 0..=m {
            let term = p[k + 2][l] * power * BERNSTEIN[m][k];
            size += term.abs();
            b[k] = term;
            power *= end;
        }
        for row in 1..=m {
            for k in (row..=m).rev() {
                b[k] += b[k - 1];
            }
        }
        let mut most = 0.0;
        for &value in &b[..=m] {
            most = larger(most, value);
        }
        bound[l] = 1e-14f64.mul_add(size, most);
    }

    for _ in 0..STEPS {
        let mut open = 0u32;
        for l in 0..LANES {
            let s = t[l];
            let (mut g, mut slope) = (p[N][l], 0.0f64);
            for k in (0..N).rev() {
                slope = slope.mul_add(s, g);
                g = g.mul_add(s, p[k][l]);
            }
            let arrived = g <= near.arrival_m && slope <= 0.0;
            let g = larger(g, 0.0);
            let root = slope.mul_add(slope, 2.0 * bound[l] * g).sqrt();
            let rising = slope > 0.0;
            let step = if rising { slope + root } else { 2.0 * g } / if rising { bound[l] } else { root - slope };
            let next = s + step;
            let landed = smaller(if step < 1e-3 { next } else { s }, block.end_m[l]);
            let going = !arrived && next <= block.end_m[l];
            block.range_m[l] = if arrived { landed } else { block.range_m[l] };
            t[l] = if going { next } else { f64::NAN };
            open += u32::from(going);
        }
        if open == 0 {
            break;
        }
    }
    block.stuck_m = t;
}

/// `BERNSTEIN[m][k]` = -(k + 1)(k + 2) / C(m, k): from the coefficients of g to those of -g'' in the Bernstein basis.
const BERNSTEIN: [[f64; MAX_DEGREE - 1]; MAX_DEGREE - 1] = {
    let mut table = [[0.0; MAX_DEGREE - 1]; MAX_DEGREE - 1];
    let mut m = 0;
    while m < MAX_DEGREE - 1 {
        let mut binomial = 1.0;
        let mut k = 0;
        while k <= m {
            table[m][k] = -(((k + 1) * (k + 2)) as f64) / binomial;
            binomial = binomial * (m - k) as f64 / (k + 1) as f64;
            k += 1;
        }
        m += 1;
    }
    table
};

/// The larger of two numbers, as one instruction.
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
pub fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
