//! These tests read, find and refuse studies, and hold the shipped ones against today's training. Others take their studies from `setting` and
//! `study`.

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
    StudySetting {
        name: name.into(),
        sets,
        told,
        gain: None,
        of_few_scenes: None,
        sizes: [16, 32, 64, 128].map(size).into(),
    }
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
        features: Vec::new(),
        settings,
        written: None,
        tells_few_scenes: false,
    }
}

#[test]
fn equal_the_studies_that_are_shipped_are_trained_as_train_does_it() {
    // A change of the default makes them stale: `python scripts/studies.py` makes them anew.
    for name in ["quickstart", "paper", "mixed", "mars"] {
        let config = Path::new("configs").join(format!("{name}.yaml"));
        let (_, study) = Study::find(&config, name).unwrap();
        let plan = crate::config::load(&config, &[]).unwrap();
        assert!(study.is_trained_as_now(&plan), "{name}");
        // Other columns by the same word, and none that are told.
        let lacking = Study { features: study.features[1..].to_vec(), ..study.clone() };
        let silent = Study { features: Vec::new(), ..study };
        assert!(!lacking.is_trained_as_now(&plan) && !silent.is_trained_as_now(&plan), "{name}");
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
                other.sizes[1].scenes = 33;
                s.settings.push(other);
            },
            "a size of 33 scenes where 'truth' has one of 32",
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
    assert_eq!(Study::find(&config, "small").unwrap(), (path.clone(), good.clone()));
    // Files of the two formats before have fewer keys.
    for format in [2, 3] {
        let mut earlier = serde_json::to_value(&good).unwrap();
        earlier["marsyard_study"] = format.into();
        std::fs::write(&path, earlier.to_string()).unwrap();
        assert_eq!(Study::read(&path).unwrap(), Study { marsyard_study: format, ..good.clone() });
    }
    for (text, told) in [("{}", "is no study"), (r#"{"marsyard_study": 1, "settings": []}"#, "format 1, and this")] {
        std::fs::write(&path, text).unwrap();
        let error = Study::find(&config, "small").unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
    }
}

#[test]
fn exact_rows_beside_another_setting_are_those_of_the_same_scenes() {
    let (one, mut other) =
        (setting("one", None, (0.03, 1.0), (0.01, 0.01)), setting("other", None, (0.03, 1.0), (0.01, 0.01)));
    other.sizes.iter_mut().for_each(|size| size.train_rows *= 0.5);
    assert_eq!((other.rows_beside(&one), one.rows_beside(&other)), (0.5, 2.0));
    // Followed to more scenes than the other: by the most that both have.
    let larger = StudySize { scenes: 256, train_rows: 1e9, ..other.largest().clone() };
    other.sizes.push(larger);
    assert_eq!(other.rows_beside(&one), 0.5);
}
