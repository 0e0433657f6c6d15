//! The verbs under test: what each starts from, what is typed, and what an undisturbed run of it gives.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

use crate::tracer::{End, How, Tracer};
use crate::tree;

/// What a verb finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The config alone.
    Empty,
    /// All shards of 7 scenes, not yet merged.
    Unmerged,
    /// A corpus of 7 scenes.
    Corpus,
    /// The same, and the folders of a training and a search that were killed before their first file.
    Begun,
    /// The same, and the shards of 7 more scenes, not yet merged.
    Grown,
    /// The corpus, with a shard cut short and another one gone.
    Damaged,
    /// The corpus, a model that was trained on it, and a scan.
    Trained,
}

impl Start {
    /// What it is made from.
    fn below(self) -> Option<Start> {
        match self {
            Start::Empty => None,
            Start::Unmerged | Start::Corpus => Some(Start::Empty),
            Start::Begun | Start::Grown | Start::Damaged | Start::Trained => Some(Start::Corpus),
        }
    }
}

/// A verb under test. Each runs in a folder of its own, on one thread, so that its calls come in the same order every time.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    pub name: &'static str,
    pub start: Start,
    pub arguments: &'static str,
}

pub const GENERATE: Task =
    Task { name: "generate", start: Start::Empty, arguments: "generate crash.yaml --out corpus --threads 1" };
pub const GROW: Task = Task {
    name: "growth",
    start: Start::Corpus,
    arguments: "generate crash.yaml --out corpus --threads 1 --set scenes=14",
};
pub const FINALIZE: Task = Task { name: "finalize", start: Start::Unmerged, arguments: "finalize corpus" };
pub const MERGE: Task = Task { name: "finalize of a growth", start: Start::Grown, arguments: "finalize corpus" };
pub const REPAIR: Task =
    Task { name: "verify --repair", start: Start::Damaged, arguments: "verify corpus --repair --threads 1" };
pub const TRAIN: Task = Task {
    name: "train",
    start: Start::Corpus,
    arguments: "train corpus --out run --resume --threads 1 --prefetch 0 --set network.hidden=[2] --set epochs=3 \
                --set patience=100 --set validate_every=150",
};
pub const SEARCH: Task = Task {
    name: "search",
    start: Start::Corpus,
    arguments: "search corpus --out found --resume --threads 1 --widths 1,2 --layers 1 --rungs 2 --rows 200 \
                --validation-rows 50 --epochs 2 --set validate_every=50",
};
pub const TRAIN_BEGUN: Task = Task { name: "train in an empty folder", start: Start::Begun, ..TRAIN };
pub const SEARCH_BEGUN: Task = Task { name: "search in an empty folder", start: Start::Begun, ..SEARCH };
pub const EVALUATE: Task =
    Task { name: "evaluate", start: Start::Trained, arguments: "evaluate run corpus --out judged" };
pub const CLASSIFY: Task = Task {
    name: "classify",
    start: Start::Trained,
    arguments: "classify run scan.xyz --out labelled --pose 0,0,0,0,0,0",
};

/// The config as it was before a growth.
pub const OLD: &str = GENERATE.arguments;

/// A folder with all that tests start from; it goes away with the test.
pub struct Bench {
    folder: TempDir,
    tracer: &'static Tracer,
}

impl Bench {
    /// `None` where nothing can be traced.
    pub fn new() -> Option<Bench> {
        let tracer = Tracer::get()?;
        // In memory where there is such a place: what a loss of power takes is the tracer's to say, not the disk's.
        let memory = Path::new("/dev/shm");
        let folder = tempfile::tempdir_in(memory).or_else(|_| tempfile::tempdir()).expect("a temporary folder");
        Some(Bench { folder, tracer })
    }

    /// A new copy of what a task starts from, in the place of the last one.
    pub fn fresh(&self, start: Start) -> PathBuf {
        let work = self.folder.path().join("work");
        let _ = fs::remove_dir_all(&work);
        tree::copy(&self.started(start), &work);
        work
    }

    /// Runs a task, disturbed.
    pub fn disturbed(&self, task: &Task, how: How) -> (PathBuf, End) {
        let work = self.fresh(task.start);
        let end = self.tracer.run(&work, how, command(&work, task.arguments));
        (work, end)
    }

    fn started(&self, start: Start) -> PathBuf {
        let folder = self.folder.path().join(format!("{start:?}"));
        if !folder.exists() {
            let making = self.folder.path().join("making");
            if let Some(below) = start.below() {
                tree::copy(&self.started(below), &making);
            }
            make(start, &making);
            fs::rename(&making, &folder).expect("a name for what was made");
        }
        folder
    }
}

/// What a start adds to the one below it.
fn make(start: Start, folder: &Path) {
    let run = |arguments| {
        let output = run(folder, arguments);
        assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let shard = |number: usize| folder.join(format!("corpus/data/cells/train-{number:07}.parquet"));
    match start {
        Start::Empty => {
            fs::create_dir_all(folder).expect("a folder");
            let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/crash.yaml");
            fs::copy(config, folder.join("crash.yaml")).expect("the config");
        }
        Start::Unmerged => run("generate crash.yaml --out corpus --threads 1 --shards 0..7"),
        Start::Corpus => run(GENERATE.arguments),
        Start::Begun => ["run", "found"].iter().for_each(|name| {
            fs::create_dir(folder.join(name)).expect("an empty folder");
        }),
        Start::Grown => run("generate crash.yaml --out corpus --threads 1 --set scenes=14 --shards 7..14"),
        Start::Damaged => {
            let bytes = fs::read(shard(1)).expect("a shard");
            fs::write(shard(1), &bytes[..bytes.len() / 2]).expect("half a shard");
            fs::remove_file(shard(2)).expect("a shard to remove");
        }
        Start::Trained => {
            run(TRAIN.arguments);
            fs::write(folder.join("scan.xyz"), scan()).expect("a scan");
        }
    }
}

/// A floor of 4 m by 4 m, 0.5 m below the sensor, with a step in it.
fn scan() -> String {
    let at = |k: usize| 0.1 * k as f64 - 2.0;
    let height = |k: usize| if k > 30 { -0.2 } else { -0.5 };
    (0..1600).map(|k| (k / 40, k % 40)).map(|(x, y)| format!("{:.2} {:.2} {}\n", at(x), at(y), height(x))).collect()
}

/// Runs the binary in a folder, undisturbed.
pub fn run(folder: &Path, arguments: &str) -> Output {
    command(folder, arguments).output().expect("the binary starts")
}

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_marsyard"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command
}
