//! The name of a kind of file -> its JSON Schema, or the columns of a table.

use clap::Args;
use clap::builder::PossibleValue;

use super::output::out;
use crate::config::{self, Kind};
use crate::corpus::documents::documents;

/// The files that `schemas/` holds, by their name before the first dot.
const FILES: [(&str, &str); 13] = [
    ("corpus", "a config of a corpus (YAML)"),
    ("train", "a config of a training (YAML)"),
    ("rover", "a rover (YAML)"),
    ("sensor", "a sensor (YAML)"),
    ("manifest", "manifest.json of a corpus"),
    ("shards", "a line of shards.jsonl of a corpus"),
    ("receipt", "a receipt of a shard"),
    ("inspection", "what `inspect --json` prints"),
    ("comparison", "what `compare --json` prints"),
    ("cells", "columns of the table `cells`"),
    ("points", "columns of the table `points`"),
    ("scenes", "columns of the table `scenes`"),
    ("poses", "columns of the table `poses`"),
];

#[derive(Debug, Args)]
pub(super) struct SchemaArgs {
    /// Which file: a JSON Schema of what is written by hand or as JSON, a list of columns with types and units of a table.
    #[arg(value_name = "FILE", value_parser = FILES.map(|(name, what)| PossibleValue::new(name).help(what)))]
    file: String,
}

pub(super) fn run(args: &SchemaArgs) {
    out!("{}", text(&args.file));
}

fn text(name: &str) -> String {
    match Kind::ALL.into_iter().find(|kind| kind.name() == name) {
        Some(kind) => config::schema_text(kind).to_string(),
        None => written_by_marsyard(name).expect("a name that the parser knows has a document"),
    }
}

fn written_by_marsyard(name: &str) -> Option<String> {
    let is_named = |file: &str| file.split('.').next() == Some(name);
    documents().into_iter().find(|(file, _)| is_named(file)).map(|(_, text)| text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_every_file_in_schemas_can_be_printed() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas");
        let mut printed = Vec::new();
        for file in std::fs::read_dir(folder).unwrap() {
            let file = file.unwrap();
            let name = file.file_name().to_str().unwrap().split('.').next().unwrap().to_string();
            assert_eq!(text(&name), std::fs::read_to_string(file.path()).unwrap(), "{name}");
            printed.push(name);
        }
        let mut named = FILES.map(|(name, _)| name.to_string());
        named.sort_unstable();
        printed.sort_unstable();
        assert_eq!(printed, named);
    }
}
