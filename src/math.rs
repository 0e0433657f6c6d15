//! The only door to transcendental functions: same bits on every CPU.
//!
//! In: `f64`. Out: `f64`, from the pinned `libm` crate. The C library picks other code paths with and without FMA
//! hardware, and their last bits differ; `libm` is plain arithmetic, so its bits depend on its version alone.
//! `clippy.toml` forbids `f64::sin` and its kin elsewhere. `sqrt`, `abs`, `floor` and `mul_add` are exact by
//! IEEE 754 and need no door.
//!
//! Other crates (rustfft's twiddles among them) call the C library's names; the program binds those to the same code (`c_symbols`).

use std::f64::consts::{PI, TAU};

macro_rules! door {
    ($($(#[$doc:meta])* $name:ident = $source:path;)*) => {$(
        $(#[$doc])*
        #[inline]
        pub fn $name(x: f64) -> f64 { $source(x) }
    )*};
}

door! {
    /// Sine of an angle in radians.
    sin = libm::sin;
    /// Cosine of an angle in radians.
    cos = libm::cos;
    /// Tangent of an angle in radians.
    tan = libm::tan;
    /// Arc sine in radians, in [-pi/2, pi/2].
    asin = libm::asin;
    /// Arc cosine in radians, in [0, pi].
    acos = libm::acos;
    /// Arc tangent in radians, in [-pi/2, pi/2].
    atan = libm::atan;
    /// e to the power x.
    exp = libm::exp;
    /// exp(x) - 1, accurate near zero.
    exp_m1 = libm::expm1;
    /// Natural logarithm.
    ln = libm::log;
    /// ln(1 + x), accurate near zero.
    ln_1p = libm::log1p;
    /// Cube root.
    cbrt = libm::cbrt;
    /// Complementary error function, 1 - erf(x).
    erfc = libm::erfc;
}

/// Sine and cosine of an angle in radians: the bits of [`sin`] and [`cos`], with the angle reduced once.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Sines and cosines of several angles: the bits of [`sin_cos`], whose steps for angles up to pi/4 these are (FreeBSD's k_sin.c and
/// k_cos.c); with a larger angle among them, all go through it one by one.
#[inline(always)]
pub(crate) fn sin_cos_lanes<const N: usize>(x: &[f64; N]) -> [[f64; N]; 2] {
    const SIN: [f64; 6] = [
        -0.166_666_666_666_666_32,
        0.008_333_333_333_322_49,
        -0.000_198_412_698_298_579_5,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    const COS: [f64; 6] = [
        0.041_666_666_666_666_6,
        -0.001_388_888_888_887_411,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    // High words of pi/4 and of 2^-27 sqrt(2), below which an angle is its sine.
    const LARGEST: u64 = 0x3fe9_21fb;
    const TINY: u64 = 0x3e46_a09e;
    let high = |x: f64| (x.to_bits() >> 32) & 0x7fff_ffff;
    let mut largest = 0;
    for &x in x {
        largest = if high(x) > largest { high(x) } else { largest };
    }
    let [mut sin, mut cos] = [[0.0; N]; 2];
    if largest > LARGEST {
        for l in 0..N {
            (sin[l], cos[l]) = sin_cos(x[l]);
        }
        return [sin, cos];
    }
    for l in 0..N {
        let x = x[l];
        let z = x * x;
        let w = z * z;
        let r = SIN[1] + z * (SIN[2] + z * SIN[3]) + z * w * (SIN[4] + z * SIN[5]);
        let s = x + z * x * (SIN[0] + z * r);
        let r = z * (COS[0] + z * (COS[1] + z * COS[2])) + w * w * (COS[3] + z * (COS[4] + z * COS[5]));
        let half = 0.5 * z;
        let rest = 1.0 - half;
        let c = rest + (((1.0 - rest) - half) + z * r);
        (sin[l], cos[l]) = if high(x) < TINY { (x, 1.0) } else { (s, c) };
    }
    [sin, cos]
}

/// Natural logarithms of positive normal numbers, lane by lane: the bits of [`ln`], whose steps these are (FreeBSD's e_log.c),
/// without its branches for numbers that are not positive and normal.
#[inline(always)]
pub(crate) fn ln_lanes<const N: usize>(x: &[f64; N]) -> [f64; N] {
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
    const EVEN: [f64; 3] = [3.999_999_999_940_942e-1, 2.222_219_843_214_978_4e-1, 1.531_383_769_920_937_3e-1];
    const ODD: [f64; 4] =
        [6.666_666_666_666_735e-1, 2.857_142_874_366_239e-1, 1.818_357_216_161_805e-1, 1.479_819_860_511_658_6e-1];
    // The high word of sqrt(1/2): numbers are brought to between it and its double.
    const HALF_ROOT: u64 = 0x3fe6_a09e;
    let mut out = [0.0; N];
    for l in 0..N {
        let bits = x[l].to_bits();
        let high = (bits >> 32) + 0x3ff0_0000 - HALF_ROOT;
        let exponent = (high >> 20) as i64 - 0x3ff;
        let reduced = f64::from_bits((((high & 0x000f_ffff) + HALF_ROOT) << 32) | (bits & 0xffff_ffff));
        let f = reduced - 1.0;
        let half_square = 0.5 * f * f;
        let s = f / (2.0 + f);
        let z = s * s;
        let w = z * z;
        let t1 = w * (EVEN[0] + w * (EVEN[1] + w * EVEN[2]));
        let t2 = z * (ODD[0] + w * (ODD[1] + w * (ODD[2] + w * ODD[3])));
        let r = t2 + t1;
        let k = exponent as f64;
        out[l] = s * (half_square + r) + k * LN2_LO - half_square + f + k * LN2_HI;
    }
    out
}

/// e to the power of several numbers: the bits of [`exp`], whose steps these are (FreeBSD's e_exp.c); with a number among them
/// that is large or not a number, all go through it one by one.
#[inline(always)]
pub(crate) fn exp_lanes<const N: usize>(x: &[f64; N]) -> [f64; N] {
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
    const P: [f64; 5] = [
        1.666_666_666_666_660_2e-1,
        -2.777_777_777_701_559_3e-3,
        6.613_756_321_437_934e-5,
        -1.653_390_220_546_525_2e-6,
        4.138_136_797_057_238_5e-8,
    ];
    // Below this the result is a normal number by far.
    const LARGEST: f64 = 700.0;
    // High words of 2^-28, ln 2 / 2 and 3 ln 2 / 2.
    const TINY: u64 = 0x3e30_0000;
    const HALF_LN2: u64 = 0x3fd6_2e42;
    const MORE_LN2: u64 = 0x3ff0_a2b2;
    let mut tame = true;
    for &x in x {
        tame &= x.abs() <= LARGEST;
    }
    let mut out = [0.0; N];
    if !tame {
        for l in 0..N {
            out[l] = exp(x[l]);
        }
        return out;
    }
    for l in 0..N {
        let x = x[l];
        let high = (x.to_bits() >> 32) & 0x7fff_ffff;
        let turns = std::f64::consts::LOG2_E * x + 0.5f64.copysign(x);
        let turns = if high >= MORE_LN2 { turns } else { 1f64.copysign(x) };
        let k = if high > HALF_LN2 { turns as i32 } else { 0 };
        let hi = x - f64::from(k) * LN2_HI;
        let lo = f64::from(k) * LN2_LO;
        let r = hi - lo;
        let z = r * r;
        let c = r - z * (P[0] + z * (P[1] + z * (P[2] + z * (P[3] + z * P[4]))));
        let y = 1.0 + (r * c / (2.0 - c) - lo + hi);
        let scale = f64::from_bits(((1023 + k) as u64) << 52);
        out[l] = if high > TINY { y * scale } else { 1.0 + x };
    }
    out
}

/// e to the power of several numbers, within 1.5 times 2^-23 of it; beyond +-87, where results leave the normal numbers, that of
/// the end. NaN for NaN.
#[inline(always)]
pub(crate) fn exp_lanes_f32<const N: usize>(x: &[f32; N]) -> [f32; N] {
    const LARGEST: f32 = 87.0;
    // What is added to a number to round it: the whole number is then in the lowest bits.
    const WHOLE: f32 = 12_582_912.0;
    // ln 2 in two parts, the first of which has few bits.
    const LN2: [f32; 2] = [355.0 / 512.0, -2.121_944_4e-4];
    // Taylor's: the first term that is left out is 5e-9 of the sum where |r| is ln 2 / 2.
    const P: [f32; 7] = [1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];
    let mut out = [0.0; N];
    for l in 0..N {
        let x = if x[l] > LARGEST { LARGEST } else { x[l] };
        let x = if x < -LARGEST { -LARGEST } else { x };
        let turns = x.mul_add(std::f32::consts::LOG2_E, WHOLE);
        let k = turns - WHOLE;
        let r = (-k).mul_add(LN2[1], (-k).mul_add(LN2[0], x));
        let mut sum = P[6];
        for place in (0..6).rev() {
            sum = sum.mul_add(r, P[place]);
        }
        let scale = f32::from_bits((turns.to_bits() << 23).wrapping_add(1f32.to_bits()));
        out[l] = sum.mul_add(r, 1.0) * scale;
    }
    out
}

/// Angle of the point (x, y) from the x axis, in (-pi, pi].
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// x to the power y.
#[inline]
pub fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// Length of the vector (x, y), without overflow.
#[inline]
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// The same angle in (-pi, pi].
#[inline]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad - TAU * (angle_rad / TAU).round();
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

#[cfg(test)]
mod tests;
