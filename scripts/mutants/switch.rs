//! Which mutant of a tree with many is switched on. Copied into the mutated tree by `scripts/mutants`; no part of the library.
//!
//! `MARSYARD_MUTANT` names the mutant by its number; without it none is on. `MARSYARD_MUTANTS_REACHED` names a file to which each
//! mutant's number is appended when its place is first reached, so that a test that never comes by need not be run for it.

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

const NONE: u32 = u32::MAX - 2;
const TRACED: u32 = u32::MAX - 1;
const UNREAD: u32 = u32::MAX;

static CHOSEN: AtomicU32 = AtomicU32::new(UNREAD);
static REACHED: [AtomicBool; 4096] = [const { AtomicBool::new(false) }; 4096];

#[inline]
pub fn active(mutant: u32) -> bool {
    let chosen = CHOSEN.load(Ordering::Relaxed);
    if chosen < TRACED { chosen == mutant } else { ask(mutant) }
}

#[cold]
#[inline(never)]
fn ask(mutant: u32) -> bool {
    if CHOSEN.load(Ordering::Relaxed) == UNREAD {
        let number = std::env::var("MARSYARD_MUTANT").ok().and_then(|text| text.parse().ok());
        let traced = std::env::var_os("MARSYARD_MUTANTS_REACHED").is_some();
        CHOSEN.store(if traced { TRACED } else { number.unwrap_or(NONE) }, Ordering::Relaxed);
    }
    let chosen = CHOSEN.load(Ordering::Relaxed);
    if chosen != TRACED {
        return chosen == mutant;
    }
    if !REACHED[mutant as usize].swap(true, Ordering::Relaxed)
        && let Some(path) = std::env::var_os("MARSYARD_MUTANTS_REACHED")
    {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path).expect("the file of mutants reached");
        writeln!(file, "{mutant}").expect("the file of mutants reached");
    }
    false
}
