//! What the CPU has -> the instruction set that vector kernels run on.
//!
//! Every set gives the same bits: it decides about speed alone. So that whole corpora can be compared, the environment
//! variable `MARSYARD_KERNELS` (`plain`, `avx2` or `avx512`) holds the kernels to sets no wider than the one it names.

use std::sync::OnceLock;

/// Holds the kernels to a set, or to those that are narrower.
pub const VARIABLE: &str = "MARSYARD_KERNELS";

/// Instruction sets that kernels are compiled for, the narrowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// What every x86-64 has; fused multiply-adds come from a routine, slowly.
    Portable,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F and DQ, and the above.
    Avx512,
}

impl Isa {
    /// All that this CPU has, the widest last.
    pub fn available() -> impl Iterator<Item = Isa> {
        #[cfg(target_arch = "x86_64")]
        let (avx2, avx512) = {
            // No CPU has AVX2 and counts no bits; the compiler asks for it by name.
            let counts = is_x86_feature_detected!("popcnt");
            let avx2 = counts && is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            (avx2, avx2 && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq"))
        };
        #[cfg(not(target_arch = "x86_64"))]
        let (avx2, avx512) = (false, false);
        [(Isa::Portable, true), (Isa::Avx2, avx2), (Isa::Avx512, avx512)].into_iter().filter(|i| i.1).map(|i| i.0)
    }

    /// The widest that this CPU has and the environment allows; looked up once.
    #[inline]
    pub fn detect() -> Isa {
        static WIDEST: OnceLock<Isa> = OnceLock::new();
        *WIDEST.get_or_init(|| {
            let allowed = allowed(std::env::var(VARIABLE).ok().as_deref()).unwrap_or(Isa::Avx512);
            Isa::available().filter(|&isa| isa <= allowed).last().unwrap_or(Isa::Portable)
        })
    }
}

/// Refuses a word in the environment that names no set.
pub fn check_environment() -> Result<(), String> {
    allowed(std::env::var(VARIABLE).ok().as_deref()).map(|_| ())
}

fn allowed(word: Option<&str>) -> Result<Isa, String> {
    match word {
        None | Some("avx512") => Ok(Isa::Avx512),
        Some("avx2") => Ok(Isa::Avx2),
        Some("plain") => Ok(Isa::Portable),
        Some(other) => Err(format!("{VARIABLE}={other}: it is one of plain, avx2, avx512, or not set")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_words_name_sets_and_others_are_refused() {
        assert_eq!(allowed(None), Ok(Isa::Avx512));
        assert_eq!(allowed(Some("plain")), Ok(Isa::Portable));
        assert_eq!(allowed(Some("avx2")), Ok(Isa::Avx2));
        assert!(allowed(Some("sse")).unwrap_err().contains("plain, avx2, avx512"));
    }
}
