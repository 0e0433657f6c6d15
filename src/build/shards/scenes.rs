//! The address of a scene -> its output; a scene that panics is made once more, and has failed where it panics alike.
//!
//! What a panic means is told by its second time: the same words are a fault of the scene (a row with its reason), other words or none
//! are a machine that is not to be trusted, and end the build.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::BuildError;
use crate::corpus::CorpusError;
use crate::episode::{Prepared, SceneOutput, Scratch, StageHashes, StageRecord, run_scene};
use crate::parallel::panic_message;
use crate::random::Drawn;

/// Where scenes come from: a plan, or a test.
pub(super) trait Scenes: Sync {
    fn per_shard(&self) -> usize;
    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut StageRecord) -> SceneOutput;
    fn family(&self, scene: u64) -> &str;
}

impl Scenes for Prepared {
    fn per_shard(&self) -> usize {
        self.plan.scenes_per_shard as usize
    }

    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut StageRecord) -> SceneOutput {
        run_scene(self, scene, scratch, record)
    }

    fn family(&self, scene: u64) -> &str {
        &self.plan.family_of(scene).name
    }
}

/// One scene of a plan, outside a build: what it would be in its shard.
pub(in crate::build) fn sample_scene(
    prepared: &Prepared,
    scene: u64,
    scratch: &mut Scratch,
) -> Result<SceneOutput, BuildError<CorpusError>> {
    make_scene(prepared, scene, false, scratch).map(|(output, _)| output)
}

/// One scene; one that panics twice with the same words has failed.
pub(super) fn make_scene<E: std::error::Error + 'static>(
    scenes: &impl Scenes,
    scene: u64,
    hashes: bool,
    scratch: &mut Scratch,
) -> Result<(SceneOutput, StageRecord), BuildError<E>> {
    let once = |scratch: &mut Scratch| {
        let mut record = StageRecord { hashes: hashes.then(StageHashes::new), ..StageRecord::default() };
        let made = catch_unwind(AssertUnwindSafe(|| scenes.make(scene, scratch, &mut record)));
        made.map(|output| (output, record)).map_err(panic_message)
    };
    let first = match once(scratch) {
        Ok(made) => return Ok(made),
        Err(first) => first,
    };
    *scratch = Scratch::default();
    let second = match once(scratch) {
        Ok(_) => "did not".to_string(),
        Err(second) if second == first => {
            *scratch = Scratch::default();
            let error = format!("panicked: {first}; this is a bug of marsyard: please report it with the plan");
            let output = SceneOutput::failed(scene, scenes.family(scene), 0, Drawn::default(), error);
            return Ok((output, StageRecord::default()));
        }
        Err(second) => format!("panicked otherwise ({second})"),
    };
    Err(BuildError::Unsteady { scene, first, second })
}
