//! Uniform in (0, 1) -> standard normal.
//!
//! Source: M. J. Wichura, *Algorithm AS 241: The Percentage Points of the Normal Distribution*, Applied Statistics 37
//! (1988), routine PPND16: relative accuracy about 1e-16. One uniform a draw, so that a draw's address costs a fixed
//! number of words.

use crate::math;
use crate::wide::{LANES, Work};

const A: [f64; 8] = [
    3.387_132_872_796_366_5,
    1.331_416_678_917_843_8e2,
    1.971_590_950_306_551_3e3,
    1.373_169_376_550_946e4,
    4.592_195_393_154_987e4,
    6.726_577_092_700_87e4,
    3.343_057_558_358_813e4,
    2.509_080_928_730_122_7e3,
];
const B: [f64; 8] = [
    1.0,
    4.231_333_070_160_091e1,
    6.871_870_074_920_579e2,
    5.394_196_021_424_751e3,
    2.121_379_430_158_659_7e4,
    3.930_789_580_009_271e4,
    2.872_908_573_572_194_3e4,
    5.226_495_278_852_855e3,
];
const C: [f64; 8] = [
    1.423_437_110_749_683_5,
    4.630_337_846_156_546,
    5.769_497_221_460_691,
    3.647_848_324_763_204_5,
    1.270_458_252_452_368_4,
    2.417_807_251_774_506e-1,
    2.272_384_498_926_918_4e-2,
    7.745_450_142_783_414e-4,
];
const D: [f64; 8] = [
    1.0,
    2.053_191_626_637_759,
    1.676_384_830_183_803_8,
    6.897_673_349_851e-1,
    1.481_039_764_274_800_8e-1,
    1.519_866_656_361_645_7e-2,
    5.475_938_084_995_345e-4,
    1.050_750_071_644_416_9e-9,
];
const E: [f64; 8] = [
    6.657_904_643_501_103,
    5.463_784_911_164_114,
    1.784_826_539_917_291_3,
    2.965_605_718_285_048_7e-1,
    2.653_218_952_657_612_4e-2,
    1.242_660_947_388_078_4e-3,
    2.711_555_568_743_487_6e-5,
    2.010_334_399_292_288_1e-7,
];
const F: [f64; 8] = [
    1.0,
    5.998_322_065_558_88e-1,
    1.369_298_809_227_358e-1,
    1.487_536_129_085_061_5e-2,
    7.868_691_311_456_133e-4,
    1.846_318_317_510_054_8e-5,
    1.421_511_758_316_446e-7,
    2.044_263_103_389_939_8e-15,
];

#[inline(always)]
fn ratio(p: &[f64; 8], q: &[f64; 8], r: f64) -> f64 {
    let horner = |c: &[f64; 8]| c[..7].iter().rev().fold(c[7], |sum, &k| sum * r + k);
    horner(p) / horner(q)
}

/// The standard normal quantile of `p` in (0, 1).
#[inline]
pub(super) fn normal_from_open_unit(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        return q * ratio(&A, &B, 0.180_625 - q * q);
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    let r = (-math::ln(tail)).sqrt();
    let size = if r <= 5.0 { ratio(&C, &D, r - 1.6) } else { ratio(&E, &F, r - 5.0) };
    if q < 0.0 { -size } else { size }
}

/// Turns uniform draws into normal ones, in place: the bits of [`normal_from_open_unit`], several at a time.
pub(super) struct Normals<'a>(pub &'a mut [f64]);

/// Draws whose tails are gathered.
const BLOCK: usize = 256;
/// Quantiles that are worked out side by side, of the middle and of the tails: more than one register of them, so that one need not
/// wait for the other's steps.
const MIDDLES: usize = 2 * LANES;
const TAILS: usize = 4 * LANES;

impl Work for Normals<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let mut p = [0.5; BLOCK];
        // Where the tails stand in a block: each place is written, and kept where it is one.
        let mut at = [0u8; BLOCK];
        for out in self.0.chunks_mut(BLOCK) {
            p[..out.len()].copy_from_slice(out);
            p[out.len()..].fill(0.5);
            let mut count = 0;
            for (k, (out, p)) in out.chunks_mut(MIDDLES).zip(p.as_chunks().0).enumerate() {
                let values: [f64; MIDDLES] = middles(p);
                match <&mut [f64; MIDDLES]>::try_from(&mut *out) {
                    Ok(out) => *out = values,
                    Err(_) => out.copy_from_slice(&values[..out.len()]),
                }
                let mut is_tail = [false; MIDDLES];
                for (is_tail, p) in is_tail.iter_mut().zip(p) {
                    *is_tail = (p - 0.5).abs() > 0.425;
                }
                for (l, &is_tail) in is_tail.iter().enumerate() {
                    at[count] = (k * MIDDLES + l) as u8;
                    count += usize::from(is_tail);
                }
            }
            let (many, few) = at[..count].as_chunks::<TAILS>();
            // Loops, not closures: those would be compiled for the narrowest registers.
            for at in many {
                write_tails::<TAILS>(&p, at, out);
            }
            for at in few.chunks(LANES) {
                write_tails::<LANES>(&p, at, out);
            }
        }
    }
}

/// The quantiles of `p` that lie in the middle; the tails' are nonsense.
#[inline(always)]
fn middles<const N: usize>(p: &[f64; N]) -> [f64; N] {
    let mut out = [0.0; N];
    for l in 0..N {
        let q = p[l] - 0.5;
        out[l] = q * ratio(&A, &B, 0.180_625 - q * q);
    }
    out
}

/// Writes the quantiles of the draws that stand `at` these places, no more than `N`, to theirs.
#[inline(always)]
fn write_tails<const N: usize>(p: &[f64; BLOCK], at: &[u8], out: &mut [f64]) {
    let mut tails = [0.1; N];
    for (tail, &at) in tails.iter_mut().zip(at) {
        *tail = p[usize::from(at)];
    }
    for (quantile, &at) in quantiles_of_tails(&tails).iter().zip(at) {
        out[usize::from(at)] = *quantile;
    }
}

#[inline(always)]
fn quantiles_of_tails<const N: usize>(p: &[f64; N]) -> [f64; N] {
    let mut tail = [0.0; N];
    for l in 0..N {
        tail[l] = if p[l] - 0.5 < 0.0 { p[l] } else { 1.0 - p[l] };
    }
    let logarithms = math::ln_lanes(&tail);
    let (mut out, mut far) = ([0.0; N], false);
    for l in 0..N {
        let r = (-logarithms[l]).sqrt();
        far |= r > 5.0;
        let size = ratio(&C, &D, r - 1.6);
        out[l] = if p[l] - 0.5 < 0.0 { -size } else { size };
    }
    // One draw in 10^11 lies beyond.
    if far { p.map(normal_from_open_unit) } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_draws_one_by_one_and_by_lanes_in_every_form() {
        let tiny = [1e-300, 1e-17, 1.0 - 1e-16, 1e-12, 1.0 - 1e-12, 0.075, 0.925, 0.5];
        let draws: Vec<f64> =
            (0..100_003).map(|i| (f64::from(i) + 0.5) / 100_003.0).chain(tiny.into_iter().cycle().take(37)).collect();
        let single: Vec<u64> = draws.iter().map(|&p| normal_from_open_unit(p).to_bits()).collect();
        struct Whole(Vec<f64>);
        impl Work for Whole {
            type Out = Vec<f64>;
            #[inline(always)]
            fn run(mut self) -> Vec<f64> {
                Normals(&mut self.0).run();
                self.0
            }
        }
        for lanes in crate::wide::every_form(|| Whole(draws.clone())) {
            assert!(lanes.iter().map(|x| x.to_bits()).eq(single.iter().copied()));
        }
        // Lists of every length, also one whose draws are all tails.
        let far: Vec<f64> = (0..600).map(|i| (f64::from(i % 70) + 1.0) * 1e-3).collect();
        for count in (0..40).chain([255, 256, 257, 511, 512, 600]) {
            for draws in [&draws[..count], &far[..count]] {
                for lanes in crate::wide::every_form(|| Whole(draws.to_vec())) {
                    let single = draws.iter().map(|&p| normal_from_open_unit(p).to_bits());
                    assert!(lanes.iter().map(|x| x.to_bits()).eq(single), "{count}");
                }
            }
        }
    }

    #[test]
    fn exact_published_quantiles() {
        // The check values printed with the algorithm.
        assert!((normal_from_open_unit(0.25) + 0.674_489_750_196_081_7).abs() < 1e-15);
        assert!((normal_from_open_unit(0.001) + 3.090_232_306_167_813_5).abs() < 1e-14);
        assert!((normal_from_open_unit(1e-20) + 9.262_340_089_798_408).abs() < 1e-13);
    }
}
