//! The contract of `evaluate` and `export`: what they print, where they exit, and that bad input is named with its cure.

use std::path::{Path, PathBuf};

use marsyard::corpus::{Table, sha256};
use marsyard::train::{MODEL_FORMAT, Model};
use serde_json::Value as Json;

use crate::door::mend;
use crate::yard::{Yard, text};

fn corpus_config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml")
}

/// A corpus and a model that was trained on it, in `corpus` and `run`.
fn trained() -> Yard {
    let yard = Yard::new();
    yard.generate(&corpus_config(), "corpus", &[]);
    let sets = ["--set", "network.hidden=[6]", "--set", "epochs=1"];
    let output = yard.marsyard(["train", "corpus", "--out", "run"].iter().chain(&sets));
    assert!(output.status.success(), "{}", text(&output.stderr));
    yard
}

/// Exit status and what was said, in one line.
fn told(yard: &Yard, arguments: &[&str]) -> (Option<i32>, String) {
    let output = yard.marsyard(arguments);
    let said = text(&output.stderr).replace(['\n', '│'], " ");
    (output.status.code(), said.split_whitespace().collect::<Vec<_>>().join(" "))
}

#[test]
fn law_evaluate_prints_a_report_and_writes_its_figures() {
    let yard = trained();
    let output = yard.marsyard(["evaluate", "run", "corpus", "--json", "--out", "judged"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    for key in [
        "model",
        "data",
        "thresholds",
        "groups",
        "points_per_cell",
        "range_m",
        "classes",
        "missed_tops",
        "roc",
        "notes",
    ] {
        assert!(!report[key].is_null(), "{key}");
    }
    assert_eq!(report["data"]["split"], "test");
    let row = report["groups"][0]["network"][0].to_string();
    for rate in ["missed_untraversable", "false_untraversable", "balanced_accuracy", "mcc", "prevalence", "majority"] {
        assert!(row.contains(rate) || report.to_string().contains(rate), "{rate}");
    }
    let written: Json =
        serde_json::from_slice(&std::fs::read(yard.path("judged/evaluation.json")).expect("a report")).expect("JSON");
    // The training judged on the same split by the same code.
    let of_training: Json =
        serde_json::from_slice(&std::fs::read(yard.path("run/evaluation.json")).expect("a report")).expect("JSON");
    assert_eq!(written, report);
    assert_eq!(of_training["groups"], report["groups"]);
    assert!(std::fs::read_dir(yard.path("judged")).expect("a folder").count() > 3, "figures");
    // People get a table, and thresholds of their own.
    let output = yard.marsyard(["evaluate", "run/model.safetensors", "corpus", "--threshold", "0.3,0.6"]);
    assert!(output.status.success() && text(&output.stdout).contains("missed_untraversable"));
}

#[test]
fn exact_what_is_asked_of_an_operating_point_and_cannot_be_had_is_told() {
    let yard = trained();
    for (arguments, code, cure) in [
        (&["--doubtful", "49%"][..], 0, "no cell is doubtful: one threshold keeps both shares"),
        (
            &["--miss-at-most", "0.0001%"],
            0,
            "untraversable cells of the model's validation scenes is less than one cell",
        ),
        (&["--doubtful", "60%"], 2, "take less than 50%"),
        (&["--threshold", "-1"], 2, "rising numbers within 0 and 1"),
        (&["--miss-at-most", "-1%"], 2, "is no share above 0 and below 1"),
        (&["--threshold", "-0.1,0.2"], 2, "rising numbers within 0 and 1"),
    ] {
        let (status, said) = told(&yard, &[&["evaluate", "run", "corpus"], arguments].concat());
        assert!(status == Some(code) && said.contains(cure), "{arguments:?}: {status:?} {said}");
    }
    let (_, said) = told(&yard, &["evaluate", "run", "corpus", "--miss-at-most", "10%"]);
    assert!(!said.contains("less than one cell"), "{said}");
}

#[test]
fn equal_a_rule_in_short_and_as_a_mapping() {
    let yard = trained();
    let of = |rule: &str| {
        let output = yard.marsyard(["evaluate", "run", "corpus", "--json", "--labels", rule]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        output.stdout
    };
    assert_eq!(of("taller_than_m=0.2"), of("{obstacle: {taller_than_m: 0.2}}"));
    for (rule, cure) in [
        ("tall", "'tall' is not part of a rule"),
        ("max_drop_m=0.2", "build it again with `cells.labels: {max_drop_m: 0.2}`"),
    ] {
        let (code, said) = told(&yard, &["evaluate", "run", "corpus", "--labels", rule]);
        assert!(code == Some(2) && said.contains(cure), "{code:?} {said}");
    }
}

/// On the validation scenes themselves, counted again cell by cell.
#[test]
fn exact_operating_points_keep_their_promise_on_the_validation_split() {
    let yard = trained();
    let report = |arguments: &[&str]| -> Json {
        let asked = ["evaluate", "run", "corpus", "--split", "validation", "--json"];
        let output = yard.marsyard(asked.iter().chain(arguments));
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let share = |report: &Json, threshold: usize, name: &str| {
        report["groups"][0]["network"]["at"][threshold]["cells"][name].as_f64().expect("a share")
    };
    let calibration = Model::read(&yard.path("run/model.safetensors")).expect("a model").about.calibration;
    let calibration = calibration.expect("a calibration");
    for percent in [2.0, 10.0] {
        let asked = format!("{percent}%");
        let judged = report(&["--miss-at-most", &asked]);
        assert!(share(&judged, 0, "missed_untraversable") <= percent / 100.0, "{asked}");
        let given = judged["thresholds"][0]["value"].as_f64().expect("a threshold");
        let curve = calibration.curve.iter().find(|point| point[0] == given).expect("a point of the curve");
        assert_eq!([share(&judged, 0, "missed_untraversable"), share(&judged, 0, "false_untraversable")], curve[1..]);
        let doubt = &report(&["--doubtful", &asked])["doubt"];
        let counts = |name: &str| [0, 1].map(|class| doubt[name][class].as_u64().expect("a count"));
        assert_eq!((counts("cells"), doubt["allowed_share"].as_f64()), (calibration.cells, Some(percent / 100.0)));
        for (wrong, cells) in counts("wrong").into_iter().zip(counts("cells")) {
            assert!(wrong as f64 <= percent / 100.0 * cells as f64, "{asked}: {doubt}");
        }
    }
    // Platt's two numbers make the mean probability the share that there is, but for his targets.
    let probabilities = &report(&[])["groups"][0]["probabilities"];
    let sums = probabilities["bins"].as_array().expect("bins").iter().map(|bin| {
        let number = |name: &str| bin[name].as_f64().expect("a number");
        [number("cells") * number("mean_probability"), number("cells") * number("untraversable_share"), number("cells")]
    });
    let [given, there, cells] = sums.fold([0.0; 3], |sum, bin| std::array::from_fn(|k| sum[k] + bin[k]));
    assert!((given - there).abs() <= 1.0 + 0.002 * cells, "{given} of {there} in {cells}");
    for (arguments, told) in [
        (["--miss-at-most", "0"], "1% or 0.01"),
        (["--doubtful", "101%"], "1% or 0.01"),
        (["--threshold", "0.6,0.3"], "rising numbers"),
    ] {
        let (code, said) = self::told(&yard, &[&["evaluate", "run", "corpus"], &arguments[..]].concat());
        assert!(code == Some(2) && said.contains(told), "{arguments:?}: {said}");
    }
}

/// The score of a seen value: between two knots in proportion, beyond them the outermost.
fn between(at: &[f64], score: &[f64], x: f64) -> f64 {
    let above = at.iter().position(|knot| x < *knot).unwrap_or(at.len());
    match (above.checked_sub(1), score.get(above)) {
        (None, _) => score[0],
        (Some(below), None) => score[below],
        (Some(below), Some(next)) => score[below] + (next - score[below]) * (x - at[below]) / (at[above] - at[below]),
    }
}

#[test]
fn law_export_prints_weights_that_give_the_outputs_beside_them() {
    let yard = trained();
    let output = yard.marsyard(["export", "run", "--json", "-", "--onnx", "model.onnx"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let exported: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    let model = Model::read(&yard.path("run/model.safetensors")).expect("a model");
    assert_eq!(exported["about"]["features"].as_array().map(Vec::len), Some(model.about.features.len()));
    assert_eq!(model.about.inputs, 2 * model.about.features.len());
    let numbers = |value: &Json| -> Vec<f64> {
        value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    let rows = exported["check"]["features"].as_array().expect("rows");
    for (row, output) in rows.iter().zip(numbers(&exported["check"]["outputs"])) {
        // By the exported weights alone.
        let scaler = &exported["about"]["scaler"];
        let (mean, scale, clip) =
            (numbers(&scaler["mean"]), numbers(&scaler["scale"]), scaler["clip"].as_f64().expect("a clip"));
        let row = numbers(row);
        let minus = |k: usize| scaler["minus"][k].as_u64().map_or(0.0, |other| row[other as usize]);
        let values: Vec<f64> = (0..row.len()).map(|k| row[k] - minus(k)).collect();
        let scaled = (0..row.len()).map(|k| ((values[k] - mean[k]) / scale[k]).clamp(-clip, clip));
        let scores = (0..row.len()).map(|k| {
            let of = &scaler["scores"][k];
            let unseen = of["unseen"].as_f64().filter(|_| values[k] == 0.0);
            unseen.unwrap_or_else(|| between(&numbers(&of["at"]), &numbers(&of["score"]), values[k]))
        });
        let inputs: Vec<f64> = scaled.chain(scores).collect();
        let of_member = |layers: &Json| {
            let mut values = inputs.clone();
            for layer in layers.as_array().expect("layers") {
                let neurons = layer["weights"].as_array().expect("weights").iter().zip(numbers(&layer["biases"]));
                values = neurons
                    .map(|(weights, bias)| {
                        let sum: f64 = numbers(weights).iter().zip(&values).map(|(w, x)| w * x).sum();
                        1.0 / (1.0 + marsyard::math::exp(-sum - bias))
                    })
                    .collect();
            }
            values[0]
        };
        let members = exported["members"].as_array().expect("members");
        let mean = members.iter().map(of_member).sum::<f64>() / members.len() as f64;
        assert!(members.len() == 2 && (mean - output).abs() < 1e-12, "{mean} {output}");
    }
    assert!(std::fs::metadata(yard.path("model.onnx")).expect("a file").len() > 500);
    let (code, said) = told(&yard, &["export", "run"]);
    assert!(code == Some(2) && said.contains("--onnx"), "{said}");
}

/// Puts other bytes in the place of a shard's cells and says so in `shards.jsonl`, as a cheat would.
fn cook(yard: &Yard, corpus: &str, bytes: &[u8], facts: &Json) {
    let path = Table::Cells.path(6);
    std::fs::write(yard.path(corpus).join(&path), bytes).expect("a file");
    let books = yard.path(corpus).join("shards.jsonl");
    let lines = std::fs::read_to_string(&books).expect("the books");
    let mut lines: Vec<Json> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let cells = &mut lines[6]["tables"]["cells"];
    for key in ["rows", "row_groups"] {
        cells[key] = facts[key].clone();
    }
    (cells["bytes"], cells["sha256"]) = (bytes.len().into(), sha256(bytes).into());
    std::fs::write(&books, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).expect("a file");
    mend(&yard.path(corpus));
}

#[test]
fn extreme_damaged_and_foreign_shards_are_named_with_the_cure() {
    let yard = trained();
    let path = Table::Cells.path(6);
    let file = yard.path("corpus").join(&path);
    let whole = std::fs::read(&file).expect("a shard of the test split");
    let evaluate = ["evaluate", "run", "corpus"];
    let mut flipped = whole.clone();
    flipped[whole.len() / 3] ^= 4;
    for (bytes, says) in [
        (&whole[..whole.len() / 2], "shards.jsonl says"),
        (&flipped[..], "its sha256 is not that of shards.jsonl"),
        (&vec![b'x'; whole.len()][..], "its sha256 is not that of shards.jsonl"),
    ] {
        std::fs::write(&file, bytes).expect("a file");
        let (code, said) = told(&yard, &evaluate);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(&path) && said.contains(says) && said.contains("marsyard verify corpus"), "{said}");
    }
    // Books that were cooked: the file is asked whose it is all the same.
    let books = std::fs::read_to_string(yard.path("corpus/shards.jsonl")).expect("the books");
    let line: Json = serde_json::from_str(books.lines().nth(6).expect("seven shards")).expect("JSON");
    let scenes = std::fs::read(yard.path("corpus").join(Table::Scenes.path(6))).expect("another table");
    cook(&yard, "corpus", &scenes, &line["tables"]["scenes"]);
    for arguments in [&evaluate[..], &["evaluate", "run", "corpus", "--split", "test"]] {
        let (code, said) = told(&yard, arguments);
        assert!(
            code == Some(1) && said.contains(&path) && said.contains("its own marsyard.table is 'scenes', not 'cells'"),
            "{said}"
        );
    }
    cook(&yard, "corpus", &[b'x'; 4000], &line["tables"]["cells"]);
    let (code, said) = told(&yard, &evaluate);
    assert!(code == Some(1) && said.contains(&path) && said.contains("cannot be read as Parquet"), "{said}");
}

#[test]
fn extreme_corpora_of_another_version_and_models_of_other_features_are_refused() {
    let yard = trained();
    yard.generate(&corpus_config(), "other", &["--set", "cells.neighbours=4"]);
    let (code, said) = told(&yard, &["evaluate", "run", "other"]);
    assert!(
        code == Some(2) && said.contains("the model takes neighbour_") && said.contains("features: listed"),
        "{said}"
    );
    yard.generate(&corpus_config(), "coarse", &["--set", "cells.size_m=0.2"]);
    let (code, said) = told(&yard, &["evaluate", "run", "coarse"]);
    assert!(code == Some(2) && said.contains("cells.size_m: 0.1"), "{said}");
    let (code, said) = told(&yard, &["train", "corpus", "coarse", "--out", "both"]);
    assert!(code == Some(2) && said.contains("cells.size_m is 0.2"), "{said}");
    let manifest = yard.path("corpus/manifest.json");
    let there = std::fs::read_to_string(&manifest).expect("a manifest");
    std::fs::write(&manifest, there.replacen("\"format\": 2", "\"format\": 9", 1)).expect("a file");
    for arguments in [&["evaluate", "run", "corpus"][..], &["train", "corpus", "--out", "again"]] {
        let (code, said) = told(&yard, arguments);
        assert!(
            code == Some(1)
                && said.contains("manifest.json")
                && said.contains("format 9, this program reads formats 1 to 2; use the"),
            "{said}"
        );
    }
    let (code, said) = told(&yard, &["evaluate", "run", "nowhere"]);
    assert!(code == Some(2) && said.contains("nowhere"), "{said}");
}

#[test]
fn extreme_model_files_that_are_none_are_named_by_every_verb() {
    let yard = trained();
    let whole = std::fs::read(yard.path("run/model.safetensors")).expect("a model");
    std::fs::write(yard.path("cut.safetensors"), &whole[..whole.len() / 2]).expect("a file");
    std::fs::write(yard.path("foreign.safetensors"), [7; 300]).expect("a file");
    let key = b"\\\"marsyard_model\\\":";
    let digit = whole.windows(key.len()).position(|part| part == key).expect("its format") + key.len();
    let mut bytes = whole.clone();
    bytes[digit] = b'0' + (MODEL_FORMAT + 1) as u8;
    let newer = format!("a model of format {}", MODEL_FORMAT + 1);
    std::fs::write(yard.path("newer.safetensors"), &bytes).expect("a file");
    std::fs::write(yard.path("cloud.csv"), "x,y,z\n1,2,0\n").expect("a file");
    for (file, says) in [
        ("cut.safetensors", "give the `model.safetensors` of a run folder"),
        ("foreign.safetensors", "give the `model.safetensors` of a run folder"),
        ("newer.safetensors", &newer),
        ("none.safetensors", "none.safetensors"),
    ] {
        for arguments in [
            &["evaluate", file, "corpus"][..],
            &["export", file, "--json", "-"],
            &["classify", file, "cloud.csv", "--pose=0,0,0,0,0,0"],
            &["train", "corpus", "--out", "on", "--init", file],
        ] {
            let (code, said) = told(&yard, arguments);
            assert_eq!(code, Some(2), "{arguments:?}: {said}");
            assert!(said.contains(file) && said.contains(says), "{arguments:?}: {said}");
        }
    }
    assert!(!yard.path("on").exists());
}
