//! One group's covariance, and the passes through it.
//!
//! P = triangle + q I - sum_j t_j t_j'. With t = P B' L^-T, L L' = S, one more t is eq. 14 exactly. A pass forms y = P b for new
//! Jacobians b; the t stay beside the triangle as long as there is room for them, and go into it all at once, in the pass that
//! finds no room. So a pass reads P and seldom writes it: what bounds a pass is then the fused multiply-adds or
//! the reading, not the writing. A triangle that lies in the nearest cache is written every time. P is symmetric by construction.
//! Passes run forward and backward in turn: the strips read last are still in the cache; the direction is part of the state,
//! because it is the order of sums.

mod strip;
mod update;

use super::lanes::{Real, Simd};
use super::triangle::{self, Masks, ROWS, Triangle, chunks};

/// Vectors that stay beside a triangle, at least: more of them cost more than the writing that they save.
const ROOM: usize = 16;
/// A smaller triangle lies in the nearest cache.
const SMALL_BYTES: usize = 32 << 10;

/// Covariance of a group of weights.
pub(crate) struct Covariance<T: Real> {
    /// The group's weights.
    pub members: Vec<u32>,
    pub triangle: Triangle<T>,
    /// Vectors t that are not in the triangle yet: a chunk of each, then the next chunk of each, with `room` for each chunk's.
    pending: Vec<T::Chunk>,
    /// Number of them, and how many there is room for.
    pub rank: usize,
    pub room: usize,
    /// What is not on the triangle's diagonal yet.
    pub pending_q: f64,
    /// Whether the next pass runs from the last strip to the first.
    pub backward: bool,
    width: usize,
    /// The first of the members, where they follow one another.
    run: Option<usize>,
    jacobian: Vec<T::Chunk>,
    product: Vec<T::Chunk>,
    /// The part of a product that comes from sums along rows.
    along: Vec<T::Chunk>,
    /// The pending vectors at the rows of up to two strips.
    at_rows: Vec<[T; 2 * ROWS]>,
}

impl<T: Real> Covariance<T> {
    /// P = `variance` I; takes up to `batch` rows at a time.
    pub(super) fn new(members: Vec<u32>, variance: f64, batch: usize) -> Covariance<T> {
        let size = members.len();
        let width = chunks::<T>(size);
        let triangle = Triangle::diagonal(size, variance);
        let small = size_of_val(&triangle.tiles[..]) < SMALL_BYTES;
        let room = if small { batch } else { batch.max(ROOM) };
        let vectors = |count: usize| vec![T::Chunk::default(); width * count];
        let follows = members.windows(2).all(|w| w[1] == w[0] + 1);
        Covariance {
            triangle,
            pending: vectors(room),
            rank: 0,
            room,
            pending_q: 0.0,
            backward: false,
            width,
            run: members.first().filter(|_| follows).map(|&first| first as usize),
            jacobian: vectors(batch),
            product: vectors(batch),
            along: vectors(batch),
            at_rows: vec![[T::default(); 2 * ROWS]; room],
            members,
        }
    }

    /// Takes this group's slopes of row `j` of a batch.
    #[inline(always)]
    pub(super) fn take(&mut self, j: usize, slopes: &[f64]) {
        let chunks = &mut self.jacobian[j * self.width..][..self.width];
        if let Some(first) = self.run {
            let own = &slopes[first..first + self.members.len()];
            let whole = own.len() / T::LANES;
            for (chunk, slopes) in chunks.iter_mut().zip(own.chunks_exact(T::LANES)) {
                for (b, slope) in chunk.as_mut().iter_mut().zip(slopes) {
                    *b = T::of(*slope);
                }
            }
            for (chunk, slopes) in chunks[whole..].iter_mut().zip(own[whole * T::LANES..].chunks(T::LANES)) {
                for (b, slope) in chunk.as_mut().iter_mut().zip(slopes) {
                    *b = T::of(*slope);
                }
            }
            return;
        }
        for (chunk, members) in chunks.iter_mut().zip(self.members.chunks(T::LANES)) {
            for (b, &member) in chunk.as_mut().iter_mut().zip(members) {
                *b = T::of(slopes[member as usize]);
            }
        }
    }

    /// Adds `q` to the variances and forms P b for the `count` Jacobians taken; afterwards there is room for their vectors.
    #[inline(always)]
    pub(super) fn pass<V: Simd<T>>(&mut self, count: usize, q: f64, masks: &[Masks<T::Chunk>]) {
        self.pending_q += q;
        let full = self.rank + count > self.room;
        let (strips, width, backward) = (self.triangle.strips(), self.width, self.backward);
        let pairs = strips.div_ceil(2); // Both of a pair have one width.
        self.product[..count * width].fill(T::Chunk::default());
        for k in 0..pairs {
            let first = 2 * if backward { pairs - 1 - k } else { k };
            let after = strips.min(first + 2);
            if V::MANY && after == first + 2 && !(full && self.room == 1) {
                self.visit::<V, 2>(first, count, full, masks);
                continue;
            }
            for strip in first..after {
                if full && self.room == 1 {
                    self.fused::<V>(strip, masks);
                } else {
                    self.visit::<V, 1>(strip, count, full, masks);
                }
            }
        }
        for (y, x) in self.product[..count * width].iter_mut().zip(&self.along) {
            V::load(y).mul_add(V::splat(T::of(1.0)), V::load(x)).store(y);
        }
        if full {
            (self.rank, self.pending_q) = (0, 0.0);
        } else {
            for j in 0..count {
                self.correct::<V>(j);
            }
        }
        self.backward = !backward;
    }

    /// `N` strips of one width from `first` on: puts into them what is pending, if asked to, and adds their part to the products.
    #[inline(always)]
    fn visit<V: Simd<T>, const N: usize>(
        &mut self,
        first: usize,
        count: usize,
        apply: bool,
        masks: &[Masks<T::Chunk>],
    ) {
        let (width, tiles) = (self.width, triangle::width::<T>(first));
        let mut own = self.triangle.tiles[triangle::start::<T>(first)..].chunks_exact_mut(tiles);
        let mut strips: [&mut [_]; N] = std::array::from_fn(|_| own.next().expect("the triangle holds the strip"));
        let masks: [&Masks<_>; N] = std::array::from_fn(|n| &masks[(first + n) % masks.len()]);
        if apply {
            let (at, lane) = (ROWS * first / T::LANES, ROWS * first % T::LANES);
            let column = &self.pending[at * self.room..][..self.rank];
            for (rows, t) in self.at_rows.iter_mut().zip(column) {
                rows[..ROWS * N].copy_from_slice(&t.as_ref()[lane..][..ROWS * N]);
            }
            let q = T::of(self.pending_q);
            strip::apply::<T, V, N>(&mut strips, &self.pending, self.room, &self.at_rows[..self.rank], q, &masks);
        }
        for j in 0..count {
            let b = &self.jacobian[j * width..][..width];
            let y = &mut self.product[j * width..][..width];
            let at_rows: [[T; ROWS]; N] = std::array::from_fn(|n| strip::rows::<T>(b, first + n));
            let sums = strip::multiply::<T, V, N>(&strips, b, &at_rows, y, &masks);
            for (n, sums) in sums.iter().enumerate() {
                strip::put_rows::<T>(&mut self.along[j * width..], first + n, sums);
            }
        }
    }

    /// One strip: the one vector that is pending, and one Jacobian.
    #[inline(always)]
    fn fused<V: Simd<T>>(&mut self, strip: usize, masks: &[Masks<T::Chunk>]) {
        let (t, b) = (&self.pending[..], &self.jacobian[..self.width]);
        let sums = strip::fused::<T, V>(
            &mut self.triangle.tiles[triangle::start::<T>(strip)..][..triangle::width::<T>(strip)],
            (t, strip::rows::<T>(t, strip)),
            (b, strip::rows::<T>(b, strip)),
            &mut self.product,
            T::of(self.pending_q),
            &masks[strip % masks.len()],
        );
        strip::put_rows::<T>(&mut self.along, strip, &sums);
    }

    /// Adds what is pending to product `j`: y += q b - sum_k t_k (t_k' b).
    #[inline(always)]
    fn correct<V: Simd<T>>(&mut self, j: usize) {
        let (q, width) = (T::of(self.pending_q), self.width);
        let b = &self.jacobian[j * width..][..width];
        let y = &mut self.product[j * width..][..width];
        if self.pending_q != 0.0 {
            for (y, b) in y.iter_mut().zip(b) {
                V::splat(q).mul_add(V::load(b), V::load(y)).store(y);
            }
        }
        // Four at a time: four chains of sums hide one another's latency, and y is gone through less often.
        let mut k = 0;
        while k < self.rank {
            if k + 4 <= self.rank {
                subtract::<T, V, 4>(&self.pending[k..], self.room, b, y);
                k += 4;
            } else {
                subtract::<T, V, 1>(&self.pending[k..], self.room, b, y);
                k += 1;
            }
        }
    }
}

/// y -= sum_k t_k (t_k' b) for the `K` vectors that stand first among those of each chunk.
#[inline(always)]
fn subtract<T: Real, V: Simd<T>, const K: usize>(
    pending: &[T::Chunk],
    room: usize,
    b: &[T::Chunk],
    y: &mut [T::Chunk],
) {
    let mut sums = [V::splat(T::of(0.0)); K];
    for (column, b) in pending.chunks(room).zip(b) {
        let (column, b) = (&column[..K], V::load(b));
        for k in 0..K {
            sums[k] = V::load(&column[k]).mul_add(b, sums[k]);
        }
    }
    let mut factors = sums;
    for k in 0..K {
        factors[k] = V::splat(sums[k].sum());
    }
    for (column, y) in pending.chunks(room).zip(y) {
        let column = &column[..K];
        let mut rest = V::load(y);
        for k in 0..K {
            rest = factors[k].neg_mul_add(V::load(&column[k]), rest);
        }
        rest.store(y);
    }
}
