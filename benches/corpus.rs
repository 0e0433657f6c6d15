//! Rows a second from a scene's cells to the bytes of a shard, and bytes a second. One thread, CPU time; nothing is put on disk.
//!
//! `cargo bench --bench corpus`

mod shared;

use marsyard::corpus::ShardWriter;
use marsyard::episode::SceneOutput;
use marsyard::episode::{Scratch, Unobserved, run_scene};
use shared::paper::prepared;
use shared::rate;

fn main() {
    for (what, sets) in
        [("cells, scenes, poses", &[][..]), ("with points", &["tables=[cells, scenes, poses, points]"][..])]
    {
        let sets: Vec<&str> =
            sets.iter().copied().chain(["drive.contact=gauss_newton", "scenes=20", "scenes_per_shard=20"]).collect();
        let prepared = prepared("paper.yaml", &sets);
        let spec = prepared.plan.corpus_spec();
        let mut scratch = Scratch::default();
        let outputs: Vec<SceneOutput> =
            (0..20).map(|scene| run_scene(&prepared, scene, &mut scratch, &mut Unobserved)).collect();
        let rows: usize = outputs.iter().flat_map(|output| &output.scans).map(|scan| scan.cells.rows.len()).sum();
        let shard = || {
            let mut writer = ShardWriter::new(&spec, 0).expect("a schema");
            outputs.iter().for_each(|output| writer.push(output).expect("good rows"));
            writer.finish().expect("a whole shard")
        };
        let bytes: usize = shard().files.iter().map(|(_, bytes)| bytes.len()).sum();
        rate(&format!("{what}, by cells"), "cells", rows as f64, || {
            shard();
        });
        rate(&format!("{what}, by bytes"), "bytes", bytes as f64, || {
            shard();
        });
    }
}
