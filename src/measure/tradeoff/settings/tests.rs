//! Settings of shipped configs: which there are, what each turns, and what rules leave out.

use std::path::{Path, PathBuf};

use super::super::{Group, Options, TradeoffError, scenes};
use super::{OTHER_DRAWS, Settings, Side, Variant};
use crate::config::load;
use crate::corpus::Split;
use crate::corpus::plan_difference::differences;
use crate::drive::params::ContactSolver;
use crate::plan::Plan;
use crate::slam::SlamParams;
use crate::slam::params::SurrogateParams;
use crate::sweep::params::Cast;

pub(in crate::measure::tradeoff) fn options(config: &str, sets: &[&str], only: &[Group]) -> Options {
    Options {
        config: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(config),
        sets: sets.iter().map(|set| (*set).to_owned()).collect(),
        scenes: 8,
        only: only.to_vec(),
        test_scenes: 6,
        combinations: 0,
        farther: 1,
        seeds: 2,
        resolve: None,
        time: None,
        threads: 2,
    }
}

pub(in crate::measure::tradeoff) fn all(config: &str, sets: &[&str], only: &[Group]) -> Settings {
    super::settings(&options(config, sets, only), &SurrogateParams::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn names(settings: &Settings, group: Group) -> Vec<&str> {
    settings.list.iter().filter(|s| s.group == Some(group)).map(|s| s.name.as_str()).collect()
}

#[test]
fn exact_the_papers_config_has_every_knob_but_the_references_own_values() {
    let settings = all("configs/paper.yaml", &[], &[]);
    for (group, expected) in [
        // As written it is the reference, for it models no mixed pixels.
        (Group::Presets, "draft"),
        (Group::Slam, "1 particle|10 particles|60 particles|300 particles|surrogate|registration|dead_reckoning|truth"),
        (Group::Cast, "raster 0.05 m|raster 0.1 m|raster 0.2 m|mesh 0.05 m|mesh 0.1 m|mesh 0.2 m"),
        (Group::SubRays, ""),
        (Group::Resolution, "every 2nd beam|every 4th beam"),
        (Group::Covariance, "Kronecker factors, f32|by layer|by node|diagonal"),
        (Group::Precision, "f32|UD, f64|UD, f32"),
        (Group::Batch, "8 rows|32 rows"),
    ] {
        assert_eq!(names(&settings, group).join("|"), expected, "{group:?}");
    }
    assert!(settings.refused.is_empty(), "{:?}", settings.refused);
    let family = &settings.reference().families[0];
    assert_eq!((&family.sweep.cast, family.drive.contact), (&Cast::Exact, ContactSolver::GaussNewton));
    // One knob: nothing else differs from the reference.
    let (other, reference) = (settings.plans().nth(1).unwrap(), settings.reference());
    assert_eq!(other.seed, reference.seed + 1);
    assert!(&Plan { seed: reference.seed, ..other.clone() } == reference);
    let barred = settings.list.iter().filter(|s| !s.may_be_recommended(settings.reference()) && s.side() != Side::Yard);
    assert_eq!(barred.map(|s| s.name.as_str()).collect::<Vec<_>>(), [OTHER_DRAWS, "truth"]);
    let one = settings.list.iter().find(|s| s.name == "raster 0.1 m").unwrap();
    let Variant::Plan(plan) = &one.variant else { panic!("a plan") };
    let found = differences(&settings.reference().to_yaml(), &plan.to_yaml()).unwrap();
    assert!(!found.is_empty() && found.iter().all(|d| d.key.starts_with("sweep.cast")), "{found:?}");
    // What a setting says it sets makes its plan.
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
    for setting in &settings.list {
        if let Variant::Plan(plan) = &setting.variant {
            assert!(load(&config, &setting.sets).unwrap() == **plan, "{}", setting.name);
        }
    }
    assert_eq!(one.sets.iter().filter(|set| set.starts_with("sweep.cast=")).count(), 1, "{:?}", one.sets);
    assert_eq!(settings.list.iter().filter(|s| s.group.is_none()).count(), 3);
    assert_eq!(settings.list[0].name, "reference");
}

#[test]
fn law_families_keep_what_they_are_and_all_turn_the_knob() {
    let settings = all("configs/mixed.yaml", &[], &[Group::Cast, Group::Resolution]);
    let written = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mixed.yaml"), &[]).unwrap();
    for (setting, plan) in settings.list.iter().zip(settings.plans()) {
        assert_eq!(plan.families.len(), written.families.len());
        for (own, family) in plan.families.iter().zip(&written.families) {
            assert_eq!(own.sweep.effects.range_noise, family.sweep.effects.range_noise, "{}", setting.name);
            assert_eq!((&own.scene, &own.cells), (&family.scene, &family.cells), "{}", setting.name);
            assert_eq!(own.sweep.cast != Cast::Exact, setting.group == Some(Group::Cast), "{}", setting.name);
            assert_eq!(own.sweep.sensor != family.sweep.sensor, setting.group == Some(Group::Resolution));
        }
    }
    assert_eq!(settings.list.len(), 2 + 6 + 2);
}

#[test]
fn law_a_pose_that_is_not_estimated_stays_the_configs_choice() {
    let settings = all("configs/paper.yaml", &["slam=truth"], &[Group::Presets, Group::Slam]);
    let truth = |plan: &Plan| plan.families[0].slam == SlamParams::Truth;
    assert!(truth(settings.reference()));
    let presets = settings.list.iter().zip(settings.plans()).filter(|(s, _)| s.group == Some(Group::Presets));
    assert!(presets.map(|(_, plan)| plan).all(truth));
    assert!(names(&settings, Group::Slam).contains(&"surrogate") && !names(&settings, Group::Slam).contains(&"truth"));
}

#[test]
fn law_sub_rays_are_a_knob_only_where_mixed_pixels_are_modelled() {
    let on = ["sweep.effects.mixed_pixels={}"];
    let modelled = all("configs/paper.yaml", &on, &[Group::SubRays, Group::Yard]);
    assert_eq!(names(&modelled, Group::SubRays), ["1 sub-ray", "7 sub-rays"]);
    let not = all("configs/paper.yaml", &[], &[Group::SubRays, Group::Yard]);
    assert!(names(&not, Group::SubRays).is_empty());
    assert!(names(&not, Group::Yard).contains(&"mixed pixels, 7 sub-rays"));
    assert!(!names(&modelled, Group::Yard).contains(&"mixed pixels, 7 sub-rays"));
    let labels = |sets: &[&str]| {
        let settings = all("configs/paper.yaml", sets, &[Group::Yard]);
        let by: Vec<String> = names(&settings, Group::Yard)
            .into_iter()
            .filter(|name| name.starts_with("labels"))
            .map(Into::into)
            .collect();
        by.join("|")
    };
    assert_eq!(labels(&[]), "labels by the rover|labels by the rover, and poses");
    assert_eq!(labels(&["cells.labels.rover={}"]), "labels by points|labels by the rover, and poses");
    assert_eq!(labels(&["cells.labels.rover={pose: true}"]), "labels by points");
}

#[test]
fn law_what_the_configs_rules_refuse_is_left_out_with_the_rule() {
    let settings = all("configs/paper.yaml", &["scene.extent_m=500"], &[Group::Cast]);
    let refused: Vec<&str> = settings.refused.iter().map(|refused| refused.name.as_str()).collect();
    assert_eq!(refused, ["raster 0.05 m", "raster 0.1 m", "mesh 0.05 m", "mesh 0.1 m"]);
    assert!(settings.refused[0].reason.contains("10000 x 10000 nodes"), "{:?}", settings.refused[0]);
    let fault =
        super::settings(&options("configs/paper.yaml", &["seed=x"], &[]), &SurrogateParams::default()).unwrap_err();
    assert!(matches!(fault, TradeoffError::Config(_)));
}

#[test]
fn exact_scenes_are_the_plans_own_of_the_train_split() {
    let plan = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml"), &[]).unwrap();
    for count in [8, 100, 700, 900] {
        let chosen = scenes(&plan, count);
        assert_eq!(chosen.len() as u64, count);
        assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(chosen.iter().all(|&scene| Split::of_shard(plan.shard_of(scene)) == Split::Train));
    }
    // 14 of 20 shards of 50 train: 700 scenes; more come from beyond the plan's end.
    assert!(scenes(&plan, 700).iter().all(|&scene| scene < plan.scenes));
    assert!(scenes(&plan, 900).iter().any(|&scene| scene >= plan.scenes));
}
