//! Contract: no text, however broken, makes `load` panic; it is a plan or a list of faults.

use std::path::Path;

use marsyard::config::load;
use proptest::prelude::*;

fn load_text(text: &[u8], sets: &[String]) -> Result<usize, usize> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corpus.yaml");
    std::fs::write(&path, text).unwrap();
    match load(&path, sets) {
        Ok(plan) => Ok(plan.to_yaml().len()),
        Err(error) => {
            assert!(!error.faults.is_empty());
            let mut out = String::new();
            let handler = miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor());
            handler.render_report(&mut out, &error).unwrap();
            Err(error.lines().len())
        }
    }
}

fn shipped() -> Vec<String> {
    let names = ["quickstart", "paper", "mars", "mixed", "holes"];
    names.iter().map(|name| std::fs::read_to_string(format!("configs/{name}.yaml")).unwrap()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn extreme_arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = load_text(&bytes, &[]);
    }

    #[test]
    fn extreme_arbitrary_text_never_panics(text in "[\\PC\\n\\t]{0,300}") {
        let _ = load_text(text.as_bytes(), &[]);
    }

    /// Lines taken out, doubled, moved and cut; characters replaced by ones that mean something in YAML.
    #[test]
    fn extreme_mutated_configs_never_panic(
        which in 0usize..4,
        edits in proptest::collection::vec((0u8..5, any::<u16>(), any::<u16>(), proptest::sample::select(
            vec!["-", ":", "{", "}", "[", "]", "&a ", "*a", "!", "|", ">", "null", ".nan", "-1", "1e999", "'", "\"", "\t", "é", "<<: ", "#", ", ", "[[", "9999999999999999999999"])), 1..8),
    ) {
        let mut text = shipped()[which].clone();
        for (kind, a, b, token) in edits {
            let lines: Vec<&str> = text.lines().collect();
            if lines.is_empty() { break; }
            let (i, j) = (usize::from(a) % lines.len(), usize::from(b) % lines.len());
            let mut lines: Vec<String> = lines.into_iter().map(str::to_owned).collect();
            match kind {
                0 => { lines.remove(i); }
                1 => { let line = lines[i].clone(); lines.insert(j, line); }
                2 => lines.swap(i, j),
                _ => {
                    let at = lines[i].char_indices().map(|(at, _)| at).nth(usize::from(b) % lines[i].chars().count().max(1)).unwrap_or(0);
                    let end = lines[i][at..].chars().next().map_or(at, |c| at + c.len_utf8());
                    lines[i].replace_range(if kind == 3 { at..at } else { at..end }, token);
                }
            }
            text = lines.join("\n");
        }
        let _ = load_text(text.as_bytes(), &[]);
    }

    #[test]
    fn extreme_overrides_never_panic(key in "(scene|drive|sweep|slam|cells|families|tables|seed)(\\.[a-z_0-9]{0,12}){0,4}", value in "\\PC{0,20}") {
        let text = std::fs::read("configs/mixed.yaml").unwrap();
        let _ = load_text(&text, &[format!("{key}={value}")]);
    }
}

#[test]
fn extreme_a_missing_file_is_a_fault() {
    let error = load(Path::new("no/such/config.yaml"), &[]).unwrap_err();
    assert_eq!(error.lines(), "no/such/config.yaml:1:1: the config cannot be read: there is no such file\n");
    assert!(load(Path::new("configs"), &[]).is_err());
}
