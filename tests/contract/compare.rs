//! What is told of corpora: two compared, one inspected by a program, the card that each brings.

use serde_json::Value;

use crate::yard::{Yard, text};

fn json(output: &std::process::Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
}

#[test]
fn law_compare_says_what_differs_and_exits_as_diff_does() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    yard.generate(&Yard::everything(), "few", &["--set", "scenes=4"]);
    yard.generate(&Yard::everything(), "grown", &["--set", "scenes=4"]);
    let same = yard.marsyard(["compare", "few", "grown"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stderr));
    assert!(text(&same.stdout).contains("equal: the same plan, the same rows"), "{}", text(&same.stdout));

    // The same command with more scenes adds to what is there.
    yard.generate(&Yard::everything(), "grown", &["--set", "scenes=6"]);
    let more = yard.marsyard(["compare", "few", "grown", "--json"]);
    assert_eq!(more.status.code(), Some(1));
    let told = json(&more);
    assert_eq!((&told["relation"], &told["keys"][0]["key"]), (&"b_extends_a".into(), &"scenes".into()), "{told}");
    assert_eq!((&told["rows"]["shards_equal"], &told["rows"]["shards_other"]), (&2.into(), &"".into()), "{told}");

    // A corpus and a config: by the keys.
    let set = yard.path("other.yaml");
    let changed = std::fs::read_to_string(Yard::everything()).unwrap().replacen("seed: ", "seed: 9", 1);
    std::fs::write(&set, changed).unwrap();
    let other = yard.marsyard(["compare", "few", "other.yaml"]);
    assert_eq!(other.status.code(), Some(1), "{}", text(&other.stderr));
    assert!(text(&other.stdout).lines().any(|line| line.trim_start().starts_with("seed ")), "{}", text(&other.stdout));
    assert_eq!(yard.marsyard(["compare", &config, &config]).status.code(), Some(0));

    // What cannot be read is no difference.
    assert_eq!(yard.marsyard(["compare", "few", "nowhere"]).status.code(), Some(2));
    std::fs::remove_file(yard.path("grown/shards.jsonl")).unwrap();
    assert_eq!(yard.marsyard(["compare", "few", "grown"]).status.code(), Some(2));
}

#[test]
fn law_inspect_prints_one_json_document_with_all_that_it_tells() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "corpus", &[]);
    let told = json(&yard.marsyard(["inspect", "corpus", "--json"]));
    let manifest: Value = serde_json::from_slice(&std::fs::read(yard.path("corpus/manifest.json")).unwrap()).unwrap();
    for key in ["name", "seed", "corpus_id", "scenes", "shards", "tables", "points", "build"] {
        assert_eq!(told[key], manifest[key], "{key}");
    }
    let features = told["features"].as_array().unwrap();
    assert_eq!(features.len(), manifest["features"].as_array().unwrap().len());
    let said = text(&yard.marsyard(["inspect", "corpus"]).stdout);
    for feature in features {
        let line = said.lines().find(|line| line.starts_with(&format!("{} ", feature["name"].as_str().unwrap())));
        let mean = format!("{:.5}", feature["mean"].as_f64().unwrap());
        assert!(line.is_some_and(|line| line.contains(&mean)), "{feature}: {line:?}");
    }
    let share = told["splits"]["train"]["untraversable_share"].as_f64().unwrap();
    assert!(said.contains(&format!("{:.2} %", 100.0 * share)), "{share}: {said}");
    // Four shards leave a split empty: both forms say so, with the cure.
    let warnings = told["warnings"].as_array().unwrap();
    assert!(warnings.iter().all(|warning| said.contains(warning.as_str().unwrap())));
    assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains("from 7 shards on")), "{warnings:?}");
}

#[test]
fn law_a_licence_changes_the_card_and_no_row() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "corpus", &[]);
    let card = || std::fs::read_to_string(yard.path("corpus/README.md")).unwrap();
    for said in
        ["card.license=", "## Limits of use", "untraversable is a cell that", "wheel diameter", "--set scenes=N"]
    {
        assert!(card().contains(said), "{said} is not in:\n{}", card());
    }
    let id = |at: &str| {
        let bytes = std::fs::read(yard.path(at).join("manifest.json")).unwrap();
        let manifest: Value = serde_json::from_slice(&bytes).unwrap();
        (manifest["corpus_id"].clone(), manifest["scene_plan_hash"].clone())
    };
    let before = id("corpus");
    let sets = [
        "--set",
        "card.license=CC-BY-4.0",
        "--set",
        "card.authors=[Ann Example]",
        "--set",
        "card.date_published=2026-11-22",
    ];
    let output = yard.command(["generate", "corpus"]).args(sets).output().expect("the binary starts");
    assert!(
        output.status.success() && text(&output.stderr).contains("0 of 4 shards to build"),
        "{}",
        text(&output.stderr)
    );
    assert_eq!(id("corpus"), before);
    assert!(card().contains("\nlicense: cc-by-4.0\n") && card().contains("Authors: Ann Example."), "{}", card());
    let croissant: Value = serde_json::from_slice(&std::fs::read(yard.path("corpus/croissant.json")).unwrap()).unwrap();
    assert_eq!(croissant["license"], "https://spdx.org/licenses/CC-BY-4.0");
    assert_eq!(
        (&croissant["creator"][0]["name"], &croissant["datePublished"]),
        (&"Ann Example".into(), &"2026-11-22".into())
    );
    assert!(yard.marsyard(["verify", "corpus"]).status.success());
    // Built in one go it is the same, byte for byte.
    yard.generate(&Yard::everything(), "at-once", &sets);
    for name in ["README.md", "croissant.json", "plan.yaml", "manifest.json"] {
        let [there, here] = ["corpus", "at-once"].map(|at| std::fs::read(yard.path(at).join(name)).unwrap());
        assert!(there == here, "{name}");
    }
    let refused = yard.command(["generate", "corpus", "--set", "card.license=cc-by-4.0"]).output().unwrap();
    assert!(
        refused.status.code() == Some(2) && text(&refused.stderr).contains("CC-BY-4.0"),
        "{}",
        text(&refused.stderr)
    );
}
