//! Contract: `docs/paper.md` has a row for each of the paper's requirements, speaks of code and tests that exist, and counts right.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

const LAST: u32 = 67;

/// One row of its tables.
struct Row {
    number: u32,
    done: String,
    /// Paths and names in backticks, in order.
    code: Vec<String>,
    tests: Vec<String>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All Rust text under a folder.
fn text_under(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries
        .map(|path| match path.extension() {
            _ if path.is_dir() => text_under(&path),
            Some(extension) if extension == "rs" => read(&path),
            _ => String::new(),
        })
        .collect()
}

/// What stands between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_string).collect()
}

fn row(line: &str) -> Option<Row> {
    let number = line.strip_prefix("| A")?.split(' ').next()?.parse().ok()?;
    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
    assert_eq!(cells.len(), 7, "five cells: {line}");
    Some(Row { number, done: cells[3].into(), code: quoted(cells[4]), tests: quoted(cells[5]) })
}

/// Code lies under `src/` unless its path begins elsewhere.
fn file(path: &str) -> Option<PathBuf> {
    [root().join("src").join(path), root().join(path)].into_iter().find(|path| path.is_file())
}

/// Whether a text defines `a` or, for `a::b`, names `a` and defines `b`.
fn defines(text: &str, name: &str) -> bool {
    let (of, own) = name.rsplit_once("::").unwrap_or(("", name));
    let is_end = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let follows = |word: &str| {
        let start = format!("{word}{own}");
        text.match_indices(&start).any(|(at, _)| is_end(&text[at + start.len()..]))
    };
    let words = ["fn ", "struct ", "enum ", "trait ", "const ", "pub ", "def "];
    text.contains(of) && (words.iter().any(|word| follows(word)) || text.contains(&format!("\n{own} = ")))
}

/// What is wrong with a row's code.
fn code_faults(row: &Row) -> Vec<String> {
    let mut faults = Vec::new();
    let mut text = None;
    for name in &row.code {
        if name.contains('/') {
            text = file(name).map(|path| read(&path));
            faults.extend(text.is_none().then(|| format!("A{}: no file {name}", row.number)));
        } else if text.as_ref().is_some_and(|text| !defines(text, name)) {
            faults.push(format!("A{}: no {name} in the file before it", row.number));
        }
    }
    faults
}

/// What is wrong with what a row names and says.
fn row_faults(row: &Row, page: &str, functions: &HashSet<String>) -> Vec<String> {
    let number = row.number;
    let mut faults = code_faults(row);
    let gone = row.tests.iter().filter(|name| !functions.contains(*name));
    faults.extend(gone.map(|name| format!("A{number}: no test {name}")));
    let done = row.done.as_str();
    if !["equal", "deviates", "half", "missing"].contains(&done) {
        faults.push(format!("A{number}: '{done}'"));
    }
    if done != "missing" && (row.code.is_empty() || row.tests.is_empty()) {
        faults.push(format!("A{number}: neither code nor test may be left out"));
    }
    if done != "equal" && !page.contains(&format!("- **A{number}.**")) {
        faults.push(format!("A{number}: no note says what differs"));
    }
    faults
}

/// Whether the head's count is that of the rows.
fn count_faults(rows: &[Row], page: &str) -> Vec<String> {
    let count = |done: &[&str]| rows.iter().filter(|row| done.contains(&row.done.as_str())).count();
    let (equal, deviate, missing) = (count(&["equal"]), count(&["deviates"]), count(&["half", "missing"]));
    let said = [format!("{equal} equal, {deviate} deviate ("), format!("), {missing} missing (")];
    said.iter().filter(|text| !page.contains(*text)).map(|text| format!("the head does not say '{text}'")).collect()
}

/// Notes name tests, configs, results and pictures too.
fn note_faults(page: &str, functions: &HashSet<String>) -> Vec<String> {
    let starts = |name: &str, with: &[&str]| with.iter().any(|start| name.starts_with(start));
    let fault = |name: String| {
        let is_test = starts(&name, &["exact_", "equal_", "law_", "dist_", "golden_", "extreme_", "order_"]);
        let is_file = starts(&name, &["scripts/", "docs/", "configs/"]);
        if is_test && !functions.contains(&name) {
            return Some(format!("a note: no test {name}"));
        }
        (is_file && !root().join(&name).exists()).then(|| format!("a note: no file {name}"))
    };
    page.lines().filter(|line| row(line).is_none()).flat_map(quoted).filter_map(fault).collect()
}

/// What is wrong with a page.
fn faults(page: &str, functions: &HashSet<String>) -> Vec<String> {
    let rows: Vec<Row> = page.lines().filter_map(row).collect();
    let rows_of = |number: u32| rows.iter().filter(|row| row.number == number).count();
    let mut faults: Vec<String> =
        (1..=LAST).filter(|&a| rows_of(a) != 1).map(|a| format!("A{a}: {} rows", rows_of(a))).collect();
    faults.extend(rows.iter().filter(|row| row.number > LAST).map(|row| format!("A{}: beyond the last", row.number)));
    faults.extend(rows.iter().flat_map(|row| row_faults(row, page, functions)));
    faults.extend(count_faults(&rows, page));
    faults.extend(note_faults(page, functions));
    faults
}

fn page() -> String {
    read(&root().join("docs/paper.md"))
}

/// Names of all functions, tests among them.
fn functions() -> HashSet<String> {
    let text = text_under(&root().join("src")) + &text_under(&root().join("tests"));
    text.split("fn ").skip(1).filter_map(|rest| Some(rest.split_once('(')?.0.to_string())).collect()
}

#[test]
fn equal_the_page_of_the_paper_and_what_there_is() {
    let faults = faults(&page(), &functions());
    assert!(faults.is_empty(), "docs/paper.md:\n{}", faults.join("\n"));
}

/// The check above can fail: each kind of damage to the page is told.
#[test]
fn law_a_page_that_went_stale_is_told() {
    let (page, functions) = (page(), functions());
    let line = page.lines().find(|line| line.starts_with("| A33 ")).expect("a row");
    for (from, to, told) in [
        (line, "", "A33: 0 rows"),
        (line, &format!("{line}\n{line}"), "A33: 2 rows"),
        (line, &line.replace("A33", "A68"), "A68: beyond the last"),
        ("`train/filter/backprop.rs`", "`train/filter/forwardprop.rs`", "A33: no file train/filter/forwardprop.rs"),
        ("`Backprop`", "`Forwardprop`", "A33: no Forwardprop in the file before it"),
        ("`exact_backprop_is_the_ekf_under_the_two_assumptions`", "`exact_it_is`", "A33: no test exact_it_is"),
        ("| half |", "| mostly |", "A39: 'mostly'"),
        ("- **A22.**", "- ", "A22: no note says what differs"),
        ("`docs/top.png`", "`docs/bottom.png`", "a note: no file docs/bottom.png"),
        ("53 equal, ", "54 equal, ", "the head does not say '53 equal, 12 deviate ('"),
    ] {
        assert_eq!(page.matches(from).count(), 1, "{from}");
        let found = faults(&page.replace(from, to), &functions);
        assert!(found.iter().any(|fault| fault == told), "{told}: {found:?}");
    }
}
