//! How a build ended -> words and an exit code: what `generate`, `finalize`, `verify --repair` and `verify --rebuild` say alike.

use super::Failure;
use super::output::printable;
use super::place::corpus_failure;
use crate::build::{BuildError, CorpusBuildError};
use crate::corpus::Manifest;
use crate::corpus::stats::PointCounts;
use crate::plan::{Plan, Table};

/// Why a build failed; `replay` gives the command that replays a scene.
pub(super) fn build_failure(error: CorpusBuildError, replay: &dyn Fn(u64) -> String) -> Failure {
    match error {
        CorpusBuildError::Corpus(error) => corpus_failure(error),
        CorpusBuildError::Build(BuildError::Write(error)) => corpus_failure(error),
        CorpusBuildError::Build(BuildError::Unsteady { scene, .. }) => {
            let help = format!("replay: {}", replay(scene));
            Failure::new(Failure::TRY_AGAIN, miette::miette!(help = help, "{error}"))
        }
        CorpusBuildError::Build(BuildError::Threads(_)) => {
            Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string()))
        }
        CorpusBuildError::Gone { .. } => Failure::new(
            Failure::TRY_AGAIN,
            miette::miette!(help = "the same command again builds them anew", "{error}"),
        ),
        CorpusBuildError::Selection(why) => Failure::usage(miette::miette!("--shards {why}")),
        error => Failure::failed(error),
    }
}

/// What a build that was asked to stop says.
pub(super) fn interrupted() -> Failure {
    Failure::new(
        Failure::TRY_AGAIN,
        miette::miette!(
            help = "the same command again goes on from here",
            "interrupted: shards that are whole are kept, others were discarded"
        ),
    )
}

/// Refuses a finished corpus of which too many scenes failed, or which holds no cell.
pub(super) fn judge_corpus(plan: &Plan, manifest: &Manifest) -> Result<(), Failure> {
    let (failed, scenes) = (manifest.failed.len() as u64, manifest.scenes);
    if let Some(first) = manifest.too_many_failed(plan.max_failed_share) {
        return Err(Failure::failed(format!(
            "{failed} of {scenes} scenes failed, more than max_failed_share = {}; the first: scene {}: {}; replay, in the corpus folder: {}",
            plan.max_failed_share,
            first.scene,
            printable(&first.error),
            first.replay
        )));
    }
    match manifest.tables.get(&Table::Cells) {
        Some(cells) if cells.rows == 0 && failed < scenes => Err(no_cells(scenes - failed, &manifest.points)),
        _ => Ok(()),
    }
}

/// Scenes that were made, and of which no sweep fell into a cell.
fn no_cells(scenes: u64, points: &PointCounts) -> Failure {
    let (PointCounts { points_in, beyond_range, off_grid, .. }, left_out) = (*points, points.words_left_out());
    let (why, help) = if points_in == 0 {
        (
            "no beam of a kept sweep came back".to_string(),
            "look at where the sensor is and where it points (rover.mount, sweep.mount), at its max_range_m and at sweep.effects; \
             `marsyard preview CONFIG --scene 0` draws it",
        )
    } else if points.without_ground == points_in {
        (
            format!("in no sweep was a plane found to level its points by: {points_in} points are without ground"),
            "look at the height of the sensor (rover.mount, sweep.mount) and at how much ground it sees, or take \
             cells.frame: estimated_pose",
        )
    } else {
        (
            format!(
                "of {points_in} points {beyond_range} lie beyond cells.max_range_m and {off_grid} off the grid{left_out}"
            ),
            "raise cells.max_range_m, or bring the sensor nearer to the ground",
        )
    };
    Failure::new(
        Failure::FAILED,
        miette::miette!(help = help, "{scenes} scenes gave 0 cells, so there is nothing to learn from: {why}"),
    )
}
