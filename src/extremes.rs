//! What a test measured at an extreme -> one line on standard output.
//!
//! In: the case, what a textbook form does there and what marsyard does, both measured by the calling test. Out: a line that
//! `scripts/extremes.py` gathers into `docs/extremes.md`; shown with `--nocapture` only. The test's own name is that of its
//! thread.

/// Families, in the order of the table.
#[derive(Clone, Copy, Debug)]
#[allow(dead_code, reason = "two test programs share this file, and neither has all families")]
pub(crate) enum Family {
    Ground,
    Casting,
    Contact,
    Slam,
    Cells,
    Filters,
    Sums,
}

/// Prints one row of the table.
pub(crate) fn row(family: Family, extreme: &str, textbook: &str, marsyard: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("main");
    for text in [extreme, textbook, marsyard] {
        assert!(!text.contains(['|', '\n']), "a cell of the table: {text}");
    }
    println!("\nextreme|{family:?}|{extreme}|{textbook}|{marsyard}|{test}");
}
