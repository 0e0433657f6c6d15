//! Runs one scene of `benches/empty_yard.yaml` so many times: what `scripts/instructions.py` counts the instructions of.
//!
//! `empty_yard TIMES`. Two numbers of times differ by whole scenes, so that start-up cancels.

use std::path::Path;

use marsyard::config;
use marsyard::episode::{Prepared, Scratch, Unobserved, run_scene};

fn main() {
    let times = std::env::args().nth(1).and_then(|text| text.parse::<u32>().ok());
    let Some(times) = times else {
        eprintln!("usage: empty_yard TIMES");
        std::process::exit(2);
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/empty_yard.yaml");
    let plan = config::load(&file, &[]).expect("the config is in the repository");
    let prepared = Prepared::new(plan).expect("a sensor of the library");
    let mut scratch = Scratch::default();
    let mut cells = 0;
    for _ in 0..times {
        let output = run_scene(&prepared, 0, &mut scratch, &mut Unobserved);
        assert!(output.error.is_none(), "{:?}", output.error);
        cells += output.scans[0].cells.rows.len();
    }
    println!("{cells} cells in {times} scenes");
}
