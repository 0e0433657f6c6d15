//! The only door to transcendental functions: same bits on every CPU.
//!
//! In: `f64`. Out: `f64`, from the pinned `libm` crate. The C library picks other code paths with and without FMA
//! hardware, and their last bits differ; `libm` is plain arithmetic, so its bits depend on its version alone.
//! `clippy.toml` forbids `f64::sin` and its kin elsewhere. `sqrt`, `abs`, `floor` and `mul_add` are exact by
//! IEEE 754 and need no door.
//!
//! The second half defines the C symbols themselves, so that dependencies (rustfft's twiddles among them) land on the
//! same code.

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
}

/// Sine and cosine of an angle in radians.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    (libm::sin(x), libm::cos(x))
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

/// The C library's names, bound to `libm` for the whole binary.
///
/// Why `unsafe`: exporting an unmangled symbol replaces the C library's. Each has the C signature and the C meaning, and
/// the linker prefers ours, so no code in the process sees two versions.
#[cfg(target_os = "linux")]
mod pinned_symbols {
    macro_rules! pinned {
        ($($name:ident)*) => {$(
            #[unsafe(no_mangle)]
            pub extern "C" fn $name(x: f64) -> f64 { libm::$name(x) }
        )*};
    }
    macro_rules! pinned_f32 {
        ($($name:ident)*) => {$(
            #[unsafe(no_mangle)]
            pub extern "C" fn $name(x: f32) -> f32 { libm::$name(x) }
        )*};
    }
    pinned! { sin cos tan asin acos atan sinh cosh tanh exp exp2 expm1 log log2 log10 log1p cbrt }
    pinned_f32! { sinf cosf tanf asinf acosf atanf expf exp2f logf log2f log10f cbrtf }

    #[unsafe(no_mangle)]
    pub extern "C" fn pow(x: f64, y: f64) -> f64 {
        libm::pow(x, y)
    }
    #[unsafe(no_mangle)]
    pub extern "C" fn powf(x: f32, y: f32) -> f32 {
        libm::powf(x, y)
    }
    #[unsafe(no_mangle)]
    pub extern "C" fn atan2(y: f64, x: f64) -> f64 {
        libm::atan2(y, x)
    }
    #[unsafe(no_mangle)]
    pub extern "C" fn atan2f(y: f32, x: f32) -> f32 {
        libm::atan2f(y, x)
    }
    #[unsafe(no_mangle)]
    pub extern "C" fn hypot(x: f64, y: f64) -> f64 {
        libm::hypot(x, y)
    }
    /// # Safety
    /// `sin_out` and `cos_out` are writable, as the C contract of `sincos` says.
    #[unsafe(no_mangle)]
    pub unsafe extern "C" fn sincos(x: f64, sin_out: *mut f64, cos_out: *mut f64) {
        // SAFETY: the caller passes two writable places; LLVM itself emits this call for a sin and a cos of one argument.
        unsafe {
            *sin_out = libm::sin(x);
            *cos_out = libm::cos(x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_wrapped_angles_stay_in_the_half_open_turn() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert!((wrap_angle(3.0 * TAU + 0.25) - 0.25).abs() < 1e-14);
        assert!((wrap_angle(-3.0 * TAU - 0.25) + 0.25).abs() < 1e-14);
    }

    /// A hash over 30,000 results of `mul_add`: operands of all sizes, sums that cancel to a few bits, and subnormal results.
    #[inline(always)]
    fn hash_of_mul_adds() -> u64 {
        let mut state = 0x1234_u64;
        let mut next = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^ (z >> 31)
        };
        // Sign and digits of the word, exponent from `low` on.
        let number = |word: u64, low: u64, span: u64| {
            f64::from_bits(word & 0x800F_FFFF_FFFF_FFFF | (low + (word >> 52 & 0x7FF) % span) << 52)
        };
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for k in 0..30_000 {
            let (a, b, c) = (next(), next(), next());
            let (a, b, c) = match k % 3 {
                0 => (number(a, 1, 2046), number(b, 1, 2046), number(c, 1, 2046)),
                1 => {
                    let (a, b) = (number(a, 900, 200), number(b, 900, 200));
                    (a, b, f64::from_bits((-(a * b)).to_bits() + c % 5 - 2))
                }
                _ => (number(a, 400, 200), number(b, 400, 200), number(c, 0, 60)),
            };
            let sum = a.mul_add(b, c);
            let bits = if sum == 0.0 { 0 } else { sum.to_bits() };
            for byte in bits.to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
        hash
    }

    /// From exact rational arithmetic, rounded once: Python's `float(Fraction(a) * Fraction(b) + Fraction(c))`.
    const EXACT_MUL_ADDS: u64 = 0x08d3_a664_8e69_b623;

    #[test]
    fn exact_mul_add_is_rounded_once_with_and_without_the_instruction() {
        assert_eq!(hash_of_mul_adds(), EXACT_MUL_ADDS);
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "fma")]
            fn by_instruction() -> u64 {
                hash_of_mul_adds()
            }
            if is_x86_feature_detected!("fma") {
                // SAFETY: the machine has the instruction.
                assert_eq!(unsafe { by_instruction() }, EXACT_MUL_ADDS);
            }
        }
        // The C library's routine takes the instruction where it finds it: the same test where it is hidden.
        const HIDDEN: (&str, &str) = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F");
        if std::env::var(HIDDEN.0).as_deref() != Ok(HIDDEN.1) {
            let this = "math::tests::exact_mul_add_is_rounded_once_with_and_without_the_instruction";
            let tests = std::env::current_exe().unwrap();
            let again = std::process::Command::new(tests).args(["--exact", this]).env(HIDDEN.0, HIDDEN.1).output();
            let again = again.unwrap();
            let said = String::from_utf8_lossy(&again.stdout);
            assert!(again.status.success() && said.contains("1 passed"), "{said}");
        }
    }
}
