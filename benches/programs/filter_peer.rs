//! The filter side of `scripts/peers/ekf_peers.py`: CPU time of whole training steps (forward run, gradient, update), one thread.
//!
//! `filter_peer` reads lines `HIDDEN FILTER ROWS` (`16x16 ekf-f32 1000`) and answers each with the CPU seconds that learning ROWS
//! rows took. The rates of all filters: `cargo bench --bench filter`.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};

#[path = "../trainee/mod.rs"]
mod trainee;

use trainee::{Trainee, rows};

fn main() -> Result<(), String> {
    let rows = rows();
    let mut trainees: BTreeMap<String, Trainee> = BTreeMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|e| e.to_string())?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let [hidden, filter, count] = words[..] else { return Err(format!("`{line}` is not `HIDDEN FILTER ROWS`")) };
        let count = count.parse().map_err(|e| format!("{count}: {e}"))?;
        let key = format!("{hidden} {filter}");
        if !trainees.contains_key(&key) {
            trainees.insert(key.clone(), Trainee::new(hidden, filter)?);
        }
        let seconds = trainees.get_mut(&key).map_or(0.0, |trainee| trainee.learn(&rows, count));
        println!("{seconds:.9}");
        std::io::stdout().flush().map_err(|e| e.to_string())?;
    }
    Ok(())
}
