//! Folders have owners: marsyard writes into a place that is empty, not there yet, or its own, and never replaces a file that it did not
//! write, nor its own input. What is refused is refused with exit code 2, the place, the first foreign file, the rule and the cure, and
//! nothing is touched: no name, no byte, no time, not by a file that comes and goes either.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::time::SystemTime;

use crate::yard::{Yard, text};

const RULE: &str = "marsyard writes into a place that is empty, not there yet, or its own; it never replaces a file that it did not \
                    write, nor its own input";

/// What there is at a path: bytes or a link's end, and when it was changed. A folder changes with every name in it.
type Tree = BTreeMap<PathBuf, (Vec<u8>, SystemTime)>;

fn tree(path: &Path) -> Tree {
    let mut found = Tree::new();
    let facts = fs::symlink_metadata(path).expect("something to look at");
    let bytes = if facts.is_dir() {
        for entry in fs::read_dir(path).expect("a folder") {
            found.extend(tree(&entry.expect("an entry").path()));
        }
        Vec::new()
    } else if facts.is_symlink() {
        fs::read_link(path).expect("a link").into_os_string().into_encoded_bytes()
    } else {
        fs::read(path).expect("a readable file")
    };
    found.insert(path.to_owned(), (bytes, facts.modified().expect("a time")));
    found
}

/// Writes files, and the folders that they lie in.
fn lay(yard: &Yard, files: &[(&str, &str)]) {
    for (name, content) in files {
        let path = yard.path(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("folders");
        fs::write(path, content).expect("a file");
    }
}

/// Runs a command that must be refused with these words and the rule, and must touch nothing.
fn refused(yard: &Yard, arguments: &[&str], words: &[&str]) {
    let said = refused_by_another_rule(yard, arguments, words);
    assert!(said.contains(RULE), "{arguments:?}: {said}");
}

fn refused_by_another_rule(yard: &Yard, arguments: &[&str], words: &[&str]) -> String {
    let before = tree(&yard.path(""));
    let output = yard.marsyard(arguments);
    // Long lines are wrapped for people.
    let said = text(&output.stderr).replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    words.iter().for_each(|word| assert!(said.contains(word), "{arguments:?}: '{word}' is not in: {said}"));
    let after = tree(&yard.path(""));
    let names = |tree: &Tree| tree.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&before), names(&after), "{arguments:?}");
    before.iter().for_each(|(path, there)| assert!(*there == after[path], "{arguments:?} touched {}", path.display()));
    said
}

fn succeeds(yard: &Yard, arguments: &[&str]) {
    let output = yard.marsyard(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
}

fn everything() -> String {
    Yard::everything().display().to_string()
}

fn training() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml").display().to_string()
}

#[test]
fn regress_generate_touches_no_folder_of_another() {
    let yard = Yard::new();
    let config = everything();
    for (place, files, first) in [
        ("readme", &[("readme/README.md", "mine")][..], "README.md"),
        (
            "project",
            &[("project/README.md", "mine"), ("project/manifest.json", "mine"), ("project/.tmp-notes", "mine")],
            ".tmp-notes",
        ),
        ("hidden", &[("hidden/.gitignore", "")], ".gitignore"),
        ("folders", &[("folders/src/main.c", "mine")], "src"),
        ("receipts", &[("receipts/receipts/0000000.json", "{}")], "receipts"),
        ("temporary", &[("temporary/.marsyard-tmp-notes", "mine")], ".marsyard-tmp-notes"),
    ] {
        lay(&yard, files);
        symlink(yard.path(place), yard.path(&format!("{place}-link"))).expect("a link");
        for mode in [&[][..], &["--plan-only"], &["--shards", "0..1"]] {
            refused(
                &yard,
                &[&["generate", &config, "--out", place], mode].concat(),
                &[place, &format!("holds {first}")],
            );
        }
        refused(&yard, &["generate", &config, "--out", &format!("{place}-link")], &[first]);
    }
    lay(&yard, &[("plan/plan.yaml", "seed: 1\n"), ("file", "mine")]);
    symlink(yard.path("nowhere"), yard.path("dangling")).expect("a link");
    refused_by_another_rule(&yard, &["generate", &config, "--out", "plan"], &["plan.yaml was not written by marsyard"]);
    refused_by_another_rule(&yard, &["generate", &config, "--out", "file"], &["name a folder"]);
    refused_by_another_rule(
        &yard,
        &["generate", &config, "--out", "dangling"],
        &["a link to a folder that is not there"],
    );
    refused(&yard, &["generate", &config, "--out", "."], &["holds"]);
}

#[test]
fn law_generate_takes_what_is_empty_not_there_or_its_own() {
    let yard = Yard::new();
    let config = everything();
    fs::create_dir(yard.path("empty")).expect("a folder");
    symlink(yard.path("empty"), yard.path("link")).expect("a link");
    // What a build that was killed in its first moments leaves.
    lay(&yard, &[("begun/.marsyard-tmp-4711-x1", "# scene_plan")]);
    for place in ["absent/deep", "link", "begun"] {
        succeeds(&yard, &["generate", &config, "--out", place, "--plan-only"]);
        succeeds(&yard, &["generate", &config, "--out", place, "--plan-only"]);
        let there: Vec<_> = tree(&yard.path(place).canonicalize().expect("a folder")).into_keys().collect();
        assert_eq!(there.len(), 2, "the folder and its plan: {there:?}");
    }
    assert!(fs::symlink_metadata(yard.path("link")).expect("a link").is_symlink());
}

#[test]
fn law_a_folder_that_cannot_be_written_is_left_as_it_is() {
    use std::os::unix::fs::PermissionsExt;
    let yard = Yard::new();
    let folder = yard.path("closed");
    fs::create_dir(&folder).expect("a folder");
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).expect("permissions");
    if fs::write(folder.join("probe"), "").is_ok() {
        eprintln!("skipped: this user may write everywhere");
        return;
    }
    let output = yard.marsyard(["generate", &everything(), "--out", "closed"]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), 0);
}

#[test]
fn law_files_of_others_in_a_corpus_stay_and_are_never_replaced() {
    let yard = Yard::new();
    let config = everything();
    yard.generate(&Yard::everything(), "corpus", &[]);
    let others = ["notes.txt", ".tmp-notes", ".tmp-4711-x1", "data/cells/.tmp-4711-x1", "receipts/.tmp-notes"];
    others.iter().for_each(|name| lay(&yard, &[(&format!("corpus/{name}"), "mine")]));
    lay(&yard, &[("corpus/.marsyard-tmp-4711-x1", "half"), ("corpus/data/cells/.marsyard-tmp-4711-x1", "half")]);
    let kept = |yard: &Yard| others.map(|name| tree(&yard.path("corpus").join(name)));
    let before = kept(&yard);
    succeeds(&yard, &["generate", &config, "--out", "corpus"]);
    succeeds(&yard, &["finalize", "corpus"]);
    fs::remove_file(yard.path("corpus/data/poses/train-0000001.parquet")).expect("a shard");
    succeeds(&yard, &["verify", "corpus", "--repair"]);
    assert_eq!(before, kept(&yard));
    assert!(!tree(&yard.path("corpus")).keys().any(|path| path.to_string_lossy().contains(".marsyard-tmp-")));

    // What stands under a name of marsyard's is its own, however damaged, or is refused.
    for name in ["README.md", "croissant.json", "manifest.json", "shards.jsonl", "report.json"] {
        let path = yard.path("corpus").join(name);
        let own = fs::read(&path).expect("a file");
        fs::write(&path, "mine").expect("a file");
        for arguments in [&["generate", &config, "--out", "corpus"][..], &["finalize", "corpus"]] {
            refused(
                &yard,
                arguments,
                &[&format!("corpus holds {name}, which marsyard did not write"), "move the file away"],
            );
        }
        fs::write(&path, &own[..own.len() / 2]).expect("a file");
        succeeds(&yard, &["generate", &config, "--out", "corpus"]);
        assert!(name == "report.json" || fs::read(&path).expect("a file") == own, "{name}");
    }
}

#[test]
fn regress_texts_that_were_edited_by_hand_are_not_replaced() {
    let yard = Yard::new();
    let config = everything();
    succeeds(&yard, &["generate", &config, "--out", "corpus", "--shards", "0..4"]);
    let [card, croissant] = ["README.md", "croissant.json"].map(|name| yard.path("corpus").join(name));
    // Before there is a manifest: by how they begin and end.
    for mine in ["---\npretty_name: mine\n---\n", "{\n  \"@context\": \"mine\"\n}\n"] {
        let path = if mine.starts_with('-') { &card } else { &croissant };
        fs::write(path, mine).expect("a file");
        refused(&yard, &["finalize", "corpus"], &["which was changed since marsyard wrote it", "move the file away"]);
        fs::remove_file(path).expect("a file");
    }
    fs::write(&card, "# mine\n- marsyard\nMade by `marsyard 0.1.0`").expect("a file");
    refused(&yard, &["finalize", "corpus"], &["corpus holds README.md, which marsyard did not write"]);
    fs::remove_file(&card).expect("a file");
    succeeds(&yard, &["finalize", "corpus"]);
    for path in [&card, &croissant] {
        let own = fs::read_to_string(path).expect("a text");
        let edited = own.replacen("lidar", "lidar, mine,", 1);
        fs::write(path, &edited).expect("a file");
        refused(&yard, &["finalize", "corpus"], &["which was changed since marsyard wrote it", "move the file away"]);
        for verb in [&["generate", &config, "--out", "corpus"][..], &["verify", "corpus", "--repair"]] {
            assert_eq!(yard.marsyard(verb).status.code(), Some(2), "{verb:?}");
            assert_eq!(fs::read_to_string(path).expect("a text"), edited, "{verb:?}");
        }
        let said = text(&yard.marsyard(["inspect", "corpus"]).stderr);
        assert!(said.contains("move away what was edited"), "{said}");
        fs::rename(path, path.with_extension("mine")).expect("a file to move");
        succeeds(&yard, &["finalize", "corpus"]);
        assert_eq!(fs::read_to_string(path).expect("a text"), own);
    }
}

#[test]
fn regress_repair_removes_no_file_of_another() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "corpus", &[]);
    yard.generate(&Yard::everything(), "other", &["--set", "seed=1"]);
    let shard = yard.path("corpus/data/cells/train-0000001.parquet");
    let receipt = yard.path("corpus/receipts/0000001.json");
    let (own_shard, own_receipt) = (fs::read(&shard).expect("a shard"), fs::read(&receipt).expect("a receipt"));
    let others = fs::read(yard.path("other/data/cells/train-0000001.parquet")).expect("a shard");
    let damaged: Vec<u8> = own_shard.iter().enumerate().map(|(k, byte)| byte ^ u8::from(k == 999)).collect();

    fs::remove_file(&receipt).expect("a receipt");
    for foreign in [&b"PAR1 mine"[..], &others] {
        fs::write(&shard, foreign).expect("a file");
        let words =
            ["corpus holds data/cells/train-0000001.parquet, which marsyard did not write", "move the file away"];
        refused(&yard, &["verify", "corpus", "--repair"], &words);
    }
    // A receipt does not make a whole table of another corpus this one's.
    fs::write(&receipt, &own_receipt).expect("a receipt");
    refused(
        &yard,
        &["verify", "corpus", "--repair"],
        &["data/cells/train-0000001.parquet, which marsyard did not write"],
    );
    fs::write(&shard, &own_shard).expect("a shard");
    fs::write(&receipt, "mine").expect("a file");
    refused(&yard, &["verify", "corpus", "--repair"], &["corpus holds receipts/0000001.json"]);

    // Named by a receipt of the plan, or of the plan by its own metadata: marsyard's own, and built anew.
    fs::write(&receipt, &own_receipt).expect("a receipt");
    fs::write(&shard, &damaged).expect("a shard");
    succeeds(&yard, &["verify", "corpus", "--repair"]);
    assert!(fs::read(&shard).expect("a shard") == own_shard);
    fs::remove_file(&receipt).expect("a receipt");
    fs::write(&receipt, &own_receipt[..own_receipt.len() / 2]).expect("a receipt");
    succeeds(&yard, &["verify", "corpus", "--repair"]);
    assert!(fs::read(&receipt).expect("a receipt") == own_receipt);
}

#[test]
fn law_hashes_of_stages_are_added_to_no_file_of_another() {
    let yard = Yard::new();
    lay(&yard, &[("notes.txt", "mine"), ("config.yaml", &fs::read_to_string(Yard::everything()).expect("a config"))]);
    let generate = |file| ["generate", "config.yaml", "--out", "corpus", "--shards", "0", "--stage-hashes", file];
    refused(&yard, &generate("notes.txt"), &["holds notes.txt, which marsyard did not write"]);
    refused(&yard, &generate("config.yaml"), &["holds config.yaml, which is an input"]);
    succeeds(&yard, &generate("hashes"));
    fs::remove_dir_all(yard.path("corpus")).expect("a corpus");
    succeeds(&yard, &generate("hashes"));
}

/// The files of a corpus in `corpus`, a model of it in `run`, and a cloud; made once, for all tests.
static TRAINED: LazyLock<BTreeMap<String, Vec<u8>>> = LazyLock::new(|| {
    let yard = Yard::new();
    succeeds(&yard, &["generate", &training(), "--out", "corpus"]);
    succeeds(&yard, &["train", "corpus", "--out", "run", "--set", "network.hidden=[2]", "--set", "epochs=1"]);
    let height = |x: i32, y: i32| if (x, y) == (5, 5) { 0.5 } else { 0.0 };
    let grid = (0..400).map(|k| (k % 20 - 10, k / 20 - 10));
    let points: String =
        grid.map(|(x, y)| format!("{},{},{}\n", f64::from(x) * 0.2, f64::from(y) * 0.2, height(x, y) - 0.4)).collect();
    lay(&yard, &[("clouds/scan.csv", &format!("x,y,z\n{points}"))]);
    yard.identity("")
});

fn trained() -> Yard {
    let yard = Yard::new();
    for (name, bytes) in TRAINED.iter() {
        fs::create_dir_all(yard.path(name).parent().expect("a folder")).expect("folders");
        fs::write(yard.path(name), bytes).expect("a file");
    }
    yard
}

const LEDGER: &str = "marsyard.sha256";

#[test]
fn regress_results_replace_no_file_of_another_and_no_input() {
    let yard = trained();
    let config = training();
    lay(&yard, &[("project/cells.parquet", "mine"), ("project/notes.txt", "mine"), ("empty.yaml", "{}")]);
    let classify = ["classify", "run", "clouds/scan.csv", "--pose=0,0,0.4,0,0,0"];
    let preview = ["preview", &config, "--scene", "0"];
    let evaluate = ["evaluate", "run", "corpus"];
    for (verb, one) in [(&classify[..], "cells.parquet"), (&preview, "scene-0-top.png"), (&evaluate, "evaluation.json")]
    {
        let into = |out| [verb, &["--out", out]].concat();
        let own = format!("own/{}", verb[0]);
        refused(
            &yard,
            &into("project"),
            &["project holds cells.parquet, which marsyard did not write", "another place"],
        );
        refused(&yard, &into("."), &["holds"]);
        refused(&yard, &into("corpus"), &["corpus holds"]);
        refused(&yard, &into("run"), &["run holds"]);
        refused_by_another_rule(&yard, &into("empty.yaml"), &["name a folder"]);

        succeeds(&yard, &into(&own));
        let mut check = Command::new("sha256sum");
        let checked = check.args(["--check", "--strict", LEDGER]).current_dir(yard.path(&own)).output();
        assert!(checked.is_ok_and(|output| output.status.success()), "{own}: the ledger is none");
        // Its own, and a file beside it that it never writes.
        lay(&yard, &[(&format!("{own}/notes.txt"), "mine"), (&format!("{own}/.marsyard-tmp-4711-x1"), "half")]);
        let notes = tree(&yard.path(&own).join("notes.txt"));
        let whole = fs::read(yard.path(&own).join(one)).expect("a result");
        succeeds(&yard, &into(&own));
        assert_eq!(notes, tree(&yard.path(&own).join("notes.txt")));
        assert!(!yard.path(&own).join(".marsyard-tmp-4711-x1").exists());
        // Changed by hand, or not marsyard's at all.
        let file = yard.path(&own).join(one);
        fs::write(&file, "mine").expect("a file");
        refused(&yard, &into(&own), &[&format!("holds {one}, which was changed since marsyard wrote it")]);
        fs::remove_file(&file).expect("a file");
        symlink(yard.path("project/notes.txt"), &file).expect("a link");
        refused(&yard, &into(&own), &[&format!("holds {one}, which marsyard did not write")]);
        fs::remove_file(&file).expect("a link");
        fs::create_dir(&file).expect("a folder");
        refused(&yard, &into(&own), &[&format!("holds {one}, which marsyard did not write")]);
        fs::remove_dir(&file).expect("a folder");
        // Killed between the ledger and the file: known all the same.
        succeeds(&yard, &into(&own));
        assert!(fs::read(&file).expect("a result") == whole, "{one}");
    }
}

#[test]
fn regress_tradeoff_looks_at_its_folder_before_it_measures() {
    let yard = Yard::new();
    let config = training();
    let tradeoff =
        ["tradeoff", &config, "--scenes", "8", "--seeds", "1", "--only", "batch", "--farther", "1", "--out", "project"];
    lay(&yard, &[("project/tradeoff.md", "mine")]);
    refused(&yard, &tradeoff, &["project holds tradeoff.md, which marsyard did not write"]);
    fs::remove_file(yard.path("project/tradeoff.md")).expect("a file");
    succeeds(&yard, &tradeoff);
    let told = fs::read_to_string(yard.path("project/tradeoff.md")).expect("a page");
    assert!(told.contains("One training has no interval") && told.contains("(--seeds 2)"), "{told}");
    lay(&yard, &[("project/tradeoff.md", "mine")]);
    refused(&yard, &tradeoff, &["project holds tradeoff.md, which was changed since marsyard wrote it"]);
}

#[test]
fn law_an_interrupted_folder_of_results_is_known() {
    let yard = trained();
    let classify = ["classify", "run", "clouds/scan.csv", "--pose=0,0,0.4,0,0,0", "--out", "own"];
    succeeds(&yard, &classify);
    // As a kill leaves it: two lines for a file that may be either, and a line that was cut short.
    let ledger = yard.path("own").join(LEDGER);
    let whole = fs::read_to_string(&ledger).expect("a ledger");
    fs::write(
        &ledger,
        format!("{whole}{}  cells.parquet\n{}", "ab".repeat(32), &whole[whole.len() - 30..whole.len() - 9]),
    )
    .expect("a ledger");
    succeeds(&yard, &classify);
    assert_eq!(fs::read_to_string(&ledger).expect("a ledger"), whole);
    // A file that is not listed is nobody's but its user's.
    fs::write(
        &ledger,
        whole
            .lines()
            .filter(|line| !line.ends_with("cells.parquet"))
            .map(|line| line.to_string() + "\n")
            .collect::<String>(),
    )
    .expect("a ledger");
    refused(&yard, &classify, &["holds cells.parquet"]);
}

#[test]
fn regress_an_input_is_never_an_output() {
    let yard = trained();
    let place = "--pose=0,0,0.4,0,0,0";
    succeeds(&yard, &["classify", "run", "clouds/scan.csv", place, "--out", "own"]);
    // The judged cloud judged again beside its own source: its result would take its place.
    succeeds(&yard, &["classify", "run", "own/scan-labelled.ply", place, "--frame", "map", "--out", "own"]);
    let again =
        ["classify", "run", "clouds/scan.csv", "own/scan-labelled.ply", place, "--frame", "map", "--out", "own"];
    refused(&yard, &again, &["holds scan-labelled.ply, which is an input of this very command"]);
    fs::hard_link(yard.path("own/scan-labelled.ply"), yard.path("linked.ply")).expect("a link");
    let linked = ["classify", "run", "clouds/scan.csv", "linked.ply", place, "--frame", "map", "--out", "./own/../own"];
    refused(&yard, &linked, &["holds scan-labelled.ply, which is an input of this very command"]);

    let quick = ["--widths", "2", "--layers", "1", "--rows", "300", "--validation-rows", "200", "--rungs", "1"];
    let search = |extra: &[&'static str]| [&["search", "corpus", "--out", "found"], &quick[..], extra].concat();
    succeeds(&yard, &search(&["--epochs", "1"]));
    refused(
        &yard,
        &search(&["--epochs", "1", "--resume", "--config", "found/train.yaml"]),
        &["holds train.yaml, which is an input"],
    );
}

#[test]
fn regress_export_replaces_exports_alone() {
    let yard = trained();
    fs::copy(yard.path("run/model.safetensors"), yard.path("m.safetensors")).expect("a model");
    fs::hard_link(yard.path("m.safetensors"), yard.path("hard.onnx")).expect("a link");
    symlink(yard.path("m.safetensors"), yard.path("soft.onnx")).expect("a link");
    lay(&yard, &[("notes.txt", "mine"), ("project.json", r#"{"about": {}, "members": [], "check": {}}"#)]);
    fs::create_dir(yard.path("folder")).expect("a folder");
    for file in ["m.safetensors", "./m.safetensors", "hard.onnx", "soft.onnx"] {
        for flag in ["--onnx", "--json"] {
            refused(&yard, &["export", "m.safetensors", flag, file], &["which is an input of this very command"]);
        }
    }
    refused(
        &yard,
        &["export", "run", "--json", "run/model.safetensors"],
        &["run holds model.safetensors, which is an input"],
    );
    for file in ["notes.txt", "project.json", "folder"] {
        for flag in ["--onnx", "--json"] {
            let words = format!("holds {file}, which marsyard did not write");
            refused(&yard, &["export", "m.safetensors", flag, file], &[&words]);
        }
    }
    refused_by_another_rule(&yard, &["export", "run", "--onnx", "one", "--json", "./one"], &["are one file"]);
    // Neither is written where one is refused.
    refused(&yard, &["export", "run", "--onnx", "new.onnx", "--json", "notes.txt"], &["holds notes.txt"]);

    let both = ["export", "run", "--onnx", "model.onnx", "--json", "model.json"];
    succeeds(&yard, &both);
    let first = ["model.onnx", "model.json"].map(|name| fs::read(yard.path(name)).expect("an export"));
    symlink("model.onnx", yard.path("latest.onnx")).expect("a link");
    succeeds(&yard, &both);
    succeeds(&yard, &["export", "run", "--onnx", "latest.onnx", "--json", "/dev/null"]);
    assert_eq!(fs::read_link(yard.path("latest.onnx")).expect("a link"), Path::new("model.onnx"));
    assert!(first == ["model.onnx", "model.json"].map(|name| fs::read(yard.path(name)).expect("an export")));
    refused(&yard, &["export", "run", "--onnx", "model.json"], &["holds model.json"]);
    refused(&yard, &["export", "run", "--json", "model.onnx"], &["holds model.onnx"]);
}

#[test]
fn law_runs_are_written_where_nothing_is_or_in_their_own_folder() {
    let yard = trained();
    lay(&yard, &[("project/model.safetensors", "mine"), ("project/notes.txt", "mine")]);
    for place in ["project", "corpus"] {
        for resume in [&[][..], &["--resume"]] {
            refused_by_another_rule(&yard, &[&["train", "corpus", "--out", place], resume].concat(), &[place]);
            refused_by_another_rule(&yard, &[&["search", "corpus", "--out", place], resume].concat(), &[place]);
        }
    }
}

#[test]
fn law_every_verb_that_writes_says_the_rule() {
    let yard = Yard::new();
    let verbs = "generate finalize verify sign preview train evaluate search export classify localise tradeoff";
    for verb in verbs.split(' ') {
        for flag in ["--help", "-h"] {
            let said = text(&yard.marsyard([verb, flag]).stdout).split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(said.matches(RULE).count(), 1, "{verb} {flag}: {said}");
        }
    }
}
