//! What a budget is worth, in words, in JSON and as a config.
//!
//! In: the choices, the best first, with what they rest on. Out: standard output, and the file of `--write`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::json;

use super::budget::{TOLD, extrapolated};
use super::{PlanArgs, machine, machine_json, words};
use crate::cli::options::{typed_out, typed_sets};
use crate::cli::output::{errln, outln};
use crate::cli::place::write_named;
use crate::cli::progress::{counted, human, si};
use crate::cli::{Failure, config_failure};
use crate::config;
use crate::corpus::advice::Advice;
use crate::measure::budget::{BELIEVED_UP_TO, Bound, Choice, FLAT_TWICE};
use crate::measure::study::{Study, StudySetting};
use crate::measure::tradeoff::points;
use crate::measure::tradeoff::report::Told;
use crate::plan::Plan;
use crate::shell;
use crate::slam::SlamParams;

/// All that an answer is made of.
pub(super) struct Answer<'a> {
    pub args: &'a PlanArgs,
    pub plan: &'a Plan,
    pub study: &'a Study,
    pub study_file: &'a Path,
    pub hours: f64,
    pub cores: usize,
    pub disk_bytes: Option<f64>,
    /// The best first.
    pub choices: &'a [Choice<'a>],
    /// Names of the settings that scenes were made of here; others have the speed and the bytes a row of the reference. Rows are of its scenes for all.
    pub measured_here: Vec<String>,
    /// Overrides of the config that make the first choice.
    pub sets: Vec<String>,
    /// Where it is built.
    pub place: PathBuf,
    pub warnings: Vec<String>,
    /// What makes a corpus of the first choice weak, by the scenes that were made for the answer.
    pub advice: Vec<Advice>,
}

impl Answer<'_> {
    pub(super) fn tell(&self) {
        let disk = self.disk_bytes.map_or("any disk".into(), |bytes| format!("{}B of disk", si(bytes)));
        let rows = self.args.budget.rows.map_or(String::new(), |rows| format!(", {} rows", si(rows)));
        outln!(
            "{}: {} h on {}, {disk}{rows}; by {}: {}, the farthest up to {} scenes, judged on {} scenes, {}",
            self.plan.name,
            self.hours,
            counted(self.cores as u64, "core"),
            self.study_file.display(),
            counted(self.study.settings.len() as u64, "setting"),
            self.study.settings.iter().map(|setting| setting.largest().scenes).max().unwrap_or(0),
            self.study.test_scenes,
            self.study.judged_by
        );
        outln!(
            "measured here, on {}: rows, bytes, what learning a row takes, and how much slower a scene is made than in the study",
            machine()
        );
        if self.study.tells_few_scenes {
            outln!(
                "so little pays few scenes: what settings gain is told as the study has it of few, and may be gone of many"
            );
        }
        self.warnings.iter().for_each(|warning| outln!("warning: {warning}"));
        for (k, choice) in self.choices.iter().take(TOLD).enumerate() {
            self.tell_choice(if k == 0 { "build" } else { "next best" }, choice);
        }
        let cheaper = self.poses_not_told_worse();
        if !cheaper.is_empty() {
            let of = |(setting, told): &(&StudySetting, Told)| {
                format!("{} ({})", setting.name, if *told == Told::Better { "better" } else { "not told apart" })
            };
            let is_told = cheaper.iter().any(|(_, told)| *told == Told::Better);
            let head = if is_told {
                "to a network FastSLAM is not worth its cost"
            } else {
                "nothing shows that FastSLAM is worth its cost to a network"
            };
            outln!(
                "\n{head}, at the CPU seconds of the study: {}",
                cheaper.iter().map(of).collect::<Vec<_>>().join(", ")
            );
        }
        if !self.advice.is_empty() {
            let lines: Vec<String> = self.advice.iter().map(Advice::to_string).collect();
            outln!("\n{}", lines.join("\n"));
        }
        let sets = typed_sets(self.args.config.sets.iter().chain(&self.sets));
        outln!("");
        let usual = self.args.place(self.plan);
        if self.place != usual {
            outln!("{} holds something else, or more scenes; beside it:", usual.display());
        }
        let is_named = self.args.out.is_some() || self.place != usual;
        let out = if is_named { typed_out(&self.place) } else { String::new() };
        outln!("marsyard generate {}{sets}{out}", shell::word(self.args.config.config.display()));
        outln!("marsyard train {}", shell::quoted(self.place.display()));
    }

    fn tell_choice(&self, title: &str, choice: &Choice) {
        let time = |seconds: f64| human(Duration::from_secs_f64(seconds));
        outln!(
            "\n{title}: {} scenes at {} ({}): {} rows, {}B, {} to generate on {}, {} to train on one",
            choice.scenes,
            choice.setting.name,
            told(choice.setting, &self.study.settings[0]),
            si(choice.rows),
            si(choice.bytes),
            time(choice.build_s),
            counted(self.cores as u64, "core"),
            time(choice.train_s)
        );
        outln!("  expected balanced accuracy: {}", expected(choice));
        extrapolated(choice).iter().for_each(|doubt| outln!("  {doubt}"));
        by_reference(choice).iter().for_each(|doubt| outln!("  {doubt}"));
        let best = &self.choices[0];
        if choice.setting == best.setting {
            outln!("  {}", self.why(choice));
            return;
        }
        outln!("  {}", ends(choice));
        if !choice.by_reference && best.setting == self.study.as_written() && choice.expected.mean > best.expected.mean
        {
            let why = match choice.setting.told {
                Some(Told::Better) => "the study did not follow it to more scenes, or CPU time does not bind",
                _ => "the study does not tell the two apart at equal CPU",
            };
            outln!("  Its curve promises more, but {why}: the config as written comes first.");
        }
    }

    /// What ends the number of scenes, and what to do instead where more of them bring little.
    fn why(&self, choice: &Choice) -> String {
        match choice.bound {
            Bound::Flat => {
                format!("{} Stop here, and vary the yards instead: {}.", ends(choice), words::how_to_vary(self.plan))
            }
            Bound::Study => {
                format!(
                    "{} `{}` measures more.",
                    ends(choice),
                    super::study::farther(self.args, choice.measured_scenes)
                )
            }
            _ => ends(choice),
        }
    }

    /// Where the config has FastSLAM: cheaper estimates of the pose that are not told to be worse at equal CPU.
    fn poses_not_told_worse(&self) -> Vec<(&StudySetting, Told)> {
        if !self.plan.families.iter().any(|family| matches!(family.slam, SlamParams::Fastslam(_))) {
            return Vec::new();
        }
        let cheaper = ["slam: dead_reckoning", "slam: surrogate"];
        let settings = self.study.settings.iter().filter(|setting| cheaper.contains(&setting.name.as_str()));
        settings
            .filter_map(|setting| Some((setting, setting.told?)))
            .filter(|(_, told)| matches!(told, Told::Better | Told::NotApart))
            .collect()
    }

    pub(super) fn json(&self) -> serde_json::Value {
        let choice = |choice: &Choice| {
            json!({
                "setting": choice.setting.name, "sets": choice.setting.sets, "told": choice.setting.told,
                "gain_at_equal_cpu": choice.setting.gain, "measured_here": self.measured_here.contains(&choice.setting.name),
                "scenes": choice.scenes, "rows": choice.rows, "bytes": choice.bytes,
                "generate_s": choice.build_s, "train_s": choice.train_s, "bound": choice.bound,
                "most_scenes": choice.most_scenes, "times_the_largest_measured": choice.beyond,
                "balanced_accuracy": {
                    "mean": choice.expected.mean, "low": choice.expected.low, "high": choice.expected.high,
                },
                "by_the_references_curve": choice.by_reference,
                "twice_would_bring": {"mean": choice.twice.0, "at_most": choice.twice.1},
                "more_would_bring": {"mean": choice.left.0, "at_most": choice.left.1},
            })
        };
        json!({
            "name": self.plan.name, "study": self.study_file, "judged_by": self.study.judged_by,
            "hours": self.hours, "cores": self.cores, "machine": machine_json(),
            "by_few_scenes": self.study.tells_few_scenes, "disk_bytes": self.disk_bytes, "most_rows": self.args.budget.rows,
            "warnings": self.warnings, "advice": self.advice, "how_to_vary": words::how_to_vary(self.plan),
            "poses_not_told_worse_than_fastslam": self.poses_not_told_worse().iter().map(|(setting, _)| &setting.name).collect::<Vec<_>>(),
            "sets": self.sets, "place": self.place, "choices": self.choices.iter().map(choice).collect::<Vec<_>>(),
        })
    }

    pub(super) fn write(&self, path: &Path) -> Result<(), Failure> {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let sets = [self.args.config.sets.as_slice(), &self.sets, &[format!("name={stem}")]].concat();
        let plan = config::load(&self.args.config.config, &sets).map_err(config_failure)?;
        let best = &self.choices[0];
        let text = format!(
            "# Written by `marsyard plan {} --hours {} --cores {}{}{}`, from the study {}.\n\
             # `marsyard plan {} --hours {} --study {}` plans it anew.\n\
             # Setting: {}. {}\n# Expected balanced accuracy on {}: {}.{}\n# Differs from the config by:{}\n{}",
            shell::word(self.args.config.config.display()),
            self.hours,
            self.cores,
            self.args.budget.disk.map_or(String::new(), |bytes| format!(" --disk {bytes}")),
            self.args.budget.rows.map_or(String::new(), |rows| format!(" --rows {rows}")),
            self.study_file.display(),
            shell::word(path.display()),
            self.hours,
            shell::word(self.study_file.display()),
            best.setting.name,
            self.why(best),
            self.study.judged_by,
            expected(best),
            by_reference(best).map_or(String::new(), |doubt| format!(" {doubt}")),
            self.sets.iter().map(|set| format!(" {set}")).collect::<String>(),
            plan.to_yaml()
        );
        write_named(path, text.as_bytes())?;
        errln!("written: {}; `marsyard generate {}` builds it", path.display(), shell::word(path.display()));
        Ok(())
    }
}

/// Whose curve tells what is expected, where it is not the setting's own.
fn by_reference(choice: &Choice) -> Option<&'static str> {
    choice.by_reference.then_some(
        "By the reference's curve: the study does not tell the two apart at equal CPU, and did not follow this one to more scenes.",
    )
}

/// What ends the number of scenes.
fn ends(choice: &Choice) -> String {
    match choice.bound {
        Bound::Hours => "The hours bind: more scenes would take longer.".into(),
        Bound::Disk => "The disk binds: it holds no more scenes, though the hours would make them.".into(),
        Bound::Rows => "The rows bind: more scenes would have more of them than asked for.".into(),
        Bound::SameTime => "As many scenes as take the time of the first choice.".into(),
        Bound::Study => format!(
            "The study ends here: no curve is believed farther than {BELIEVED_UP_TO:.0} times the most scenes that it was measured at, {}, and what the {} that \
             the budget allows would bring is not known.",
            choice.measured_scenes, choice.most_scenes
        ),
        Bound::Flat => format!(
            "The curve is flat from here on: twice as many scenes would bring {:.2} points, and by every believed law {:.2} at most; the {} that the budget allows {:.2}, and {:.2} at most.",
            // Told as it was decided.
            100.0 * choice.twice.0.min(FLAT_TWICE.0),
            100.0 * choice.twice.1.min(FLAT_TWICE.1),
            choice.most_scenes,
            100.0 * choice.left.0,
            100.0 * choice.left.1
        ),
    }
}

fn told(setting: &StudySetting, reference: &StudySetting) -> String {
    let word = match setting.told {
        Some(Told::Better) => "better than the reference",
        Some(Told::Worse) => "worse than the reference",
        Some(Told::NotApart | Told::OneSeed) => "not told apart from the reference",
        None if setting == reference => return "the reference".into(),
        None => return "not compared: no CPU time in common with the reference".into(),
    };
    let by = setting.gain.map_or(String::new(), |gain| format!(": {} points", points(&gain)));
    format!("{word} at equal CPU{by}")
}

fn expected(choice: &Choice) -> String {
    let of = choice.expected;
    format!("{:.1} % ({:.1} to {:.1})", 100.0 * of.mean, 100.0 * of.low, 100.0 * of.high)
}
