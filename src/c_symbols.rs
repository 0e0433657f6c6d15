//! The C library's names for functions of numbers, bound to the pinned `libm` for the whole program.
//!
//! Part of the binary, not of the library: a program that links marsyard as a library keeps its own C library, and marsyard's own code
//! calls [`marsyard::math`] everywhere. What these symbols catch is other crates' calls and those that the compiler makes itself, so that
//! no value in the process comes from the machine's C library.
//!
//! Why `unsafe`: exporting an unmangled symbol replaces the C library's. Each has the C signature and the C meaning, and
//! the linker prefers ours, so no code in the process sees two versions.
#![cfg(target_os = "linux")]
#![allow(unsafe_code)]

macro_rules! pinned {
    ($($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $name(x: f64) -> f64 { libm::$name(x) }
    )*};
}
macro_rules! pinned_f32 {
    ($($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $name(x: f32) -> f32 { libm::$name(x) }
    )*};
}
pinned! { sin cos tan asin acos atan sinh cosh tanh exp exp2 expm1 log log2 log10 log1p cbrt }
pinned_f32! { sinf cosf tanf asinf acosf atanf expf exp2f logf log2f log10f cbrtf }

#[unsafe(no_mangle)]
pub(crate) extern "C" fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}
#[unsafe(no_mangle)]
pub(crate) extern "C" fn powf(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}
#[unsafe(no_mangle)]
pub(crate) extern "C" fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}
#[unsafe(no_mangle)]
pub(crate) extern "C" fn atan2f(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}
#[unsafe(no_mangle)]
pub(crate) extern "C" fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}
/// # Safety
/// `sin_out` and `cos_out` are writable, as the C contract of `sincos` says.
#[unsafe(no_mangle)]
pub(crate) unsafe extern "C" fn sincos(x: f64, sin_out: *mut f64, cos_out: *mut f64) {
    // SAFETY: the caller passes two writable places; LLVM itself emits this call for a sin and a cos of one argument.
    unsafe {
        *sin_out = libm::sin(x);
        *cos_out = libm::cos(x);
    }
}
