//! A plan, and what is there of it -> the bytes that more of its shards will surely take.
//!
//! By the shards that are there; where there are none, by a few scenes of the plan, written into memory as a shard of half of them and
//! one of all: bytes = fixed + scenes x slope. Of what `measure::estimate` measures this is the one figure that a build asks for, without
//! its times and errors.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::BuildError;
use super::shards::sample_scene;
use crate::corpus::{CorpusError, CorpusSpec, ShardWriter, Status};
use crate::episode::{Prepared, SceneOutput, Scratch};

/// From so many scenes on, a build is worth a few scenes to see whether it will fit.
const SAMPLE_FROM_SCENES: u64 = 200;
/// Scenes of that look, and the time after which no other is begun.
const SAMPLE: u64 = 4;
const SAMPLE_LIMIT: Duration = Duration::from_secs(10);
/// So few scenes may have so many times the bytes of others. What would fit is not refused for them: each shard is checked before it is written.
const SAMPLE_MAY_EXCEED: f64 = 1.5;

/// Bytes of so many more shards, at least where none is there; `None` for a build too short to be worth a look.
pub(super) fn bytes(
    prepared: &Prepared,
    spec: &CorpusSpec,
    status: &Status,
    shards: u64,
    stop: &AtomicBool,
) -> Result<Option<u64>, BuildError<CorpusError>> {
    let per_shard = if let Some(done) = std::num::NonZero::new(status.done.len() as u64) {
        status.bytes / done
    } else if shards * u64::from(spec.scenes_per_shard) >= SAMPLE_FROM_SCENES {
        sampled(prepared, spec, stop)?
    } else {
        return Ok(None);
    };
    Ok(Some(per_shard.saturating_mul(shards)))
}

/// Bytes of a shard at least, by scenes that lie evenly over the plan; zero where the build is asked to stop before the first.
fn sampled(prepared: &Prepared, spec: &CorpusSpec, stop: &AtomicBool) -> Result<u64, BuildError<CorpusError>> {
    let (begun, mut scratch, mut outputs) = (Instant::now(), Scratch::default(), Vec::new());
    for number in 0..SAMPLE.min(spec.scenes) {
        if stop.load(Ordering::Relaxed) || begun.elapsed() > SAMPLE_LIMIT {
            break;
        }
        let scene = number * spec.scenes / SAMPLE.min(spec.scenes);
        // Numbered anew: the scenes of one shard.
        outputs.push(SceneOutput { scene_id: number, ..sample_scene(prepared, scene, &mut scratch)? });
    }
    let (few, all) = (outputs.len().div_ceil(2), outputs.len());
    let few = (few as f64, shard_bytes(spec, &outputs[..few]).map_err(BuildError::Write)? as f64);
    let all = (all as f64, shard_bytes(spec, &outputs).map_err(BuildError::Write)? as f64);
    Ok((extrapolated(few, all, f64::from(spec.scenes_per_shard)) / SAMPLE_MAY_EXCEED) as u64)
}

/// Bytes of a shard of these scenes alone.
fn shard_bytes(spec: &CorpusSpec, outputs: &[SceneOutput]) -> Result<u64, CorpusError> {
    if outputs.is_empty() {
        return Ok(0);
    }
    let count = outputs.len() as u32;
    let spec = CorpusSpec { scenes: count.into(), scenes_per_shard: count, ..spec.clone() };
    let mut writer = ShardWriter::new(&spec, 0)?;
    outputs.iter().try_for_each(|output| writer.push(output))?;
    Ok(writer.finish()?.files.iter().map(|(_, bytes)| bytes.len() as u64).sum())
}

/// Bytes of so many scenes, on the line through two shards of (scenes, bytes); in proportion where they give no line that rises.
fn extrapolated(few: (f64, f64), all: (f64, f64), scenes: f64) -> f64 {
    let slope = (all.1 - few.1) / (all.0 - few.0);
    let fixed = all.1 - slope * all.0;
    if slope > 0.0 && fixed >= 0.0 && fixed.is_finite() {
        return fixed + slope * scenes;
    }
    all.1 / all.0.max(1.0) * scenes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_bytes_lie_on_the_line_through_two_shards() {
        assert_eq!(extrapolated((2.0, 700.0), (4.0, 900.0), 50.0), 500.0 + 50.0 * 100.0);
        // One scene gives no line, and bytes that fall give none that can be gone on with.
        assert_eq!(extrapolated((1.0, 80.0), (1.0, 80.0), 50.0), 4000.0);
        assert_eq!(extrapolated((2.0, 900.0), (4.0, 800.0), 10.0), 2000.0);
        assert_eq!(extrapolated((0.0, 0.0), (0.0, 0.0), 10.0), 0.0);
    }
}
