//! A place and a shard -> how long the place takes to have it safely on disk.
//!
//! The sample's shard, and half of it, are committed as a build commits them (in a folder: written, synced, renamed; in an object
//! store: put) beside the place, and go away again. Time = files' latency + bytes / bandwidth: the line through both, medians of three.

use std::path::Path;
use std::time::{Instant, SystemTime};

use super::encode::{Encoded, bytes_of};
use super::{EstimateError, Options};
use crate::corpus::FinishedShard;
use crate::corpus::address::Address;
use crate::corpus::store::temporary_prefix;
use crate::measure::interleave::{Repeats, try_rotated};

const REPEATS: usize = 3;

/// What a place takes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Storage {
    /// Where it was measured: the URL, or the folder, or the nearest above it that is there.
    pub place: String,
    /// Of a shard as large as the build's, latency included.
    pub bytes_per_s: f64,
    /// Waiting for the place in the whole build, all threads together.
    pub build_s: f64,
}

/// Where trials are made: names in an object store, or a folder that goes away with all that is in it.
struct TrialPlace {
    name: String,
    beside: Address,
    _folder: Option<tempfile::TempDir>,
}

impl TrialPlace {
    fn of(place: &Path) -> Result<TrialPlace, EstimateError> {
        let folder = match Address::parse(place)? {
            Address::Folder(folder) => folder,
            objects @ Address::Objects { .. } => {
                // Containers share their process numbers: two probes of one place must not meet.
                let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
                let own = format!("{}{}", temporary_prefix(), since_1970.as_nanos());
                return Ok(TrialPlace { name: place.display().to_string(), beside: objects.join(&own), _folder: None });
            }
        };
        let absolute = std::path::absolute(&folder).unwrap_or(folder);
        let there = absolute.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("."));
        let folder =
            tempfile::Builder::new().prefix(&temporary_prefix()).tempdir_in(there).map_err(|e| refused(there, &e))?;
        let beside = Address::Folder(folder.path().into());
        Ok(TrialPlace { name: there.display().to_string(), beside, _folder: Some(folder) })
    }

    /// Seconds until the shard is safely there; then it is taken away again, also where it got there in part.
    fn committed_s(&self, shard: &FinishedShard, name: &str) -> Result<f64, EstimateError> {
        let place = self.beside.join(name);
        if let Address::Folder(folder) = &place {
            std::fs::create_dir(folder).map_err(|error| refused(folder, &error))?;
        }
        let store = place.open()?;
        let started = Instant::now();
        let committed = shard.commit(&*store);
        let took_s = started.elapsed().as_secs_f64();
        let withdrawn = match place {
            Address::Folder(_) => Ok(()),
            Address::Objects { .. } => shard.withdraw(&*store),
        };
        committed?;
        withdrawn?;
        Ok(took_s)
    }
}

/// Refuses what names no place, and a store that this program has no credentials or no code for. Nothing is asked of it yet.
pub(super) fn check(place: &Path) -> Result<(), EstimateError> {
    Address::parse(place)?.open()?;
    Ok(())
}

/// Free on the disk of a folder; `None` where nobody can say, as of an object store.
pub(crate) fn free_bytes(place: &Path) -> Option<u64> {
    Address::parse(place).ok()?.open().ok()?.free_bytes().ok()?
}

fn refused(place: &Path, error: &std::io::Error) -> EstimateError {
    EstimateError::Place { place: place.display().to_string(), reason: error.to_string() }
}

/// Measures the place with the sample's shard.
pub(super) fn probe(
    place: &Path,
    encoded: &Encoded,
    shards: u64,
    build_bytes: f64,
    options: &Options,
) -> Result<Storage, EstimateError> {
    let trial = TrialPlace::of(place)?;
    let shards_tried = [&encoded.half, &encoded.whole];
    let mut seconds = Repeats::default();
    for repeat in 0..REPEATS {
        let commit = |k: usize| {
            if options.stopped() {
                return Err(EstimateError::Interrupted);
            }
            trial.committed_s(shards_tried[k], &format!("{repeat}-{k}"))
        };
        seconds.push(try_rotated(shards_tried.len(), repeat, commit)?);
    }
    let point = |k: usize| (bytes_of(shards_tried[k]), seconds.spread(k).map_or(0.0, |spread| spread.median));
    let shard_bytes = build_bytes / shards as f64;
    let shard_s = line_at(shard_bytes, point(0), point(1));
    Ok(Storage { place: trial.name, bytes_per_s: shard_bytes / shard_s, build_s: shard_s * shards as f64 })
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
