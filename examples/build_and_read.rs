//! Builds a small corpus, opens it and reads two of its columns: how much more often a rough cell is untraversable than a flat one.
//!
//! `cargo run --release --example build_and_read [FOLDER]`. Given a folder, the corpus stays there, and the same command again finds
//! nothing left to build.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use marsyard::cells::HEIGHT_DIFFERENCE;
use marsyard::corpus::cells::{CellBatch, LABEL};
use marsyard::corpus::{Split, Table};
use marsyard::{build_corpus, config, open_corpus};

/// Upper ends of the ranges of height difference, metres.
const HEIGHTS_M: [f32; 6] = [0.02, 0.05, 0.1, 0.2, 0.4, f32::INFINITY];

fn main() -> Result<(), Box<dyn Error>> {
    let temporary = tempfile::tempdir()?;
    let place = std::env::args().nth(1).map_or_else(|| temporary.path().to_path_buf(), PathBuf::from);
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.yaml");
    let plan = config::load(&config, &["scenes=40", "scenes_per_shard=2"].map(String::from))?;

    let started = Instant::now();
    let threads = std::thread::available_parallelism()?.get();
    let corpus = build_corpus(&plan, &place, threads)?;
    println!(
        "{} scenes in {:.1} s, corpus_id {}",
        corpus.manifest.scenes,
        started.elapsed().as_secs_f64(),
        corpus.manifest.corpus_id
    );

    // Whoever reads begins here: the files are held against their hashes, and half a corpus is refused.
    let corpus = open_corpus(&place)?;
    let mut cells = [[0_u64; 2]; HEIGHTS_M.len()];
    for shard in corpus.lines_of(Split::Train) {
        let file = corpus.open_table(shard, Table::Cells).map_err(|why| corpus.refused(shard, Table::Cells, why))?;
        for group in 0..shard.tables[&Table::Cells].row_groups as usize {
            let Some(file) = &file else { continue };
            let rows = CellBatch::read(file, group, &[HEIGHT_DIFFERENCE, LABEL])?;
            let heights_m = rows.feature_if_there(HEIGHT_DIFFERENCE)?.unwrap_or_default();
            let labels = rows.labels()?;
            for (row, &height_m) in heights_m.iter().enumerate() {
                let range = HEIGHTS_M.partition_point(|&end_m| end_m <= height_m);
                if let Some(label) = labels.at(row) {
                    cells[range.min(HEIGHTS_M.len() - 1)][label.index()] += 1;
                }
            }
        }
    }

    println!("{:>18} {:>8}   untraversable", "height difference", "cells");
    for (k, [traversable, untraversable]) in cells.into_iter().enumerate() {
        let from_m = if k == 0 { 0.0 } else { HEIGHTS_M[k - 1] };
        let all = traversable + untraversable;
        let share = untraversable as f64 / all.max(1) as f64;
        let bar = "#".repeat((40.0 * share).round() as usize);
        println!("{:>12} {from_m:4.2} m {all:>8}   {:5.1} % {bar}", "from", 100.0 * share);
    }
    Ok(())
}
