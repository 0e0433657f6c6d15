//! The rows of `docs/extremes.md`, and whether that page still speaks of tests that exist.

#[path = "../../src/extremes.rs"]
mod row;

use std::path::Path;

pub(crate) use row::{Family, row};

/// All Rust text under a folder.
fn text_under(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        if entry.is_dir() {
            text += &text_under(&entry);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            text += &std::fs::read_to_string(&entry).expect("a readable file");
        }
    }
    text
}

#[test]
fn equal_the_page_of_extremes_names_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/extremes.md")).expect("docs/extremes.md");
    let tests = text_under(&root.join("src")) + &text_under(&root.join("tests"));
    let named: Vec<&str> = page
        .lines()
        .filter_map(|line| line.strip_suffix("` |")?.rsplit("::").next())
        .filter(|name| name.starts_with("extreme_"))
        .collect();
    assert!(named.len() > 40, "{} rows", named.len());
    for name in named {
        assert!(
            tests.contains(&format!("fn {name}(")),
            "docs/extremes.md names {name}, which is gone: python scripts/extremes.py"
        );
    }
}
