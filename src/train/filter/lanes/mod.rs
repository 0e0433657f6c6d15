//! Vectors of numbers with the same bits on every CPU.
//!
//! A [`Chunk`](Real::Chunk) is one cache line: 16 f32 or 8 f64, whatever the registers hold. A [`Kernel`] is written once over
//! [`Simd`] and compiled for AVX-512 (one register a chunk), AVX2 with FMA (two) and plain arrays; all round alike, because the
//! lane count, the fused multiply-adds and the tree of [`Simd::sum`] are fixed. Plain `mul_add` without FMA hardware calls a
//! routine of the C library and is some 30 times slower: x86-64-v3 and every aarch64 have the hardware.

#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    reason = "registers; one reason stands for each type's operations"
)]
mod x86;

use std::fmt::Debug;
use std::ops::Add;

use crate::cpu::InstructionSet;
pub(crate) use crate::cpu::Isa;

/// Element of a covariance.
pub(crate) trait Real: Copy + Add<Output = Self> + Debug + Default + PartialEq + Send + Sync + 'static {
    /// Elements in a chunk.
    const LANES: usize;
    /// As state files call it.
    const NAME: &'static str;
    type Chunk: Simd<Self> + AsRef<[Self]> + AsMut<[Self]> + Default + Debug + PartialEq + Send + Sync + 'static;
    #[cfg(target_arch = "x86_64")]
    type Avx2: Simd<Self>;
    #[cfg(target_arch = "x86_64")]
    type Avx512: Simd<Self>;

    fn of(x: f64) -> Self;
    fn f64(self) -> f64;
    fn write_le(self, to: &mut Vec<u8>);
    fn read_le(from: &[u8]) -> Self;
}

/// A chunk in registers.
pub(crate) trait Simd<T: Real>: Copy {
    /// Whether there are registers for more than a dozen chunks.
    const MANY: bool = false;
    fn load(from: &T::Chunk) -> Self;
    fn store(self, to: &mut T::Chunk);
    /// Asks for a chunk that is read in a while, into the second cache; nothing happens where there is none.
    #[inline(always)]
    fn fetch(_from: *const T::Chunk) {}
    fn splat(x: T) -> Self;
    fn mul(self, b: Self) -> Self;
    /// self b + c, rounded once.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// c - self b, rounded once.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// Sum of the lanes: upper half onto lower half until one is left.
    fn sum(self) -> T;
    /// How many lanes hold at most `x`, where none is less than the one before it; none for NaN.
    fn count_up_to(self, x: T) -> usize;
    /// Sums of four, each as [`Simd::sum`] has it.
    #[inline(always)]
    fn sums(four: [Self; 4]) -> [T; 4] {
        [four[0].sum(), four[1].sum(), four[2].sum(), four[3].sum()]
    }
}

/// Work that is compiled once per instruction set.
pub(crate) trait Kernel<T: Real> {
    type Out;
    /// Implementations are `#[inline(always)]`, so that they take on the instruction set of their caller.
    fn run<V: Simd<T>>(self) -> Self::Out;
}

impl Isa {
    /// Runs a kernel, compiled for this set.
    #[inline]
    #[allow(unsafe_code)]
    pub(crate) fn run<T: Real, K: Kernel<T>>(self, kernel: K) -> K::Out {
        match self.set() {
            // SAFETY: an `Isa` of this set proves that the CPU has it.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => unsafe { x86::avx512(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => unsafe { x86::avx2(kernel) },
            _ => kernel.run::<T::Chunk>(),
        }
    }
}

macro_rules! portable {
    ($chunk:ident, $real:ident, $lanes:literal, $name:literal, $avx2:ident, $avx512:ident) => {
        /// One cache line of numbers.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[repr(C, align(64))]
        pub(crate) struct $chunk([$real; $lanes]);

        impl AsRef<[$real]> for $chunk {
            #[inline(always)]
            fn as_ref(&self) -> &[$real] {
                &self.0
            }
        }

        impl AsMut<[$real]> for $chunk {
            #[inline(always)]
            fn as_mut(&mut self) -> &mut [$real] {
                &mut self.0
            }
        }

        impl Real for $real {
            const LANES: usize = $lanes;
            const NAME: &'static str = $name;
            type Chunk = $chunk;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = x86::$avx2;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = x86::$avx512;

            #[inline(always)]
            fn of(x: f64) -> $real {
                x as $real
            }
            #[inline(always)]
            fn f64(self) -> f64 {
                self as f64
            }
            fn write_le(self, to: &mut Vec<u8>) {
                to.extend_from_slice(&self.to_le_bytes());
            }
            fn read_le(from: &[u8]) -> $real {
                let mut bytes = [0; size_of::<$real>()];
                bytes.copy_from_slice(from);
                $real::from_le_bytes(bytes)
            }
        }

        impl Simd<$real> for $chunk {
            #[inline(always)]
            fn load(from: &$chunk) -> Self {
                *from
            }
            #[inline(always)]
            fn store(self, to: &mut $chunk) {
                *to = self;
            }
            #[inline(always)]
            fn splat(x: $real) -> Self {
                $chunk([x; $lanes])
            }
            #[inline(always)]
            fn mul(mut self, b: Self) -> Self {
                for l in 0..$lanes {
                    self.0[l] *= b.0[l];
                }
                self
            }
            #[inline(always)]
            fn mul_add(mut self, b: Self, c: Self) -> Self {
                for l in 0..$lanes {
                    self.0[l] = self.0[l].mul_add(b.0[l], c.0[l]);
                }
                self
            }
            #[inline(always)]
            fn neg_mul_add(mut self, b: Self, c: Self) -> Self {
                for l in 0..$lanes {
                    self.0[l] = (-self.0[l]).mul_add(b.0[l], c.0[l]);
                }
                self
            }
            #[inline(always)]
            fn sum(mut self) -> $real {
                let mut half = $lanes / 2;
                while half > 0 {
                    for l in 0..half {
                        self.0[l] += self.0[l + half];
                    }
                    half /= 2;
                }
                self.0[0]
            }
            #[inline(always)]
            fn count_up_to(self, x: $real) -> usize {
                self.0.iter().map(|own| usize::from(*own <= x)).sum()
            }
        }
    };
}

portable!(Chunk32, f32, 16, "F32", Pair32, Wide32);
portable!(Chunk64, f64, 8, "F64", Pair64, Wide64);

#[cfg(test)]
mod tests;
