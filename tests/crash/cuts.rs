//! Power cuts, as a file system that keeps only what was synced would answer them: data that was written and not synced is gone,
//! and names are either all there, or back to what they were when their folder was last synced.
//!
//! `scripts/trust/power_cut.py` cuts a real file system off, which needs root.

use crate::aftermath::Bar;
use crate::kills::{Tally, changes};
use crate::tasks::{Bench, FINALIZE, GENERATE, GROW, REPAIR, SEARCH, TRAIN, Task};
use crate::tracer::{How, Names, Tracer};

/// Cuts a task off before every `stride`-th of its changes, and once behind its end, in both ways.
fn cut(bench: &Bench, task: Task, stride: usize) -> Tally {
    let mut tally = Tally::default();
    let bar = Bar::of(bench, task);
    let calls = changes(bench, &task);
    for (k, call) in calls.iter().enumerate().skip(stride / 2).step_by(stride) {
        for names in [Names::Keep, Names::Undo] {
            let (work, end) = bench.disturbed(&task, How::Cut(call.number, names));
            let outcome = match end.code {
                Tracer::KILLED => {
                    let asked = |reader: usize| stride == 1 || reader == k % 3;
                    bar.readers(&work, asked, stride == 1).and_then(|()| bar.again(&work))
                }
                0 if task.name == TRAIN.name => bar.done(&work, &end.stdout),
                code => Err(format!("not cut, exit {code}: {}", end.stderr)),
            };
            tally.add(format_args!("{}, cut off before {call}, {names:?}", task.name), outcome);
        }
    }
    for names in [Names::Keep, Names::Undo] {
        let (work, end) = bench.disturbed(&task, How::Cut(usize::MAX, names));
        // Who was told that it is done has it, power or not; times and rates alone may be lost.
        let outcome = match end.code {
            0 => bar.done(&work, &end.stdout),
            code => Err(format!("not done, exit {code}: {}", end.stderr)),
        };
        tally.add(format_args!("{}, cut off behind its end, {names:?}", task.name), outcome);
    }
    tally
}

fn demand(tasks: &[Task], stride: usize) {
    let Some(bench) = Bench::new() else { return };
    let tallies: Vec<Tally> = tasks.iter().map(|&task| cut(&bench, task, stride)).collect();
    Tally::demand_none(tasks, &tallies, "cut off from power");
}

#[test]
fn law_a_build_cut_off_from_power_goes_on() {
    demand(&[GENERATE], 16);
}

#[test]
fn law_a_growth_cut_off_from_power_is_old_or_new_and_goes_on() {
    demand(&[GROW], 16);
}

#[test]
fn law_a_finalize_or_repair_cut_off_from_power_goes_on() {
    demand(&[FINALIZE, REPAIR], 8);
}

#[test]
fn law_a_training_cut_off_from_power_goes_on() {
    demand(&[TRAIN, SEARCH], 6);
}

#[test]
#[ignore = "every point: some minutes"]
fn law_every_power_cut_loses_nothing() {
    demand(&[GENERATE, GROW, FINALIZE, REPAIR, TRAIN, SEARCH], 1);
}
