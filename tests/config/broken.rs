//! Contract: a broken config is refused with every fault's place, rule and cure, in these very words.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use marsyard::config;

/// As a terminal shows it, without colours.
fn rendered(error: &config::ConfigError) -> String {
    let mut out = String::new();
    let theme = miette::GraphicalTheme::unicode_nocolor();
    let handler = miette::GraphicalReportHandler::new_themed(theme).with_width(120);
    handler.render_report(&mut out, error).expect("a String takes all");
    out.lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}

#[test]
fn golden_each_broken_config_is_refused_in_these_words() {
    // Messages name the files as given: a relative path is the same on every machine.
    let folder = Path::new("tests/config/broken");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "yaml"));
    files.sort();
    assert!(files.len() >= 40, "{}", files.len());
    let mut all = String::new();
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        let sets: Vec<String> =
            text.lines().filter_map(|line| line.strip_prefix("# set: ")).map(str::to_owned).collect();
        let error = config::load(&path, &sets).expect_err(&path.display().to_string());
        assert!(!error.faults.is_empty());
        writeln!(all, "== {} ==\n{}\n", path.file_stem().unwrap().display(), rendered(&error)).unwrap();
    }
    insta::assert_snapshot!(all);
}
