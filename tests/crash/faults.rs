//! A system call that fails: no panic, no lie, nothing lost.
//!
//! Done is said only where the products are right; else the message names the place and what helps, and the same command again
//! completes the work. Where a call was only interrupted, it is made again.

use std::collections::BTreeMap;
use std::path::Path;

use crate::aftermath::{Bar, flat, refusal};
use crate::kills::Tally;
use crate::tasks::{
    Bench, CLASSIFY, EVALUATE, FINALIZE, GENERATE, GROW, REPAIR, SEARCH, SEARCH_BEGUN, TRAIN, TRAIN_BEGUN, Task,
};
use crate::tracer::{Call, End, Fault, How};
use crate::tree;

use Fault::{Error, Short};

/// The ways in which a call of a class fails in the field.
fn faults(class: &str) -> &'static [Fault] {
    match class {
        "open" => &[Error("EIO"), Error("EMFILE"), Error("EINTR")],
        "create" => &[Error("EIO"), Error("ENOSPC"), Error("EROFS"), Error("EMFILE"), Error("EINTR")],
        "read" => &[Error("EIO"), Error("EINTR"), Short],
        "write" => &[Error("EIO"), Error("ENOSPC"), Error("EINTR"), Short],
        "sync" => &[Error("EIO"), Error("ENOSPC"), Error("EINTR")],
        "truncate" => &[Error("EIO"), Error("EINTR")],
        "rename" => &[Error("EIO"), Error("ENOSPC"), Error("EXDEV"), Error("EROFS")],
        "mkdir" => &[Error("EIO"), Error("ENOSPC"), Error("EROFS")],
        "link" | "unlink" => &[Error("EIO"), Error("EROFS")],
        _ => &[Error("EIO")],
    }
}

/// Calls that signals interrupt, and that are then to be made again; to open a folder is none of them.
fn is_made_again(work: &Path, call: &Call, fault: Fault) -> bool {
    let is_folder = work.join(call.path.trim_start_matches('/')).is_dir();
    fault == Short || fault == Error("EINTR") && !is_folder
}

/// Lets every `stride`-th pair of a call and a fault of it happen to a task.
fn failing(bench: &Bench, task: Task, stride: usize) -> Tally {
    let mut tally = Tally::default();
    let bar = Bar::of(bench, task);
    let (_, listed) = bench.disturbed(&task, How::Calls);
    assert_eq!(listed.code, 0, "{}: {}", task.name, listed.stderr);
    let calls = unlike(&listed.calls);
    let pairs = calls.iter().flat_map(|call| faults(&call.class).iter().map(move |&fault| (call, fault)));
    for (call, fault) in pairs.skip(stride / 2).step_by(stride) {
        let (work, end) = bench.disturbed(&task, How::Fail(call.number, &call.class, fault));
        // How often a checkpoint is written is a matter of time, so that another call of the class may have been met, or none.
        let met = end.failed.map_or(call, |number| &end.calls[number - 1]);
        let outcome = judged(&bar, &work, met, fault, &end).and_then(|()| bar.again(&work));
        tally.add(format_args!("{}, {fault:?} of {met}", task.name), outcome);
    }
    tally
}

/// Of calls that are alike, of one name on one file, the first two and the last: a shard is read some hundred times.
fn unlike(calls: &[Call]) -> Vec<Call> {
    let mut seen: BTreeMap<(&str, &str), Vec<&Call>> = BTreeMap::new();
    for call in calls {
        let alike = seen.entry((&call.name, &call.path)).or_default();
        alike.truncate(2);
        alike.push(call);
    }
    let mut chosen: Vec<Call> = seen.into_values().flatten().cloned().collect();
    chosen.sort_by_key(|call| call.number);
    chosen
}

/// What the disturbed run itself may do.
fn judged(bar: &Bar, work: &Path, met: &Call, fault: Fault, end: &End) -> Result<(), String> {
    if end.code == 0 {
        return bar.done(work, &end.stdout);
    }
    if is_made_again(work, met, fault) {
        return Err(format!("not made again, exit {}: {}", end.code, flat(&end.stderr)));
    }
    refusal("it", Some(end.code), &end.stderr)?;
    let due = exit_of(fault);
    if due.is_some_and(|due| due != end.code) {
        return Err(format!("exit {}, and not {due:?}: {}", end.code, flat(&end.stderr)));
    }
    let said: String = flat(&end.stderr).split(' ').collect();
    match said.contains(named(&met.path)) {
        true => Ok(()),
        false => Err(format!("does not name {}: {}", named(&met.path), flat(&end.stderr))),
    }
}

/// The exit code that a fault is due: what passes is tried again, a folder that cannot be written stays so.
fn exit_of(fault: Fault) -> Option<i32> {
    match fault {
        Error("EIO" | "EMFILE" | "ENOSPC") => Some(75),
        Error("EROFS") => Some(1),
        _ => None,
    }
}

/// What a message must name of a path: its last part, or the folder of a temporary file, which nobody knows by name. Of the
/// folder that all is in, nothing.
fn named(path: &str) -> &str {
    let parts = path.rsplit('/').filter(|part| !part.is_empty());
    parts.into_iter().find(|part| *part != "TEMPORARY" && !tree::is_temporary(part)).unwrap_or_default()
}

#[test]
fn exact_what_a_message_must_name() {
    let paths = ["/run/model.safetensors", "/run/TEMPORARY", "/run", "", "/TEMPORARY"];
    assert_eq!(paths.map(named), ["model.safetensors", "run", "run", "", ""]);
}

fn demand(tasks: &[Task], stride: usize) {
    let Some(bench) = Bench::new() else { return };
    let tallies: Vec<Tally> = tasks.iter().map(|&task| failing(&bench, task, stride)).collect();
    Tally::demand_none(tasks, &tallies, "a call failed");
}

#[test]
fn law_a_training_or_search_whose_calls_fail_loses_nothing() {
    demand(&[TRAIN, SEARCH], 13);
}

#[test]
fn law_a_run_in_an_empty_folder_whose_calls_fail_loses_nothing() {
    demand(&[TRAIN_BEGUN, SEARCH_BEGUN], 61);
}

#[test]
fn law_a_build_whose_calls_fail_loses_nothing() {
    demand(&[GENERATE, FINALIZE, REPAIR], 29);
}

#[test]
fn law_judging_and_classifying_survive_failing_calls() {
    demand(&[EVALUATE, CLASSIFY], 7);
}

#[test]
#[ignore = "every call with every fault: many minutes"]
fn law_every_failing_call_loses_nothing() {
    let runs = [TRAIN, SEARCH, TRAIN_BEGUN, SEARCH_BEGUN, EVALUATE, CLASSIFY];
    demand(&[&runs[..], &[GENERATE, GROW, FINALIZE, REPAIR]].concat(), 1);
}
