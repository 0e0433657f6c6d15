//! A split -> so many of its rows, of whole scenes drawn at random.
//!
//! Cells of one scene resemble each other, so a fair sample of a corpus is one of scenes. They are taken in a random order that is a
//! pure function of (seed, split), until there are enough rows; the last one is cut there.

use super::order::permutation;
use super::rows::Rows;
use super::{Sources, TrainError};
use crate::corpus::Split;
use crate::random::{Purpose, Stage, Streams};

/// Rows that were drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub rows: Rows,
    /// Scenes that gave them, and scenes of the split.
    pub scenes: u64,
    pub scenes_there: u64,
}

/// Draws `count` rows, or all where there are fewer.
pub(crate) fn draw(sources: &Sources, split: Split, count: usize, seed: u64) -> Result<Sample, TrainError> {
    let scenes = sources.scenes(split);
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: split as u32 };
    let order = permutation(scenes.len(), &mut streams.open(Purpose::TrainScenes).generator_at(0));
    let mut sample = Sample { rows: Rows::new(sources.features.len()), scenes: 0, scenes_there: scenes.len() as u64 };
    for scene in order {
        if sample.rows.len() >= count {
            break;
        }
        let before = sample.rows.len();
        sources.read_scene(split, scenes[scene as usize], &mut sample.rows)?;
        sample.scenes += u64::from(sample.rows.len() > before);
    }
    sample.rows.truncate(count);
    Ok(sample)
}
