//! A measurement of worth -> the file that plans are made from, and back: `study.json`.
//!
//! In: a report of `tradeoff`, or the file. Out: the learning curves of the settings that a corpus may be built with: scenes, seconds of CPU
//! of one thread, balanced accuracy (shares, not percent). Refused: files of another format, of one training (which has no interval), and
//! of numbers that no measurement gives.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::tradeoff::report::Told;
use super::tradeoff::settings::Side;
use super::tradeoff::{Report, inputs};
use crate::plan::Plan;
use crate::statistics::Interval;
use crate::train::{TrainParams, as_noted_now};

/// Version of the file's format.
const FORMAT: u32 = 4;
/// The oldest that is read: its settings do not say what they gain; those of format 3 not what they gain of few scenes.
const OLDEST: u32 = 2;

/// The file `study.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Study {
    pub marsyard_study: u32,
    pub version: String,
    pub commit: String,
    pub name: String,
    /// Of the plan that the settings are compared with: the config at `fidelity: reference`.
    pub scene_plan_hash: String,
    /// Overrides that hold at every setting.
    pub sets: Vec<String>,
    /// What accuracy is of, in words, and of how many scenes.
    pub judged_by: String,
    pub test_scenes: u64,
    pub seeds: u64,
    /// How the networks were trained, every key.
    pub training: serde_json::Value,
    /// What the networks read; empty in files that do not say.
    #[serde(default)]
    pub features: Vec<String>,
    /// The reference first.
    pub settings: Vec<StudySetting>,
    /// Which of them is the config as it is asked for; `None` where none is, or nobody looked.
    #[serde(skip)]
    pub written: Option<usize>,
    /// Whether what is told and gained is of as few scenes as all settings are compared at ([`Study::of_few_scenes`]).
    #[serde(skip)]
    pub tells_few_scenes: bool,
}

/// What every version of the file has.
#[derive(Deserialize)]
struct Version {
    marsyard_study: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudySetting {
    pub name: String,
    /// Overrides of the config.
    pub sets: Vec<String>,
    /// Against the reference at equal CPU, on the most scenes that both were measured at; `None` for the reference, and where no cost is common.
    pub told: Option<Told>,
    /// By how much, as a share; `None` where nothing is told, and in files of format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<Interval>,
    /// What is told of the sizes at which all settings are compared, where it was followed to more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_few_scenes: Option<OfFewScenes>,
    /// Ascending in scenes: those at which all settings are compared, and of some more.
    pub sizes: Vec<StudySize>,
}

/// Against the reference at the largest equal CPU of the sizes at which all settings are compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OfFewScenes {
    pub told: Told,
    pub gain: Interval,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudySize {
    /// That train and that stop.
    pub scenes: u64,
    pub generate_cpu_s: f64,
    pub train_cpu_s: f64,
    /// Cells to learn, and cells learnt, later passes counted again: means of the trainings.
    pub train_rows: f64,
    pub rows_learnt: f64,
    /// With its interval over test scenes and trainings.
    pub balanced_accuracy: Interval,
    /// Of each training.
    pub by_seed: Vec<f64>,
}

impl StudySetting {
    /// Rows of a scene over those of the same scenes at another setting, by the most scenes that both were measured at.
    pub(crate) fn rows_beside(&self, other: &StudySetting) -> f64 {
        let common = self.sizes.iter().zip(&other.sizes).rfind(|(own, of_other)| own.scenes == of_other.scenes);
        common.map_or(1.0, |(own, of_other)| own.train_rows / of_other.train_rows)
    }

    /// The most scenes that it was measured at. A study that was read or made has sizes at every setting.
    pub(crate) fn largest(&self) -> &StudySize {
        &self.sizes[self.sizes.len() - 1]
    }

    /// CPU seconds of making a scene.
    pub(crate) fn scene_cpu_s(&self) -> f64 {
        let largest = self.largest();
        largest.generate_cpu_s / largest.scenes as f64
    }
}

/// Why there is no study.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StudyError {
    #[error("there is no study of {name}: looked for {}", .tried.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" and "))]
    None { name: String, tried: Vec<PathBuf> },
    #[error("{place}: {reason}")]
    Unreadable { place: String, reason: String },
}

impl Study {
    /// Of what may be recommended alone. `None` where the reference has no curve, or nothing could be trained.
    pub(crate) fn of(report: &Report) -> Option<Study> {
        report.side(Side::Pipeline).next()?.worth.as_ref()?;
        let rows = report.side(Side::Pipeline).filter(|row| row.may_be_recommended);
        let settings = rows.filter_map(|row| {
            let worth = row.worth.as_ref()?;
            let sizes = worth.curve.iter().chain(&worth.farther).map(|size| StudySize {
                scenes: size.scenes,
                generate_cpu_s: size.generate_cpu_s,
                train_cpu_s: size.train_cpu_s,
                train_rows: size.train_rows,
                rows_learnt: size.rows_learnt,
                balanced_accuracy: size.balanced_accuracy,
                by_seed: size.by_seed.clone(),
            });
            let gain = row.last_gain().map(|gain| gain.balanced_accuracy);
            let of_few = worth.gain.as_ref().filter(|_| worth.farther_gain.is_some());
            let of_few_scenes = of_few.map(|gain| OfFewScenes { told: gain.told, gain: gain.balanced_accuracy });
            let (name, sets) = (row.label(), row.sets.clone());
            Some(StudySetting { name, sets, told: row.told(), gain, of_few_scenes, sizes: sizes.collect() })
        });
        let settings: Vec<StudySetting> = settings.collect();
        (!settings.is_empty()).then(|| Study {
            marsyard_study: FORMAT,
            version: report.version.clone(),
            commit: report.commit.clone(),
            name: report.name.clone(),
            scene_plan_hash: report.scene_plan_hash.clone(),
            sets: report.sets.clone(),
            judged_by: report.judged_by(),
            test_scenes: report.test.iter().filter(|group| group.judges).map(|group| group.scenes).sum(),
            seeds: report.seeds,
            training: usual_training(),
            features: report.features.clone(),
            settings,
            written: None,
            tells_few_scenes: false,
        })
    }

    /// What it tells of as few scenes as all settings are compared at: there a cheaper scene may be worth more than it is where there are many.
    pub(crate) fn of_few_scenes(mut self) -> Study {
        for setting in &mut self.settings {
            if let Some(of_few) = setting.of_few_scenes {
                (setting.told, setting.gain) = (Some(of_few.told), Some(of_few.gain));
            }
        }
        self.tells_few_scenes = true;
        self
    }

    /// The config as it is written; the reference in its place, where that is told to be worse.
    pub(crate) fn as_planned(&self) -> &StudySetting {
        let written = self.as_written();
        if written.told == Some(Told::Worse) { &self.settings[0] } else { written }
    }

    /// Whether its networks were trained as `train` does it by default now, on the columns that it takes of such a plan's cells; what an
    /// earlier marsyard did not note, it did not do.
    pub(crate) fn is_trained_as_now(&self, plan: &Plan) -> bool {
        as_noted_now(&self.training) == usual_training() && self.features == inputs(plan).0
    }

    /// The config as it is written; where it is the reference itself, or none of the settings, that.
    pub(crate) fn as_written(&self) -> &StudySetting {
        let found = self.written.and_then(|index| self.settings.get(index));
        found.or_else(|| self.settings.iter().find(|setting| setting.sets.is_empty())).unwrap_or(&self.settings[0])
    }

    /// The study of a config: the one that `tradeoff` wrote where it writes by itself, else the one that lies beside the config.
    pub(crate) fn find(config: &Path, name: &str) -> Result<(PathBuf, Study), StudyError> {
        let own = Path::new("tradeoffs").join(name).join("study.json");
        let shipped = config.with_file_name("studies").join(format!("{name}.json"));
        let tried = vec![own, shipped];
        match tried.iter().find(|path| path.is_file()) {
            Some(path) => Ok((path.clone(), Study::read(path)?)),
            None => Err(StudyError::None { name: name.to_owned(), tried }),
        }
    }

    pub(crate) fn read(path: &Path) -> Result<Study, StudyError> {
        let unreadable = |reason: String| StudyError::Unreadable { place: path.display().to_string(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| unreadable(error.to_string()))?;
        let is_none = |error: serde_json::Error| unreadable(format!("is no study: {error}"));
        // The version first: what another one lacks is no fault of the file.
        let version = serde_json::from_str::<Version>(&text).map_err(is_none)?.marsyard_study;
        if !(OLDEST..=FORMAT).contains(&version) {
            return Err(unreadable(format!(
                "is a study of format {version}, and this program reads {OLDEST} to {FORMAT}"
            )));
        }
        let study: Study = serde_json::from_str(&text).map_err(is_none)?;
        match study.fault() {
            Some(fault) => Err(unreadable(fault)),
            None => Ok(study),
        }
    }

    /// What makes it of no use.
    pub(crate) fn fault(&self) -> Option<String> {
        if self.seeds < 2 {
            return Some("is of one training a size, which has no interval: make it with --seeds 2 or more".into());
        }
        if self.settings.is_empty() {
            return Some("holds no setting".into());
        }
        for setting in &self.settings {
            let is_sound = |size: &StudySize| {
                let numbers = [size.generate_cpu_s, size.train_cpu_s, size.train_rows, size.rows_learnt];
                size.scenes > 0
                    && numbers.iter().all(|number| number.is_finite() && *number > 0.0)
                    && (0.0..=1.0).contains(&size.balanced_accuracy.mean)
                    && (0.0..=1.0).contains(&size.balanced_accuracy.half_width.min(1.0))
                    && size.by_seed.len() == self.seeds as usize
            };
            let grows = setting
                .sizes
                .windows(2)
                .all(|pair| pair[0].scenes < pair[1].scenes && pair[0].train_rows < pair[1].train_rows);
            if setting.sizes.len() < 3 || !grows || !setting.sizes.iter().all(is_sound) {
                return Some(format!(
                    "setting '{}': a curve needs three sizes or more, ascending in scenes and rows, with times and rows above 0, accuracies in [0, 1] \
                     and {} trainings each; `marsyard tradeoff` writes such",
                    setting.name, self.seeds
                ));
            }
            let first = &self.settings[0];
            let other = setting.sizes.iter().zip(&first.sizes).find(|(own, other)| own.scenes != other.scenes);
            if let Some((own, other)) = other {
                return Some(format!(
                    "setting '{}' has a size of {} scenes where '{}' has one of {}: all settings of a study are measured at the same, some at more",
                    setting.name, own.scenes, first.name, other.scenes
                ));
            }
        }
        None
    }
}

/// How `train` trains where nothing is said, and `tradeoff` each setting but those of filters.
fn usual_training() -> serde_json::Value {
    serde_json::to_value(TrainParams::default()).expect("finite numbers and text keys")
}

#[cfg(test)]
pub(crate) mod tests;
