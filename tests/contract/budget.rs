//! The contract of `plan --hours`: a study in, what to build out, in words, as JSON and as a config; refusals with exit code 2.

use std::fs;
use std::path::Path;

use crate::tradeoff::measured;
use crate::yard::{Yard, text};

fn config() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml").display().to_string()
}

/// A study of the fixture, where `tradeoff` puts it.
fn with_study() -> Yard {
    let yard = Yard::new();
    measured(&yard, "cast", "2", &[]);
    yard
}

#[test]
fn law_hours_become_a_config_that_is_built() {
    let yard = with_study();
    let config = config();
    let plan = ["plan", &config, "--hours", "0.002", "--cores", "2", "--disk", "40MB", "--limit", "1"];
    let output = yard.marsyard(plan.iter().chain(&["--json", "--write", "night.yaml"]));
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    assert!(json["machine"]["cores"].as_u64().is_some_and(|cores| cores > 0), "{json}");
    let best = &json["choices"][0];
    let figure = |of: &serde_json::Value, key: &str| of[key].as_f64().unwrap_or_else(|| panic!("{key}: {of}"));
    assert!(figure(best, "generate_s") + figure(best, "train_s") <= 7.2 * 1.0001, "{best}");
    assert!(figure(best, "bytes") <= 4e7, "{best}");
    let accuracy = &best["balanced_accuracy"];
    let [low, mean, high] = ["low", "mean", "high"].map(|key| figure(accuracy, key));
    assert!(0.0 <= low && low <= mean && mean <= high && high <= 1.0, "{accuracy}");
    assert!(json["choices"].as_array().is_some_and(|choices| choices.len() > 1), "{json}");
    // Each override changes something.
    let sets: Vec<String> =
        json["sets"].as_array().expect("overrides").iter().map(|set| set.as_str().expect("text").into()).collect();
    let plan_of = |sets: &[String]| marsyard::config::load(Path::new(&config), sets).ok();
    assert!(sets.iter().any(|set| set.starts_with("scenes=")), "{sets:?}");
    for k in 0..sets.len() {
        assert_ne!(plan_of(&[&sets[..k], &sets[k + 1..]].concat()), plan_of(&sets), "{}", sets[k]);
    }
    // The study is of this config, and of this training.
    let warned = json["warnings"].to_string();
    assert!(!warned.contains("another state") && !warned.contains("another training"), "{json}");

    let written = fs::read_to_string(yard.path("night.yaml")).expect("the config");
    assert!(written.starts_with("# Written by `marsyard plan") && written.contains("Expected balanced accuracy"));
    let scenes = best["scenes"].as_u64().expect("scenes");
    assert!(written.contains("name: night\n") && written.contains(&format!("scenes: {scenes}\n")), "{written}");
    let output = yard.marsyard(["plan", "night.yaml", "--sample", "0"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).starts_with(&format!("night: {scenes} scenes")), "{}", text(&output.stdout));
    // Half the rows, and fewer than teach anybody.
    let half = format!("{}", figure(best, "rows") / 2.0);
    let of_rows =
        |most: &str| yard.marsyard(["plan", &config, "--hours", "0.002", "--limit", "1", "--json", "--rows", most]);
    let fewer: serde_json::Value = serde_json::from_slice(&of_rows(&half).stdout).expect("JSON on stdout");
    // Each plan measures the rows of a scene on scenes of its own.
    assert!(figure(&fewer["choices"][0], "rows") <= 0.55 * figure(best, "rows"), "{fewer}");
    assert!(fewer["how_to_vary"].as_str().is_some_and(|how| how.contains("grass")), "{fewer}");
    // Of some 70 scenes a shard has three, and the config's own number of scenes is no multiple of that.
    let rows = format!("{}", 70.0 * figure(best, "rows") / scenes as f64);
    let large = ["--set", "scenes=200", "--set", "scenes_per_shard=50"];
    let few = ["plan", &config, "--hours", "1", "--limit", "1", "--json", "--rows", &rows];
    let output = yard.marsyard(few.iter().chain(&large));
    assert!(output.status.success(), "{rows} rows: {}", text(&output.stderr));
    let small: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    assert!(small["sets"].to_string().contains("\"scenes_per_shard=3\""), "{small}");
    let too_few = of_rows("3");
    assert_eq!(too_few.status.code(), Some(2), "{}", text(&too_few.stdout));
    assert!(text(&too_few.stderr).contains("rows hold fewer than 7 scenes"), "{}", text(&too_few.stderr));
    // Fewer shards than give each split one teach nobody.
    let small = ["plan", &config, "--hours", "0.002", "--limit", "1", "--json", "--disk", "50kB"];
    let too_small = yard.marsyard(small);
    assert_eq!(too_small.status.code(), Some(2), "{}", text(&too_small.stdout));
    let said = text(&too_small.stderr);
    assert!(said.contains("of disk hold fewer than 7 scenes") && said.contains("7 scenes take some "), "{said}");
    // What is there already is nobody's to write over.
    let again = yard.marsyard(plan.iter().chain(&["--write", "night.yaml"]));
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("is there already"), "{}", text(&again.stderr));

    let place = yard.path("tradeoffs/training/study.json");
    let mut study: serde_json::Value = serde_json::from_slice(&fs::read(&place).expect("the study")).expect("JSON");
    study["training"]["network"]["members"] = 7.into();
    fs::write(&place, study.to_string()).expect("a file");
    let output = yard.marsyard(plan.iter().chain(&["--set", "seed=9"]));
    let said = text(&output.stdout);
    for part in [
        "\nbuild: ",
        "\nnext best: ",
        "expected balanced accuracy: ",
        "another state of this config",
        "another training than the default",
        " points)",
        "advice: ",
        "marsyard generate ",
        "marsyard train ",
    ] {
        assert!(said.contains(part), "{part} is not in:\n{said}");
    }
}

#[test]
fn law_without_a_study_or_a_sound_budget_the_cure_is_told() {
    let yard = Yard::new();
    let config = config();
    for (extra, expected) in [
        (&["--hours", "1"][..], "there is no study of training"),
        (&["--hours", "1"], "marsyard tradeoff"),
        (&["--hours", "0"], "is not a number of hours"),
        (&["--hours", "1", "--disk", "3 parsec"], "no unit of bytes"),
        (&["--hours", "1", "--study", "none.json"], "none.json"),
        (&["--hours", "1", "--write", "nowhere/night.yaml"], "there is no folder nowhere"),
        (&["--hours", "1", "--sample", "3"], "--limit gives that longer"),
        (&["--hours", "1", "--threads", "2"], "--cores says how many cores"),
        (&["--hours", "1", "--no-parts"], "no part is priced"),
        (&["--cores", "2"], "--hours"),
        (&["--study-minutes", "2"], "--hours"),
        (&["--hours", "1", "--study-minutes", "0"], "is not a number above 0"),
        (&["--hours", "1", "--study-minutes", "1", "--study", "some.json"], "cannot be used with"),
        (&["--hours", "1", "--study-minutes", "0.01", "--set", "scene.rocks.diameter_m=0.02"], "put obstacles into"),
        // Beside what excludes hours as well.
        (&["--write", "night.yaml", "--sample", "0"], "give --hours"),
        (&["--disk", "1GB", "--threads", "1", "--sample", "1", "--no-parts"], "give --hours"),
    ] {
        let output = yard.marsyard(["plan", config.as_str()].iter().chain(extra));
        assert_eq!(output.status.code(), Some(2), "{extra:?}: {}", text(&output.stdout));
        let said = text(&output.stderr);
        assert!(said.split_whitespace().collect::<Vec<_>>().join(" ").contains(expected), "{extra:?}: {said}");
    }
    for (study, expected) in
        [(r#"{"marsyard_study": 2}"#, "is no study"), (r#"{"marsyard_study": 1}"#, "a study of format 1")]
    {
        fs::write(yard.path("bad.json"), study).expect("a file");
        let output = yard.marsyard(["plan", &config, "--hours", "1", "--study", "bad.json"]);
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(expected), "{}", text(&output.stderr));
    }
}

#[test]
fn law_a_study_of_the_config_as_it_stands_is_made_once() {
    let yard = Yard::new();
    // Beside the config lies a study of another one.
    fs::copy(config(), yard.path("yard.yaml")).expect("the config");
    fs::create_dir(yard.path("studies")).expect("a folder");
    fs::copy(shipped("studies/quickstart.json"), yard.path("studies/training.json")).expect("the study");
    // A time that pays nothing beyond the least.
    let plan = ["plan", "yard.yaml", "--hours", "0.002", "--limit", "1", "--json", "--study-minutes", "0.01"];
    let made = yard.marsyard(plan);
    let said = text(&made.stderr);
    assert!(made.status.success(), "{said}");
    assert!(said.contains("made of another config, 'quickstart'") && said.contains("a study of 12 scenes"), "{said}");
    let answer: serde_json::Value = serde_json::from_slice(&made.stdout).expect("JSON on stdout");
    assert!(!answer["warnings"].to_string().contains("was made"), "{answer}");
    let file = yard.path("tradeoffs/training/study.json");
    let written = fs::read_to_string(&file).expect("the study");
    let study: serde_json::Value = serde_json::from_str(&written).expect("JSON");
    let largest = &study["settings"][0]["sizes"][3];
    assert_eq!((largest["scenes"].as_u64(), study["seeds"].as_u64()), (Some(12), Some(3)), "{study}");
    let names: Vec<String> =
        study["settings"].as_array().expect("settings").iter().map(|setting| setting["name"].to_string()).collect();
    assert!(names.iter().any(|name| name.contains("dead_reckoning")), "{names:?}");

    let again = yard.marsyard(plan);
    let said = text(&again.stderr);
    assert!(again.status.success() && said.contains("no other is made") && !said.contains("a study of"), "{said}");
    assert_eq!(fs::read_to_string(&file).expect("the study"), written);
}

/// A file of the shipped configs.
fn shipped(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name).display().to_string()
}

/// The answer for paper.yaml by its shipped study, with some overrides.
fn of_paper(yard: &Yard, extra: &[&str]) -> serde_json::Value {
    answer_of(yard, &shipped("paper.yaml"), extra)
}

fn answer_of(yard: &Yard, config: &str, extra: &[&str]) -> serde_json::Value {
    let plan = ["plan", config, "--hours", "0.05", "--cores", "2", "--disk", "2GB", "--limit", "1", "--json"];
    let output = yard.marsyard(plan.iter().chain(extra));
    assert!(output.status.success(), "{extra:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON on stdout")
}

#[test]
fn law_the_setting_that_is_asked_for_is_planned_and_what_the_study_does_not_know_is_told() {
    let yard = Yard::new();
    let answer = |sets: &[&str]| {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let answer = of_paper(&yard, &sets);
        (answer["choices"][0]["setting"].as_str().expect("a name").to_owned(), answer["warnings"].to_string())
    };
    for (sets, setting) in [
        (&[][..], "reference"),
        (&["slam=dead_reckoning"], "slam: dead_reckoning"),
        (&["slam={fastslam: {particles: 300}}", "scenes_per_shard=10"], "slam: 300 particles"),
    ] {
        let (first, warnings) = answer(sets);
        assert_eq!((first.as_str(), warnings.as_str()), (setting, "[]"), "{sets:?}");
    }
    let (_, warnings) = answer(&["slam={fastslam: {particles: 42}}"]);
    assert!(
        warnings.contains("is this config as it is asked for") && !warnings.contains("another state"),
        "{warnings}"
    );
    // What the study's settings do not undo is another config to it, though one of them has the same beams.
    let beams = "sweep.sensor.pattern.tilted";
    let (_, warnings) = answer(&[&format!("{beams}.beams=341"), &format!("{beams}.beam_step_deg=0.703125")]);
    assert!(warnings.contains("another state"), "{warnings}");
}

#[test]
fn law_what_a_plan_wrote_is_planned_by_the_same_study_and_gives_the_same() {
    let yard = Yard::new();
    let written = of_paper(&yard, &["--write", "night.yaml"]);
    let night = fs::read_to_string(yard.path("night.yaml")).expect("the config");
    assert!(night.contains("plan night.yaml --hours 0.05 --study "), "{night}");
    let again = answer_of(&yard, "night.yaml", &["--study", &shipped("studies/paper.json")]);
    assert_eq!((&again["warnings"], again["name"].as_str()), (&serde_json::json!([]), Some("night")), "{again}");
    // The curve alone says how many, and it is the same.
    let told = |answer: &serde_json::Value| ["setting", "scenes", "bound"].map(|key| answer["choices"][0][key].clone());
    assert_eq!(told(&again), told(&written));
    assert_eq!(told(&again)[2], "flat");
    // Of other yards it is told that the study is of another config.
    let other = answer_of(
        &yard,
        "night.yaml",
        &["--study", &shipped("studies/paper.json"), "--set", "scene.rocks.diameter_m=0.5"],
    );
    assert!(other["warnings"].to_string().contains("of another config, 'paper'"), "{other}");
}

#[test]
fn law_a_study_of_few_scenes_ends_the_scenes_and_names_the_command_that_measures_more() {
    let yard = Yard::new();
    let file = fs::read(shipped("studies/paper.json")).expect("the study");
    let mut study: serde_json::Value = serde_json::from_slice(&file).expect("JSON");
    for setting in study["settings"].as_array_mut().expect("settings") {
        let sizes = setting["sizes"].as_array_mut().expect("sizes");
        sizes.truncate(4);
        // A tenth fewer errors a doubling, and no floor in sight.
        for (size, error) in sizes.iter_mut().zip([0.2, 0.18, 0.162, 0.1458]) {
            let mean = 1.0 - error;
            size["balanced_accuracy"]["mean"] = mean.into();
            size["by_seed"].as_array_mut().expect("seeds").iter_mut().for_each(|seed| *seed = mean.into());
        }
    }
    let largest = study["settings"][0]["sizes"][3]["scenes"].as_u64().expect("scenes");
    fs::write(yard.path("steep.json"), study.to_string()).expect("a file");
    let asked = ["--study", "steep.json", "--hours", "20", "--cores", "2", "--disk", "1TB", "--limit", "1"];
    let output = yard.marsyard(["plan", &shipped("paper.yaml")].iter().chain(&asked));
    let said = text(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let scenes = 32 * largest * 100 / 84 / 50 * 50;
    assert!(said.contains(&format!("build: {scenes} scenes")), "{scenes}: {said}");
    assert!(said.contains(&format!("the most scenes that it was measured at, {largest}, and what the ")), "{said}");
    let farther = (4 * largest).div_ceil(160).max(8);
    assert!(said.contains(&format!("--scenes 160 --seeds 3 --farther {farther}` measures more.")), "{said}");
}

#[test]
fn law_nothing_is_planned_into_a_place_that_holds_something_else() {
    let yard = Yard::new();
    let place = |out: &str| {
        let answer = of_paper(&yard, &["--out", out]);
        let scenes = answer["choices"][0]["scenes"].as_u64().expect("scenes");
        (answer["place"].as_str().expect("a path").to_owned(), scenes)
    };
    assert_eq!(place("new").0, "new");
    fs::create_dir(yard.path("empty")).expect("a folder");
    assert_eq!(place("empty").0, "empty");
    fs::create_dir(yard.path("full")).expect("a folder");
    fs::write(yard.path("full/plan.yaml"), "no plan of marsyard's").expect("a file");
    // How many scenes are flat hangs on the study alone, and is the same for all.
    let (beside, scenes) = place("full/");
    assert_eq!(beside, format!("full-{scenes}"));
    fs::create_dir(yard.path(&beside)).expect("a folder");
    fs::write(yard.path(&beside).join("notes.txt"), "mine").expect("a file");
    assert_eq!(place("full").0, format!("full-{scenes}-2"));
}
