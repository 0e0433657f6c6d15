//! One group's covariance, and the passes through it.
//!
//! A pass applies the last update, P -= sum_j t_j t_j', adds Q to the diagonal and forms y = P b for new Jacobians b, strip by
//! strip, so that P goes through the memory once an update (`ekf.md`: fused). With t = P B' L^-T, L L' = S, this is eq. 14
//! exactly. P is symmetric by construction. Passes run forward and backward in turn: the strips read last are still in the
//! cache; the direction is part of the state, because it is the order of sums.

mod batch;

use super::lanes::{Real, Simd};
use super::triangle::{self, Masks, ROWS, Triangle, chunks};

/// Covariance of a group of weights, with what is not applied to it yet.
pub struct Covariance<T: Real> {
    /// The group's weights.
    pub members: Vec<u32>,
    pub triangle: Triangle<T>,
    /// Vectors t of the last update, one after the other, `width` chunks each.
    pub pending: Vec<T::Chunk>,
    /// Number of them.
    pub rank: usize,
    /// Whether the next pass runs from the last strip to the first.
    pub backward: bool,
    width: usize,
    /// The first of the members, where they follow one another.
    run: Option<usize>,
    jacobian: Vec<T::Chunk>,
    product: Vec<T::Chunk>,
    /// The part of a product that comes from sums along rows.
    along: Vec<T::Chunk>,
}

/// Four elements of a vector, each in all lanes.
#[inline(always)]
fn rows<T: Real, V: Simd<T>>(vector: &[T::Chunk], strip: usize) -> [V; ROWS] {
    let at = ROWS * strip;
    let four = &vector[at / T::LANES].as_ref()[at % T::LANES..][..ROWS];
    [V::splat(four[0]), V::splat(four[1]), V::splat(four[2]), V::splat(four[3])]
}

impl<T: Real> Covariance<T> {
    /// P = `variance` I; room for `batch` rows at a time.
    pub fn new(members: Vec<u32>, variance: f64, batch: usize) -> Covariance<T> {
        let size = members.len();
        let width = chunks::<T>(size);
        let room = vec![T::Chunk::default(); width * batch];
        let follows = members.windows(2).all(|w| w[1] == w[0] + 1);
        Covariance {
            triangle: Triangle::diagonal(size, variance),
            pending: room.clone(),
            rank: 0,
            backward: false,
            width,
            run: members.first().filter(|_| follows).map(|&first| first as usize),
            jacobian: room.clone(),
            along: vec![T::Chunk::default(); width],
            product: room,
            members,
        }
    }

    /// Takes this group's slopes of row `j` of a batch.
    #[inline(always)]
    pub fn take(&mut self, j: usize, slopes: &[f64]) {
        let chunks = &mut self.jacobian[j * self.width..][..self.width];
        if let Some(first) = self.run {
            let own = &slopes[first..first + self.members.len()];
            for (chunk, slopes) in chunks.iter_mut().zip(own.chunks(T::LANES)) {
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

    /// Applies what is pending, adds `q`, and forms P b for the `count` Jacobians taken.
    #[inline(always)]
    pub fn pass<V: Simd<T>>(&mut self, count: usize, q: f64, masks: &[Masks<T::Chunk>]) {
        let (strips, backward, q) = (self.triangle.strips(), self.backward, T::of(q));
        self.product[..count * self.width].fill(T::Chunk::default());
        if count == 1 && self.rank <= 1 {
            if self.rank == 0 {
                self.pending[..self.width].fill(T::Chunk::default());
            }
            let mut end = if backward { self.triangle.tiles.len() } else { 0 };
            for k in 0..strips {
                let strip = if backward { strips - 1 - k } else { k };
                let tiles = triangle::width::<T>(strip);
                let start = if backward { end - tiles } else { end };
                self.fused::<V>(strip, start, tiles, q, &masks[strip % masks.len()]);
                end = if backward { start } else { start + tiles };
            }
            for (y, x) in self.product.iter_mut().zip(&self.along) {
                V::load(y).mul_add(V::splat(T::of(1.0)), V::load(x)).store(y);
            }
        } else {
            for k in 0..strips {
                let strip = if backward { strips - 1 - k } else { k };
                self.joint::<V>(strip, count, q, &masks[strip % masks.len()]);
            }
        }
        self.rank = 0;
        self.backward = !backward;
    }

    /// One strip of a pass with one pending vector and one Jacobian.
    #[inline(always)]
    fn fused<V: Simd<T>>(&mut self, strip: usize, start: usize, count: usize, q: T, masks: &Masks<T::Chunk>) {
        let t_rows: [V; ROWS] = rows::<T, V>(&self.pending, strip);
        let b_rows: [V; ROWS] = rows::<T, V>(&self.jacobian, strip);
        let zero = V::splat(T::of(0.0));
        let mut sums = [zero; ROWS];
        let tiles = &mut self.triangle.tiles[start..start + count];
        let (last, body) = tiles.split_last_mut().expect("a strip has a tile");
        let vectors = self.pending.iter().zip(&self.jacobian).zip(&mut self.product);
        for (tile, ((t, b), y)) in body.iter_mut().zip(vectors) {
            let (t, b) = (V::load(t), V::load(b));
            let mut down = V::load(y);
            for r in 0..ROWS {
                let p = t_rows[r].neg_mul_add(t, V::load(&tile.0[r]));
                p.store(&mut tile.0[r]);
                sums[r] = p.mul_add(b, sums[r]);
                down = p.mul_add(b_rows[r], down);
            }
            down.store(y);
        }
        let at = count - 1;
        let (t, b) = (V::load(&self.pending[at]), V::load(&self.jacobian[at]));
        let mut down = V::load(&self.product[at]);
        for r in 0..ROWS {
            let p = t_rows[r].neg_mul_add(t.mul(V::load(&masks.lower[r])), V::load(&last.0[r]));
            let p = V::splat(q).mul_add(V::load(&masks.diagonal[r]), p);
            p.store(&mut last.0[r]);
            sums[r] = p.mul_add(b, sums[r]);
            down = p.mul_add(b_rows[r].mul(V::load(&masks.strict[r])), down);
        }
        down.store(&mut self.product[at]);
        self.put_sums(strip, &sums);
    }

    #[inline(always)]
    fn put_sums<V: Simd<T>>(&mut self, strip: usize, sums: &[V; ROWS]) {
        let at = ROWS * strip;
        let four = &mut self.along[at / T::LANES].as_mut()[at % T::LANES..][..ROWS];
        for r in 0..ROWS {
            four[r] = sums[r].sum();
        }
    }
}

/// What the update reads and leaves.
impl<T: Real> Covariance<T> {
    /// B P B' of the rows of a batch into the lower triangle of `to`; false where P cannot be positive semidefinite.
    #[inline(always)]
    pub fn form(&self, count: usize, to: &mut [f64], stride: usize) -> bool {
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
    pub fn leave<V: Simd<T>>(&mut self, count: usize, root: &[f64], stride: usize) {
        for j in 0..count {
            let (done, t) = self.pending.split_at_mut(j * self.width);
            let t = &mut t[..self.width];
            t.copy_from_slice(&self.product[j * self.width..][..self.width]);
            for (k, earlier) in done.chunks_exact(self.width).enumerate() {
                let factor = V::splat(T::of(root[j * stride + k]));
                for (t, e) in t.iter_mut().zip(earlier) {
                    factor.neg_mul_add(V::load(e), V::load(t)).store(t);
                }
            }
            let factor = V::splat(T::of(1.0 / root[j * stride + j]));
            for t in t {
                V::load(t).mul(factor).store(t);
            }
        }
        self.rank = count;
    }

    /// Adds sum_j t_j z_j to the members' entries of `step`.
    #[inline(always)]
    pub fn step(&self, z: &[f64], step: &mut [f64]) {
        for (j, z) in z.iter().enumerate() {
            let t = &self.pending[j * self.width..][..self.width];
            if let Some(first) = self.run {
                let own = &mut step[first..first + self.members.len()];
                for (t, places) in t.iter().zip(own.chunks_mut(T::LANES)) {
                    for (t, place) in t.as_ref().iter().zip(places) {
                        *place = t.f64().mul_add(*z, *place);
                    }
                }
                continue;
            }
            for (t, members) in t.iter().zip(self.members.chunks(T::LANES)) {
                for (t, &member) in t.as_ref().iter().zip(members) {
                    let place = &mut step[member as usize];
                    *place = t.f64().mul_add(*z, *place);
                }
            }
        }
    }

    /// Variances of the members once the last update is applied; at least `floor`.
    pub fn variances(&self, floor: f64) -> impl Iterator<Item = f64> + '_ {
        (0..self.members.len()).map(move |i| {
            let square = |j: usize| self.pending(j, i).f64() * self.pending(j, i).f64();
            let p = self.triangle.get(i, i).f64() - (0..self.rank).map(square).sum::<f64>();
            if p.is_finite() { p.max(floor) } else { floor }
        })
    }

    /// Forgets all covariances; variances stay, but not below `floor`. The products become those of the new P.
    pub fn rebuild(&mut self, count: usize, floor: f64) {
        for i in 0..self.members.len() {
            let p = self.triangle.get(i, i).f64();
            let p = if p.is_finite() { p.max(floor) } else { floor };
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
    }

    /// Element `i` of pending vector `j`.
    pub fn pending(&self, j: usize, i: usize) -> T {
        self.pending[j * self.width + i / T::LANES].as_ref()[i % T::LANES]
    }

    pub fn set_pending(&mut self, j: usize, i: usize, value: T) {
        self.pending[j * self.width + i / T::LANES].as_mut()[i % T::LANES] = value;
    }
}
