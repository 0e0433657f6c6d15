//! What this machine can do at most: fused multiply-adds a second, and bytes a second read and written, of one thread.
//!
//! Both are the best of several rounds by CPU time, with the widest registers that the CPU has: a bound is what nothing passes.

use marsyard::measure::clock::thread_cpu_s;

const ROUNDS: usize = 9;

/// f32 operations a second, two to a fused multiply-add; of f64 it is half.
pub fn peak_flops() -> f64 {
    const TURNS: usize = 200_000;
    best(|| kernels::multiply_add(TURNS))
}

/// Bytes a second, read and written, of a pass over `bytes` that changes them in place.
pub fn bandwidth(bytes: usize) -> f64 {
    let mut lines = vec![Line([1.0; 16]); bytes.div_ceil(size_of::<Line>())];
    let passes = (20_000_000 / bytes).max(1);
    best(|| {
        (0..passes).for_each(|_| kernels::change(&mut lines));
        (2 * passes * lines.len() * size_of::<Line>()) as f64
    })
}

/// Amount per second of CPU, of the best round; `work` returns the amount.
fn best(mut work: impl FnMut() -> f64) -> f64 {
    let round = |work: &mut dyn FnMut() -> f64| {
        let begun = thread_cpu_s();
        let amount = work();
        amount / (thread_cpu_s() - begun)
    };
    (0..ROUNDS).map(|_| round(&mut work)).fold(0.0, f64::max)
}

/// One cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Line([f32; 16]);

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // Vector registers.
mod kernels {
    use std::arch::x86_64::*;
    use std::hint::black_box;

    use super::Line;

    /// Twelve chains hide the latency of each.
    const CHAINS: usize = 12;

    pub fn multiply_add(turns: usize) -> f64 {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the CPU has the set.
            black_box(unsafe { wide::multiply_add(turns) });
            (turns * CHAINS * 16 * 2) as f64
        } else {
            assert!(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"), "a CPU with AVX2 and FMA");
            // SAFETY: the CPU has the sets.
            black_box(unsafe { narrow::multiply_add(turns) });
            (turns * CHAINS * 8 * 2) as f64
        }
    }

    pub fn change(lines: &mut [Line]) {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the CPU has the set.
            unsafe { wide::change(lines) }
        } else {
            // SAFETY: `multiply_add` has asked for the sets.
            unsafe { narrow::change(lines) }
        }
    }

    macro_rules! kernels {
        ($name:ident, $set:literal, $lanes:literal, $splat:ident, $fma:ident, $mul:ident, $load:ident, $store:ident, $first:expr) => {
            mod $name {
                use super::*;

                #[target_feature(enable = $set)]
                pub unsafe fn multiply_add(turns: usize) -> f32 {
                    // Values that the compiler cannot know, and that neither grow nor vanish.
                    let (a, b) = ($splat(black_box(0.999)), $splat(black_box(0.001)));
                    let mut chains = [$splat(black_box(1.0)); CHAINS];
                    for _ in 0..turns {
                        for chain in &mut chains {
                            *chain = $fma(*chain, a, b);
                        }
                    }
                    chains.into_iter().map($first).sum()
                }

                #[target_feature(enable = $set)]
                pub unsafe fn change(lines: &mut [Line]) {
                    let factor = $splat(black_box(0.999_999));
                    for line in lines {
                        for part in line.0.as_chunks_mut::<$lanes>().0 {
                            // SAFETY: a line is aligned to 64 bytes, its parts to their size.
                            unsafe { $store(part.as_mut_ptr(), $mul($load(part.as_ptr()), factor)) };
                        }
                    }
                }
            }
        };
    }

    kernels!(
        wide,
        "avx512f",
        16,
        _mm512_set1_ps,
        _mm512_fmadd_ps,
        _mm512_mul_ps,
        _mm512_load_ps,
        _mm512_store_ps,
        |x| { _mm512_cvtss_f32(x) }
    );
    kernels!(
        narrow,
        "avx2,fma",
        8,
        _mm256_set1_ps,
        _mm256_fmadd_ps,
        _mm256_mul_ps,
        _mm256_load_ps,
        _mm256_store_ps,
        |x| { _mm256_cvtss_f32(x) }
    );
}
