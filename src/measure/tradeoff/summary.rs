//! What was measured -> the report: spreads over scenes, errors added up, losses by pairs of seeds.

use super::Options;
use super::judging::TestScenes;
use super::learning::Trainings;
use super::measure::{Counts, Measured, PoseError, SceneMeasurement};
use super::missed::FALSE_SHARE;
use super::ranges::RangeErrors;
use super::recommend::recommend;
use super::report::{CellRow, DriveRow, Ended, PipelineRow, PoseRow, RangeRow, Report, Row, ShiftRow, StageRow, Told};
use super::rounds;
use super::settings::{OTHER_DRAWS, Settings, Side};
use super::worth::{Seeds, worth};
use crate::corpus::Build;
use crate::corpus::stats::RowMoments;
use crate::episode::StageTimes;
use crate::statistics::{Spread, quantile};

/// One row a setting, and the verdicts.
pub(super) fn report(
    options: &Options,
    settings: &Settings,
    measured: &Measured,
    test: &TestScenes,
    trainings: &[Option<Trainings>],
    rounds: u64,
) -> Report {
    let plan = settings.reference();
    let deviations = deviations(measured);
    let seeds = Seeds { all: (options.seeds * rounds) as usize, per_round: options.seeds as usize };
    let (worths, variance_ratio) = worth(settings, measured, test, trainings, seeds);
    let rows = settings.list.iter().zip(worths).enumerate().map(|(k, (setting, worth))| Row {
        side: setting.side(),
        group: setting.group,
        name: setting.name.clone(),
        sets: setting.sets.clone(),
        may_be_recommended: setting.may_be_recommended(plan),
        pipeline: (setting.side() != Side::Trainer).then(|| pipeline_row(measured, k, &deviations)),
        worth,
    });
    let mut rows: Vec<Row> = rows.collect();
    let noise_floor = tell_apart(&mut rows);
    let build = Build::of_this_binary();
    Report {
        marsyard_tradeoff: 3,
        version: build.version.clone(),
        commit: build.commit.clone(),
        name: plan.name.clone(),
        scene_plan_hash: plan.scene_plan_hash(),
        sets: options.sets.clone(),
        scenes: measured.scenes.len() as u64,
        test: test.groups.clone(),
        false_share: FALSE_SHARE,
        threads: options.threads as u64,
        seeds: options.seeds * rounds,
        rounds,
        ended: Ended::Once,
        resolve: options.resolve,
        widest: rounds::widest(&rows),
        noise_floor,
        variance_ratio,
        recommended_pipeline: recommend(&rows, Side::Pipeline),
        recommended_filter: recommend(&rows, Side::Trainer),
        features: measured.features.clone(),
        rows,
        refused: settings.refused.clone(),
    }
}

/// Tells no gain apart that other draws of the reference alone have too. The trainer's settings share all scenes and need no such floor.
fn tell_apart(rows: &mut [Row]) -> Option<f64> {
    let other = rows.iter().find(|row| row.name == OTHER_DRAWS);
    let floor = other.and_then(Row::gain).map(|gain| gain.balanced_accuracy.mean.abs());
    let built = rows.iter_mut().filter(|row| row.side != Side::Trainer && row.name != OTHER_DRAWS);
    for gain in built.filter_map(|row| row.worth.as_mut()?.gain.as_mut()) {
        gain.told = Told::of(&gain.balanced_accuracy, floor);
    }
    floor
}

/// Standard deviation of each feature over the reference's cells of all scenes.
fn deviations(measured: &Measured) -> Vec<f64> {
    let mut moments = RowMoments::new(measured.features.len());
    for made in measured.scenes.iter().filter_map(|scene| scene[0].as_ref().ok()) {
        moments.add(&made.cells.features);
    }
    moments.moments().map(|moments| moments.variance().sqrt()).collect()
}

fn pipeline_row(measured: &Measured, setting: usize, deviations: &[f64]) -> PipelineRow {
    let of_scenes = || measured.scenes.iter().map(|scene| &scene[setting]);
    let made: Vec<&SceneMeasurement> = of_scenes().filter_map(|made| made.as_ref().ok()).collect();
    let per_scan = |value: &dyn Fn(&SceneMeasurement) -> f64| -> Vec<f64> {
        made.iter().filter(|made| made.scans > 0).map(|made| value(made) / made.scans as f64).collect()
    };
    let ms = |value: &dyn Fn(&SceneMeasurement) -> f64| Spread::of(&per_scan(&|made| 1e3 * value(made)));
    let stages = StageTimes::STAGES.iter().enumerate().map(|(k, (_, name))| StageRow {
        stage: (*name).into(),
        cpu_ms: ms(&|made| made.costs.stages[k].cpu),
        wall_ms: ms(&|made| made.costs.stages[k].wall),
    });
    let scans: usize = made.iter().map(|made| made.scans).sum();
    let count = |of: &dyn Fn(&Counts) -> u64| made.iter().map(|made| of(&made.counts)).sum::<u64>();
    let known = count(&|counts| counts.traversable + counts.untraversable);
    let share = |count: u64, of: u64| (of > 0).then(|| count as f64 / of as f64);
    PipelineRow {
        scenes: made.len() as u64,
        failed: of_scenes().filter(|made| made.is_err()).count() as u64,
        cpu_ms: ms(&|made| made.costs.whole.cpu),
        wall_ms: ms(&|made| made.costs.whole.wall),
        stages: stages.collect(),
        rays_per_scan: quantile(&per_scan(&|made| made.costs.rays as f64), 0.5),
        ranges: range_row(&made),
        pose: pose_row(&made),
        drive: drive_row(&made),
        cells: cell_row(&made, &measured.features, deviations),
        untraversable: share(count(&|counts| counts.untraversable), known),
        cells_per_scan: share(known + count(&|counts| counts.unknown), scans as u64),
    }
}

fn range_row(made: &[&SceneMeasurement]) -> Option<RangeRow> {
    let mut sum: Option<RangeErrors> = None;
    for errors in made.iter().filter_map(|made| made.ranges.as_ref()) {
        sum.get_or_insert_default().merge(errors);
    }
    let sum = sum?;
    Some(RangeRow {
        rays: sum.rays,
        median_m: sum.quantile_m(0.5),
        p99_m: sum.quantile_m(0.99),
        max_m: sum.max_m,
        missed: sum.missed,
        invented: sum.invented,
        other_object: sum.other_object,
    })
}

fn pose_row(made: &[&SceneMeasurement]) -> Option<PoseRow> {
    let poses: Vec<_> = made.iter().flat_map(|made| &made.poses).collect();
    let of_each = |value: &dyn Fn(&PoseError) -> f64| -> Vec<f64> { poses.iter().map(|p| value(p)).collect() };
    let nees: Vec<f64> = poses.iter().filter_map(|pose| pose.nees).collect();
    (!poses.is_empty()).then(|| PoseRow {
        scans: poses.len() as u64,
        position_m: Spread::of(&of_each(&|pose| pose.position_m)),
        heading_deg: Spread::of(&of_each(&|pose| pose.heading_rad.to_degrees())),
        mean_nees: (!nees.is_empty()).then(|| nees.iter().sum::<f64>() / nees.len() as f64),
        nees: Spread::of(&nees),
    })
}

fn drive_row(made: &[&SceneMeasurement]) -> Option<DriveRow> {
    let shifts: Vec<_> =
        made.iter().filter_map(|made| made.against.as_ref()).flat_map(|against| &against.drive).collect();
    let positions: Vec<f64> = shifts.iter().map(|shift| shift.position_m).collect();
    let turns: Vec<f64> = shifts.iter().map(|shift| shift.turn_rad.to_degrees()).collect();
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    (!shifts.is_empty()).then(|| DriveRow {
        median_position_m: quantile(&positions, 0.5),
        max_position_m: most(&positions),
        median_turn_deg: quantile(&turns, 0.5),
        max_turn_deg: most(&turns),
    })
}

fn cell_row(made: &[&SceneMeasurement], features: &[String], deviations: &[f64]) -> Option<CellRow> {
    let mut compared = made.iter().filter_map(|made| made.against.as_ref()).map(|against| &against.cells);
    let mut sum = compared.next()?.clone();
    compared.for_each(|change| sum.merge(change));
    let count = sum.matched.max(1) as f64;
    // A feature that never varies has no deviation to shift by.
    let in_sd = |value: f64, sd: f64| if sd > 0.0 { value / sd } else { 0.0 };
    let shifts: Vec<ShiftRow> = features
        .iter()
        .zip(deviations)
        .enumerate()
        .map(|(k, (feature, &sd))| ShiftRow {
            feature: feature.clone(),
            mean_sd: in_sd(sum.shift[k] / count, sd),
            rms_sd: in_sd((sum.shift_squared[k] / count).sqrt(), sd),
        })
        .collect();
    let worst = shifts.iter().max_by(|a, b| a.rms_sd.total_cmp(&b.rms_sd))?;
    Some(CellRow {
        matched: sum.matched,
        appeared: sum.appeared,
        vanished: sum.vanished,
        other_label: sum.other_label as f64 / count,
        scenes_of_another_attempt: made.iter().filter(|made| made.against.is_none()).count() as u64,
        worst_feature: worst.feature.clone(),
        worst_shift_sd: worst.rms_sd,
        shifts,
    })
}
