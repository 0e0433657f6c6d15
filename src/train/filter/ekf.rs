//! The extended Kalman filter on weights, with one group of them (the paper's) or several (decoupled).
//!
//! In: Jacobians and innovations of one row or of a batch. Out: better weights. Source: Hewitt et al. 2017, eqs 11-16; groups
//! after Puskorius & Feldkamp 1991: S = R + sum_g B_g P_g B_g' is shared, each group has its own gain. A batch is linearised at
//! the same weights and learnt together (S is m x m). The covariance is `T`; weights, innovations and S are f64.

use super::FilterError;
use super::covariance::Covariance;
use super::lanes::{Isa, Kernel, Real, Simd};
use super::linearised::{Learner, Outcome, Rows, finite};
use super::state::{Reader, Writer};
use super::triangle::{Masks, Triangle};
use super::ud::Ud;

/// Variances are not rebuilt below this share of P0.
const REBUILD_FLOOR: f64 = 1e-7;

/// The filter with covariances of element type `T`.
pub(super) struct Ekf<T: Real> {
    isa: Isa,
    name: String,
    batch: usize,
    p0: f64,
    groups: Vec<Covariance<T>>,
    masks: Vec<Masks<T::Chunk>>,
    /// S, then its root, in the lower triangle of rows of `batch`; and a group's part of S.
    root: Vec<f64>,
    forms: Vec<f64>,
    z: Vec<f64>,
    step: Vec<f64>,
}

impl<T: Real> Ekf<T> {
    /// A filter over the given groups of weights, each weight in one of them.
    pub(super) fn new(name: &str, groups: Vec<Vec<u32>>, p0: f64, batch: usize, isa: Isa) -> Ekf<T> {
        let size = groups.iter().map(Vec::len).sum();
        Ekf {
            isa,
            name: format!("{name}-{}", T::NAME.to_lowercase()),
            batch,
            p0,
            groups: groups.into_iter().map(|members| Covariance::new(members, p0, batch)).collect(),
            masks: (0..T::LANES / super::triangle::ROWS).map(Triangle::<T>::masks).collect(),
            root: vec![0.0; batch * batch],
            forms: vec![0.0; batch * batch],
            z: vec![0.0; batch],
            step: vec![0.0; size],
        }
    }
}

impl<T: Real> Ekf<T> {
    /// The factored form that goes on with the variances of the first group, where it holds all weights.
    pub(super) fn factored(&self, isa: Isa) -> Ud<T> {
        let variances = self.groups[0].variances(REBUILD_FLOOR * self.p0).collect();
        Ud::diagonal(variances, self.p0, self.batch, isa)
    }
}

struct Update<'a, T: Real> {
    filter: &'a mut Ekf<T>,
    weights: &'a mut [f64],
    rows: &'a Rows<'a>,
}

impl<T: Real> Kernel<T> for Update<'_, T> {
    type Out = Outcome;

    #[inline(always)]
    fn run<V: Simd<T>>(self) -> Outcome {
        let Update { filter, weights, rows } = self;
        let Ekf { groups, masks, root, forms, z, step, batch: stride, p0, .. } = filter;
        let (count, stride) = (rows.innovations.len(), *stride);
        let mut outcome = Outcome::default();
        for j in 0..count {
            root[j * stride..][..j].fill(0.0);
            root[j * stride + j] = rows.noise[j]; // S = R + sum B P B'
        }
        for group in groups.iter_mut() {
            for (j, slopes) in rows.jacobian.chunks_exact(weights.len()).enumerate() {
                group.take(j, slopes);
            }
            group.pass::<V>(count, rows.q, masks); // Eq. (11) and P B'
            if !group.form(count, forms, stride) {
                group.rebuild(count, REBUILD_FLOOR * *p0);
                group.form(count, forms, stride);
                outcome.rebuilt += 1;
            }
            root.iter_mut().zip(forms.iter()).for_each(|(s, own)| *s += own);
        }
        if !factor(root, count, stride) {
            outcome.rejected = true;
            return outcome;
        }
        for j in 0..count {
            let mut sum = rows.innovations[j];
            for k in 0..j {
                sum -= root[j * stride + k] * z[k];
            }
            z[j] = sum / root[j * stride + j];
        }
        step.copy_from_slice(weights);
        for group in groups.iter_mut() {
            group.leave::<V>(count, root, stride); // Eqs (13) and (14)
            group.step(&z[..count], step); // Eq. (15)
        }
        if finite(step) {
            weights.copy_from_slice(step);
        } else {
            groups.iter_mut().for_each(|group| group.rank -= count);
            outcome.rejected = true;
        }
        outcome
    }
}

/// Lower Cholesky root in place; false where the matrix is not positive definite or not finite.
#[inline(always)]
fn factor(a: &mut [f64], size: usize, stride: usize) -> bool {
    for j in 0..size {
        for k in 0..=j {
            let mut sum = a[j * stride + k];
            for l in 0..k {
                sum -= a[j * stride + l] * a[k * stride + l];
            }
            if k < j {
                a[j * stride + k] = sum / a[k * stride + k];
            } else if sum > 0.0 && sum < f64::INFINITY {
                a[j * stride + j] = sum.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

impl<T: Real> Learner for Ekf<T> {
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
        to.reals("covariance", self.groups.iter().flat_map(|g| g.triangle.elements()));
        to.counts("pending_rank", self.groups.iter().map(|g| g.rank as u64));
        to.reals("pending_q", self.groups.iter().map(|g| g.pending_q));
        to.counts("backward", self.groups.iter().map(|g| u64::from(g.backward)));
        let pending = |g: &'_ Covariance<T>| -> Vec<T> {
            (0..g.rank).flat_map(|j| (0..g.members.len()).map(move |i| g.pending(j, i))).collect()
        };
        to.reals("pending", self.groups.iter().flat_map(pending));
    }

    fn load(&mut self, from: &Reader) -> Result<(), FilterError> {
        let ranks = from.counts("pending_rank", self.groups.len())?;
        let pending_q = from.reals::<f64>("pending_q", self.groups.len())?;
        let backward = from.counts("backward", self.groups.len())?;
        let covariance = from.reals::<T>("covariance", self.groups.iter().map(|g| g.triangle.count()).sum())?;
        if let Some((&rank, g)) = ranks.iter().zip(&self.groups).find(|(rank, g)| **rank > g.room as u64) {
            return Err(FilterError::OtherSize { there: rank as usize, here: g.room });
        }
        let size = |(g, &rank): (&Covariance<T>, &u64)| rank as usize * g.members.len();
        let pending = from.reals::<T>("pending", self.groups.iter().zip(&ranks).map(size).sum())?;
        let (mut covariance, mut pending) = (covariance.into_iter(), pending.into_iter());
        for ((g, q), (rank, backward)) in self.groups.iter_mut().zip(pending_q).zip(ranks.iter().zip(backward)) {
            g.triangle.set_elements(&mut covariance);
            (g.rank, g.pending_q) = (*rank as usize, q);
            g.backward = backward != 0;
            for j in 0..g.rank {
                for i in 0..g.members.len() {
                    if let Some(value) = pending.next() {
                        g.set_pending(j, i, value);
                    }
                }
            }
        }
        Ok(())
    }
}
