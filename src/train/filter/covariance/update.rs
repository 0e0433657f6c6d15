//! What an update reads of a covariance, and leaves in it.

use super::Covariance;
use crate::train::filter::lanes::{Real, Simd};

impl<T: Real> Covariance<T> {
    /// B P B' of the rows of a batch into the lower triangle of `to`; false where P cannot be positive semidefinite.
    #[inline(always)]
    pub(crate) fn form(&self, count: usize, to: &mut [f64], stride: usize) -> bool {
        let mut sound = true;
        for j in 0..count {
            for k in 0..=j {
                to[j * stride + k] = self.quadratic(j, k);
            }
            let own = to[j * stride + j];
            sound &= (0.0..f64::INFINITY).contains(&own);
        }
        sound
    }

    /// b_j' P b_k, in f64.
    #[inline(always)]
    fn quadratic(&self, j: usize, k: usize) -> f64 {
        let b = &self.jacobian[j * self.width..][..self.width];
        let y = &self.product[k * self.width..][..self.width];
        let mut lanes = [0.0f64; 8];
        for (b, y) in b.iter().zip(y) {
            for (b, y) in b.as_ref().chunks_exact(8).zip(y.as_ref().chunks_exact(8)) {
                for l in 0..8 {
                    lanes[l] = b[l].f64().mul_add(y[l].f64(), lanes[l]);
                }
            }
        }
        let four = [lanes[0] + lanes[4], lanes[1] + lanes[5], lanes[2] + lanes[6], lanes[3] + lanes[7]];
        (four[0] + four[2]) + (four[1] + four[3])
    }

    /// Leaves t = P B' L^-T pending for the rows of a batch; `root` is L, row-major with `stride`.
    #[inline(always)]
    pub(crate) fn leave<V: Simd<T>>(&mut self, count: usize, root: &[f64], stride: usize) {
        for (c, column) in self.pending.chunks_exact_mut(self.room).enumerate() {
            let column = &mut column[self.rank..];
            for j in 0..count {
                let mut t = V::load(&self.product[j * self.width + c]);
                for k in 0..j {
                    t = V::splat(T::of(root[j * stride + k])).neg_mul_add(V::load(&column[k]), t);
                }
                t.mul(V::splat(T::of(1.0 / root[j * stride + j]))).store(&mut column[j]);
            }
        }
        self.rank += count;
    }

    /// Adds sum_j t_j z_j of the last rows left to the members' entries of `step`.
    #[inline(always)]
    pub(crate) fn step(&self, z: &[f64], step: &mut [f64]) {
        let first = self.rank - z.len();
        let columns = self.pending.chunks_exact(self.room);
        if let Some(run) = self.run {
            let own = &mut step[run..run + self.members.len()];
            let whole = own.len() / T::LANES;
            let (full, part) = own.split_at_mut(whole * T::LANES);
            // Whole chunks apart: their length is known, so they become vectors.
            for (column, places) in columns.clone().zip(full.chunks_exact_mut(T::LANES)) {
                add::<T>(&column[first..], z, places);
            }
            for column in columns.skip(whole) {
                add::<T>(&column[first..], z, part);
            }
            return;
        }
        for (column, members) in columns.zip(self.members.chunks(T::LANES)) {
            for (t, z) in column[first..].iter().zip(z) {
                for (t, &member) in t.as_ref().iter().zip(members) {
                    let place = &mut step[member as usize];
                    *place = t.f64().mul_add(*z, *place);
                }
            }
        }
    }

    /// Variances of the members, with what is pending; at least `floor`.
    pub(crate) fn variances(&self, floor: f64) -> impl Iterator<Item = f64> + '_ {
        (0..self.members.len()).map(move |i| {
            let square = |j: usize| self.pending(j, i).f64() * self.pending(j, i).f64();
            let p = self.triangle.get(i, i).f64() + self.pending_q - (0..self.rank).map(square).sum::<f64>();
            if p.is_finite() { p.max(floor) } else { floor }
        })
    }

    /// Forgets all covariances; variances stay, but not below `floor`. The products become those of the new P.
    pub(crate) fn rebuild(&mut self, count: usize, floor: f64) {
        let variances: Vec<f64> = self.variances(floor).collect();
        for (i, p) in variances.into_iter().enumerate() {
            for j in 0..i {
                self.triangle.set(i, j, T::of(0.0));
            }
            self.triangle.set(i, i, T::of(p));
            let (chunk, lane) = (i / T::LANES, i % T::LANES);
            for j in 0..count {
                let b = self.jacobian[j * self.width + chunk].as_ref()[lane];
                self.product[j * self.width + chunk].as_mut()[lane] = T::of(p * b.f64());
            }
        }
        self.rank = 0;
        self.pending_q = 0.0;
    }

    /// Element `i` of pending vector `j`.
    pub(crate) fn pending(&self, j: usize, i: usize) -> T {
        self.pending[i / T::LANES * self.room + j].as_ref()[i % T::LANES]
    }

    pub(crate) fn set_pending(&mut self, j: usize, i: usize, value: T) {
        self.pending[i / T::LANES * self.room + j].as_mut()[i % T::LANES] = value;
    }
}

/// Adds the sum of a chunk of each vector, times its number, to some places.
#[inline(always)]
fn add<T: Real>(chunks: &[T::Chunk], factors: &[f64], places: &mut [f64]) {
    for (t, factor) in chunks.iter().zip(factors) {
        for (t, place) in t.as_ref().iter().zip(places.iter_mut()) {
            *place = t.f64().mul_add(*factor, *place);
        }
    }
}
