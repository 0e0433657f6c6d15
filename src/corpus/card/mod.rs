//! Manifest -> `README.md`: the dataset card, with the front matter that Hugging Face reads.

mod facts;

use std::fmt::Write;

pub(crate) use facts::FamilyCard;

use super::schema::{self, Column, Role};
use super::{CorpusSpec, Manifest, Split, Table};

pub(crate) const NAME: &str = "README.md";
/// How it ends.
pub(crate) const END: &str = "never train on them. `info` columns are not features either.\n";

/// The card as text.
pub(crate) fn text(spec: &CorpusSpec, manifest: &Manifest) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = front_matter(&mut out, spec, manifest);
    let _ = body(&mut out, spec, manifest);
    out
}

fn front_matter(out: &mut String, spec: &CorpusSpec, manifest: &Manifest) -> std::fmt::Result {
    writeln!(out, "---\npretty_name: {}", quoted(&spec.name))?;
    match (&spec.card.license, spec.card.hub_license()) {
        (None, _) => writeln!(out, "license: unknown")?,
        (Some(_), Some(license)) => writeln!(out, "license: {license}")?,
        (Some(license), None) => {
            writeln!(out, "license: other\nlicense_name: {}", quoted(&license.to_lowercase()))?;
            spec.card.license_url().map_or(Ok(()), |url| writeln!(out, "license_link: {url}"))?;
        }
    }
    writeln!(out, "tags:\n- lidar\n- robotics\n- traversability\n- synthetic\n- tabular\n- marsyard")?;
    let rows = manifest.tables.get(&Table::Cells).map_or(0, |totals| totals.rows);
    writeln!(out, "task_categories:\n- tabular-classification\nsize_categories:\n- {}\nconfigs:", size_category(rows))?;
    for table in &spec.tables {
        let name = table.name();
        writeln!(out, "- config_name: {name}")?;
        if *table == Table::Cells {
            writeln!(out, "  default: true")?;
        }
        writeln!(out, "  data_files:")?;
        for split in full_splits(manifest) {
            let split = split.name();
            writeln!(out, "  - split: {split}\n    path: data/{name}/{split}-*.parquet")?;
        }
    }
    writeln!(out, "dataset_info:")?;
    for &table in &spec.tables {
        writeln!(out, "- config_name: {}\n  features:", table.name())?;
        for column in spec.columns(table) {
            writeln!(out, "  - name: {}", column.name)?;
            if column.role == Role::Label {
                writeln!(out, "    dtype:\n      class_label:\n        names:")?;
                for (value, label) in schema::LABELS.iter().enumerate() {
                    writeln!(out, "          '{value}': {label}")?;
                }
            } else {
                writeln!(out, "    dtype: {}", column.kind.name())?;
            }
        }
    }
    writeln!(out, "---\n")
}

fn body(out: &mut String, spec: &CorpusSpec, manifest: &Manifest) -> std::fmt::Result {
    writeln!(out, "# {}\n", spec.name)?;
    writeln!(
        out,
        "Simulated lidar sweeps of random yards, as cells of a grid with features and labels: which ground can a rover cross?\n\
         Made by `marsyard {}`. The same `plan.yaml` gives the same bytes.\n",
        manifest.build.version
    )?;
    writeln!(out, "| | |\n|---|---|")?;
    writeln!(out, "| seed | {} |\n| scenes | {} ({} failed) |", manifest.seed, manifest.scenes, manifest.failed.len())?;
    writeln!(out, "| families | {} |", manifest.families.join(", "))?;
    writeln!(out, "| corpus_id | `{}` |\n| scene_plan_hash | `{}` |\n", manifest.corpus_id, manifest.scene_plan_hash)?;
    writeln!(out, "| split | shards | scenes | cells | untraversable |\n|---|---|---|---|---|")?;
    for split in Split::ALL {
        let Some(totals) = manifest.splits.get(&split) else { continue };
        let share = totals.labels.untraversable_share().map_or("-".into(), |share| format!("{:.2} %", 100.0 * share));
        writeln!(
            out,
            "| {} | {} | {} | {} | {share} |",
            split.name(),
            totals.shards,
            totals.scenes,
            totals.labels.total()
        )?;
    }
    writeln!(
        out,
        "\nNo scene is in two splits. Statistics of the features (train split) are in `manifest.json`, hashes of the files in `shards.jsonl`."
    )?;
    out.push_str(EXTENDED);
    families(out, spec)?;
    out.push_str(LIMITS);
    rights(out, spec, manifest)?;
    writeln!(out, "\n## Reading\n\n```python")?;
    writeln!(out, "import polars as pl")?;
    writeln!(out, "cells = pl.read_parquet(\"data/cells/train-*.parquet\")\n```\n")?;
    writeln!(
        out,
        "```sql\nSELECT label, count(*), avg(height_difference_m) FROM 'data/cells/train-*.parquet' GROUP BY label;\n```\n"
    )?;
    writeln!(
        out,
        "`datasets.load_dataset(\"/absolute/path/of/this/folder\", \"cells\")` works too (a bare `\".\"` does not).\n"
    )?;
    for &table in &spec.tables {
        writeln!(
            out,
            "## `{}`: one row is {}\n\n| column | type | unit | role | meaning |\n|---|---|---|---|---|",
            table.name(),
            table.row_is()
        )?;
        for Column { name, kind, nullable, unit, role, description } in spec.columns(table) {
            let null = if nullable { ", nullable" } else { "" };
            let role = format!("{role:?}").to_lowercase();
            writeln!(out, "| `{name}` | {}{null} | {unit} | {role} | {} |", kind.name(), cell(&description))?;
        }
        writeln!(out)?;
    }
    writeln!(out, "Columns of the role `truth` are known to the simulator only: {}", END.trim_end())
}

/// That a corpus may grow is asked by whoever finds it too small.
const EXTENDED: &str = "\nMore scenes: `marsyard generate . --set scenes=N`, run in this folder with a larger N (a multiple of \
                        `scenes_per_shard`), builds the shards that are missing; those that are here stay as they are, byte for \
                        byte, and so do their splits. Pictures of a scene: `marsyard preview . --scene 0 --out ../preview`.\n";

/// What is not modelled whatever the plan says: the heads of the stages say the same.
const LIMITS: &str = "\n## Limits of use\n\n\
    All of it is simulated; no scan of a real place is in it.\n\n\
    - The ground is firm and at rest: no loose soil, overhangs or moving things, and no ground outside the yard.\n\
    - The rover has no dynamics and does not sink in; wheel slip is noise of its motion, and a constant share of what its \
    odometry counts where the config names one. It drives over what is no taller than a wheel as if it were not there.\n\
    - A sweep is taken at rest, from one point. Dust, crosstalk and several echoes a beam are not simulated, nor are errors of the \
    sensor that are not named above.\n\
    - Labels follow the rule above; no rover was seen to fail. Points lie where the estimated pose puts them, so that some cells at the \
    border of an obstacle carry the label of their neighbour.\n\
    - What was learnt from it is to be judged on real scans before a rover relies on it: `marsyard classify`.\n";

/// What each family is.
fn families(out: &mut String, spec: &CorpusSpec) -> std::fmt::Result {
    for FamilyCard { name, rows } in &spec.facts {
        writeln!(out, "\n## Family `{name}`\n\n| | |\n|---|---|")?;
        for (what, words) in rows {
            writeln!(out, "| {what} | {} |", cell(words))?;
        }
    }
    Ok(())
}

/// Licence, authors, citation.
fn rights(out: &mut String, spec: &CorpusSpec, manifest: &Manifest) -> std::fmt::Result {
    let card = &spec.card;
    writeln!(out, "\n## Licence and citation\n")?;
    match (&card.license, card.license_url()) {
        (Some(license), Some(url)) => writeln!(out, "Licence: [{license}]({url}).")?,
        (Some(license), None) => writeln!(out, "Licence: {license}, which is not one of SPDX's.")?,
        (None, _) => writeln!(
            out,
            "Licence: not stated. Whoever built the corpus may state it, with authors and citation, by the section `card` of the \
             config: `marsyard generate . --set card.license=CC-BY-4.0`, run in this folder, writes this card anew and builds nothing."
        )?,
    }
    if !card.authors.is_empty() {
        writeln!(out, "\nAuthors: {}.", card.authors.join(", "))?;
    }
    if let Some(date) = &card.date_published {
        writeln!(out, "\nPublished: {date}.")?;
    }
    if let Some(url) = &card.url {
        writeln!(out, "\nPublished at <{url}>.")?;
    }
    // A fence within the text would end the block.
    writeln!(out, "\nTo cite it:\n\n```text\n{}\n```", citation(spec, manifest).replace("```", "~~~"))
}

/// How the corpus is cited: as its config says, or by what it is.
pub(crate) fn citation(spec: &CorpusSpec, manifest: &Manifest) -> String {
    let by_id =
        || format!("corpus_id {} ({}, marsyard {})", manifest.corpus_id, super::manifest::NAME, manifest.build.version);
    spec.card.citation.as_ref().map_or_else(by_id, |citation| citation.trim_end().to_owned())
}

/// A text within a table of Markdown.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(char::is_control, " ")
}

/// Splits that have a shard: loaders refuse a pattern that matches nothing.
fn full_splits(manifest: &Manifest) -> Vec<Split> {
    Split::ALL.into_iter().filter(|split| manifest.splits.get(split).is_some_and(|totals| totals.shards > 0)).collect()
}

/// Hugging Face's classes of size, by rows.
fn size_category(rows: u64) -> &'static str {
    match rows {
        0..1_000 => "n<1K",
        1_000..10_000 => "1K<n<10K",
        10_000..100_000 => "10K<n<100K",
        100_000..1_000_000 => "100K<n<1M",
        1_000_000..10_000_000 => "1M<n<10M",
        10_000_000..100_000_000 => "10M<n<100M",
        100_000_000..1_000_000_000 => "100M<n<1B",
        _ => "n>1B",
    }
}

/// A YAML scalar that is text whatever it looks like.
fn quoted(text: &str) -> String {
    serde_json::to_string(text).expect("text")
}
