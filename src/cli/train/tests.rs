//! What is taken of the command line, and what is told of a training that ended.

use super::tell::{guards, of_more_scenes};
use super::*;
use crate::cli::place::StoreFault;
use crate::corpus::CorpusError;
use crate::statistics::Interval;
use crate::train::filter::Counters;
use crate::train::generalisation::Generalisation;

#[test]
fn exact_corpora_carry_weights_behind_a_colon() {
    assert_eq!(parse_corpus("a/b:0.5"), Ok(("a/b".into(), 0.5)));
    assert_eq!(parse_corpus("a/b"), Ok(("a/b".into(), 1.0)));
    assert_eq!(parse_corpus("a:b/c"), Ok(("a:b/c".into(), 1.0)));
    for wrong in ["a:0", "a:-1", "a:nan", "a:inf"] {
        assert!(parse_corpus(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn law_what_a_machine_is_told_of_a_store_outlives_the_advice_to_resume() {
    let fault = std::io::Error::from_raw_os_error(rustix::io::Errno::IO.raw_os_error());
    let failure = goes_on(corpus_failure(CorpusError::of_path(Path::new("run/model"), fault)), Path::new("run"));
    assert_eq!(failure.code, Failure::TRY_AGAIN);
    let said = failure.report.downcast::<StoreFault>().expect("still a store's fault");
    assert_eq!((said.kind, said.place.as_str()), ("io", "run"));
    assert!(said.help.is_some_and(|help| help.contains("--resume --out run")));
}

#[test]
fn exact_what_more_scenes_would_bring_is_told_as_far_as_it_is_known() {
    let told = |mean, half_width| {
        of_more_scenes(&Generalisation { learnt: 0.01, held_back: 0.02, gap: Interval { mean, half_width } })
    };
    assert!(told(0.5, 0.2).contains("would take off up to 50 % of the error (30 to 70), for"), "{}", told(0.5, 0.2));
    assert!(told(0.02, 0.06).contains("bring little (8 % of the error at most): vary"), "{}", told(0.02, 0.06));
    assert!(told(-0.2, 0.1).contains("(0 % of the error at most)"), "{}", told(-0.2, 0.1));
    // Little, and surely not nothing, is told as what it is.
    assert!(told(0.2, 0.04).contains("up to 20 % of the error (16 to 24)"), "{}", told(0.2, 0.04));
    assert!(told(0.1, 0.3).ends_with("cannot be told (up to 40 % of the error)"), "{}", told(0.1, 0.3));
    assert!(told(0.1, f64::INFINITY).ends_with("cannot be told (up to 100 % of the error)"));
}

#[test]
fn exact_guards_are_told_with_the_time_of_the_first() {
    assert!(guards(&Counters { updates: 9, ..Counters::default() }).is_empty());
    let spoilt = Counters { rebuilt: 2, rebuilt_at: Some(40), factored_at: Some(70), ..Counters::default() };
    let told = guards(&Counters { clipped: 3, rejected: 1, cut_back: 5, ..spoilt });
    assert_eq!(told.len(), 4);
    assert!(told[2].contains("after 40 rows: it was rebuilt 2 times, and went on factored after 70"), "{}", told[2]);
}
