//! What the CPU has -> the instruction set that vector kernels run on.
//!
//! Every set gives the same bits: it decides about speed alone. So that whole corpora can be compared, the environment
//! variable `MARSYARD_KERNELS` (`plain`, `avx2` or `avx512`) holds the kernels to sets no wider than the one it names.

use std::sync::OnceLock;

/// Holds the kernels to a set, or to those that are narrower.
pub const VARIABLE: &str = "MARSYARD_KERNELS";

/// The CPU by the name that its maker gave it; `None` where the system does not say (Linux on x86-64 does).
pub(crate) fn name() -> Option<String> {
    let told = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = told.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    let name = name.trim();
    (!name.is_empty()).then(|| name.to_owned())
}

/// Instruction sets that kernels are compiled for, the narrowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every x86-64 has; fused multiply-adds come from a routine, slowly.
    Portable,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F and DQ, and the above.
    Avx512,
}

/// An instruction set that this CPU has. A value proves it, since only [`Isa::PORTABLE`], [`Isa::available`] and [`Isa::detect`]
/// make one: who holds it may run code that was compiled for the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Isa(InstructionSet);

impl Isa {
    /// What every CPU has.
    pub const PORTABLE: Isa = Isa(InstructionSet::Portable);

    /// Which set it is.
    #[inline]
    pub fn set(self) -> InstructionSet {
        self.0
    }

    /// All that this CPU has, the widest last.
    pub fn available() -> impl Iterator<Item = Isa> {
        #[cfg(target_arch = "x86_64")]
        let (avx2, avx512) = {
            // Every CPU with AVX2 has popcnt; the kernels name it as a feature of theirs, so it is asked for as well.
            let popcnt = is_x86_feature_detected!("popcnt");
            let avx2 = popcnt && is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            (avx2, avx2 && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq"))
        };
        #[cfg(not(target_arch = "x86_64"))]
        let (avx2, avx512) = (false, false);
        let sets = [(InstructionSet::Portable, true), (InstructionSet::Avx2, avx2), (InstructionSet::Avx512, avx512)];
        sets.into_iter().filter(|(_, is_there)| *is_there).map(|(set, _)| Isa(set))
    }

    /// The widest that this CPU has and the environment allows; looked up once.
    #[inline]
    pub fn detect() -> Isa {
        static WIDEST: OnceLock<Isa> = OnceLock::new();
        *WIDEST.get_or_init(|| {
            let allowed = allowed(std::env::var(VARIABLE).ok().as_deref()).unwrap_or(InstructionSet::Avx512);
            Isa::available().filter(|isa| isa.set() <= allowed).last().unwrap_or(Isa::PORTABLE)
        })
    }
}

/// Refuses a word in the environment that names no set.
pub fn check_environment() -> Result<(), String> {
    allowed(std::env::var(VARIABLE).ok().as_deref()).map(|_| ())
}

fn allowed(word: Option<&str>) -> Result<InstructionSet, String> {
    match word {
        None | Some("avx512") => Ok(InstructionSet::Avx512),
        Some("avx2") => Ok(InstructionSet::Avx2),
        Some("plain") => Ok(InstructionSet::Portable),
        Some(other) => Err(format!("{VARIABLE}={other}: it is one of plain, avx2, avx512, or not set")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_words_name_sets_and_others_are_refused() {
        assert_eq!(allowed(None), Ok(InstructionSet::Avx512));
        assert_eq!(allowed(Some("plain")), Ok(InstructionSet::Portable));
        assert_eq!(allowed(Some("avx2")), Ok(InstructionSet::Avx2));
        assert!(allowed(Some("sse")).unwrap_err().contains("plain, avx2, avx512"));
    }
}
