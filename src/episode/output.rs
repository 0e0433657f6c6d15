//! What an episode leaves: one scene's values, poses and scans, from which the corpus makes rows.

use crate::cells::Cells;
use crate::geometry::{GridSpec, Pose, Transform};
use crate::random::Drawn;
use crate::slam::Estimate;
use crate::sweep::Sweep;

/// One scene, done or failed.
#[derive(Clone, Debug, Default)]
pub struct SceneOutput {
    pub scene_id: u64,
    pub family: String,
    /// Drives tried; the last of them that came to an end is written.
    pub attempts: u32,
    /// Why the scene failed; a failed scene has no scans.
    pub error: Option<String>,
    pub drawn: Drawn,
    pub counts: SceneCounts,
    /// Kept scans, ascending by scan_id.
    pub scans: Vec<ScanOutput>,
    /// Ascending by step.
    pub poses: Vec<PoseRow>,
}

impl ScanPoints {
    /// Whether a slot's return is left out of the cells because it hangs.
    pub(crate) fn hangs(&self, slot: usize) -> bool {
        self.hanging.get(slot) == Some(&true)
    }
}

impl SceneOutput {
    /// A scene that failed: a row in `scenes`, and an entry in the manifest with the command that replays it.
    pub fn failed(scene_id: u64, family: &str, attempts: u32, drawn: Drawn, error: String) -> SceneOutput {
        SceneOutput { scene_id, family: family.into(), attempts, error: Some(error), drawn, ..SceneOutput::default() }
    }
}

/// What stood in the yard, and how often the rover stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneCounts {
    pub rocks: u32,
    pub boxes: u32,
    pub trees: u32,
    pub volumes: u32,
    pub patches: u32,
    pub stops: u32,
    /// An obstacle, the yard's edge or the ground ended the drive before its length or goal.
    pub cut_short: bool,
}

/// One kept scan.
#[derive(Clone, Debug)]
pub struct ScanOutput {
    /// Number of the stop, from 0.
    pub scan_id: u32,
    pub cells: Cells,
    /// Only where the `points` table is on.
    pub points: Option<ScanPoints>,
}

/// A sweep and where its points fall, for the `points` table.
#[derive(Clone, Debug)]
pub struct ScanPoints {
    pub sweep: Sweep,
    /// Sensor coordinates -> the map of its cells, as `cells.frame` says: by the estimated pose times the mount, or by the fitted plane.
    /// Not finite where no plane was found.
    pub map_from_sensor: Transform,
    /// What mean heights are measured from, in that map.
    pub rover_z_m: f64,
    pub grid: GridSpec,
    /// Points farther than this from the sensor, horizontally, are in no cell.
    pub max_range_m: f64,
    /// By slot: it hangs over free height and is in no cell (`cells.overhang`); empty where the rule is absent.
    pub hanging: Vec<bool>,
    /// By object id: its returns are an obstacle's, as the label's rule says (`cells::obstacles`).
    pub obstacles: Vec<bool>,
}

/// One step of a drive.
#[derive(Clone, Debug)]
pub struct PoseRow {
    pub step: u32,
    /// Time from the start, seconds.
    pub time_s: f64,
    /// The rover stands and sweeps here.
    pub stop: bool,
    /// The scan made here, if it is kept.
    pub scan_id: Option<u32>,
    pub truth: Pose,
    pub estimate: Estimate,
}
