//! A config -> the reference setting and the alternatives to it.
//!
//! The reference is the config with everything that `fidelity: reference` names set so, whatever the config says. An alternative is
//! the reference with one knob turned, or with a preset's values, or the config as it is written. Each is made by overrides like
//! `--set`, in the document's sections or in each family's, and checked like any config: what a rule refuses is left out, with the
//! rule. A knob that the config does not have (sub-rays without mixed pixels) has no alternatives, or is a change of what is modelled.
//! One more is the reference with another seed: other yards and other noise of the same config, so that what it gains or loses is noise.

use std::path::Path;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::knobs::{fidelity, knobs};
use super::{Options, TradeoffError};
use crate::config::{self, ConfigError};
use crate::plan::{Fidelity, Plan};
use crate::slam::SlamParams;
use crate::slam::params::SurrogateParams;
use crate::train::params::FilterParams;

/// The setting that differs from the reference by its seed alone.
pub(crate) const OTHER_DRAWS: &str = "reference, other draws";

/// The config itself, where it is not the reference.
pub(crate) const AS_WRITTEN: &str = "as written";

/// Settings that turn the same knob.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub(crate) enum Group {
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
    /// Several of these at once, made of those that gained most.
    #[value(skip)]
    Combinations,
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
pub(crate) enum Side {
    Pipeline,
    Yard,
    Trainer,
}

impl Group {
    pub(crate) const ALL: [Group; 11] = [
        Group::Presets,
        Group::Cast,
        Group::Contact,
        Group::Slam,
        Group::SubRays,
        Group::Resolution,
        Group::Combinations,
        Group::Yard,
        Group::Covariance,
        Group::Precision,
        Group::Batch,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Group::Presets => "presets",
            Group::Cast => "cast",
            Group::Contact => "contact",
            Group::Slam => "slam",
            Group::SubRays => "sub_rays",
            Group::Resolution => "resolution",
            Group::Combinations => "combinations",
            Group::Yard => "yard",
            Group::Covariance => "covariance",
            Group::Precision => "precision",
            Group::Batch => "batch",
        }
    }

    pub(crate) fn side(self) -> Side {
        match self {
            Group::Covariance | Group::Precision | Group::Batch => Side::Trainer,
            Group::Yard => Side::Yard,
            _ => Side::Pipeline,
        }
    }
}

/// One way to build or to train.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    /// `None`: a reference, or the reference with other draws.
    pub group: Option<Group>,
    pub name: String,
    /// What is set beyond the config; beyond the training config for the trainer.
    pub sets: Vec<String>,
    pub variant: Variant,
}

/// What is built or trained at a setting.
#[derive(Clone, Debug)]
pub(crate) enum Variant {
    /// Builds another corpus.
    Plan(Box<Plan>),
    /// Trains otherwise on the reference's corpus.
    Filter(FilterParams),
}

impl Setting {
    pub(crate) fn side(&self) -> Side {
        match (&self.variant, self.group) {
            (Variant::Filter(_), _) => Side::Trainer,
            (Variant::Plan(_), group) => group.map_or(Side::Pipeline, Group::side),
        }
    }

    /// Whether a corpus may be built so: what changes the yard is another corpus, and true poses are known to no rover; they are the config's own
    /// choice where the reference has them.
    pub(crate) fn may_be_recommended(&self, reference: &Plan) -> bool {
        let knows_the_truth = |plan: &Plan| plan.families.iter().any(|family| family.slam == SlamParams::Truth);
        match &self.variant {
            Variant::Plan(plan) => {
                let is_honest = knows_the_truth(reference) || !knows_the_truth(plan);
                self.side() == Side::Pipeline && self.name != OTHER_DRAWS && is_honest
            }
            Variant::Filter(_) => true,
        }
    }
}

/// A setting that the config's own rules refuse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Refused {
    pub group: Group,
    pub name: String,
    pub reason: String,
}

/// All that is measured: plans first, the reference the first of them; then filters, their reference the first of them.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub list: Vec<Setting>,
    pub refused: Vec<Refused>,
}

impl Settings {
    /// The plan that the others are judged by.
    pub(crate) fn reference(&self) -> &Plan {
        self.plans().next().expect("the reference is the first setting")
    }

    /// What a setting is compared with: the first of the trainer's settings, or the reference.
    pub(super) fn base_of(&self, setting: usize) -> usize {
        let is_filter = |setting: &Setting| matches!(setting.variant, Variant::Filter(_));
        let kind = is_filter(&self.list[setting]);
        self.list.iter().position(|other| is_filter(other) == kind).unwrap_or(setting)
    }

    pub(crate) fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.list.iter().filter_map(|setting| match &setting.variant {
            Variant::Plan(plan) => Some(&**plan),
            Variant::Filter(_) => None,
        })
    }
}

/// The plan of a config that its settings are compared with: what it is at `fidelity: reference`.
pub(crate) fn reference(config: &Path, sets: &[String]) -> Result<Plan, ConfigError> {
    let written = config::load(config, sets)?;
    let sets: Vec<String> = sets.iter().cloned().chain(fidelity(&written, Fidelity::Reference)).collect();
    config::load(config, &sets)
}

/// The settings that the options ask for; `surrogate`: drawn pose errors as large as the reference's.
pub(super) fn settings(options: &Options, surrogate: &SurrogateParams) -> Result<Settings, TradeoffError> {
    let written = config::load(&options.config, &options.sets)?;
    let reference_sets = fidelity(&written, Fidelity::Reference);
    let load = |more: &[String]| {
        let sets: Vec<String> = options.sets.iter().chain(&reference_sets).chain(more).cloned().collect();
        config::load(&options.config, &sets)
    };
    let reference = reference(&options.config, &options.sets)?;
    let wanted = |group| options.wants(group);
    let plan = |plan| Variant::Plan(Box::new(plan));
    let mut list = vec![Setting {
        group: None,
        name: "reference".into(),
        sets: reference_sets.clone(),
        variant: plan(reference.clone()),
    }];
    let other_seed = format!("seed={}", reference.seed.wrapping_add(1));
    let other_draws = load(std::slice::from_ref(&other_seed))?;
    list.push(Setting {
        group: None,
        name: OTHER_DRAWS.into(),
        sets: overridden(&reference_sets, &[other_seed]),
        variant: plan(other_draws),
    });
    let mut refused = Vec::new();
    if wanted(Group::Presets) && !is_listed(&list, &written) {
        let variant = plan(written.clone());
        list.push(Setting { group: Some(Group::Presets), name: AS_WRITTEN.into(), sets: Vec::new(), variant });
    }
    for (group, name, knob_sets) in
        knobs(&written, &reference, surrogate).into_iter().filter(|(group, ..)| wanted(*group))
    {
        let is_preset = group == Group::Presets;
        match load(&knob_sets) {
            // A knob that stands there already, or is turned so by another setting: 100 particles are the reference's.
            Ok(other) if is_listed(&list, &other) => {}
            Ok(other) => {
                let sets = if is_preset { knob_sets } else { overridden(&reference_sets, &knob_sets) };
                list.push(Setting { group: Some(group), name, sets, variant: plan(other) });
            }
            Err(error) => {
                let reason = error.faults.first().map(|fault| fault.rule.clone()).unwrap_or_default();
                refused.push(Refused { group, name, reason });
            }
        }
    }
    list.extend(super::filters::filters().into_iter().filter(|setting| setting.group.is_none_or(wanted)));
    if !Group::ALL.iter().any(|group| group.side() == Side::Trainer && wanted(*group)) {
        list.retain(|setting| matches!(setting.variant, Variant::Plan(_)));
    }
    Ok(Settings { list, refused })
}

pub(super) fn is_listed(list: &[Setting], plan: &Plan) -> bool {
    let hash = plan.scene_plan_hash();
    list.iter().any(|setting| matches!(&setting.variant, Variant::Plan(own) if own.scene_plan_hash() == hash))
}

/// Overrides of which some are overridden in turn: of a key set twice, the last counts.
pub(super) fn overridden(base: &[String], over: &[String]) -> Vec<String> {
    let kept = base.iter().filter(|set| over.iter().all(|other| key(other) != key(set)));
    kept.chain(over).cloned().collect()
}

/// What an override sets.
pub(super) fn key(set: &str) -> &str {
    set.split('=').next().unwrap_or_default()
}

#[cfg(test)]
pub(super) mod tests;
