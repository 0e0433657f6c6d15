//! One strip of a covariance: pending vectors applied, products formed.
//!
//! In: the strip's tiles, vectors in chunks, the masks of its last tile. Out: the tiles after P += q I - sum_j t_j t_j', or the
//! strip's part of P b. Every element has one order of operations, whatever the registers hold.

#![allow(clippy::needless_range_loop)] // Lanes and rows of small arrays, by number.

use crate::train::filter::lanes::{Real, Simd};
use crate::train::filter::triangle::{CovarianceBlock, Masks, ROWS};

/// The elements of a vector that stand at a strip's rows.
#[inline(always)]
pub(super) fn rows<T: Real>(vector: &[T::Chunk], strip: usize) -> [T; ROWS] {
    let at = ROWS * strip;
    let four = &vector[at / T::LANES].as_ref()[at % T::LANES..][..ROWS];
    [four[0], four[1], four[2], four[3]]
}

/// Puts numbers where a vector stands at a strip's rows.
#[inline(always)]
pub(crate) fn put_rows<T: Real>(vector: &mut [T::Chunk], strip: usize, four: &[T; ROWS]) {
    let at = ROWS * strip;
    vector[at / T::LANES].as_mut()[at % T::LANES..][..ROWS].copy_from_slice(four);
}

/// P += q I - sum_j t_j t_j' in `N` strips of one width. `pending` holds a chunk of each t_j, then the next chunk of each, with
/// `room` for each chunk's; `at_rows` holds their elements at the strips' rows.
#[inline(always)]
pub(super) fn apply<T: Real, V: Simd<T>, const N: usize>(
    strips: &mut [&mut [CovarianceBlock<T::Chunk>]; N],
    pending: &[T::Chunk],
    room: usize,
    at_rows: &[[T; 2 * ROWS]],
    q: T,
    masks: &[&Masks<T::Chunk>; N],
) {
    let last = strips[0].len() - 1;
    strips.iter().for_each(|strip| assert_eq!(strip.len(), last + 1, "strips of one width"));
    for (column, chunks) in pending.chunks_exact(room).take(last).enumerate() {
        let mut p = [[V::splat(q); ROWS]; N];
        for n in 0..N {
            for r in 0..ROWS {
                p[n][r] = V::load(&strips[n][column].0[r]);
            }
        }
        for (t, rows) in chunks.iter().zip(at_rows) {
            let t = V::load(t);
            for n in 0..N {
                for r in 0..ROWS {
                    p[n][r] = V::splat(rows[ROWS * n + r]).neg_mul_add(t, p[n][r]);
                }
            }
        }
        for n in 0..N {
            for r in 0..ROWS {
                p[n][r].store(&mut strips[n][column].0[r]);
            }
        }
    }
    for n in 0..N {
        for r in 0..ROWS {
            let row = &mut strips[n][last].0[r];
            let mut p = V::splat(q).mul_add(V::load(&masks[n].diagonal[r]), V::load(row));
            let lower = V::load(&masks[n].lower[r]);
            for (t, rows) in pending[last * room..].iter().zip(at_rows) {
                p = V::splat(rows[ROWS * n + r]).mul(lower).neg_mul_add(V::load(t), p);
            }
            p.store(row);
        }
    }
}

/// [`apply`] for one vector and [`multiply`] for one Jacobian, in one go: for strips that lie in the nearest cache.
#[inline(always)]
pub(super) fn fused<T: Real, V: Simd<T>>(
    tiles: &mut [CovarianceBlock<T::Chunk>],
    (t, t_rows): (&[T::Chunk], [T; ROWS]),
    (b, b_rows): (&[T::Chunk], [T; ROWS]),
    y: &mut [T::Chunk],
    q: T,
    masks: &Masks<T::Chunk>,
) -> [T; ROWS] {
    let (mut sums, mut t_row, mut b_row) = ([V::splat(T::of(0.0)); ROWS], [V::splat(q); ROWS], [V::splat(q); ROWS]);
    for r in 0..ROWS {
        (t_row[r], b_row[r]) = (V::splat(t_rows[r]), V::splat(b_rows[r]));
    }
    let (last, body) = tiles.split_last_mut().expect("a strip has a tile");
    for (tile, ((t, b), y)) in body.iter_mut().zip(t.iter().zip(b).zip(y.iter_mut())) {
        let (t, b) = (V::load(t), V::load(b));
        let mut down = V::load(y);
        for r in 0..ROWS {
            let p = t_row[r].neg_mul_add(t, V::load(&tile.0[r]));
            p.store(&mut tile.0[r]);
            sums[r] = p.mul_add(b, sums[r]);
            down = p.mul_add(b_row[r], down);
        }
        down.store(y);
    }
    let at = body.len();
    let (t, b) = (V::load(&t[at]), V::load(&b[at]));
    let mut down = V::load(&y[at]);
    for r in 0..ROWS {
        let p = V::splat(q).mul_add(V::load(&masks.diagonal[r]), V::load(&last.0[r]));
        let p = t_row[r].mul(V::load(&masks.lower[r])).neg_mul_add(t, p);
        p.store(&mut last.0[r]);
        sums[r] = p.mul_add(b, sums[r]);
        down = p.mul_add(b_row[r].mul(V::load(&masks.strict[r])), down);
    }
    down.store(&mut y[at]);
    V::sums(sums)
}

/// Adds the part of P b of `N` strips of one width to y, but for the sums along their rows, which it returns.
#[inline(always)]
pub(super) fn multiply<T: Real, V: Simd<T>, const N: usize>(
    strips: &[&mut [CovarianceBlock<T::Chunk>]; N],
    b: &[T::Chunk],
    at_rows: &[[T; ROWS]; N],
    y: &mut [T::Chunk],
    masks: &[&Masks<T::Chunk>; N],
) -> [[T; ROWS]; N] {
    let mut sums = [[V::splat(T::of(0.0)); ROWS]; N];
    let mut b_rows = sums;
    for n in 0..N {
        for r in 0..ROWS {
            b_rows[n][r] = V::splat(at_rows[n][r]);
        }
    }
    let last = strips[0].len() - 1;
    strips.iter().for_each(|strip| assert_eq!(strip.len(), last + 1, "strips of one width"));
    let (b, y) = (&b[..=last], &mut y[..=last]);
    for column in 0..last {
        let b = V::load(&b[column]);
        let mut down = V::load(&y[column]);
        for n in 0..N {
            for r in 0..ROWS {
                let p = V::load(&strips[n][column].0[r]);
                sums[n][r] = p.mul_add(b, sums[n][r]);
                down = p.mul_add(b_rows[n][r], down);
            }
        }
        down.store(&mut y[column]);
    }
    let b = V::load(&b[last]);
    let mut down = V::load(&y[last]);
    for n in 0..N {
        for r in 0..ROWS {
            let p = V::load(&strips[n][last].0[r]);
            sums[n][r] = p.mul_add(b, sums[n][r]);
            down = p.mul_add(b_rows[n][r].mul(V::load(&masks[n].strict[r])), down);
        }
    }
    down.store(&mut y[last]);
    let mut out = [[T::of(0.0); ROWS]; N];
    for n in 0..N {
        out[n] = V::sums(sums[n]);
    }
    out
}
