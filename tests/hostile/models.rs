use std::path::Path;
use std::sync::LazyLock;

use marsyard::search::journal::Journal;
use marsyard::train::Model;
use marsyard::train::looks::{self, LookLog, Looks};
use proptest::prelude::*;
use serde_json::json;

use crate::corpora::CORPUS;
use crate::edits::{JSON, apply, cases, edits};
use crate::heap::bounded;

/// What means something in these files, beside JSON's own.
const TOKENS: &[&str] = &[
    "\"dtype\":\"F64\"",
    "\"shape\":[1099511627776]",
    "\"data_offsets\":[0,18446744073709551615]",
    "\"hidden\":[4294967295]",
];

/// A model that marsyard trained: three neurons.
static MODEL: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let run = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hostile-run");
    let _ = std::fs::remove_dir_all(&run);
    let trained = std::process::Command::new(env!("CARGO_BIN_EXE_marsyard"))
        .arg("train")
        .arg(&*CORPUS)
        .args(["--set", "network.hidden=[3]", "--set", "epochs=1", "--out"])
        .arg(&run)
        .output()
        .expect("the binary starts");
    assert!(trained.status.success(), "{}", String::from_utf8_lossy(&trained.stderr));
    unchecked(&std::fs::read(run.join("model.safetensors")).expect("a model"))
});

/// The model in the format before, without the checksum, by which every broken one below would be refused at once.
fn unchecked(bytes: &[u8]) -> Vec<u8> {
    let mut model = Model::load(bytes).expect("a model");
    (model.about.marsyard_model, model.about.run) = (1, None);
    model.save().expect("a model")
}

/// The header of a safetensors file changed, and its length put right.
fn with_header(bytes: &[u8], change: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let header = change(&bytes[8..8 + length]);
    [&(header.len() as u64).to_le_bytes(), header.as_slice(), &bytes[8 + length..]].concat()
}

fn load(bytes: &[u8]) {
    if let Ok(model) = bounded(bytes.len(), || Model::load(bytes)) {
        let inputs = vec![0.5f32; model.about.features.len()];
        let output = bounded(bytes.len(), || model.output(&inputs));
        assert!((0.0..=1.0).contains(&output), "{output}");
    }
}

#[test]
fn the_model_that_is_broken_below_is_whole() {
    Model::load(&MODEL).expect("a model");
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn extreme_broken_models_are_refused_or_still_models(edits in edits(&[JSON, TOKENS].concat())) {
        load(&apply(&MODEL, &edits));
    }

    #[test]
    fn extreme_models_with_broken_headers_are_refused_or_still_models(edits in edits(&[JSON, TOKENS].concat())) {
        load(&with_header(&MODEL, |header| apply(header, &edits)));
    }

    #[test]
    fn extreme_broken_journals_are_gone_on_with_or_refused(edits in edits(&[JSON, TOKENS].concat())) {
        let folder = tempfile::tempdir().expect("a folder");
        let identity = json!({"rows": 3, "config": {"seed": 1}});
        let line = "{\"hidden\":[4,2],\"rung\":0,\"weights\":30,\"rows\":100,\"best_rows\":50,\"validation_error\":0.1,\"balanced_accuracy\":\
            0.9,\"auc\":0.95,\"stopped\":\"epochs\",\"rejected\":0,\"rebuilt\":0,\"seconds\":0.1}\n";
        let text = format!("{}\n{line}{line}", json!({"search": identity}));
        let bytes = apply(text.as_bytes(), &edits);
        std::fs::write(folder.path().join("search.jsonl"), &bytes).expect("a file");
        if let Ok(journal) = bounded(bytes.len(), || Journal::open(folder.path(), &identity)) {
            let _ = journal.get(0, &[4, 2]);
            prop_assert!(journal.trainings() <= bytes.len());
        }
    }

    #[test]
    fn extreme_broken_logs_of_looks_are_gone_on_with(keep in 0..4usize, edits in edits(&[JSON, TOKENS].concat())) {
        let folder = tempfile::tempdir().expect("a folder");
        let line = "{\"rows\":100,\"epoch\":0,\"train_error\":0.1,\"validation_error\":0.1,\"best\":true,\"elapsed_s\":0.5}\n";
        let bytes = apply(line.repeat(3).as_bytes(), &edits);
        std::fs::write(folder.path().join("training.jsonl"), &bytes).expect("a file");
        let there = bounded(bytes.len(), || looks::read(folder.path(), u64::MAX));
        let kept = Looks::new(there.into_iter().take(keep).collect());
        bounded(bytes.len(), || LookLog::begin(folder.path(), &kept)).expect("a log");
        prop_assert_eq!(looks::read(folder.path(), u64::MAX), kept.lines());
    }
}
