//! First hits of many rays from one point on a polynomial ground: the fast path of a sweep.
//!
//! In: the Taylor coefficients of the ground about the sensor and unit directions. Out: the range of each first crossing.
//! Along a ray the height is a power series whose k-th coefficient is a homogeneous form of the direction; its curvature
//! is bounded by Bernstein coefficients on the piece that lies ahead (see `series`), and Newton steps bounded by it approach
//! the first root from this side, quadratically. Rays go in blocks of [`LANES`], lane by lane the same arithmetic with
//! fused multiply-adds throughout: a ray's result depends on no neighbour and on no instruction set.

use super::series::{MAX_DEGREE, Series};

/// Rays in a block.
pub(super) const LANES: usize = 16;
/// One number a ray of the block.
pub(super) type Lanes = [f64; LANES];
/// Steps before a stubborn ray (a near tangency) is left to the scalar solver.
const STEPS: usize = 12;

/// The ground about a sensor, and how far this expansion serves.
#[derive(Clone)]
pub(super) struct LocalSeries {
    pub degree: usize,
    /// `table[k][j]` goes with X^(k-j) Y^j, metres.
    pub table: [Series; MAX_DEGREE + 1],
    /// Height of the sensor above the expansion's zero, metres.
    pub z_m: f64,
    /// Ranges up to which the expansion is exact to a tenth of a picometre.
    pub reach_m: f64,
    /// Certified heights of the ground as far as any ray goes: a ray that has left them meets nothing beyond either.
    pub lowest_m: f64,
    pub highest_m: f64,
    /// The yard as seen from the sensor: least and greatest x, then y.
    pub square_m: [f64; 4],
    /// No ray can leave the yard within its reach.
    pub within_yard: bool,
    /// Clearance that counts as arrival.
    pub arrival_m: f64,
}

/// A block's outcome.
pub(super) struct Block {
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
    pub(super) fn new() -> Block {
        let series = [[0.0; LANES]; MAX_DEGREE + 1];
        Block { range_m: [0.0; LANES], end_m: [0.0; LANES], stuck_m: [0.0; LANES], series }
    }
}

/// Directions of a block by component.
#[derive(Clone, Copy)]
pub(super) struct Dirs<'a> {
    pub x: &'a Lanes,
    pub y: &'a Lanes,
    pub z: &'a Lanes,
}

/// Solves one block of rays up to `max_m`.
#[inline(always)]
pub(super) fn solve<const N: usize>(near: &LocalSeries, dirs: Dirs, max_m: f64, block: &mut Block) {
    let mut t = extent(near, dirs, max_m, block);
    forms::<N>(near, dirs, &mut block.series);
    let bound = curvature::<N>(&block.series, &block.end_m);
    let p = &block.series;
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

/// The part of each ray over the yard, between the lowest and the highest ground and within reach: its end goes to the
/// block, its start is returned (NaN, the mark of a ray that is done, where there is no such part).
#[inline(always)]
fn extent(near: &LocalSeries, dirs: Dirs, max_m: f64, block: &mut Block) -> Lanes {
    let Dirs { x: dx, y: dy, z: dz } = dirs;
    let inverse = |d: f64| 1.0 / if d == 0.0 { 1e-300 } else { d };
    let [west, east, south, north] = near.square_m;
    let (lowest, highest) = (near.lowest_m - near.z_m, near.highest_m - near.z_m);
    let mut end = [smaller(max_m, near.reach_m); LANES];
    if !near.within_yard {
        let out_x = each(|l| larger(west * inverse(dx[l]), east * inverse(dx[l])));
        let out_y = each(|l| larger(south * inverse(dy[l]), north * inverse(dy[l])));
        end = each(|l| smaller(end[l], smaller(out_x[l], out_y[l])));
    }
    let iz = each(|l| inverse(dz[l]));
    block.end_m = each(|l| smaller(end[l], larger(lowest * iz[l], highest * iz[l])));
    block.range_m = [f64::INFINITY; LANES];
    each(|l| {
        let start = larger(0.0, smaller(lowest * iz[l], highest * iz[l]));
        if start <= block.end_m[l] { start } else { f64::NAN }
    })
}

/// Clearance along each ray: forms of the direction, degree by degree, in ascending powers of y.
#[inline(always)]
#[expect(
    clippy::needless_range_loop,
    reason = "plain counted loops are unrolled; iterator chains cost a sixth of the rate"
)]
fn forms<const N: usize>(near: &LocalSeries, dirs: Dirs, p: &mut [Lanes; MAX_DEGREE + 1]) {
    let Dirs { x: dx, y: dy, z: dz } = dirs;
    let mut powers = [[1.0; LANES]; MAX_DEGREE + 1];
    for k in 1..N + 1 {
        powers[k] = each(|l| powers[k - 1][l] * dy[l]);
    }
    p[0] = [near.z_m - near.table[0][0]; LANES];
    for k in 1..N + 1 {
        let row = &near.table[k];
        let mut sum = [-row[0]; LANES];
        for j in 1..k + 1 {
            sum = each(|l| sum[l].mul_add(dx[l], -row[j] * powers[j][l]));
        }
        p[k] = sum;
    }
    p[1] = each(|l| p[1][l] + dz[l]);
}

/// An upper bound of -g'' on [0, end], at least 0: the largest Bernstein coefficient.
#[inline(always)]
fn curvature<const N: usize>(p: &[Lanes; MAX_DEGREE + 1], end: &Lanes) -> Lanes {
    let mut b = [[0.0; LANES]; MAX_DEGREE - 1];
    let (mut power, mut size) = ([1.0; LANES], [0.0; LANES]);
    for k in 0..N - 1 {
        b[k] = each(|l| p[k + 2][l] * power[l] * BERNSTEIN[N - 2][k]);
        size = each(|l| size[l] + b[k][l].abs());
        power = each(|l| power[l] * end[l]);
    }
    for row in 1..N - 1 {
        for k in (row..N - 1).rev() {
            b[k] = each(|l| b[k][l] + b[k - 1][l]);
        }
    }
    let mut most = [0.0; LANES];
    for value in b.iter().take(N - 1) {
        most = each(|l| larger(most[l], value[l]));
    }
    // The sums above round; 1e-14 of the terms' size covers it for every degree up to 12.
    each(|l| 1e-14f64.mul_add(size[l], most[l]))
}

/// One number a ray.
#[inline(always)]
pub(super) fn each(value: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (l, lane) in lanes.iter_mut().enumerate() {
        *lane = value(l);
    }
    lanes
}

/// One bit a ray.
#[inline(always)]
pub(super) fn bits(set: impl Fn(usize) -> bool) -> u32 {
    let mut bits = [0; LANES];
    for (l, bit) in bits.iter_mut().enumerate() {
        *bit = if set(l) { 1 << l } else { 0 };
    }
    bits.iter().fold(0, |all, bit| all | bit)
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
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
