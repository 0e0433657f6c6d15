//! Killed before each change to a file: what is there is whole, and the same command goes on.

use crate::aftermath::{Bar, MIXED};
use crate::tasks::{Bench, FINALIZE, GENERATE, GROW, MERGE, REPAIR, SEARCH, SEARCH_BEGUN, TRAIN, TRAIN_BEGUN, Task};
use crate::tracer::{Call, How, Tracer};

/// What a number of attempts came to.
#[derive(Default)]
pub struct Tally {
    pub attempts: usize,
    pub failures: Vec<String>,
}

impl Tally {
    /// Counts one attempt; `what`: where it was disturbed, and how it ended.
    pub fn add(&mut self, what: impl std::fmt::Display, outcome: Result<(), String>) {
        self.attempts += 1;
        self.failures.extend(outcome.err().map(|why| format!("{what}: {why}")));
    }

    /// A row of the long form's table: which task, what happened to it, how often, and what that cost.
    fn tell(&self, task: &Task, what: &str) {
        let mixed = self.failures.iter().filter(|line| line.contains(MIXED)).count();
        let lost = self.failures.len() - mixed;
        println!("| {} | {what} | {} | {lost} | {mixed} |", task.name, self.attempts);
    }

    /// Tells all tallies, and fails where one of them has a failure.
    pub fn demand_none(tasks: &[Task], tallies: &[Tally], what: &str) {
        tasks.iter().zip(tallies).for_each(|(task, tally)| tally.tell(task, what));
        let attempts: usize = tallies.iter().map(|tally| tally.attempts).sum();
        let failures: Vec<&str> = tallies.iter().flat_map(|tally| &tally.failures).map(String::as_str).collect();
        assert!(tallies.iter().all(|tally| tally.attempts > 0), "nothing was attempted");
        assert!(
            failures.is_empty(),
            "{} of {attempts} attempts lost something:\n  {}",
            failures.len(),
            failures.join("\n  ")
        );
    }
}

/// Kills a task before each of its changes. In the short form syncs are left out, since a kill before one and a kill behind it leave the
/// same files, and of the readers beside `train` each is asked in turn.
fn killed(bench: &Bench, task: Task, is_long: bool) -> Tally {
    let mut tally = Tally::default();
    let bar = Bar::of(bench, task);
    let calls = changes(bench, &task);
    for (k, call) in calls.iter().filter(|call| is_long || !call.is_sync()).enumerate() {
        let (work, end) = bench.disturbed(&task, How::Kill(call.number));
        let outcome = match end.code {
            Tracer::KILLED => {
                let asked = |reader: usize| is_long || reader == 0 || reader == 1 + k % 2;
                let back = || if task.name == GROW.name { bar.back(&work) } else { Ok(()) };
                bar.readers(&work, asked, is_long || k % 8 == 0).and_then(|()| back()).and_then(|()| bar.again(&work))
            }
            // How often a checkpoint is written is a matter of time.
            0 if task.arguments == TRAIN.arguments => bar.done(&work, &end.stdout),
            code => Err(format!("not killed, exit {code}: {}", end.stderr)),
        };
        tally.add(format_args!("{}, killed before {call}", task.name), outcome);
    }
    tally
}

/// The changes to files that a task makes, in order.
pub fn changes(bench: &Bench, task: &Task) -> Vec<Call> {
    let (_, end) = bench.disturbed(task, How::Changes);
    assert_eq!(end.code, 0, "{}: {}", task.name, end.stderr);
    assert!(end.calls.len() > 5, "{}: {} changes: the tracer sees nothing", task.name, end.calls.len());
    end.calls
}

fn demand(tasks: &[Task], is_long: bool) {
    let Some(bench) = Bench::new() else { return };
    let tallies: Vec<Tally> = tasks.iter().map(|&task| killed(&bench, task, is_long)).collect();
    Tally::demand_none(tasks, &tallies, "killed");
}

#[test]
fn equal_the_same_task_makes_the_same_calls_twice() {
    let Some(bench) = Bench::new() else { return };
    for task in [GENERATE, GROW, FINALIZE, REPAIR] {
        assert_eq!(changes(&bench, &task), changes(&bench, &task), "{}", task.name);
    }
}

#[test]
fn law_a_killed_build_is_whole_and_goes_on() {
    demand(&[GENERATE, FINALIZE], false);
}

#[test]
fn law_a_killed_growth_is_old_or_new_and_goes_on() {
    demand(&[GROW, MERGE], false);
}

#[test]
fn law_a_killed_repair_goes_on() {
    demand(&[REPAIR], false);
}

#[test]
fn law_a_killed_training_or_search_goes_on() {
    demand(&[TRAIN, SEARCH], false);
}

#[test]
#[ignore = "every point: some minutes"]
fn law_every_kill_point_loses_nothing() {
    demand(&[GENERATE, GROW, FINALIZE, MERGE, REPAIR, TRAIN, SEARCH, TRAIN_BEGUN, SEARCH_BEGUN], true);
}
