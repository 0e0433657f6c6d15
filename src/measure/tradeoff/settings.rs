//! A config -> the reference setting and the alternatives to it.
//!
//! The reference is the config with everything that `fidelity: reference` names set so, whatever the config says. An alternative is
//! the reference with one knob turned, or with a preset's values, or the config as it is written. Each is made by overrides like
//! `--set`, in the document's sections or in each family's, and checked like any config: what a rule refuses is left out, with the
//! rule. A knob that the config does not have (sub-rays without mixed pixels) has no alternatives, or is a change of what is modelled.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::{Options, TradeoffError};
use crate::config::fidelity::SUB_RAYS;
use crate::config::{self};
use crate::plan::Fidelity;
use crate::plan::{Family, Plan};
use crate::scene::params::GroundShape;
use crate::slam::SlamParams;
use crate::sweep::sensor::PatternParams;
use crate::train::params::FilterParams;

/// Settings that turn the same knob.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum Group {
    /// The config as written, and `fidelity: draft` and `standard`.
    Presets,
    /// How the ground is cast.
    Cast,
    /// How the chassis is set on the ground, and how near the solution must be.
    Contact,
    /// How the pose is estimated.
    Slam,
    /// Sub-rays of a beam, where mixed pixels are modelled.
    SubRays,
    /// Every second or fourth beam.
    Resolution,
    /// Changes of the yard and of what is modelled: no errors.
    Yard,
    /// The trainer: which weights share a covariance.
    Covariance,
    /// The trainer: the type and form of the covariance.
    Precision,
    /// The trainer: rows learnt together.
    Batch,
}

/// What a setting is a choice of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    Pipeline,
    Yard,
    Trainer,
}

impl Group {
    pub const ALL: [Group; 10] = [
        Group::Presets,
        Group::Cast,
        Group::Contact,
        Group::Slam,
        Group::SubRays,
        Group::Resolution,
        Group::Yard,
        Group::Covariance,
        Group::Precision,
        Group::Batch,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Group::Presets => "presets",
            Group::Cast => "cast",
            Group::Contact => "contact",
            Group::Slam => "slam",
            Group::SubRays => "sub_rays",
            Group::Resolution => "resolution",
            Group::Yard => "yard",
            Group::Covariance => "covariance",
            Group::Precision => "precision",
            Group::Batch => "batch",
        }
    }

    pub fn side(self) -> Side {
        match self {
            Group::Covariance | Group::Precision | Group::Batch => Side::Trainer,
            Group::Yard => Side::Yard,
            _ => Side::Pipeline,
        }
    }
}

/// One way to build or to train.
#[derive(Clone, Debug)]
pub struct Setting {
    /// `None`: a reference.
    pub group: Option<Group>,
    pub name: String,
    /// What is set beyond the config; beyond the training config for the trainer.
    pub sets: Vec<String>,
    pub what: What,
}

#[derive(Clone, Debug)]
pub enum What {
    /// Builds another corpus.
    Plan(Box<Plan>),
    /// Trains otherwise on the reference's corpus.
    Filter(FilterParams),
}

impl Setting {
    pub fn side(&self) -> Side {
        match (&self.what, self.group) {
            (What::Filter(_), _) => Side::Trainer,
            (What::Plan(_), group) => group.map_or(Side::Pipeline, Group::side),
        }
    }
}

/// A setting that the config's own rules refuse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refused {
    pub group: Group,
    pub name: String,
    pub reason: String,
}

/// All that is measured: plans first, the reference the first of them; then filters, their reference the first of them.
#[derive(Clone, Debug)]
pub struct Settings {
    pub list: Vec<Setting>,
    pub refused: Vec<Refused>,
}

impl Settings {
    /// The plan that the others are judged by.
    pub fn reference(&self) -> &Plan {
        self.plans().next().expect("the reference is the first setting")
    }

    pub fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.list.iter().filter_map(|setting| match &setting.what {
            What::Plan(plan) => Some(&**plan),
            What::Filter(_) => None,
        })
    }

    pub fn filters(&self) -> impl Iterator<Item = (&Setting, &FilterParams)> {
        self.list.iter().filter_map(|setting| match &setting.what {
            What::Plan(_) => None,
            What::Filter(params) => Some((setting, params)),
        })
    }
}

/// The settings that the options ask for.
pub(super) fn settings(options: &Options) -> Result<Settings, TradeoffError> {
    let written = config::load(&options.config, &options.sets)?;
    let reference_sets = fidelity(&written, Fidelity::Reference);
    let load = |more: &[String]| {
        let sets: Vec<String> = options.sets.iter().chain(&reference_sets).chain(more).cloned().collect();
        config::load(&options.config, &sets)
    };
    let reference = load(&[])?;
    let reference_hash = reference.scene_plan_hash();
    let wanted = |group| options.only.is_empty() || options.only.contains(&group);
    let plan = |plan| What::Plan(Box::new(plan));
    let mut list = vec![Setting {
        group: None,
        name: "reference".into(),
        sets: reference_sets.clone(),
        what: plan(reference.clone()),
    }];
    let mut refused = Vec::new();
    if wanted(Group::Presets) && written.scene_plan_hash() != reference_hash {
        let what = plan(written.clone());
        list.push(Setting { group: Some(Group::Presets), name: "as written".into(), sets: Vec::new(), what });
    }
    for (group, name, knob_sets) in knobs(&written, &reference).into_iter().filter(|(group, ..)| wanted(*group)) {
        let is_preset = group == Group::Presets;
        match load(&knob_sets) {
            // A knob that stands there already.
            Ok(other) if other.scene_plan_hash() == reference_hash => {}
            Ok(other) => {
                let sets = if is_preset { knob_sets } else { laid_over(&reference_sets, &knob_sets) };
                list.push(Setting { group: Some(group), name, sets, what: plan(other) });
            }
            Err(error) => {
                let reason = error.faults.first().map(|fault| fault.rule.clone()).unwrap_or_default();
                refused.push(Refused { group, name, reason });
            }
        }
    }
    list.extend(super::filters::filters().into_iter().filter(|setting| setting.group.is_none_or(wanted)));
    if !Group::ALL.iter().any(|group| group.side() == Side::Trainer && wanted(*group)) {
        list.retain(|setting| matches!(setting.what, What::Plan(_)));
    }
    Ok(Settings { list, refused })
}

/// Overrides laid over others: of a key set twice, the last counts.
fn laid_over(base: &[String], over: &[String]) -> Vec<String> {
    let key = |set: &String| set.split('=').next().unwrap_or_default().to_owned();
    let kept = base.iter().filter(|set| over.iter().all(|other| key(other) != key(set)));
    kept.chain(over).cloned().collect()
}

/// `key=value` in the document's section, or in every family's.
fn everywhere(plan: &Plan, value: impl Fn(&Family) -> Option<(String, String)>) -> Vec<String> {
    let families = plan.families.iter().enumerate();
    if let [family] = plan.families.as_slice()
        && family.name == "default"
    {
        return value(family).map(|(key, value)| format!("{key}={value}")).into_iter().collect();
    }
    families.filter_map(|(k, family)| value(family).map(|(key, value)| format!("families.{k}.{key}={value}"))).collect()
}

fn always(plan: &Plan, key: &str, value: &str) -> Vec<String> {
    everywhere(plan, |_| Some((key.into(), value.into())))
}

/// What a preset sets, laid over the config's own keys; a pose that is not estimated by FastSLAM is the config's own choice.
fn fidelity(plan: &Plan, fidelity: Fidelity) -> Vec<String> {
    let applies = |key: &str, family: &Family| match key {
        SUB_RAYS => family.sweep.effects.mixed_pixels.is_some(),
        "slam" => matches!(family.slam, SlamParams::Fastslam(_)),
        _ => true,
    };
    let set = |(key, value): &(&str, &str)| {
        everywhere(plan, |family| applies(key, family).then(|| ((*key).to_owned(), (*value).to_owned())))
    };
    fidelity.settings().iter().flat_map(set).collect()
}

/// Every knob of the pipeline and the yard, with what it sets.
fn knobs(written: &Plan, reference: &Plan) -> Vec<(Group, String, Vec<String>)> {
    let mut knobs: Vec<(Group, String, Vec<String>)> = Vec::new();
    for preset in [Fidelity::Draft, Fidelity::Standard] {
        knobs.push((Group::Presets, preset.name().into(), fidelity(written, preset)));
    }
    let one = |group, name: &str, key: &str, value: &str| (group, name.to_owned(), always(reference, key, value));
    for method in ["raster", "mesh"] {
        for spacing_m in ["0.05", "0.1", "0.2"] {
            let value = format!("{{{method}: {{spacing_m: {spacing_m}}}}}");
            knobs.push(one(Group::Cast, &format!("{method} {spacing_m} m"), "sweep.cast", &value));
        }
    }
    knobs.push(one(Group::Contact, "plane_fit", "drive.contact", "plane_fit"));
    for solver in ["gauss_newton", "nelder_mead"] {
        knobs.push(one(Group::Contact, solver, "drive.contact", solver));
        for tolerance in ["1e-6", "1e-4"] {
            let mut sets = always(reference, "drive.contact", solver);
            sets.extend(always(reference, "drive.contact_tolerance_m", tolerance));
            knobs.push((Group::Contact, format!("{solver} {tolerance}"), sets));
        }
    }
    // The last has other draws than the reference and nothing else: what remains of it is the noise of the comparison.
    for particles in [1, 10, 30, 100, 300, 101] {
        let value = format!("{{fastslam: {{particles: {particles}}}}}");
        let name = format!("{particles} particle{}", if particles == 1 { "" } else { "s" });
        knobs.push(one(Group::Slam, &name, "slam", &value));
    }
    for (name, value) in [("surrogate", "{surrogate: {}}"), ("dead_reckoning", "dead_reckoning"), ("truth", "truth")] {
        knobs.push(one(Group::Slam, name, "slam", value));
    }
    for rays in ["1", "7", "19"] {
        let with_pixels = |on: bool| {
            everywhere(reference, |family| {
                (family.sweep.effects.mixed_pixels.is_some() == on).then(|| (SUB_RAYS.to_owned(), rays.to_owned()))
            })
        };
        let (named, not_named) = (with_pixels(true), with_pixels(false));
        if !named.is_empty() {
            knobs.push((Group::SubRays, format!("{rays} sub-ray{}", if rays == "1" { "" } else { "s" }), named));
        } else if rays != "1" {
            knobs.push((Group::Yard, format!("mixed pixels, {rays} sub-rays"), not_named));
        }
    }
    for stride in [2, 4] {
        let name = format!("every {} beam", if stride == 2 { "2nd" } else { "4th" });
        let kth_key = |k: usize| {
            everywhere(reference, |family| {
                let (key, value) = thinned(family, stride).get(k)?.clone();
                Some((format!("sweep.sensor.pattern.{key}"), value))
            })
        };
        knobs.push((Group::Resolution, name, [kth_key(0), kth_key(1)].concat()));
    }
    knobs.extend(yards(reference));
    knobs
}

/// Every `stride`-th beam of a pattern, in the pattern's own keys (two at most); none where it is a list of beams.
fn thinned(family: &Family, stride: u32) -> Vec<(&'static str, String)> {
    let fewer = |count: u32| count.div_ceil(stride).to_string();
    match &family.sweep.sensor.pattern {
        PatternParams::Tilted(p) => vec![
            ("tilted.beams", fewer(p.beams)),
            ("tilted.beam_step_deg", (p.beam_step_deg * f64::from(stride)).to_string()),
        ],
        PatternParams::Spinning(p) => vec![("spinning.columns", fewer(p.columns))],
        PatternParams::Raster(p) => vec![("raster.columns", fewer(p.columns))],
        PatternParams::Rosette(p) => {
            vec![("rosette.beams", fewer(p.beams)), ("rosette.rate_hz", (p.rate_hz / f64::from(stride)).to_string())]
        }
        PatternParams::File(_) => Vec::new(),
    }
}

/// Other yards: the ground's shape.
fn yards(reference: &Plan) -> Vec<(Group, String, Vec<String>)> {
    let mut knobs = Vec::new();
    let fitted = |family: &Family| matches!(family.scene.ground.shape, GroundShape::Polynomial(_));
    for degree in [3, 5, 8] {
        let sets = everywhere(reference, |family| {
            fitted(family).then(|| ("scene.ground.shape".into(), format!("{{polynomial: {{degree: {degree}}}}}")))
        });
        knobs.push((Group::Yard, format!("polynomial of degree {degree}"), sets));
    }
    let sets = everywhere(reference, |family| {
        fitted(family).then(|| ("scene.ground.shape".into(), "{raw: {spacing_m: 0.1}}".into()))
    });
    knobs.push((Group::Yard, "raw ground at 0.1 m".into(), sets));
    knobs
}
