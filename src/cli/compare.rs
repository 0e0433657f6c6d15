//! Two corpora, or a corpus and a config -> where they differ, told; the exit code says whether.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Failure;
use super::options::plan_of;
use super::output::out;
use super::place;
use crate::corpus::compare::{Comparison, Side, compare};
use crate::corpus::{Finished, documents};
use crate::plan::Plan;

/// The exit codes, as `--help` says them.
pub(super) const CODES: &str = "Exit codes, as of diff: 0 nothing differs, 1 something differs, 2 one of them could not be read, 75 try again (storage)";

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Folder or URL of a finished corpus; or a config or plan.yaml, of which the keys alone are compared.
    a: PathBuf,
    /// The other.
    b: PathBuf,
    /// Print one JSON document (schemas/comparison.schema.json) instead of text.
    #[arg(long)]
    json: bool,
}

/// What was named, read.
struct Read {
    plan: Plan,
    corpus: Option<Finished>,
}

fn read(at: &Path) -> Result<Read, Failure> {
    let read = || match plan_of(at, &[])? {
        (plan, None) => Ok(Read { plan, corpus: None }),
        (_, Some(place)) => Ok(Read { corpus: Some(place::finished(place)?), plan: place::finished_plan(place)? }),
    };
    // 1 says that they differ.
    read().map_err(|failure: Failure| match failure.code {
        Failure::FAILED => Failure { code: Failure::USAGE, ..failure },
        _ => failure,
    })
}

pub(super) fn run(args: &CompareArgs) -> Result<(), Failure> {
    let (a, b) = (read(&args.a)?, read(&args.b)?);
    let names = [&args.a, &args.b].map(|at| at.display().to_string());
    let (plans, hashes) =
        ([&a, &b].map(|read| read.plan.to_document()), [&a, &b].map(|read| read.plan.scene_plan_hash()));
    let side = |k: usize, corpus| Side { at: &names[k], plan: &plans[k], scene_plan_hash: &hashes[k], corpus };
    let comparison = compare(side(0, a.corpus.as_ref()), side(1, b.corpus.as_ref()));
    if args.json {
        out!("{}", documents::text(&comparison));
    } else {
        out!("{comparison}");
    }
    if comparison.is_equal { Ok(()) } else { Err(differing(&comparison)) }
}

fn differing(comparison: &Comparison) -> Failure {
    let keys = match comparison.keys.len() {
        1 => "1 key differs".into(),
        count => format!("{count} keys differ"),
    };
    Failure::failed(format!("{} and {} differ: {keys}", comparison.at.a, comparison.at.b))
}
