//! The checked config: everything resolved, every default written out.

use serde::{Deserialize, Serialize};

use crate::cells::CellParams;
use crate::corpus::{Split, Table};
use crate::drive::DriveParams;
use crate::random::{Purpose, Stage, Streams};
use crate::scene::SceneParams;
use crate::slam::SlamParams;
use crate::sweep::SweepParams;

/// A corpus, ready to build: presets written out, families resolved, rules checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the config format.
    pub marsyard: u32,
    pub name: String,
    pub seed: u64,
    pub scenes: u64,
    pub scenes_per_shard: u32,
    pub tables: Vec<Table>,
    /// The run fails when more than this share of its scenes fails.
    pub max_failed_share: f64,
    /// At least one; a config without families has one named `default`.
    pub families: Vec<Family>,
}

/// One kind of yard, rover and sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Family {
    pub name: String,
    pub weight: f64,
    /// Only test shards hold scenes of this family.
    pub hold_out: bool,
    pub scene: SceneParams,
    pub drive: DriveParams,
    pub sweep: SweepParams,
    pub slam: SlamParams,
    pub cells: CellParams,
}

impl Plan {
    pub fn shards(&self) -> u64 {
        self.scenes / u64::from(self.scenes_per_shard)
    }

    pub fn shard_of(&self, scene: u64) -> u64 {
        scene / u64::from(self.scenes_per_shard)
    }

    /// The address of a scene's draws in one stage.
    pub fn streams(&self, scene: u64, attempt: u32, stage: Stage) -> Streams {
        Streams { seed: self.seed, scene, attempt, stage, step: 0 }
    }

    /// The family a scene belongs to: drawn by weight; families that are held out are drawn in test shards alone.
    pub fn family_of(&self, scene: u64) -> &Family {
        let test = Split::of_shard(self.shard_of(scene)) == Split::Test;
        let open: Vec<&Family> = self.families.iter().filter(|f| test || !f.hold_out).collect();
        let total: f64 = open.iter().map(|f| f.weight).sum();
        let mut left = self.streams(scene, 0, Stage::Plan).open(Purpose::Family).uniform(0) * total;
        for family in &open {
            left -= family.weight;
            if left < 0.0 {
                return family;
            }
        }
        open.last().expect("checked: at least one family is not held out")
    }
}
