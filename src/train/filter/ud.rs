//! The extended Kalman filter on a factored covariance, P = U D U': slower, and sound at any setting.
//!
//! In: Jacobians and innovations. Out: better weights. Source: Bierman 1977, *Factorization Methods for Discrete Sequential
//! Estimation*, ch. V: U is unit upper triangular, D diagonal and never negative, so that S >= R holds by construction. The
//! columns of U are the rows of a packed lower triangle, and go through the memory once an update; U is `T`, D and S are f64.
//! Deviation: Q is added to D, that is, P += U q U' (exact for Q = 0; the exact sum costs O(s^3)). Rows of a batch are learnt
//! one by one against weights that stand still, which equals learning them together.

#![allow(clippy::needless_range_loop)] // Lanes and rows of small arrays, by number.

use super::FilterError;
use super::lanes::{Isa, Kernel, Real, Simd};
use super::linearised::{Learner, Outcome, Rows};
use super::state::{Reader, Writer};
use super::triangle::{CovarianceBlock, ROWS, Triangle, chunks, width};

/// The filter with factors of element type `T`.
pub(crate) struct Ud<T: Real> {
    isa: Isa,
    name: String,
    batch: usize,
    p0: f64,
    /// U': row j holds column j of U, its unit diagonal included.
    factor: Triangle<T>,
    /// D, padded to whole strips.
    variances: Vec<f64>,
    slopes: Vec<T::Chunk>,
    gain: Vec<T::Chunk>,
    step: Vec<f64>,
}

impl<T: Real> Ud<T> {
    /// Name of the array of U', which no other form has.
    pub(crate) const FACTOR: &str = "factor";

    /// P = P0 I.
    pub(super) fn new(size: usize, p0: f64, batch: usize, isa: Isa) -> Ud<T> {
        Ud::diagonal(vec![p0; size], p0, batch, isa)
    }

    /// P with these variances and no covariance; P0 is what it falls back to.
    pub(super) fn diagonal(mut variances: Vec<f64>, p0: f64, batch: usize, isa: Isa) -> Ud<T> {
        let size = variances.len();
        variances.resize(size.next_multiple_of(ROWS), 0.0);
        let room = vec![T::Chunk::default(); chunks::<T>(size)];
        Ud {
            isa,
            name: format!("ud-{}", T::NAME.to_lowercase()),
            batch,
            p0,
            factor: Triangle::diagonal(size, 1.0),
            variances,
            slopes: room.clone(),
            gain: room,
            step: vec![0.0; size],
        }
    }

    /// P = P0 I.
    fn reset(&mut self) {
        let size = self.step.len();
        self.factor = Triangle::diagonal(size, 1.0);
        self.variances = vec![self.p0; size];
        self.variances.resize(size.next_multiple_of(ROWS), 0.0);
    }

    /// One row: leaves S K in `gain`, returns S.
    ///
    /// A strip is changed while the one after the next is multiplied: what the changes wait for, the sums of a strip and the chain
    /// of divisions after them, is then done before its turn comes.
    #[inline(always)]
    fn measure<V: Simd<T>>(&mut self, noise: f64) -> f64 {
        self.gain.fill(T::Chunk::default());
        let strips = self.variances.len() / ROWS;
        let zero = [V::splat(T::of(0.0)); ROWS];
        let mut rest = &mut self.factor.tiles[..];
        let mut f = [[T::of(0.0); ROWS]; 2]; // f = U' b, of a strip and of the next
        let mut start = 0;
        for (strip, f) in f.iter_mut().enumerate().take(strips) {
            let mut sums = zero;
            for (tile, b) in rest[start..][..width::<T>(strip)].iter().zip(&self.slopes) {
                add::<T, V>(tile, b, &mut sums);
            }
            *f = V::sums(sums);
            start += width::<T>(strip);
        }
        let mut alpha = noise;
        for (strip, d) in self.variances.chunks_exact_mut(ROWS).enumerate() {
            let (mut p, mut v) = (zero, zero);
            for r in 0..ROWS {
                let f = f[0][r].f64();
                let vf = d[r] * f;
                let next = vf.mul_add(f, alpha);
                d[r] *= alpha / next;
                p[r] = V::splat(T::of(-f / alpha));
                v[r] = V::splat(T::of(vf));
                alpha = next;
            }
            let (tiles, others) = rest.split_at_mut(width::<T>(strip));
            let ahead = match strip + 2 < strips {
                true => &others[width::<T>(strip + 1)..][..width::<T>(strip + 2)],
                false => &[],
            };
            let common = tiles.len().min(ahead.len());
            let mut sums = zero;
            let both = tiles.iter_mut().zip(&mut self.gain).zip(ahead.iter().zip(&self.slopes));
            for ((tile, gain), (ahead, b)) in both {
                change::<T, V>(tile, gain, &p, &v);
                add::<T, V>(ahead, b, &mut sums);
            }
            for (tile, gain) in tiles[common..].iter_mut().zip(&mut self.gain[common..]) {
                change::<T, V>(tile, gain, &p, &v);
            }
            for (ahead, b) in ahead[common..].iter().zip(&self.slopes[common..]) {
                add::<T, V>(ahead, b, &mut sums);
            }
            f = [f[1], V::sums(sums)];
            rest = others;
        }
        alpha
    }
}

/// How far ahead of the sums a factor is asked for, in tiles: 32 KiB. Two streams in turn, one of them written, are more than CPUs
/// keep up with by themselves.
const FETCHED_AHEAD: usize = 128;

/// Adds a tile's part to the sums of U' b.
#[inline(always)]
fn add<T: Real, V: Simd<T>>(tile: &CovarianceBlock<T::Chunk>, b: &T::Chunk, sums: &mut [V; ROWS]) {
    let b = V::load(b);
    for r in 0..ROWS {
        V::fetch((&raw const tile.0[r]).wrapping_add(ROWS * FETCHED_AHEAD));
        sums[r] = V::load(&tile.0[r]).mul_add(b, sums[r]);
    }
}

/// Columns of a tile of U, one after the other: u += p k, and the gain k += v u of the old u.
#[inline(always)]
fn change<T: Real, V: Simd<T>>(
    tile: &mut CovarianceBlock<T::Chunk>,
    gain: &mut T::Chunk,
    p: &[V; ROWS],
    v: &[V; ROWS],
) {
    let mut k = V::load(gain);
    for r in 0..ROWS {
        let u = V::load(&tile.0[r]);
        // Entries of the gain below row j are still 0 at column j, so zeros and the diagonal stay.
        k.mul_add(p[r], u).store(&mut tile.0[r]);
        k = u.mul_add(v[r], k);
    }
    k.store(gain);
}

struct Update<'a, T: Real> {
    filter: &'a mut Ud<T>,
    weights: &'a mut [f64],
    rows: &'a Rows<'a>,
}

impl<T: Real> Kernel<T> for Update<'_, T> {
    type Out = Outcome;

    #[inline(always)]
    fn run<V: Simd<T>>(self) -> Outcome {
        let Update { filter, weights, rows } = self;
        let size = weights.len();
        filter.step.fill(0.0);
        filter.variances[..size].iter_mut().for_each(|d| *d += rows.q); // Eq. (11), approximately
        for ((slopes, &innovation), &noise) in rows.jacobian.chunks_exact(size).zip(rows.innovations).zip(rows.noise) {
            let mut left = innovation;
            for (chunk, slopes) in filter.slopes.iter_mut().zip(slopes.chunks(T::LANES)) {
                for (b, slope) in chunk.as_mut().iter_mut().zip(slopes) {
                    *b = T::of(*slope);
                }
            }
            for (slope, step) in slopes.iter().zip(&filter.step) {
                left -= slope * step;
            }
            let s = filter.measure::<V>(noise); // Eqs (13) and (14)
            let scale = left / s;
            for (chunk, steps) in filter.gain.iter().zip(filter.step.chunks_mut(T::LANES)) {
                for (k, step) in chunk.as_ref().iter().zip(steps) {
                    *step = k.f64().mul_add(scale, *step); // Eq. (15)
                }
            }
            if !(s < f64::INFINITY && filter.variances.iter().all(|d| d.is_finite())) {
                filter.reset();
                return Outcome { rebuilt: 1, rejected: true };
            }
        }
        if !weights.iter().zip(&filter.step).all(|(w, step)| (w + step).is_finite()) {
            filter.reset();
            return Outcome { rebuilt: 1, rejected: true };
        }
        for (w, step) in weights.iter_mut().zip(&filter.step) {
            *w += step;
        }
        Outcome::default()
    }
}

impl<T: Real> Learner for Ud<T> {
    fn kind(&self) -> &str {
        &self.name
    }

    fn batch(&self) -> usize {
        self.batch
    }

    fn update(&mut self, weights: &mut [f64], rows: &Rows) -> Outcome {
        self.isa.run(Update { filter: self, weights, rows })
    }

    fn save(&self, to: &mut Writer) {
        to.reals(Self::FACTOR, self.factor.elements());
        to.reals("variances", self.variances[..self.step.len()].iter().copied());
    }

    fn load(&mut self, from: &Reader) -> Result<(), FilterError> {
        let factor = from.reals::<T>(Self::FACTOR, self.factor.count())?;
        let variances = from.reals::<f64>("variances", self.step.len())?;
        self.factor.set_elements(factor.into_iter());
        self.variances[..variances.len()].copy_from_slice(&variances);
        Ok(())
    }
}
