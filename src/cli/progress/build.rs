//! What happens while shards are built, in words: scenes and rates, scenes that failed with the command that replays them, shards that
//! are built anew.

use super::{Teller, human, si};
use crate::build::{CorpusEvent, Tally};
use crate::cli::LogFormat;
use crate::episode::SceneOutput;
use crate::shell;

/// Shows a build; `replay` gives the command that replays a scene.
pub(in crate::cli) struct BuildProgress<'a> {
    teller: Teller,
    /// As it was typed.
    place: String,
    replay: &'a dyn Fn(u64) -> String,
}

impl<'a> BuildProgress<'a> {
    pub(in crate::cli) fn new(log: LogFormat, place: String, replay: &'a dyn Fn(u64) -> String) -> Self {
        BuildProgress { teller: Teller::new(log), place, replay }
    }

    pub(in crate::cli) fn take(&mut self, event: &CorpusEvent) {
        match *event {
            // What only the verb that opened the place has words for.
            CorpusEvent::Start { .. } | CorpusEvent::Discarded { .. } => {}
            CorpusEvent::OtherProgram { shards, there, here } => tracing::warn!(
                "{shards} of the shards there were written by another marsyard ({there}), this is {here}; equal values are \
                 promised for equal sources by one compiler: `marsyard verify {} --rebuild 3`, once it is whole, says whether this one \
                 builds them alike",
                shell::word(&self.place)
            ),
            CorpusEvent::Damaged { shard, reason } => {
                tracing::warn!("shard {shard} is damaged and is built anew: {reason}");
            }
            CorpusEvent::Scene { output, tally } => self.scene(output, tally),
            CorpusEvent::Shard { shard, bytes } => {
                if self.teller.is_json() {
                    tracing::info!(event = "shard_written", shard, bytes);
                }
            }
        }
    }

    fn scene(&mut self, output: &SceneOutput, tally: &Tally) {
        if let Some(error) = &output.error {
            let (scene, replay) = (output.scene_id, (self.replay)(output.scene_id));
            if self.teller.is_json() {
                tracing::warn!(event = "scene_failed", scene, error, replay);
            } else {
                self.teller.say(&format!("scene {scene} failed: {error}\n  replay: {replay}"));
            }
        }
        let json = || {
            tracing::info!(
                event = "progress",
                scenes_done = tally.done,
                scenes = tally.scenes,
                failed = tally.failed,
                rows = tally.rows,
                rays = tally.times.rays(),
                elapsed_s = tally.elapsed().as_secs_f64(),
                eta_s = tally.remaining().as_secs_f64(),
            );
        };
        self.teller.step((tally.done, tally.scenes), false, || text(tally), json);
    }

    /// Takes the bar away.
    pub(in crate::cli) fn finish(&self) {
        self.teller.finish();
    }
}

fn text(tally: &Tally) -> String {
    format!(
        "{}/{} scenes  ETA {}  {:.1} scenes/s  {} rays/s  {} rows/s",
        tally.done,
        tally.scenes,
        human(tally.remaining()),
        tally.per_second(tally.done),
        si(tally.per_second(tally.times.rays())),
        si(tally.per_second(tally.rows))
    )
}
