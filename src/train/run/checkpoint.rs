//! What a killed run goes on from: the place in the stream, what was learnt, and the weights and filter's memory of now and the best.

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::{Setup, Training, identity};
use crate::train::TrainError;
use crate::train::folder::{self, RunFolder};
use crate::train::learner::Learnt;
use crate::train::rows::LeftOut;
use crate::train::state::{self, Snapshot};
use crate::train::stopping::Stop;

/// Where training stands in the stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    pub epoch: u32,
    pub window: u32,
    /// Rows of the window that are learnt.
    pub offset: u64,
    pub left_out: LeftOut,
    pub stopped: Option<Stop>,
}

/// What a killed run left.
pub(super) struct Checkpoint {
    pub place: Place,
    pub learnt: Learnt,
    pub now: Snapshot,
    pub best: Snapshot,
}

impl Checkpoint {
    /// That of a run folder, if there is one.
    pub fn read(
        setup: &Setup,
        run: &RunFolder,
        identity: &Json,
        weights: usize,
    ) -> Result<Option<Checkpoint>, TrainError> {
        if !run.holds(folder::CHECKPOINT) {
            return Ok(None);
        }
        let path = run.path().join(folder::CHECKPOINT).display().to_string();
        let bad = |reason: String| TrainError::BadState { path: path.clone(), reason };
        let (mut header, mut snapshots) = state::from_bytes(&run.read(folder::CHECKPOINT)?).map_err(bad)?;
        identity::check(setup, &header["identity"], identity)?;
        let place = serde_json::from_value(header["place"].take()).map_err(|error| bad(error.to_string()))?;
        let learnt = serde_json::from_value(header["learnt"].take()).map_err(|error| bad(error.to_string()))?;
        let both = snapshots.remove("now").zip(snapshots.remove("best"));
        let (now, best) = both.ok_or_else(|| bad("it is not whole".into()))?;
        if now.weights.len() != weights || best.weights.len() != weights {
            return Err(bad(format!("it holds {} weights", now.weights.len())));
        }
        Ok(Some(Checkpoint { place, learnt, now, best }))
    }
}

impl Training<'_> {
    /// The checkpoint of now, as a file's bytes.
    pub(super) fn checkpoint_bytes(&self) -> Vec<u8> {
        let header = json!({"identity": self.identity, "place": self.place, "learnt": self.learner.learnt});
        state::to_bytes(&header, &[("now", &self.learner.snapshot()), ("best", &self.learner.best)])
    }
}
