use std::path::Path;

use marsyard::config::{load, load_train};
use proptest::prelude::*;

use crate::edits::{Edit, Share, apply, cases, edits};
use crate::heap::{MIB, bounded, bounded_by};

const TOKENS: &[&str] = &[
    ": ",
    "- ",
    "{",
    "}",
    "[",
    "]",
    "&a ",
    "*a",
    "<<: *a\n",
    "!!binary ",
    "!include ",
    "|\n",
    ">-\n",
    "? ",
    "null",
    ".nan",
    "-.inf",
    "'",
    "\"",
    "\t",
    "#",
    "\n",
    "---\n",
    "%YAML 9.9\n",
    "families: ",
    "{uniform: [0, 1e308]}",
    "{choice: []}",
    "../../../../etc/passwd",
];

/// What `load` says of the file; faults are there where there is no plan.
fn load_text(folder: &Path, name: &str, text: &[u8]) -> Result<(), String> {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a temporary file");
    load_file(&path, text.len(), &[])
}

fn load_file(path: &Path, bytes: usize, sets: &[String]) -> Result<(), String> {
    match bounded(bytes, || load(path, sets)) {
        Ok(_) => Ok(()),
        Err(error) => {
            assert!(!error.faults.is_empty());
            Err(error.lines())
        }
    }
}

fn shipped(which: usize) -> Vec<u8> {
    let files = [
        "configs/quickstart.yaml",
        "configs/paper.yaml",
        "configs/mars.yaml",
        "configs/mixed.yaml",
        "tests/fixtures/everything.yaml",
        "tests/fixtures/training.yaml",
        "configs/holes.yaml",
    ];
    std::fs::read(files[which]).expect("a shipped config")
}

/// A config beside files of its own.
fn with_files(source: &str, files: &[(&str, &[u8])]) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).expect("a file"));
    let path = folder.path().join("corpus.yaml");
    let text = shipped(0);
    std::fs::write(&path, &text).expect("a file");
    // A height map of 33 kB of PNG may hold 4096 x 4096 heights; that many are allowed, at 10 bytes each.
    match bounded_by(256 * MIB, text.len() + bytes, || load(&path, &[source.to_owned()])) {
        Ok(_) => Ok(()),
        Err(error) => Err(error.lines()),
    }
}

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    let header = format!("{header:<117}\n");
    [b"\x93NUMPY\x01\x00", (header.len() as u16).to_le_bytes().as_slice(), header.as_bytes(), data].concat()
}

fn grey16(side: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&vec![0; (side * side * 2) as usize]).expect("a picture");
    writer.finish().expect("a file");
    bytes
}

const HILL_NPY: &str = "scene.ground.source={file: {path: hill.npy}}";
const HILL_PNG: &str = "scene.ground.source={file: {path: hill.png, height_m: 3}}";
const SENSOR: &str = "name: mine\npattern: {file: {path: beams.csv}}\nmin_range_m: 0.1\nmax_range_m: 9\nrange_sigma_m: 0.01\n\
    range_step_m: 0.001\ndivergence_mrad: 1\nrange_at_10_percent_m: 4\nranging: {pulse: {pulse_ns: 5, report: first}}\n";
const BEAMS: &str = "# my own\nelevation_deg, azimuth_deg, time_s\n-10, 0, 0\n-20.5, 1, 0.1\n";

proptest! {
    #![proptest_config(cases(120))]

    #[test]
    fn extreme_broken_corpus_configs_give_a_plan_or_faults(which in 0..7usize, edits in edits(TOKENS)) {
        let folder = tempfile::tempdir().expect("a folder");
        let _ = load_text(folder.path(), "corpus.yaml", &apply(&shipped(which), &edits));
    }

    #[test]
    fn extreme_broken_plans_of_corpora_give_a_plan_or_faults(edits in edits(TOKENS)) {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = load(Path::new("tests/fixtures/training.yaml"), &[]).expect("a plan").to_yaml();
        let _ = load_text(folder.path(), "plan.yaml", &apply(plan.as_bytes(), &edits));
    }

    #[test]
    fn extreme_broken_training_configs_are_read_or_refused(which in 0..3usize, edits in edits(TOKENS)) {
        let mut files: Vec<_> = std::fs::read_dir("configs/train").expect("configs").map(|e| e.expect("an entry").path()).collect();
        files.sort();
        let text = apply(&std::fs::read(&files[which % files.len()]).expect("a config"), &edits);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("train.yaml");
        std::fs::write(&path, &text).expect("a file");
        let _ = bounded(text.len(), || load_train(Some(&path), &[]).map(|_| ()));
    }

    #[test]
    fn extreme_broken_rovers_and_sensors_are_read_or_refused(rover in any::<bool>(), edits in edits(TOKENS)) {
        let (set, file) =
            if rover { ("drive.rover=./mine.yaml", "configs/rovers/kapvik.yaml") } else { ("sweep.sensor=./mine.yaml", "configs/sensors/urg-04lx.yaml") };
        let _ = with_files(set, &[("mine.yaml", &apply(&std::fs::read(file).expect("a preset"), &edits))]);
    }

    #[test]
    fn extreme_broken_beam_patterns_are_read_or_refused(edits in edits(&[",", "\n", "\"", "time_s", "nan", "-0", "#", "\r", "90.0001"])) {
        let _ = with_files("sweep.sensor=./mine.yaml", &[("mine.yaml", SENSOR.as_bytes()), ("beams.csv", &apply(BEAMS.as_bytes(), &edits))]);
    }

    #[test]
    fn extreme_broken_npy_height_maps_are_read_or_refused(edits in edits(&["(", ")", ",", "'", "{", "[", "<f8", ">f4", "True", "99999"])) {
        let whole = npy("<f4", "(2, 2)", &1f32.to_le_bytes().repeat(4));
        let _ = with_files(HILL_NPY, &[("hill.npy", &apply(&whole, &edits))]);
    }

    #[test]
    fn extreme_broken_png_height_maps_are_read_or_refused(edits in edits(&["IDAT", "IHDR", "IEND", "iCCP", "zTXt", "tRNS"])) {
        let _ = with_files(HILL_PNG, &[("hill.png", &apply(&grey16(3), &edits))]);
    }

    /// Checksums put right, so that what is behind them is reached.
    #[test]
    fn extreme_png_headers_with_sound_checksums_are_read_or_refused(at in 0..13usize, value in any::<u8>()) {
        let mut bytes = grey16(3);
        bytes[16 + at] = value;
        let crc = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        let _ = with_files(HILL_PNG, &[("hill.png", &bytes)]);
    }
}

/// ISO 3309, as PNG chunks carry it.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[test]
fn the_files_that_are_broken_above_are_whole() {
    for which in 0..7 {
        let folder = tempfile::tempdir().expect("a folder");
        load_text(folder.path(), "corpus.yaml", &shipped(which)).expect("a plan");
    }
    with_files(HILL_NPY, &[("hill.npy", &npy("<f4", "(2, 2)", &1f32.to_le_bytes().repeat(4)))]).expect("a map");
    with_files(HILL_PNG, &[("hill.png", &grey16(3))]).expect("a map");
    with_files("sweep.sensor=./mine.yaml", &[("mine.yaml", SENSOR.as_bytes()), ("beams.csv", BEAMS.as_bytes())])
        .expect("a sensor");
}

/// A document of `head` and what is repeated; all of it is refused within the memory of its size.
fn refused(head: &str, body: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = format!("{head}{body}");
    load_text(folder.path(), "corpus.yaml", whole.as_bytes()).expect_err("a bomb is refused")
}

#[test]
fn extreme_yaml_bombs_are_refused() {
    let laughs: String =
        (1..30).map(|k| format!("l{k}: &l{k} [{}]\n", vec![format!("*l{}", k - 1); 9].join(", "))).collect();
    refused("l0: &l0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]\n", &laughs);
    // One long text, many times.
    let many = vec!["*a"; 900].join(", ");
    refused(&format!("a: &a \"{}\"\n", "x".repeat(MIB)), &format!("b: [{many}]\n"));
    let rows: String = (0..90).map(|k| format!("k{k}: *a\n")).collect();
    refused(&format!("a: &a [{}]\n", vec!["\"x\""; 20_000].join(",")), &rows);
    // Merge keys of merge keys.
    let merges: String =
        (1..40).map(|k| format!("m{k}: &m{k} {{<<: [*m{}, *m{}], k{k}: 1}}\n", k - 1, k - 1)).collect();
    refused("m0: &m0 {a: 1}\n", &merges);
    for (open, close) in
        [("[", "]"), ("{a: ", "}"), ("- ", "\n"), ("? ", "\n"), ("[[", ""), ("&a [", "]"), ("!!seq [", "]")]
    {
        refused("scene: ", &format!("{}{}", open.repeat(20_000), close.repeat(20_000)));
    }
    refused("", &"a: 1\n".repeat(1000));
    refused("", &"---\n".repeat(100_000));
    refused("", &(0..100_000).map(|k| format!("k{k}: &a{k} 1\n")).collect::<String>());
    refused("name: ", &"x".repeat(8 * MIB));
    refused("&a a: ", "*a");
    refused("a: &a [*a]\n", "");
    refused("name: \"", &"\\U0010FFFF".repeat(100_000));
    refused("seed: ", &"9".repeat(MIB));
}

#[test]
fn extreme_label_mappings_are_no_bombs_either() {
    let laughs: String =
        (1..30).map(|k| format!("l{k}: &l{k} [{}]\n", vec![format!("*l{}", k - 1); 9].join(", "))).collect();
    let text = format!("l0: &l0 [lol]\n{laughs}labels: {{}}\n");
    assert!(bounded(text.len(), || marsyard::cloud::LabelMap::parse("a.yaml", &text)).is_err());
    let deep = format!("labels: {}", "[".repeat(100_000));
    assert!(bounded(deep.len(), || marsyard::cloud::LabelMap::parse("a.yaml", &deep)).is_err());
}

/// The largest picture that is allowed, of one colour: a small file.
#[test]
fn extreme_a_small_picture_of_sixteen_million_heights_stays_within_its_bound() {
    let bytes = grey16(4096);
    assert!(bytes.len() < 1_000_000);
    with_files(HILL_PNG, &[("hill.png", &bytes)]).expect("level ground is ground");
    assert!(with_files(HILL_PNG, &[("hill.png", &grey16(4097))]).expect_err("one more").contains("at most"));
}

#[test]
fn extreme_the_plan_of_a_corpus_names_no_file_outside_it() {
    let outside = tempfile::tempdir().expect("a folder");
    let hill = npy("<f4", "(2, 2)", &1f32.to_le_bytes().repeat(4));
    std::fs::write(outside.path().join("hill.npy"), &hill).expect("a file");
    std::fs::write(outside.path().join("mine.yaml"), std::fs::read("configs/rovers/kapvik.yaml").expect("a rover"))
        .expect("a file");
    let corpus = outside.path().join("corpus");
    std::fs::create_dir(&corpus).expect("a folder");
    std::os::unix::fs::symlink(outside.path().join("hill.npy"), corpus.join("link.npy")).expect("a link");
    std::fs::write(corpus.join("hill.npy"), &hill).expect("a file");
    let text = shipped(5);
    let absolute = outside.path().join("hill.npy").display().to_string();
    let map = |path: &str| format!("scene.ground.source={{file: {{path: {path}}}}}");
    let rover = "drive.rover=../mine.yaml".to_owned();
    for (name, own) in [("plan.yaml", false), ("corpus.yaml", true)] {
        std::fs::write(corpus.join(name), &text).expect("a file");
        let said = |set: &str| load_file(&corpus.join(name), text.len(), &[set.to_owned()]);
        said(&map("hill.npy")).expect("a file beside it");
        for set in [&map("../hill.npy"), &map(&absolute), &map("link.npy"), &rover] {
            match said(set) {
                Err(lines) => assert!(!own && lines.contains("lies outside the corpus"), "{name} {set}: {lines}"),
                Ok(()) => assert!(own, "{name} {set}"),
            }
        }
    }
}

/// Opening a pipe waits for somebody to write into it.
#[test]
fn regress_a_pipe_in_the_place_of_a_preset_is_refused_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = std::process::Command::new("mkfifo").arg(folder.path().join("mine.yaml")).status().expect("mkfifo");
    assert!(made.success());
    let path = folder.path().join("corpus.yaml");
    std::fs::write(&path, shipped(0)).expect("a file");
    let lines = load_file(&path, 0, &["drive.rover=./mine.yaml".into()]).expect_err("no file");
    assert!(lines.contains("it is not a file"), "{lines}");
}

/// Edits that are no use if they change nothing.
#[test]
fn law_edits_break_what_they_touch() {
    let at = |share: f64| Share((share * f64::from(u32::MAX)) as u32);
    let text = b"count: 12, radius: 3";
    assert_eq!(apply(text, &[Edit::Digits { which: at(0.1), text: "nan" }]), b"count: nan, radius: 3");
    assert_eq!(apply(text, &[Edit::Cut { at: at(0.5) }]), b"count: 12");
    assert_eq!(apply(b"ab", &[Edit::Repeat { at: at(0.0), length: 2, times: 2 }]), b"ababab");
}
