//! A split -> so many of its rows, of many scenes drawn at random.
//!
//! Cells of one scene resemble each other, so a fair sample of a corpus is one of scenes, and the more of them the better: at least a
//! hundred give rows, where there are so many and each can give its share. Scenes are taken in a random order that is a pure function of (seed, split), of each no
//! more rows than its share, drawn at random too, until there are enough; the last scene's are cut there.

use super::order::permutation;
use super::rows::Rows;
use super::{Sources, TrainError};
use crate::corpus::Split;
use crate::random::{Purpose, Stage, Streams};

/// At least so many scenes give rows, where the split has them.
const LEAST_SCENES: usize = 100;

/// Rows that were drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub rows: Rows,
    /// Of each row the place of its scene among those that gave rows.
    pub of_row: Vec<u32>,
    /// Scenes that gave them, and scenes of the split.
    pub scenes: u64,
    pub scenes_there: u64,
}

/// Draws `count` rows, or all where there are fewer.
pub(crate) fn draw(sources: &Sources, split: Split, count: usize, seed: u64) -> Result<Sample, TrainError> {
    let there = sources.scenes(split).len();
    let mut most = if there > LEAST_SCENES { (count / LEAST_SCENES).max(1) } else { count.div_ceil(there.max(1)) };
    loop {
        let (sample, is_thinned) = draw_thinned(sources, split, count, most, seed)?;
        if sample.rows.len() == count || !is_thinned {
            return Ok(sample);
        }
        // Scenes of few rows left others to give more.
        most *= 2;
    }
}

/// The same with at most so many rows of a scene; whether any scene had more.
fn draw_thinned(
    sources: &Sources,
    split: Split,
    count: usize,
    most: usize,
    seed: u64,
) -> Result<(Sample, bool), TrainError> {
    let scenes = sources.scenes(split);
    let stream =
        Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: split as u32 }.open(Purpose::TrainScenes);
    let order = permutation(scenes.len(), &mut stream.generator_at(0));
    let mut sample = Sample {
        rows: Rows::new(sources.features.len()),
        of_row: Vec::new(),
        scenes: 0,
        scenes_there: scenes.len() as u64,
    };
    let mut is_thinned = false;
    for scene in order {
        if sample.rows.len() >= count {
            break;
        }
        let before = sample.rows.len();
        sources.read_scene(split, scenes[scene as usize], &mut sample.rows)?;
        let found = sample.rows.len() - before;
        if found > most {
            is_thinned = true;
            let mut drawn = permutation(found, &mut stream.generator_at(1 + u64::from(scene)));
            drawn.truncate(most);
            drawn.sort_unstable();
            sample.rows.keep_of_last(before, &drawn);
        }
        sample.of_row.resize(sample.rows.len(), sample.scenes as u32);
        sample.scenes += u64::from(found > 0);
    }
    sample.rows.truncate(count);
    sample.of_row.truncate(count);
    Ok((sample, is_thinned))
}
