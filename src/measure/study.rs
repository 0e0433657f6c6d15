//! A measurement of worth -> the file that plans are made from, and back: `study.json`.
//!
//! In: a report of `tradeoff`, or the file. Out: the learning curves of the settings that a corpus may be built with: scenes, seconds of CPU
//! of one thread, balanced accuracy (shares, not percent). Refused: files of another format, of one training (which has no interval), and
//! of numbers that no measurement gives.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::tradeoff::Report;
use super::tradeoff::report::Told;
use super::tradeoff::settings::Side;
use crate::statistics::Interval;
use crate::train::{TrainParams, as_noted_now};

/// Version of the file's format.
const FORMAT: u32 = 2;

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
    /// The reference first.
    pub settings: Vec<StudySetting>,
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
    /// Against the reference at equal CPU; `None` for the reference, and where no cost is common.
    pub told: Option<Told>,
    /// Ascending in scenes.
    pub sizes: Vec<StudySize>,
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
    /// All its scenes. A study that was read or made has sizes at every setting.
    pub(crate) fn largest(&self) -> &StudySize {
        &self.sizes[self.sizes.len() - 1]
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
            let sizes = worth.curve.iter().map(|size| StudySize {
                scenes: size.scenes,
                generate_cpu_s: size.generate_cpu_s,
                train_cpu_s: size.train_cpu_s,
                train_rows: size.train_rows,
                rows_learnt: size.rows_learnt,
                balanced_accuracy: size.balanced_accuracy,
                by_seed: size.by_seed.clone(),
            });
            let told = worth.gain.as_ref().map(|gain| gain.told);
            Some(StudySetting { name: row.label(), sets: row.sets.clone(), told, sizes: sizes.collect() })
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
            settings,
        })
    }

    /// Whether its networks were trained as `train` does it by default now; what an earlier marsyard did not note, it did not do.
    pub(crate) fn is_trained_as_now(&self) -> bool {
        as_noted_now(&self.training) == usual_training()
    }

    /// The config as it is written; where it is the reference itself, that.
    pub(crate) fn as_written(&self) -> &StudySetting {
        self.settings.iter().find(|setting| setting.sets.is_empty()).unwrap_or(&self.settings[0])
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
        if version != FORMAT {
            return Err(unreadable(format!("is a study of format {version}, and this program reads {FORMAT}")));
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
            if setting.sizes.len() != first.sizes.len() {
                return Some(format!(
                    "setting '{}' has {} sizes and '{}' {}: all settings of a study are measured at as many",
                    setting.name,
                    setting.sizes.len(),
                    first.name,
                    first.sizes.len()
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
pub(crate) mod tests {
    use super::*;

    /// A setting whose error is `asymptote + slope / scenes`, at 16, 32, 64 and 128 scenes; seconds of a scene, and of learning one.
    pub(crate) fn setting(name: &str, told: Option<Told>, error: (f64, f64), seconds: (f64, f64)) -> StudySetting {
        let size = |scenes: u64| {
            let mean = 1.0 - error.0 - error.1 / scenes as f64;
            StudySize {
                scenes,
                generate_cpu_s: seconds.0 * scenes as f64,
                train_cpu_s: seconds.1 * scenes as f64,
                // Three passes, one of which is patience, however many scenes.
                train_rows: 1e6 * scenes as f64,
                rows_learnt: 3e6 * scenes as f64,
                balanced_accuracy: Interval { mean, half_width: 0.004 },
                by_seed: vec![mean - 0.001, mean, mean + 0.001],
            }
        };
        let sets = vec![format!("slam={name}")];
        StudySetting { name: name.into(), sets, told, sizes: [16, 32, 64, 128].map(size).into() }
    }

    pub(crate) fn study(settings: Vec<StudySetting>) -> Study {
        Study {
            marsyard_study: FORMAT,
            version: "0.1.0".into(),
            commit: "abc".into(),
            name: "small".into(),
            scene_plan_hash: "0".into(),
            sets: Vec::new(),
            judged_by: "unseen yards of the config".into(),
            test_scenes: 40,
            seeds: 3,
            training: usual_training(),
            settings,
        }
    }

    #[test]
    fn equal_the_studies_that_are_shipped_are_trained_as_train_does_it() {
        // A change of the default makes them stale: `python scripts/studies.py` makes them anew.
        for name in ["quickstart", "paper", "mixed", "mars"] {
            let (_, study) = Study::find(Path::new("configs").join(format!("{name}.yaml")).as_path(), name).unwrap();
            assert!(study.is_trained_as_now(), "{name}");
        }
    }

    #[test]
    fn law_what_no_measurement_gives_is_refused_with_the_reason() {
        let good = study(vec![setting("truth", None, (0.03, 1.0), (0.01, 0.01))]);
        assert_eq!(good.fault(), None);
        let broken = |change: fn(&mut Study)| {
            let mut study = good.clone();
            change(&mut study);
            study.fault().unwrap_or_default()
        };
        for (change, expected) in [
            ((|s| s.seeds = 1) as fn(&mut Study), "--seeds 2"),
            (|s| s.settings.clear(), "no setting"),
            (|s| s.settings[0].sizes.truncate(2), "three sizes"),
            (|s| s.settings[0].sizes[1].scenes = 4, "ascending"),
            (|s| s.settings[0].sizes[1].train_rows = s.settings[0].sizes[0].train_rows, "ascending in scenes and rows"),
            (|s| s.settings[0].sizes[1].train_cpu_s = f64::NAN, "times and rows above 0"),
            (|s| s.settings[0].sizes[1].by_seed.clear(), "3 trainings each"),
            (
                |s| {
                    let mut other = s.settings[0].clone();
                    other.sizes.pop();
                    s.settings.push(other);
                },
                "has 3 sizes and 'truth' 4",
            ),
        ] {
            assert!(broken(change).contains(expected), "{expected}: {}", broken(change));
        }
    }

    #[test]
    fn law_files_are_read_back_and_looked_for_in_two_places() {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("small.yaml");
        let missing = Study::find(&config, "small").unwrap_err().to_string();
        assert!(missing.contains("tradeoffs/small/study.json") && missing.contains("studies/small.json"), "{missing}");
        let good = study(vec![setting("truth", None, (0.03, 1.0), (0.01, 0.01))]);
        let path = folder.path().join("studies/small.json");
        std::fs::create_dir(folder.path().join("studies")).unwrap();
        std::fs::write(&path, serde_json::to_string(&good).unwrap()).unwrap();
        assert_eq!(Study::find(&config, "small").unwrap(), (path.clone(), good));
        for (text, told) in [("{}", "is no study"), (r#"{"marsyard_study": 1, "settings": []}"#, "format 1, and this")]
        {
            std::fs::write(&path, text).unwrap();
            let error = Study::find(&config, "small").unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
