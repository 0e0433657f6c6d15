//! A place and a shard -> how long the place takes to have it safely on disk.
//!
//! The sample's shard, and half of it, are committed as a build commits them (written, synced, renamed) into a folder beside
//! the place, which goes away again. Time = files' latency + bytes / bandwidth: the line through both, medians of three.

use std::path::Path;
use std::time::Instant;

use super::EstimateError;
use super::encode::{Encoded, bytes_of};
use crate::corpus::{FinishedShard, LocalFolder};

const ROUNDS: usize = 3;

/// What a place takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// The folder in which it was measured: the place, or the nearest above it that is there.
    pub place: String,
    /// Of a shard as large as the build's, latency included.
    pub bytes_per_s: f64,
    /// Waiting for the place in the whole build, all threads together.
    pub build_s: f64,
}

/// Measures the place with the sample's shard.
pub(super) fn probe(place: &Path, encoded: &Encoded, shards: u64, build_bytes: f64) -> Result<Storage, EstimateError> {
    let absolute = std::path::absolute(place).unwrap_or_else(|_| place.into());
    let there = absolute.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("."));
    let refused =
        |error: std::io::Error| EstimateError::Place { place: there.display().to_string(), reason: error.to_string() };
    let folder = tempfile::Builder::new().prefix(".marsyard-probe-").tempdir_in(there).map_err(refused)?;
    let (mut whole_s, mut half_s) = ([0.0; ROUNDS], [0.0; ROUNDS]);
    for round in 0..ROUNDS {
        half_s[round] = committed_s(&encoded.half, &folder.path().join(format!("half-{round}")))?;
        whole_s[round] = committed_s(&encoded.whole, &folder.path().join(format!("whole-{round}")))?;
    }
    let shard_bytes = build_bytes / shards as f64;
    let shard_s =
        line_at(shard_bytes, (bytes_of(&encoded.half), median(half_s)), (bytes_of(&encoded.whole), median(whole_s)));
    Ok(Storage {
        place: there.display().to_string(),
        bytes_per_s: shard_bytes / shard_s,
        build_s: shard_s * shards as f64,
    })
}

fn committed_s(shard: &FinishedShard, folder: &Path) -> Result<f64, EstimateError> {
    std::fs::create_dir(folder)
        .map_err(|error| EstimateError::Place { place: folder.display().to_string(), reason: error.to_string() })?;
    let store = LocalFolder::new(folder);
    let started = Instant::now();
    shard.commit(&store)?;
    Ok(started.elapsed().as_secs_f64())
}

fn median(mut values: [f64; ROUNDS]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[ROUNDS / 2]
}

/// Seconds at so many bytes, on the line through two measurements; in proportion to the larger where they lie on none.
fn line_at(bytes: f64, half: (f64, f64), whole: (f64, f64)) -> f64 {
    let slope = (whole.1 - half.1) / (whole.0 - half.0);
    let latency_s = half.1 - slope * half.0;
    if slope > 0.0 && slope.is_finite() && latency_s >= 0.0 {
        latency_s + slope * bytes
    } else {
        whole.1 * (bytes / whole.0.max(1.0)).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_latency_and_bandwidth_from_two_measurements() {
        // 10 ms and 100 MB/s.
        assert!((line_at(5e6, (1e6, 0.02), (2e6, 0.03)) - 0.06).abs() < 1e-15);
        // The smaller took longer: all is latency up to its size, and bandwidth beyond.
        assert_eq!(line_at(1e6, (1e6, 0.05), (2e6, 0.03)), 0.03);
        assert_eq!(line_at(4e6, (1e6, 0.05), (2e6, 0.03)), 0.06);
    }
}
