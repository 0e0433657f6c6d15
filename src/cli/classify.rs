//! Judges real scans with a trained model, and writes what other tools read.

mod args;
mod load;
mod report;
mod write;

pub(super) use args::ClassifyArgs;

use super::Failure;
use super::evaluate::read_model;
use super::output::errln;
use super::place::{corpus_failure, must_be_local};
use crate::judge::{JudgeError, ScanJudge};

pub(super) fn run(args: &ClassifyArgs) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let model = read_model(&args.model)?;
    load::check_clouds(args)?;
    let mut judge = ScanJudge::new(&model, load::options(args, &model)?).map_err(failure)?;
    let poses = load::poses(args)?;
    poses.iter().try_for_each(|pose| judge.check_pose(pose)).map_err(failure)?;
    let stems = load::stems(&args.clouds);
    let mut outputs = write::open(args, &stems)?;
    report::assumed(args, &model, &judge);
    let (mut scans, mut written) = (Vec::new(), Vec::new());
    for (number, path) in args.clouds.iter().enumerate() {
        let cloud = load::cloud(args, path)?;
        let scan = judge.scan(&path.display().to_string(), cloud, poses.get(number)).map_err(failure)?;
        report::nowhere(judge.setup(), &scan);
        report::scan(args, &scan);
        written.extend(write::files(args, &mut outputs, write::scan(args, &stems[number], &scan)?)?);
        scans.push(scan.cells);
    }
    written.extend(write::files(args, &mut outputs, vec![write::cells(&judge, &scans)?])?);
    let has_cells = scans.iter().any(|judged| !judged.cells.rows.is_empty());
    if has_cells {
        report::ranges(args, &judge.outside_training(&scans));
        if let Some(evaluation) = judge.report(load::names(&args.clouds), &load::label_file(args)) {
            report::evaluation(args, &evaluation);
            written.extend(write::files(args, &mut outputs, vec![write::evaluation(&evaluation)])?);
        }
    }
    outputs.finish().map_err(corpus_failure)?;
    written.iter().for_each(|path| errln!("{}", path.display()));
    if has_cells {
        Ok(())
    } else {
        Err(Failure::failed("no point of any scan fell into a cell: the warnings above say why"))
    }
}

/// What was given is wrong, unless it is what came out that cannot be written.
fn failure(error: JudgeError) -> Failure {
    match error {
        JudgeError::MapTooLarge { .. } | JudgeError::Table(_) => Failure::failed(error),
        _ => Failure::usage(miette::Report::msg(error.to_string())),
    }
}
