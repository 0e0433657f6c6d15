//! A report -> `tradeoff.parquet`: one row a setting.

use super::report::{CurveRow, PipelineRow, Report, Row};
use crate::corpus::CorpusError;
use crate::corpus::plain::{PlainColumn, Values, plain_table};
use crate::statistics::Spread;

/// The bytes of the file.
pub(crate) fn parquet(report: &Report) -> Result<Vec<u8>, CorpusError> {
    plain_table("tradeoff", &columns(report))
}

fn columns(report: &Report) -> Vec<PlainColumn> {
    let mut table = Table { rows: &report.rows, columns: Vec::new() };
    table.text("side", "What is chosen: pipeline, yard (no error) or trainer.", |row| Some(word(&row.side)));
    table.text("group", "The knob; null for a reference.", |row| row.group.map(|group| group.name().to_owned()));
    table.text("name", "The setting.", |row| Some(row.name.clone()));
    table.text("sets", "What it overrides in the config (or the training config).", |row| Some(row.sets.join(" ")));
    table.flag("may_be_recommended", "Not another yard, and not poses that no rover knows.", |row| {
        Some(row.may_be_recommended)
    });
    table.whole("scenes", "Scenes made.", |p| Some(p.scenes));
    table.whole("failed_scenes", "Scenes that could not be made.", |p| Some(p.failed));
    table.spread("cpu_s", "CPU time of the thread a kept scan, over scenes", |p| p.cpu_ms);
    table.spread("wall_s", "Wall time a kept scan, over scenes", |p| p.wall_ms);
    let stages = report.rows.first().and_then(|row| row.pipeline.as_ref()).map_or(&[][..], |p| &p.stages);
    for (k, stage) in stages.iter().enumerate() {
        let about = |what: &str| format!("{what} of the {} stage a kept scan, over scenes", stage.stage);
        let of = |p: &PipelineRow| p.stages.get(k).cloned();
        table.spread(&format!("{}_cpu_s", stage.stage), &about("CPU time"), |p| of(p)?.cpu_ms);
        table.spread(&format!("{}_wall_s", stage.stage), &about("Wall time"), |p| of(p)?.wall_ms);
    }
    table.number("rays_per_scan", "1", "Beams cast a kept scan, median over scenes.", |p| p.rays_per_scan);
    table.whole("range_rays", "Beams cast both exactly and by the setting.", |p| Some(p.ranges.as_ref()?.rays));
    table.number("range_median_m", "m", "Median range error, before noise.", |p| p.ranges.as_ref()?.median_m);
    table.number("range_p99_m", "m", "99 % of the range errors are below.", |p| p.ranges.as_ref()?.p99_m);
    table.number("range_max_m", "m", "Greatest range error.", |p| Some(p.ranges.as_ref()?.max_m));
    table.whole("range_missed", "Hits of the exact cast that were missed.", |p| Some(p.ranges.as_ref()?.missed));
    table.whole("range_invented", "Hits that the exact cast does not have.", |p| Some(p.ranges.as_ref()?.invented));
    table.whole("range_other_object", "Hits of another object.", |p| Some(p.ranges.as_ref()?.other_object));
    let position = |p: &PipelineRow| p.pose.as_ref()?.position_m;
    table.number("position_error_m", "m", "Position error, median over scans.", |p| Some(position(p)?.median));
    let about = "Heading error, median over scans.";
    table.number("heading_error_rad", "rad", about, |p| Some(p.pose.as_ref()?.heading_deg?.median.to_radians()));
    table.number("mean_nees", "1", "Normalised estimation error squared; 6 is honest.", |p| p.pose.as_ref()?.mean_nees);
    let about = "Greatest distance between the rover's true place here and at the reference.";
    table.number("drive_moved_m", "m", about, |p| Some(p.drive.as_ref()?.max_position_m));
    table.number("drive_turned_rad", "rad", "Greatest angle between the two.", |p| {
        Some(p.drive.as_ref()?.max_turn_deg.to_radians())
    });
    table.whole("cells_matched", "Cells that both have.", |p| Some(p.cells.as_ref()?.matched));
    table.whole("cells_appeared", "Cells that the reference lacks.", |p| Some(p.cells.as_ref()?.appeared));
    table.whole("cells_vanished", "Cells that only the reference has.", |p| Some(p.cells.as_ref()?.vanished));
    table.number("labels_changed", "1", "Share of the matched cells.", |p| Some(p.cells.as_ref()?.other_label));
    let about = "Scenes whose kept scan is another attempt's.";
    table.whole("scenes_of_another_attempt", about, |p| Some(p.cells.as_ref()?.scenes_of_another_attempt));
    table.number("worst_shift_sd", "1", "Root mean square shift of the feature that shifted most.", |p| {
        Some(p.cells.as_ref()?.worst_shift_sd)
    });
    for (k, feature) in report.features.iter().enumerate() {
        let about = "Root mean square shift, in the reference's standard deviations.";
        table.number(&format!("shift_sd.{feature}"), "1", about, |p| Some(p.cells.as_ref()?.shifts.get(k)?.rms_sd));
    }
    table.number("untraversable_share", "1", "Share of the setting's cells.", |p| p.untraversable);
    table.number("cells_per_scan", "1", "Mean over its scans.", |p| p.cells_per_scan);
    table.worth();
    table.columns
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// A value's name as JSON writes it.
fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|json| json.as_str().map(str::to_owned)).unwrap_or_default()
}

struct Table<'a> {
    rows: &'a [Row],
    columns: Vec<PlainColumn>,
}

impl Table<'_> {
    fn add(&mut self, name: &str, unit: &'static str, description: &str, values: Values) {
        self.columns.push(PlainColumn { name: name.into(), unit, description: description.into(), values });
    }

    fn text(&mut self, name: &str, about: &str, value: impl Fn(&Row) -> Option<String>) {
        self.add(name, "1", about, Values::Text(self.rows.iter().map(value).collect()));
    }

    fn flag(&mut self, name: &str, about: &str, value: impl Fn(&Row) -> Option<bool>) {
        self.add(name, "1", about, Values::Flag(self.rows.iter().map(value).collect()));
    }

    fn column(&mut self, name: &str, unit: &'static str, about: &str, value: impl Fn(&Row) -> Option<f64>) {
        self.add(name, unit, about, Values::Number(self.rows.iter().map(value).collect()));
    }

    /// The learning curve by size, and the gain at equal CPU.
    fn worth(&mut self) {
        for (k, share) in ["eighth", "quarter", "half", "whole"].into_iter().enumerate() {
            let size = move |row: &Row| row.worth.as_ref()?.curve.get(k).cloned();
            let mut add = |name: &str, unit: &'static str, about: &str, value: &dyn Fn(CurveRow) -> Option<f64>| {
                let about = format!("{about} ({share} of the scenes).");
                self.column(&format!("{share}.{name}"), unit, &about, |row| value(size(row)?));
            };
            add("scenes", "1", "Scenes that train and that stop", &|size| Some(size.scenes as f64));
            add("train_rows", "1", "Cells to learn", &|size| Some(size.train_rows));
            add("rows_learnt", "1", "Cells learnt, later epochs counted again", &|size| Some(size.rows_learnt));
            add("generate_cpu_s", "s", "CPU time of making the scenes", &|size| Some(size.generate_cpu_s));
            add("train_cpu_s", "s", "CPU time of a training, mean over seeds", &|size| Some(size.train_cpu_s));
            let about = "On the common test scenes, mean over seeds";
            add("balanced_accuracy", "1", about, &|size| Some(size.balanced_accuracy.mean));
            let about = "Half width of its 95 % interval over scenes and trainings; null for one seed";
            add("balanced_accuracy_half_width", "1", about, &|size| finite(size.balanced_accuracy.half_width));
            add("worst_family", "1", "Balanced accuracy on the worst held-out family", &|size| {
                Some(size.worst?.balanced_accuracy)
            });
            add("missed", "1", "Share of the untraversable missed at 2 % false", &|size| Some(size.missed.mean));
            let about = "Half width of its 95 % interval over scenes and trainings; null for one seed";
            add("missed_half_width", "1", about, &|size| finite(size.missed.half_width));
        }
        self.column("equal_cpu_s", "s", "CPU time at which it is compared with the reference.", |row| {
            Some(row.gain()?.cpu_s)
        });
        self.column("equal_scenes", "1", "Scenes it has for that.", |row| Some(row.gain()?.scenes as f64));
        let about = "Scenes the reference has for that.";
        self.column("equal_reference_scenes", "1", about, |row| Some(row.gain()?.reference_scenes as f64));
        let about = "Balanced accuracy gained on the reference at equal CPU.";
        self.column("gain", "1", about, |row| Some(row.gain()?.balanced_accuracy.mean));
        let about = "Half width of its 95 % interval over scenes and trainings; null for one seed.";
        self.column("gain_half_width", "1", about, |row| finite(row.gain()?.balanced_accuracy.half_width));
        let about = "Share of the untraversable missed less than by the reference, at 2 % false and equal CPU.";
        self.column("fewer_missed", "1", about, |row| Some(row.gain()?.fewer_missed.mean));
        let about = "Half width of its 95 % interval over scenes and trainings; null for one seed.";
        self.column("fewer_missed_half_width", "1", about, |row| finite(row.gain()?.fewer_missed.half_width));
        self.text("told", "better, worse, not_apart or one_seed; null for a reference.", |row| {
            Some(word(&row.gain()?.told))
        });
        let about = "Scenes from which on more bring at most half a point.";
        self.column("flat_from_scenes", "1", about, |row| Some(row.worth.as_ref()?.flat_from? as f64));
    }

    fn whole(&mut self, name: &str, about: &str, value: impl Fn(&PipelineRow) -> Option<u64>) {
        let of = |row: &Row| row.pipeline.as_ref().and_then(&value).map(|count| count as i64);
        self.add(name, "1", about, Values::Whole(self.rows.iter().map(of).collect()));
    }

    fn number(&mut self, name: &str, unit: &'static str, about: &str, value: impl Fn(&PipelineRow) -> Option<f64>) {
        self.column(name, unit, about, |row| row.pipeline.as_ref().and_then(&value));
    }

    /// Median and quartiles of times kept in milliseconds.
    fn spread(&mut self, name: &str, about: &str, value: impl Fn(&PipelineRow) -> Option<Spread>) {
        let base = name.strip_suffix("_s").unwrap_or(name);
        self.number(&format!("{base}_median_s"), "s", &format!("{about}: median."), |p| Some(1e-3 * value(p)?.median));
        self.number(&format!("{base}_q25_s"), "s", &format!("{about}: lower quartile."), |p| {
            Some(1e-3 * value(p)?.lower_quartile)
        });
        self.number(&format!("{base}_q75_s"), "s", &format!("{about}: upper quartile."), |p| {
            Some(1e-3 * value(p)?.upper_quartile)
        });
    }
}
