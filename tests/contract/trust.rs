//! The contract of trust: equal sources name the same program anywhere, no scene is judged that was learnt from, a signature covers a
//! corpus, and what was built again is on record.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use marsyard::corpus::sha256;

use crate::yard::{Yard, assert_same, text};

const SETTINGS: [&str; 8] =
    ["--set", "scenes_per_shard=1", "--set", "scenes=7", "--set", "drive.stops=1", "--threads", "2"];

/// Seven shards of one small scene, named as the folder.
fn tiny(yard: &Yard, out: &str, extra: &[&str]) {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    let name = format!("name={out}");
    yard.generate(&config, out, &[&SETTINGS[..], &["--set", &name], extra].concat());
}

/// What a run said on stderr in one line, and its exit code.
fn told(yard: &Yard, arguments: &[&str]) -> (Option<i32>, String) {
    let output = yard.marsyard(arguments);
    let said = text(&output.stderr) + &text(&output.stdout);
    (output.status.code(), said.replace("\n  │ ", " ").replace('\n', " "))
}

fn json(yard: &Yard, file: &str) -> Value {
    serde_json::from_slice(&std::fs::read(yard.path(file)).expect("a file")).expect("JSON")
}

const QUICK: [&str; 6] = ["--set", "network.hidden=[3]", "--set", "epochs=1", "--threads", "1"];

#[test]
fn regress_a_build_without_proc_gives_the_same_receipts() {
    let yard = Yard::new();
    tiny(&yard, "here", &["--set", "name=training"]);
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    let script = "umount -l /proc && test ! -e /proc/self && exec \"$@\"";
    let mut command = Command::new("unshare");
    command.args(["-m", "sh", "-c", script, "sh", env!("CARGO_BIN_EXE_marsyard"), "generate", "--out", "bare"]);
    let output = command.arg(&config).args(SETTINGS).current_dir(yard.path("")).output();
    let Some(output) = output.ok().filter(|output| !text(&output.stderr).contains("unshare")) else {
        eprintln!("skipped: no mount namespace can be made here");
        return;
    };
    if text(&output.stderr).contains("umount") {
        eprintln!("skipped: /proc cannot be unmounted here");
        return;
    }
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same(&yard.identity("here"), &yard.identity("bare"));
    let build = &json(&yard, "bare/manifest.json")["build"];
    assert_eq!(build["sources_sha256"].as_str().map(str::len), Some(64));
    assert_eq!(build.get("binary_sha256"), None);
}

#[test]
fn regress_a_test_scene_of_one_corpus_is_no_train_scene_of_another() {
    let yard = Yard::new();
    let cut = |per_shard: &'static str| ["--set", "scenes=28", "--set", per_shard];
    tiny(&yard, "a", &cut("scenes_per_shard=4"));
    tiny(&yard, "b", &cut("scenes_per_shard=2"));
    let (code, said) = told(&yard, &[&["train", "a", "b", "--out", "run"][..], &QUICK].concat());
    assert_eq!(code, Some(2), "{said}");
    let leak = "2 scenes of the test split of a are in the train split of b (the first is scene 24)";
    assert!(said.contains(leak) && said.contains("--allow-shared-scenes"), "{said}");
    assert!(!yard.path("run").exists());

    // Learnt from one, judged on the other: the same.
    let (code, said) = told(&yard, &[&["train", "b", "--out", "of-b"][..], &QUICK].concat());
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = told(&yard, &["evaluate", "of-b", "a"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("2 scenes of the test split of this corpus are in the train split of b"), "{said}");
    assert!(said.contains("(the first is scene 24)"), "{said}");
    assert_eq!(told(&yard, &["evaluate", "of-b", "b"]).0, Some(0));
    let (code, said) = told(&yard, &["evaluate", "of-b", "a", "--allow-shared-scenes"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("2 scenes of the test split"), "the report tells: {said}");

    // A network that is started from another knows what that one learnt.
    let (code, said) = told(&yard, &[&["train", "a", "--init", "of-b", "--out", "on"][..], &QUICK].concat());
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("2 scenes of the test split of a are in the train split of b, which the network of --init"),
        "{said}"
    );

    let allowed = [&["train", "a", "b", "--out", "both", "--allow-shared-scenes"][..], &QUICK].concat();
    let (code, said) = told(&yard, &allowed);
    assert_eq!(code, Some(0), "{said}");
    assert!(json(&yard, "both/training.json")["shared_scenes"].to_string().contains(leak));
    assert!(json(&yard, "both/evaluation/b/evaluation.json").to_string().contains("split of a (the first"));
}

#[test]
fn regress_a_corpus_is_not_learnt_together_with_its_own_grown_copy() {
    let yard = Yard::new();
    tiny(&yard, "a", &[]);
    tiny(&yard, "grown", &["--set", "scenes=8"]);
    let (code, said) = told(&yard, &[&["train", "a", "grown", "--out", "run"][..], &QUICK].concat());
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("5 scenes of the train split of a are in the train split of grown"), "{said}");
    // The same yards by another sensor, dealt to the splits alike, teach more; and another seed is other yards.
    tiny(&yard, "noisier", &["--set", "sweep.sensor.range_sigma_m=0.02"]);
    tiny(&yard, "elsewhere", &["--set", "seed=6", "--set", "scenes=8"]);
    for (other, run) in [("noisier", "by-two"), ("elsewhere", "of-two")] {
        let (code, said) = told(&yard, &[&["train", "a", other, "--out", run][..], &QUICK].concat());
        assert_eq!(code, Some(0), "{said}");
    }
    // What grew keeps its splits: the model of the smaller one is judged on the larger.
    assert_eq!(told(&yard, &[&["train", "a", "--out", "of-a"][..], &QUICK].concat()).0, Some(0));
    assert_eq!(told(&yard, &["evaluate", "of-a", "grown"]).0, Some(0));
}

#[test]
fn regress_texts_that_were_edited_with_their_hashes_are_seen_by_the_program_that_wrote_them() {
    let yard = Yard::new();
    tiny(&yard, "c", &[]);
    let path = |name: &str| yard.path("c").join(name);
    let read = |name: &str| std::fs::read_to_string(path(name)).expect("a text");
    let write = |name: &str, text: &str| std::fs::write(path(name), text).expect("a text to write");
    let manifest = read("manifest.json");
    for (name, from, to) in
        [("README.md", "never train on them", "train on them"), ("croissant.json", "synthetic", "real")]
    {
        let whole = read(name);
        let edited = whole.replace(from, to);
        assert_ne!(whole, edited);
        write(name, &edited);
        write("manifest.json", &manifest.replace(&sha256(whole.as_bytes()), &sha256(edited.as_bytes())));
        let (code, said) = told(&yard, &["verify", "c"]);
        assert!(code == Some(1) && said.contains(name) && said.contains("made to fit"), "{said}");
        assert_eq!(told(&yard, &["finalize", "c"]).0, Some(0));
        assert!(read(name) == whole && read("manifest.json") == manifest);
    }
    write("manifest.json", &manifest.replacen('{', "{\n  \"mine\": 1,", 1));
    let (code, said) = told(&yard, &["verify", "c"]);
    assert!(code == Some(1) && said.contains("manifest.json"), "{said}");
    write("manifest.json", &manifest);
    assert_eq!(told(&yard, &["verify", "c"]).0, Some(0));
}

/// Makes a key pair without a password: `k` and `k.pub`.
fn new_key(yard: &Yard, name: &str) {
    let (code, said) = told(yard, &["sign", "--new-key", name, "--no-password"]);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn law_a_signature_is_checked_first_and_by_its_key_alone() {
    let yard = Yard::new();
    tiny(&yard, "c", &[]);
    new_key(&yard, "mine");
    new_key(&yard, "other");
    assert_eq!(told(&yard, &["verify", "c", "--key", "mine.pub"]).0, Some(1), "not signed yet");
    let (code, said) = told(&yard, &["sign", "c", "--key", "mine"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = told(&yard, &["verify", "c", "--key", "mine.pub"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("is what the key") && said.contains("marsyard corpus of 7 scenes"), "{said}");
    // The key itself, as minisign prints it; and a file beside.
    let key = std::fs::read_to_string(yard.path("mine.pub")).expect("a key");
    let letters = key.lines().nth(1).expect("a second line");
    assert_eq!(told(&yard, &["verify", "c", "--key", letters]).0, Some(0));
    assert_eq!(told(&yard, &["sign", "c", "--key", "mine", "--out", "beside.minisig"]).0, Some(0));
    assert_eq!(told(&yard, &["verify", "c", "--key", "mine.pub", "--signature", "beside.minisig"]).0, Some(0));

    let (code, said) = told(&yard, &["verify", "c", "--key", "other.pub"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("signed with the key"), "{said}");

    // A consistent forgery: verify alone takes it, with the key it does not.
    let commit = json(&yard, "c/manifest.json")["build"]["commit"].as_str().expect("a commit").to_string();
    let forge = |from: &str, to: &str| {
        for shard in 0..7 {
            let path = yard.path(&format!("c/receipts/{shard:07}.json"));
            let receipt = std::fs::read_to_string(&path).expect("a receipt");
            std::fs::write(&path, receipt.replace(from, to)).expect("a receipt to change");
        }
        // While it is there, receipts are held against it.
        std::fs::remove_file(yard.path("c/manifest.json")).expect("a manifest");
        assert_eq!(told(&yard, &["finalize", "c"]).0, Some(0));
    };
    forge(&commit, "forged");
    assert_eq!(told(&yard, &["verify", "c", "--rebuild", "all"]).0, Some(0));
    let (code, said) = told(&yard, &["verify", "c", "--key", "mine.pub"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("manifest.json is not what was signed"), "{said}");
    forge("forged", &commit);
    assert_eq!(told(&yard, &["verify", "c", "--key", "mine.pub"]).0, Some(0));

    // A receipt that changed is built anew, and the signed bytes are there again; or nothing is written.
    let signed = std::fs::read(yard.path("c/manifest.json")).expect("a manifest");
    let receipt = yard.path("c/receipts/0000002.json");
    let whole = std::fs::read_to_string(&receipt).expect("a receipt");
    std::fs::write(&receipt, whole.replace("\"points_in\": ", "\"points_in\": 1")).expect("a receipt to change");
    let (code, said) = told(&yard, &["verify", "c", "--key", "mine.pub", "--repair", "--rebuild", "1"]);
    assert!(code == Some(0) && said.contains("built again, have the same bytes"), "{said}");
    assert_eq!(std::fs::read_to_string(&receipt).expect("a receipt"), whole);
    assert_eq!(std::fs::read(yard.path("c/manifest.json")).expect("a manifest"), signed);
    // By another program, which cannot give the receipt that was signed.
    forge(&commit, "forged");
    assert_eq!(told(&yard, &["sign", "c", "--key", "mine"]).0, Some(0));
    let signed = std::fs::read(yard.path("c/manifest.json")).expect("a manifest");
    let forged = std::fs::read_to_string(&receipt).expect("a receipt");
    std::fs::write(&receipt, forged.replace("\"points_in\": ", "\"points_in\": 1")).expect("a receipt to change");
    let (code, said) = told(&yard, &["verify", "c", "--key", "mine.pub", "--repair"]);
    assert!(code == Some(1) && said.contains("the signature would not cover them"), "{said}");
    assert_eq!(std::fs::read(yard.path("c/manifest.json")).expect("a manifest"), signed);
    std::fs::write(&receipt, forged).expect("a receipt");
    forge("forged", &commit);
    assert_eq!(told(&yard, &["sign", "c", "--key", "mine"]).0, Some(0));

    // Grown since: it says so.
    tiny(&yard, "c", &["--set", "scenes=8"]);
    let (code, said) = told(&yard, &["verify", "c", "--key", "mine.pub"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("of 7 scenes") && said.contains("of 8 scenes") && said.contains("grew"), "{said}");
    assert_eq!(told(&yard, &["sign", "c", "--key", "mine"]).0, Some(0));
    assert_eq!(told(&yard, &["verify", "c", "--key", "mine.pub"]).0, Some(0));
}

#[test]
fn law_keys_replace_nothing_and_their_passwords_are_never_typed_in_the_open() {
    let yard = Yard::new();
    tiny(&yard, "c", &[]);
    let with_password = |password: Option<&str>, arguments: &[&str]| {
        let mut command = yard.command(arguments);
        command.stdin(Stdio::null()).env_remove("MARSYARD_KEY_PASSWORD");
        password.map(|password| command.env("MARSYARD_KEY_PASSWORD", password));
        let output = command.output().expect("the binary starts");
        (output.status.code(), text(&output.stderr).replace("\n  │ ", " "))
    };
    let (code, said) = with_password(None, &["sign", "--new-key", "k"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("MARSYARD_KEY_PASSWORD") && !yard.path("k").exists(), "{said}");
    assert_eq!(with_password(Some("hush"), &["sign", "--new-key", "k"]).0, Some(0));
    let mode =
        std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(yard.path("k")).expect("a key").permissions());
    assert_eq!(mode & 0o777, 0o600);
    let (code, said) = with_password(Some("hush"), &["sign", "--new-key", "k"]);
    assert_eq!(code, Some(2), "{said}");
    for (password, expected) in [(None, 2), (Some("other"), 2), (Some("hush"), 0)] {
        let (code, said) = with_password(password, &["sign", "c", "--key", "k"]);
        assert_eq!(code, Some(expected), "{said}");
    }
    assert_eq!(told(&yard, &["verify", "c", "--key", "k.pub"]).0, Some(0));
    // What is no signature is not replaced; what is no key is refused.
    std::fs::write(yard.path("notes"), "mine").expect("a file");
    let (code, said) = with_password(Some("hush"), &["sign", "c", "--key", "k", "--out", "notes"]);
    assert_eq!(
        (code, std::fs::read_to_string(yard.path("notes")).expect("a file").as_str()),
        (Some(2), "mine"),
        "{said}"
    );
    for wrong in ["k.pub", "notes", "c", "nowhere"] {
        assert_eq!(with_password(Some("hush"), &["sign", "c", "--key", wrong]).0, Some(2), "{wrong}");
        if wrong != "k.pub" {
            assert_eq!(told(&yard, &["verify", "c", "--key", wrong]).0, Some(2), "{wrong}");
        }
    }
}

#[test]
fn equal_minisign_takes_our_signatures_and_we_take_its() {
    if Command::new("minisign").arg("-v").output().is_err() {
        eprintln!("skipped: minisign is not installed (apt-get install minisign)");
        return;
    }
    let yard = Yard::new();
    tiny(&yard, "c", &[]);
    let minisign = |arguments: &[&str]| {
        let output = Command::new("minisign").args(arguments).current_dir(yard.path("")).stdin(Stdio::null()).output();
        let output = output.expect("minisign starts");
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    new_key(&yard, "ours");
    assert_eq!(told(&yard, &["sign", "c", "--key", "ours"]).0, Some(0));
    let said = minisign(&["-Vm", "c/manifest.json", "-p", "ours.pub"]);
    assert!(said.contains("Trusted comment: marsyard corpus of 7 scenes, corpus_id"), "{said}");
    minisign(&["-G", "-W", "-p", "theirs.pub", "-s", "theirs"]);
    minisign(&["-Sm", "c/manifest.json", "-s", "theirs"]);
    let (code, said) = told(&yard, &["verify", "c", "--key", "theirs.pub"]);
    assert_eq!(code, Some(0), "{said}");
    // Their key signs here, and ours signs there.
    assert_eq!(told(&yard, &["sign", "c", "--key", "theirs"]).0, Some(0));
    minisign(&["-Vm", "c/manifest.json", "-p", "theirs.pub"]);
    minisign(&["-Sm", "c/manifest.json", "-s", "ours"]);
    assert_eq!(told(&yard, &["verify", "c", "--key", "ours.pub"]).0, Some(0));
}

#[test]
fn law_what_was_built_again_is_on_record_and_a_difference_is_not_recorded_as_equal() {
    let yard = Yard::new();
    tiny(&yard, "c", &[]);
    let found = || {
        let entries = json(&yard, "c/rebuilt.json")["rebuilt"].as_array().expect("a list").clone();
        let plain = |entry: &Value| (entry["shards"].as_str().expect("shards").to_string(), entry["equal"] == true);
        entries.iter().map(plain).collect::<Vec<_>>()
    };
    let (code, said) = told(&yard, &["verify", "c", "--rebuild", "20%"]);
    assert_eq!(code, Some(0), "{said}");
    let once = found();
    assert_eq!((once.len(), once[0].1), (1, true), "{once:?}");
    let (code, said) = told(&yard, &["verify", "c", "--rebuild", "all"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(found(), [("0..7".to_string(), true)]);
    assert_eq!(json(&yard, "c/rebuilt.json")["rebuilt"][0]["build"], json(&yard, "c/manifest.json")["build"]);
    let (code, said) = told(&yard, &["verify", "c"]);
    assert!(code == Some(0) && said.contains("shards 0..7, built again by marsyard"), "{said}");
    assert_eq!(told(&yard, &["verify", "c", "--rebuild", "0%"]).0, Some(2));

    // A shard of the test split with other facts, finalized: only building it again shows it.
    let path = yard.path("c/receipts/0000006.json");
    let mut receipt = json(&yard, "c/receipts/0000006.json");
    receipt["points"]["points_in"] = 1.into();
    std::fs::write(&path, format!("{receipt:#}\n")).expect("a receipt to change");
    std::fs::remove_file(yard.path("c/manifest.json")).expect("a manifest");
    assert_eq!(told(&yard, &["finalize", "c"]).0, Some(0));
    let (code, said) = told(&yard, &["verify", "c", "--rebuild", "all"]);
    assert_eq!(code, Some(1), "{said}");
    assert_eq!(found(), [("0..6".to_string(), true), ("6".to_string(), false)]);
}
