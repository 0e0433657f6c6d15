//! What the one door into a finished corpus lets through, and what it costs.

use std::time::Instant;

use super::books;
use super::fixture::{corpus, spec};
use crate::corpus::listing::Listing;
use crate::corpus::{Finished, LocalFolder, Receipt, Split, Store, Table, verify};

fn path(store: &LocalFolder, name: &str) -> std::path::PathBuf {
    std::path::Path::new(&store.place()).join(name)
}

fn refusal(store: &LocalFolder) -> String {
    Finished::open(store).err().map_or_else(String::new, |error| error.to_string())
}

#[test]
fn exact_a_whole_corpus_opens_with_its_shards_by_split() {
    let spec = spec(14, &Table::ALL);
    let (_dir, store, manifest) = corpus(&spec);
    let finished = Finished::open(&store).unwrap();
    assert_eq!(finished.manifest, manifest);
    assert!(finished.unchecked.is_empty());
    assert_eq!(Split::ALL.map(|split| finished.lines_of(split).count()), [5, 1, 1]);
    for line in &finished.lines {
        assert!(Table::ALL.iter().all(|&table| finished.open_table(line, table).unwrap().is_some()));
    }
    assert_eq!(manifest.files.len(), 4);
}

#[test]
fn exact_the_hash_of_all_receipts_is_that_of_their_bytes_in_order() {
    let (_dir, store, manifest) = corpus(&spec(6, &[Table::Cells]));
    let bytes: Vec<u8> = (0..3).flat_map(|shard| store.read(&Receipt::path(shard)).unwrap()).collect();
    assert_eq!(manifest.receipts_sha256, Some(crate::corpus::sha256(&bytes)));
}

#[test]
fn law_every_number_of_a_manifest_is_held_against_its_shards() {
    let (_dir, store, _) = corpus(&spec(14, &[Table::Cells, Table::Scenes]));
    let whole = String::from_utf8(store.read("manifest.json").unwrap()).unwrap();
    for (from, to, says) in [
        ("\"name\": \"tiny\"", "\"name\": \"../../evil\"", "letters, digits"),
        ("\"name\": \"tiny\"", "\"name\": \"/tmp/evil\"", "letters, digits"),
        ("\"default\"", "\"../x\"", "letters, digits"),
        ("\"shards\": 7", "\"shards\": 8", "it lists 7 shards, the manifest has 8"),
        ("\"scenes\": 14", "\"scenes\": 16", "it plans 14 scenes of 'tiny', the corpus was finished with 16"),
        ("\"seed\": 42", "\"seed\": 43", "plan.yaml"),
        ("\"scenes_per_shard\": 2", "\"scenes_per_shard\": 0", "absurd"),
        ("\"scenes_per_shard\": 2", "\"scenes_per_shard\": 7", "plan.yaml"),
        ("\"corpus_id\": \"", "\"corpus_id\": \"0", "corpus_id"),
        ("\"rows\": 1120", "\"rows\": 1121", "other tables, rows or bytes"),
        ("\"traversable\": 400", "\"traversable\": 401", "labels of the train split"),
        ("\"failed_scenes\": 0", "\"failed_scenes\": 1", "of the train split"),
        ("\"shards.jsonl\": \"", "\"shards.jsonl\": \"0", "shards.jsonl: its SHA-256 is not the manifest's"),
        ("\"README.md\"", "\"../../README.md\"", "it lacks the hashes"),
        ("\"failed\": []", "\"failed\": [{\"scene\": 3, \"error\": \"\", \"replay\": \"rm -rf\"}]", "none of its own"),
        ("\"format\": 2", "\"format\": 3", "written in format 3, this program reads formats 1 to 2"),
    ] {
        let edited = whole.replacen(from, to, 1);
        assert_ne!(edited, whole, "{from}");
        store.replace("manifest.json", edited.as_bytes()).unwrap();
        let said = refusal(&store);
        assert!(said.contains(says), "{to}: {said}");
    }
    store.replace("manifest.json", whole.as_bytes()).unwrap();
    assert_eq!(refusal(&store), "");
}

#[test]
fn law_every_line_of_the_list_is_held_against_the_manifest() {
    let (_dir, store, _) = corpus(&spec(14, &[Table::Cells, Table::Scenes]));
    let whole = String::from_utf8(store.read("shards.jsonl").unwrap()).unwrap();
    let lost: String =
        whole.lines().enumerate().filter(|(k, _)| *k != 1).map(|(_, line)| format!("{line}\n")).collect();
    for (text, says) in [
        (lost, "it lists 6 shards, the manifest has 7"),
        (whole.replacen("[2,4]", "[2,5]", 1), "says shard 1 of scenes 2..5"),
        (whole.replacen("\"traversable\":80", "\"traversable\":90", 1), "labels of the train split"),
        (whole.replacen("\"rows\":160", "\"rows\":0", 1), "labels of the train split"),
        (whole.replacen("\"split\":\"train\"", "\"split\":\"test\"", 1), "its split or paths"),
        (whole.replacen("data/cells/", "data/../x/", 1), "its split or paths"),
        (whole.replacen("\"value_hash\":\"", "\"value_hash\":\"0", 1), "corpus_id"),
        (whole.replacen('{', "[", 1), "line 1"),
    ] {
        assert_ne!(text, whole, "{says}");
        store.replace("shards.jsonl", text.as_bytes()).unwrap();
        assert!(refusal(&store).contains("its SHA-256 is not the manifest's"), "{}", refusal(&store));
        let manifest = store.read("manifest.json").unwrap();
        // A cheat who mends the hash, and no more; for the row that is missing, the sums of rows too.
        let mended = String::from_utf8(manifest.clone()).unwrap();
        let hash = crate::corpus::sha256(whole.as_bytes());
        store
            .replace("manifest.json", mended.replace(&hash, &crate::corpus::sha256(text.as_bytes())).as_bytes())
            .unwrap();
        let said = refusal(&store);
        assert!(said.contains(says) || says.contains("train split") && said.contains("other tables"), "{says}: {said}");
        store.replace("manifest.json", &manifest).unwrap();
    }
}

#[test]
fn law_strays_missing_files_and_links_are_found_by_readers_and_verify() {
    let spec = spec(4, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let whole = store.read(&Table::Cells.path(0)).unwrap();
    let findings =
        || verify::verify(&store, &spec, None).unwrap().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for (name, says) in [
        ("data/cells/train-0000099.parquet", "--repair` removes it"),
        ("data/points/train-0000000.parquet", "--repair` removes it"),
        ("data/cells/.hidden.parquet", "--repair` removes it"),
    ] {
        store.put(name, &whole).unwrap();
        let said = refusal(&store);
        assert!(said.contains(name) && said.contains(says), "{said}");
        assert!(findings().contains(name), "{}", findings());
        store.remove(name).unwrap();
    }
    for name in ["data/cells/notes.txt", "data/cells/mine.parquet", "receipts/0000009.json"] {
        store.put(name, b"mine").unwrap();
        assert!(refusal(&store).contains("move it away") && findings().contains(name), "{name}: {}", refusal(&store));
        store.remove(name).unwrap();
    }
    std::os::unix::fs::symlink("train-0000000.parquet", path(&store, "data/cells/link.parquet")).unwrap();
    assert!(refusal(&store).contains("data/cells/link.parquet") && findings().contains("link.parquet"));
    std::fs::remove_file(path(&store, "data/cells/link.parquet")).unwrap();
    for hidden in ["data/cells/.DS_Store", "data/cells/_SUCCESS", "receipts/notes.txt"] {
        store.put(hidden, b"").unwrap();
    }
    assert_eq!((refusal(&store), findings()), (String::new(), String::new()));
    std::fs::remove_file(path(&store, &Receipt::path(1))).unwrap();
    assert!(refusal(&store).contains("receipts/0000001.json: it is missing"));
    // A link in the place of a table is told apart from a table that is not there.
    std::fs::remove_file(path(&store, &Table::Cells.path(0))).unwrap();
    std::os::unix::fs::symlink("elsewhere.parquet", path(&store, &Table::Cells.path(0))).unwrap();
    assert!(refusal(&store).contains("it is a link, a folder or a pipe"), "{}", refusal(&store));
}

#[test]
fn law_files_that_are_whole_and_another_shards_are_refused_when_opened() {
    let (_dir, store, _) = corpus(&spec(14, &[Table::Cells]));
    let bytes = store.read(&Table::Cells.path(0)).unwrap();
    store.replace(&Table::Cells.path(6), &bytes).unwrap();
    let list = String::from_utf8(store.read("shards.jsonl").unwrap()).unwrap();
    let mut lines: Vec<serde_json::Value> = list.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let facts = lines[0]["tables"]["cells"].clone();
    for key in ["bytes", "sha256"] {
        lines[6]["tables"]["cells"][key] = facts[key].clone();
    }
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    store.replace("shards.jsonl", text.as_bytes()).unwrap();
    books::mend(std::path::Path::new(&store.place()));
    let finished = Finished::open(&store).unwrap();
    let line = finished.lines_of(Split::Test).next().unwrap();
    let refused = finished.open_table(line, Table::Cells).err().unwrap();
    let said = finished.refused(line, Table::Cells, refused).to_string();
    assert!(said.contains("its own marsyard.shard is '0', not '6'") && said.contains("test-0000006"), "{said}");
}

#[test]
#[ignore = "makes 400,000 files: cargo test --release --lib listing_a_large -- --ignored --nocapture"]
fn law_listing_a_large_corpus_takes_seconds() {
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path());
    for folder in ["data/cells", "data/scenes", "data/poses", "receipts"] {
        std::fs::create_dir_all(dir.path().join(folder)).unwrap();
    }
    for shard in 0..100_000 {
        for name in [Table::Cells, Table::Scenes, Table::Poses].map(|table| table.path(shard)) {
            std::fs::write(dir.path().join(name), b"x").unwrap();
        }
        std::fs::write(dir.path().join(Receipt::path(shard)), b"x").unwrap();
    }
    let started = Instant::now();
    let strays = Listing::of(&store).unwrap().strays(99_999, |_| true);
    eprintln!("100,000 shards of 3 tables: listed and compared in {:.2} s", started.elapsed().as_secs_f64());
    assert_eq!(strays.len(), 4);
}
