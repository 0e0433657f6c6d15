use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use marsyard::corpus::reader::TableFile;
use marsyard::corpus::{Finished, LocalFolder, Manifest, Receipt, Split, inspect, manifest, sha256};
use marsyard::train::{FeatureSet, Source, Sources};
use proptest::prelude::*;
use serde_json::Value;

use crate::edits::{JSON, apply, cases, edits};
use crate::heap::{MIB, bounded, bounded_by};

/// What means something in these files, beside JSON's own.
const TOKENS: &[&str] = &["\\ud800", "../", "/etc/passwd", "\"cells\"", "\"test\""];

/// A row group may become 96 MiB, and is held as pages and as a batch.
const FREE_BYTES: usize = 256 * MIB;

/// A small finished corpus with all four tables.
pub static CORPUS: LazyLock<PathBuf> = LazyLock::new(|| {
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hostile-corpus");
    let _ = std::fs::remove_dir_all(&place);
    let built = std::process::Command::new(env!("CARGO_BIN_EXE_marsyard"))
        .args(["generate", "tests/fixtures/training.yaml", "--set", "tables=[cells, scenes, poses, points]", "--out"])
        .arg(&place)
        .output()
        .expect("the binary starts");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    place
});

/// The corpus with other bytes for some of its files, and sizes and hashes put right, as who forges a corpus would: readers meet the
/// files themselves, and not only the door before them. The other files are hard links.
struct Altered {
    folder: tempfile::TempDir,
    store: LocalFolder,
}

impl Altered {
    fn new(files: &[(&str, &[u8])]) -> Altered {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
        let place = folder.path();
        for name in ["", "receipts", "data", "data/cells", "data/scenes", "data/poses", "data/points"] {
            std::fs::create_dir_all(place.join(name)).expect("a folder");
            for entry in std::fs::read_dir(CORPUS.join(name)).expect("a folder of the corpus") {
                let path = entry.expect("an entry").path();
                let there = place.join(name).join(path.file_name().expect("a name"));
                if path.is_file() {
                    std::fs::hard_link(&path, there).expect("a link");
                }
            }
        }
        let put = |name: &str, bytes: &[u8]| {
            std::fs::remove_file(place.join(name)).expect("a file of the corpus");
            std::fs::write(place.join(name), bytes).expect("a file");
        };
        files.iter().for_each(|(name, bytes)| put(name, bytes));
        let altered = |name: &str| files.iter().any(|(file, _)| *file == name);
        let mut manifest: Value = serde_json::from_slice(&whole("manifest.json")).expect("JSON");
        if !altered("shards.jsonl") {
            put("shards.jsonl", forged_list(files, &mut manifest).as_bytes());
        }
        if !altered("manifest.json") {
            for (name, hash) in manifest["files"].as_object_mut().expect("hashes by name") {
                *hash = sha256(&std::fs::read(place.join(name)).expect("a file of the corpus")).into();
            }
            put("manifest.json", manifest.to_string().as_bytes());
        }
        Altered { store: LocalFolder::new(place), folder }
    }
}

/// `shards.jsonl` with the sizes and hashes of altered tables; their sizes are added up anew in the manifest.
fn forged_list(files: &[(&str, &[u8])], manifest: &mut Value) -> String {
    let mut list = String::from_utf8(whole("shards.jsonl")).expect("text");
    for (name, bytes) in files.iter().filter(|(name, _)| name.starts_with("data/")) {
        let (before, table) = (whole(name), name.split('/').nth(1).expect("a table"));
        let said = |bytes: &[u8]| format!("\"bytes\":{},\"sha256\":\"{}\"", bytes.len(), sha256(bytes));
        assert!(list.contains(&said(&before)), "{name}");
        list = list.replace(&said(&before), &said(bytes));
        let total = &mut manifest["tables"][table]["bytes"];
        *total = (total.as_u64().expect("bytes") - before.len() as u64 + bytes.len() as u64).into();
    }
    list
}

fn whole(name: &str) -> Vec<u8> {
    std::fs::read(CORPUS.join(name)).expect("a file of the corpus")
}

fn table(which: usize) -> String {
    format!("data/{}/train-0000000.parquet", ["cells", "scenes", "poses", "points"][which])
}

/// Everything that a Parquet file is asked for.
fn read_table(bytes: &[u8], name: &str) -> Result<u64, String> {
    let altered = Altered::new(&[(name, bytes)]);
    let file =
        bounded_by(FREE_BYTES, bytes.len(), || TableFile::open(&altered.store, name)).map_err(|e| e.to_string())?;
    let mut rows = 0;
    for group in 0..file.row_groups().len() {
        // One at a time, as every reader takes them.
        let batch =
            bounded_by(FREE_BYTES, bytes.len(), || file.read_row_group(group, None)).map_err(|e| e.to_string())?;
        rows += batch.num_rows() as u64;
    }
    let _ = bounded_by(FREE_BYTES, bytes.len(), || file.key_values());
    Ok(rows)
}

/// What a trainer makes of a place: the addresses of its row groups and scenes, and the rows of the first of each.
fn train_on(store: &LocalFolder, bytes: usize) -> Result<usize, String> {
    bounded_by(FREE_BYTES, bytes, || {
        let source = Source::open(store, 1.0).map_err(|error| error.to_string())?;
        let sources = Sources::new(vec![source], &FeatureSet::Full, None).map_err(|error| error.to_string())?;
        let mut rows = marsyard::train::rows::Rows::new(sources.features.len());
        for split in Split::ALL {
            let (groups, scenes) = (sources.groups(split), sources.scenes(split));
            if let Some(&group) = groups.first() {
                sources.read(split, group, &mut rows).map_err(|error| error.to_string())?;
            }
            if let Some(&scene) = scenes.first() {
                sources.read_scene(split, scene, &mut rows).map_err(|error| error.to_string())?;
            }
        }
        Ok(rows.len())
    })
}

#[test]
fn the_corpus_that_is_broken_below_is_whole() {
    for which in 0..4 {
        assert!(read_table(&whole(&table(which)), &table(which)).expect("a table") > 0);
    }
    let altered = Altered::new(&[]);
    assert!(train_on(&altered.store, 0).expect("rows") > 0);
    assert!(inspect(&altered.store).expect("a corpus").families.len() == 1);
    assert!(altered.folder.path().join("plan.yaml").exists());
}

proptest! {
    #![proptest_config(cases(150))]

    #[test]
    fn extreme_broken_manifests_are_read_or_refused(edits in edits(&[JSON, TOKENS].concat())) {
        let bytes = apply(&whole("manifest.json"), &edits);
        let altered = Altered::new(&[("manifest.json", &bytes)]);
        if bounded(bytes.len(), || Manifest::read(&altered.store)).is_ok() {
            let shown = bounded_by(FREE_BYTES, bytes.len(), || inspect(&altered.store).map(|inspection| inspection.to_string()));
            // What is no longer the corpus's manifest is refused, with the command that mends it.
            let refusal = shown.err().map(|error| error.to_string());
            prop_assert!(refusal.as_ref().is_none_or(|refusal| refusal.contains("`marsyard ")), "{refusal:?}");
            let _ = train_on(&altered.store, bytes.len());
        }
    }

    #[test]
    fn extreme_broken_shard_lists_are_read_or_refused(edits in edits(&[JSON, TOKENS].concat())) {
        let bytes = apply(&whole("shards.jsonl"), &edits);
        let altered = Altered::new(&[("shards.jsonl", &bytes)]);
        if let Ok(lines) = bounded(bytes.len(), || manifest::parse_shard_lines(&bytes)) {
            prop_assert!(lines.iter().all(|line| line.tables.iter().all(|(table, facts)| facts.path == table.path(line.shard))));
            let _ = bounded_by(FREE_BYTES, bytes.len(), || inspect(&altered.store).map(|_| ()));
            let _ = train_on(&altered.store, bytes.len());
        }
    }

    #[test]
    fn extreme_broken_receipts_are_read_or_refused(edits in edits(&[JSON, TOKENS].concat())) {
        let name = Receipt::path(0);
        let bytes = apply(&whole(&name), &edits);
        let altered = Altered::new(&[(&name, &bytes)]);
        let hash = Manifest::read(&altered.store).expect("the manifest").scene_plan_hash;
        if let Ok(receipt) = bounded(bytes.len(), || Receipt::read(&altered.store, 0, &hash)) {
            prop_assert!(receipt.tables.iter().all(|(table, facts)| facts.path == table.path(0)));
            prop_assert!(receipt.scenes[0] <= receipt.scenes[1]);
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn extreme_broken_tables_are_read_or_refused(which in 0..4usize, edits in edits(&["PAR1", "\u{0}", "ARROW:schema"])) {
        let _ = read_table(&apply(&whole(&table(which)), &edits), &table(which));
    }

    /// The footer and the page headers alone: what sizes, counts and types are announced in.
    #[test]
    fn extreme_tables_with_broken_footers_are_read_or_refused(which in 0..4usize, edits in edits(&["PAR1", "\u{0}", "\u{15}"])) {
        let bytes = whole(&table(which));
        let tail = bytes.len() - 8;
        let length = u32::from_le_bytes(bytes[tail..tail + 4].try_into().expect("four bytes")) as usize;
        let (body, footer) = bytes[..tail].split_at(tail - length);
        let footer = apply(footer, &edits);
        let size = (footer.len() as u32).to_le_bytes();
        let _ = read_table(&[body, &footer, &size, b"PAR1"].concat(), &table(which));
    }

    #[test]
    fn extreme_forged_corpora_are_learnt_from_or_refused(edits in edits(&["PAR1", "\u{0}"])) {
        let name = table(0);
        let bytes = apply(&whole(&name), &edits);
        let altered = Altered::new(&[(&name, &bytes)]);
        let _ = train_on(&altered.store, bytes.len());
    }
}

/// A table of one column, written by the Parquet crate itself, as a stranger would.
fn foreign(column: arrow_array::ArrayRef, name: &str, dictionary: bool) -> Vec<u8> {
    let batch = arrow_array::RecordBatch::try_from_iter([(name, column)]).expect("a batch");
    let properties = parquet::file::properties::WriterProperties::builder()
        .set_compression(parquet::basic::Compression::ZSTD(parquet::basic::ZstdLevel::default()))
        .set_max_row_group_row_count(None)
        .set_data_page_row_count_limit(usize::MAX)
        .set_data_page_size_limit(1 << 30)
        .set_dictionary_enabled(dictionary)
        .build();
    let mut writer =
        parquet::arrow::ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties)).expect("a writer");
    writer.write(&batch).expect("rows");
    writer.into_inner().expect("a file")
}

#[test]
fn extreme_small_tables_of_many_rows_or_long_texts_are_refused() {
    use arrow_array::types::Int32Type;
    use arrow_array::{Int64Array, ListArray, StringArray};
    use std::sync::Arc;

    // Run-length encoded: 20 million rows in some hundred bytes.
    let rows = foreign(Arc::new(Int64Array::from_value(7, 20_000_000)), "scene_id", true);
    assert!(rows.len() < 20_000, "{}", rows.len());
    let said = read_table(&rows, &table(0)).expect_err("too many rows");
    assert!(said.contains("20000000 rows in a row group are more than"), "{said}");
    // One text of 100 kB, 2000 times.
    let text = "x".repeat(100_000);
    let texts = foreign(Arc::new(StringArray::from_iter_values(std::iter::repeat_n(&text, 2_000))), "status", true);
    assert!(texts.len() < 50_000, "{}", texts.len());
    let said = read_table(&texts, &table(1)).expect_err("too much text");
    assert!(said.contains("column 'status' repeats texts of 100000 bytes 2000 times"), "{said}");
    // Nested columns may hold any number of values a row.
    let nested = ListArray::from_iter_primitive::<Int32Type, _, _>([Some(vec![Some(1); 100])]);
    let said = read_table(&foreign(Arc::new(nested), "list", true), &table(0)).expect_err("a nested column");
    assert!(said.contains("a corpus has flat columns"), "{said}");
}

/// What a page header announces was reserved before a byte was expanded: up to 2 GiB.
#[test]
fn regress_a_page_header_that_announces_more_than_the_file_warrants_is_refused() {
    let column = std::sync::Arc::new(arrow_array::Float32Array::from_value(1.0, 8_000_000));
    let mut bytes = foreign(column, "range_m", false);
    assert_eq!(read_table(&bytes, &table(0)), Ok(8_000_000));
    // Behind the magic: the page's type, then its size as a varint of four bytes, of which the largest says 134 MB.
    assert!(
        (bytes[4], bytes[6]) == (0x15, 0x15) && bytes[7..10].iter().all(|byte| byte & 128 != 0) && bytes[10] & 128 == 0
    );
    bytes[7..11].copy_from_slice(&[0xfe, 0xff, 0xff, 0x7f]);
    let said = read_table(&bytes, &table(0)).expect_err("a forged page");
    assert!(said.contains("column 'range_m' grows beyond what"), "{said}");
}

#[test]
fn regress_a_cell_is_looked_up_in_a_table_of_other_types_without_a_panic() {
    use arrow_array::{ArrayRef, Float32Array, Int64Array, RecordBatch};
    use parquet::file::metadata::KeyValue;
    let (name, store) = (table(0), LocalFolder::new(CORPUS.as_path()));
    let there = TableFile::open(&store, &name).expect("a table");
    let rows = there.rows() as usize;
    let columns: [(&str, ArrayRef); 2] = [
        ("scene_id", std::sync::Arc::new(Int64Array::from_value(0, rows))),
        ("scan_id", std::sync::Arc::new(Float32Array::from_value(0.0, rows))),
    ];
    let batch = RecordBatch::try_from_iter(columns).expect("a batch");
    let said = there.key_values().into_iter().map(|(key, value)| KeyValue::new(key, value)).collect();
    let properties = parquet::file::properties::WriterProperties::builder().set_key_value_metadata(Some(said)).build();
    let mut writer =
        parquet::arrow::ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties)).expect("a writer");
    writer.write(&batch).expect("rows");
    let altered = Altered::new(&[(&name, &writer.into_inner().expect("a file"))]);
    let corpus = Finished::open(&altered.store).expect("a forged corpus");
    let cell = marsyard::geometry::CellIndex { row: 0, col: 0 };
    let said = marsyard::corpus::stored_cell(&corpus, 0, 0, cell).expect_err("other types").to_string();
    assert!(said.contains("its column 'scan_id' is Float32, not Int32"), "{said}");
}

#[test]
fn extreme_shard_lists_that_leave_the_place_or_are_absurd_are_refused() {
    let list = String::from_utf8(whole("shards.jsonl")).expect("text");
    for (from, to, word) in [
        ("data/scenes/train-0000000.parquet", "../../etc/passwd", "split or paths"),
        ("data/cells/train-0000000.parquet", "/etc/passwd", "split or paths"),
        ("data/cells/train-0000000.parquet", "data/cells/train-0000001.parquet", "split or paths"),
        ("\"scenes\":[0,2]", "\"scenes\":[0,18446744073709551615]", "not those of one shard"),
        ("\"scenes\":[0,2]", "\"scenes\":[2,0]", "not those of one shard"),
        ("\"row_groups\":1", "\"row_groups\":4294967295", "absurd"),
        ("{\"shard\":1,\"split\":\"train\"", "{\"shard\":0,\"split\":\"train\"", "split or paths"),
    ] {
        assert!(list.contains(from), "{from} in {list}");
        let error = manifest::parse_shard_lines(list.replacen(from, to, 1).as_bytes()).expect_err(to);
        assert!(error.contains(word), "{to}: {error}");
    }
    let twice = format!("{}\n{list}", list.lines().next().expect("a line"));
    assert!(manifest::parse_shard_lines(twice.as_bytes()).expect_err("twice").contains("does not follow"));
}
