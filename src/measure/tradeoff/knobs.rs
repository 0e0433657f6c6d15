//! A plan -> the knobs that trade speed against accuracy, each as the overrides that turn it.
//!
//! An override is `key=value`, as `--set` takes it, in the document's section or in each family's. A knob that the config does not have
//! (sub-rays without mixed pixels) gives no override, or is a change of what is modelled ([`Group::Yard`]).

use super::settings::Group;
use crate::config::fidelity::SUB_RAYS;
use crate::plan::{Family, Fidelity, Plan};
use crate::scene::params::GroundShape;
use crate::slam::SlamParams;
use crate::slam::params::SurrogateParams;
use crate::sweep::sensor::PatternParams;

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

/// What a preset sets, in the place of the config's own keys; a pose that is not estimated by FastSLAM is the config's own choice.
pub(super) fn fidelity(plan: &Plan, fidelity: Fidelity) -> Vec<String> {
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

/// Every knob of the pipeline and the yard, with what it sets; `surrogate`: of the knob of that name.
pub(super) fn knobs(
    written: &Plan,
    reference: &Plan,
    surrogate: &SurrogateParams,
) -> Vec<(Group, String, Vec<String>)> {
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
    for particles in [1, 10, 60, 100, 300] {
        let value = format!("{{fastslam: {{particles: {particles}}}}}");
        let name = format!("{particles} particle{}", if particles == 1 { "" } else { "s" });
        knobs.push(one(Group::Slam, &name, "slam", &value));
    }
    let drawn = super::surrogate::written(surrogate);
    knobs.push(one(Group::Slam, "surrogate", "slam", &drawn));
    for (name, value) in
        [("registration", "{registration: {}}"), ("dead_reckoning", "dead_reckoning"), ("truth", "truth")]
    {
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
    knobs.extend(labels(reference));
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

/// Labels by the other rule, and the truth of the pose beside them: what each costs. A rule that the config's frame does not know is left out.
fn labels(reference: &Plan) -> Vec<(Group, String, Vec<String>)> {
    let key = || "cells.labels.rover".to_owned();
    let has = |family: &Family| family.cells.labels.rover.is_some();
    let by_points = everywhere(reference, |family| has(family).then(|| (key(), "null".into())));
    let by_rover = everywhere(reference, |family| (!has(family)).then(|| (key(), "{}".into())));
    let poses = everywhere(reference, |family| match &family.cells.labels.rover {
        Some(rule) if rule.pose => None,
        Some(_) => Some((format!("{}.pose", key()), "true".into())),
        None => Some((key(), "{pose: true}".into())),
    });
    [("labels by points", by_points), ("labels by the rover", by_rover), ("labels by the rover, and poses", poses)]
        .map(|(name, sets)| (Group::Yard, name.to_owned(), sets))
        .into()
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
