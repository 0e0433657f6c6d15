//! What a killed run goes on from: the place in the stream, what was learnt, the looks, and the weights and
//! filter's memory of now and the best, and the weights of the first look.

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::{Setup, Training, identity};
use crate::train::TrainError;
use crate::train::filter::FilterState;
use crate::train::folder::{self, RunFolder};
use crate::train::learner::Learnt;
use crate::train::looks::{self, Looks};
use crate::train::rows::LeftOut;
use crate::train::state::{self, Snapshot, State, Unreadable};
use crate::train::stopping::Stop;

/// Where training stands in the stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Cursor {
    pub epoch: u32,
    pub window: u32,
    /// Rows of the window that are learnt.
    pub offset: u64,
    pub left_out: LeftOut,
    pub stopped: Option<Stop>,
}

/// The name of the weights of the first look after the first row.
const EARLY: &str = "early";

/// What a killed run left.
pub(super) struct Checkpoint {
    pub place: Cursor,
    pub learnt: Learnt,
    pub looks: Looks,
    pub now: Snapshot,
    pub best: Snapshot,
    /// The weights of the first look after the first row, where there was one.
    pub early: Option<Vec<f64>>,
    /// A checksum vouches for it.
    pub checked: bool,
}

impl Checkpoint {
    /// That of a run folder, if there is one.
    pub(super) fn read(
        setup: &Setup,
        run: &RunFolder,
        identity: &Json,
        weights: usize,
    ) -> Result<Option<Checkpoint>, TrainError> {
        let Some(bytes) = run.read_if_there(folder::CHECKPOINT)? else { return Ok(None) };
        let path = run.path().join(folder::CHECKPOINT).display().to_string();
        let bad = |reason: String| TrainError::BadState { path: path.clone(), reason };
        let State { header, looks, mut snapshots, checked } = state::from_bytes(&bytes).map_err(|why| match why {
            Unreadable::Newer { there } => TrainError::Newer { path: path.clone(), there },
            Unreadable::Damaged(reason) => bad(reason),
        })?;
        identity::check(setup, &header["identity"], identity)?;
        let place = serde_json::from_value(header["place"].clone()).map_err(|error| bad(error.to_string()))?;
        let learnt: Learnt =
            serde_json::from_value(header["learnt"].clone()).map_err(|error| bad(error.to_string()))?;
        let both = snapshots.remove("now").zip(snapshots.remove("best"));
        let (now, best) = both.ok_or_else(|| bad("it is not whole".into()))?;
        let early = snapshots.remove(EARLY).map(|early| early.weights);
        let sizes = [Some(now.weights.len()), Some(best.weights.len()), early.as_ref().map(Vec::len)];
        if let Some(other) = sizes.into_iter().flatten().find(|size| *size != weights) {
            return Err(bad(format!("it holds {other} weights")));
        }
        // One of an earlier marsyard holds no looks: what is left of the log must do.
        let looks = if checked { looks } else { looks::read(run.path(), learnt.stopping.looks) };
        Ok(Some(Checkpoint { place, learnt, looks: Looks::new(looks), now, best, early, checked }))
    }
}

impl Training<'_> {
    /// The checkpoint of now, as a file's bytes.
    pub(super) fn checkpoint_bytes(&self) -> Vec<u8> {
        let header = json!({"identity": self.identity, "place": self.place, "learnt": self.learner.learnt});
        let now = self.learner.snapshot();
        // Nothing goes on from it, so that it needs no memory of the filter.
        let without_filter = || FilterState { kind: String::new(), arrays: Vec::new() };
        let early = self.learner.early.clone().map(|weights| Snapshot { weights, filter: without_filter() });
        let mut snapshots = vec![("now", &now), ("best", &self.learner.best)];
        snapshots.extend(early.iter().map(|early| (EARLY, early)));
        state::to_bytes(&header, self.looks.lines(), &snapshots)
    }
}
