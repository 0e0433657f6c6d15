//! Contract: `fidelity` sets what the config does not name, and the resolved plan writes all of it out.

use std::path::Path;

use marsyard::config::load;
use marsyard::corpus::place::differences;
use marsyard::drive::params::ContactSolver;
use marsyard::plan::Fidelity;
use marsyard::plan::Plan;
use marsyard::slam::SlamParams;
use marsyard::sweep::params::Cast;

fn plan(text: &str, sets: &[&str]) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corpus.yaml");
    std::fs::write(&path, format!("marsyard: 1\nname: f\nseed: 0\nscenes: 20\nscenes_per_shard: 10\n{text}")).unwrap();
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    load(&path, &sets).unwrap_or_else(|error| panic!("{}", error.lines()))
}

const ROCKS: &str = "scene: {rocks: {count: 9, diameter_m: 0.5}}\n";

/// What each word sets, read off the code's own list.
fn value(fidelity: Fidelity, key: &str) -> &'static str {
    fidelity.settings().iter().find(|(name, _)| *name == key).map(|(_, value)| *value).unwrap()
}

#[test]
fn equal_a_word_and_its_values_written_out() {
    for fidelity in Fidelity::ALL {
        let word = plan(&format!("{ROCKS}fidelity: {}\n", fidelity.name()), &[]);
        let sets: Vec<String> = fidelity
            .settings()
            .iter()
            .filter(|(key, _)| !key.contains("mixed_pixels"))
            .map(|(key, value)| format!("{key}={value}"))
            .collect();
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let written = plan(ROCKS, &sets);
        assert_eq!(word.families, written.families, "{fidelity:?}");
        assert_eq!(word.scene_plan_hash(), written.scene_plan_hash(), "{fidelity:?}");
        assert_eq!(differences(&word.to_yaml(), &written.to_yaml()), Some(Vec::new()));
        assert_eq!((word.fidelity, written.fidelity), (Some(fidelity), None));
        // No part is switched on.
        assert!(word.families[0].sweep.effects.mixed_pixels.is_none());
        // Nor does a set word differ from a written one.
        let set = format!("fidelity={}", fidelity.name());
        assert!(plan(ROCKS, &[&set]) == word);
    }
}

#[test]
fn law_the_configs_own_keys_win() {
    let own = "fidelity: draft\nsweep: {cast: {mesh: {spacing_m: 0.3}}}\ndrive: {contact: nelder_mead}\nslam: truth\n";
    let own = format!("{ROCKS}{own}");
    let family = &plan(&own, &[]).families[0];
    assert!(matches!(family.sweep.cast, Cast::Mesh(_)));
    assert_eq!((family.drive.contact, &family.slam), (ContactSolver::NelderMead, &SlamParams::Truth));
    // Overrides are the config's own keys too, whatever their order.
    for sets in [["fidelity=reference", "drive.contact=plane_fit"], ["drive.contact=plane_fit", "fidelity=reference"]] {
        assert_eq!(plan(ROCKS, &sets).families[0].drive.contact, ContactSolver::PlaneFit);
    }
}

#[test]
fn law_the_same_choice_takes_over_the_keys_it_leaves_out() {
    let particles = |text: &str| match &plan(&format!("{ROCKS}fidelity: reference\n{text}"), &[]).families[0].slam {
        SlamParams::Fastslam(params) => (params.particles, params.max_features),
        other => panic!("{other:?}"),
    };
    let set: u32 =
        value(Fidelity::Reference, "slam").chars().filter(char::is_ascii_digit).collect::<String>().parse().unwrap();
    assert_eq!(particles(""), (set, 12));
    assert_eq!(particles("slam: {fastslam: {max_features: 5}}"), (set, 5));
    assert_eq!(particles("slam: {fastslam: {particles: 7}}"), (7, 12));
}

#[test]
fn law_sub_rays_are_set_where_mixed_pixels_are_modelled_by_the_document_or_a_family() {
    let rays = |plan: &Plan| -> Vec<Option<u32>> {
        plan.families.iter().map(|f| f.sweep.effects.mixed_pixels.as_ref().map(|pixels| pixels.sub_rays)).collect()
    };
    let with = |effects: &str, families: &str| {
        rays(&plan(&format!("{ROCKS}fidelity: reference\nsweep: {{effects: {effects}}}\n{families}"), &[]))
    };
    assert_eq!(with("{mixed_pixels: {}}", ""), [Some(19)]);
    assert_eq!(with("{mixed_pixels: {sub_rays: 1}}", ""), [Some(1)]);
    assert_eq!(with("{gates: {}}", ""), [None]);
    let families = "families: [{name: a}, {name: b, sweep: {effects: {mixed_pixels: {}}}}]";
    assert_eq!(with("{gates: {}}", families), [None, Some(19)]);
    assert_eq!(with("{mixed_pixels: {}}", families), [Some(19), Some(19)]);
}

#[test]
fn equal_a_plan_with_a_word_comes_back() {
    let plan = plan(&format!("{ROCKS}fidelity: standard\n"), &[]);
    assert!(plan.to_yaml().contains("fidelity: standard\n"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.yaml");
    std::fs::write(&path, plan.to_yaml()).unwrap();
    let again = load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.lines()));
    assert!(plan == again && plan.to_yaml() == again.to_yaml());
}

#[test]
fn extreme_another_word_is_refused_with_the_known_ones() {
    let path = Path::new("configs/quickstart.yaml");
    let error = load(path, &["fidelity=standart".into()]).unwrap_err();
    assert!(error.lines().contains("standard"), "{}", error.lines());
    assert!(load(path, &["fidelity=3".into()]).is_err());
    assert!(load(path, &["fidelity=null".into()]).unwrap().fidelity.is_none());
}
