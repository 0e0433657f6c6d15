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
#[allow(unsafe_code)]
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
}
