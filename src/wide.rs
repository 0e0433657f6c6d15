//! Plain loops over numbers -> the same loops, compiled for each width of the CPU's vector registers.
//!
//! In: [`Work`], a loop over arrays written lane by lane. Out: what it returns. The machine picks the widest form it has; the
//! compiler never contracts a product and a sum on its own and never reorders a sum, so that the form changes the speed and
//! not a bit. Where `mul_add` is written out, CPUs without the instruction round alike, slowly.

use crate::cpu::{InstructionSet, Isa};

/// Lanes that fill the widest registers, for loops over blocks.
pub(crate) const LANES: usize = 8;

/// A loop that may run in any of its forms.
pub(crate) trait Work {
    type Out;
    /// Implementations are `#[inline(always)]`, so that they take on the instruction set of their caller.
    fn run(self) -> Self::Out;
}

/// Runs the work in the widest form that this CPU has.
#[inline]
pub(crate) fn widest<W: Work>(work: W) -> W::Out {
    run(Isa::detect(), work)
}

/// Runs the work in the form of one instruction set.
#[allow(unsafe_code)] // Calls what the CPU was asked for.
#[inline]
pub(crate) fn run<W: Work>(isa: Isa, work: W) -> W::Out {
    match isa.set() {
        // SAFETY: an `Isa` of this set proves that the CPU has it.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { avx512(work) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { avx2(work) },
        _ => work.run(),
    }
}

/// Runs the work in the form of registers of four f64, for rows that fill no wider ones.
#[allow(unsafe_code)] // Calls what the CPU was asked for.
#[inline]
pub(crate) fn in_fours<W: Work>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    if Isa::detect().set() >= InstructionSet::Avx2 {
        // SAFETY: a CPU with this set or a wider one has this set.
        return unsafe { avx2(work) };
    }
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx2,fma,popcnt")]
fn avx512<W: Work>(work: W) -> W::Out {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt")]
fn avx2<W: Work>(work: W) -> W::Out {
    work.run()
}

/// All forms that this CPU has, for tests of their sameness.
#[cfg(test)]
pub(crate) fn every_form<W: Work>(work: impl Fn() -> W) -> Vec<W::Out> {
    Isa::available().map(|isa| run(isa, work())).collect()
}
