//! Chunks in the registers of x86-64: one of AVX-512, or two of AVX2.

use std::arch::x86_64::*;

use super::{Chunk32, Chunk64, Kernel, Real, Simd};

/// # Safety
/// The CPU has AVX-512 F and DQ.
#[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
pub(super) unsafe fn avx512<T: Real, K: Kernel<T>>(kernel: K) -> K::Out {
    kernel.run::<T::Avx512>()
}

/// # Safety
/// The CPU has AVX2 and FMA.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn avx2<T: Real, K: Kernel<T>>(kernel: K) -> K::Out {
    kernel.run::<T::Avx2>()
}

macro_rules! wide {
    ($wide:ident, $register:ident, $chunk:ident, $real:ident, $splat:ident, $mul:ident, $fma:ident, $fnma:ident,
     |$x:ident| $sum:expr, |$own:ident, $bound:ident| $mask:expr) => {
        /// A chunk in one register. Made and used in [`avx512`] alone.
        #[derive(Clone, Copy)]
        pub(crate) struct $wide($register);

        // SAFETY (all): values of this type exist only in kernels that `avx512` runs, on a CPU that has the set; a
        // chunk and the register have the same size, and every bit pattern is valid. A fetch may have any address.
        impl Simd<$real> for $wide {
            const MANY: bool = true;

            #[inline(always)]
            fn load(from: &$chunk) -> Self {
                unsafe { std::mem::transmute::<$chunk, Self>(*from) }
            }
            #[inline(always)]
            fn store(self, to: &mut $chunk) {
                *to = unsafe { std::mem::transmute::<Self, $chunk>(self) };
            }
            #[inline(always)]
            fn fetch(from: *const $chunk) {
                unsafe { _mm_prefetch::<_MM_HINT_T1>(from.cast()) }
            }
            #[inline(always)]
            fn splat(x: $real) -> Self {
                $wide(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                $wide(unsafe { $mul(self.0, b.0) })
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                $wide(unsafe { $fma(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                $wide(unsafe { $fnma(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn sum(self) -> $real {
                let $x = self.0;
                unsafe { $sum }
            }
            #[inline(always)]
            fn count_up_to(self, x: $real) -> usize {
                // Lanes rise: those that hold at most `x` come first.
                let ($own, $bound) = (self.0, Self::splat(x).0);
                unsafe { $mask }.trailing_ones() as usize
            }
        }
    };
}

macro_rules! pair {
    ($pair:ident, $register:ident, $chunk:ident, $real:ident, $splat:ident, $mul:ident, $fma:ident, $fnma:ident,
     |$lo:ident, $hi:ident| $sum:expr, |$own:ident, $bound:ident| $mask:expr) => {
        /// A chunk in two registers. Made and used in [`avx2`] alone.
        #[derive(Clone, Copy)]
        #[repr(C)]
        pub(crate) struct $pair($register, $register);

        // SAFETY (all): values of this type exist only in kernels that `avx2` runs, on a CPU that has the set; a
        // chunk and the pair have the same size, and every bit pattern is valid. A fetch may have any address.
        impl Simd<$real> for $pair {
            #[inline(always)]
            fn load(from: &$chunk) -> Self {
                unsafe { std::mem::transmute::<$chunk, Self>(*from) }
            }
            #[inline(always)]
            fn store(self, to: &mut $chunk) {
                *to = unsafe { std::mem::transmute::<Self, $chunk>(self) };
            }
            #[inline(always)]
            fn fetch(from: *const $chunk) {
                unsafe { _mm_prefetch::<_MM_HINT_T1>(from.cast()) }
            }
            #[inline(always)]
            fn splat(x: $real) -> Self {
                let x = unsafe { $splat(x) };
                $pair(x, x)
            }
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                unsafe { $pair($mul(self.0, b.0), $mul(self.1, b.1)) }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                unsafe { $pair($fma(self.0, b.0, c.0), $fma(self.1, b.1, c.1)) }
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                unsafe { $pair($fnma(self.0, b.0, c.0), $fnma(self.1, b.1, c.1)) }
            }
            #[inline(always)]
            fn sum(self) -> $real {
                let ($lo, $hi) = (self.0, self.1);
                unsafe { $sum }
            }
            #[inline(always)]
            fn count_up_to(self, x: $real) -> usize {
                // As of one register; the upper half has the upper bits.
                let ($own, $bound) = (self.0, Self::splat(x).0);
                let low = unsafe { $mask };
                let $own = self.1;
                let high = unsafe { $mask };
                (low | high << ($real::LANES / 2)).trailing_ones() as usize
            }
        }
    };
}

wide!(
    Wide32,
    __m512,
    Chunk32,
    f32,
    _mm512_set1_ps,
    _mm512_mul_ps,
    _mm512_fmadd_ps,
    _mm512_fnmadd_ps,
    |x| sum32(_mm512_castps512_ps256(x), _mm512_extractf32x8_ps::<1>(x)),
    |own, bound| _mm512_cmp_ps_mask::<_CMP_LE_OQ>(own, bound)
);
wide!(
    Wide64,
    __m512d,
    Chunk64,
    f64,
    _mm512_set1_pd,
    _mm512_mul_pd,
    _mm512_fmadd_pd,
    _mm512_fnmadd_pd,
    |x| sum64(_mm512_castpd512_pd256(x), _mm512_extractf64x4_pd::<1>(x)),
    |own, bound| _mm512_cmp_pd_mask::<_CMP_LE_OQ>(own, bound)
);
pair!(
    Pair32,
    __m256,
    Chunk32,
    f32,
    _mm256_set1_ps,
    _mm256_mul_ps,
    _mm256_fmadd_ps,
    _mm256_fnmadd_ps,
    |lo, hi| sum32(lo, hi),
    |own, bound| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(own, bound))
);
pair!(
    Pair64,
    __m256d,
    Chunk64,
    f64,
    _mm256_set1_pd,
    _mm256_mul_pd,
    _mm256_fmadd_pd,
    _mm256_fnmadd_pd,
    |lo, hi| sum64(lo, hi),
    |own, bound| _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(own, bound))
);

/// # Safety
/// As the kernel that calls it.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn sum32(lo: __m256, hi: __m256) -> f32 {
    let eight = _mm256_add_ps(lo, hi);
    let four = _mm_add_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
    let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
    _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps::<1>(two, two)))
}

/// # Safety
/// As the kernel that calls it.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn sum64(lo: __m256d, hi: __m256d) -> f64 {
    let four = _mm256_add_pd(lo, hi);
    let two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd::<1>(four));
    _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
}
