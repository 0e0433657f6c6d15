//! The document as a user may write it, for the schema and for the keys outside the sections.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cells::CellParams;
use crate::corpus::{Table, names};
use crate::drive::DriveParams;
use crate::plan::{CardParams, Fidelity};
use crate::random::within;
use crate::scene::SceneParams;
use crate::slam::SlamParams;
use crate::sweep::SweepParams;

/// Version of the config format that this program reads.
pub(crate) const FORMAT: u32 = 1;

/// Most families of a document: each is held as a whole config of its own, some 40 kB, and read anew by every verb.
pub(crate) const MAX_FAMILIES: usize = 1000;

/// One YAML file is one corpus.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "of the sections the schema is made; their values are read from the tree")]
pub(crate) struct Document {
    /// Version of this format: 1.
    #[garde(custom(this_format))]
    pub marsyard: u32,
    /// Name of the corpus, and of its folder.
    #[garde(custom(folder_name))]
    pub name: String,
    /// Everything that is drawn follows from it. 0 is a seed like any other.
    #[garde(skip)]
    pub seed: u64,
    /// How many scenes; a multiple of `scenes_per_shard`. Raising it later only adds shards.
    #[garde(range(min = 1, max = 1_000_000_000))]
    pub scenes: u64,
    /// Scenes in one shard. A shard is one file a table and one split.
    #[garde(range(min = 1, max = 100_000))]
    pub scenes_per_shard: u32,
    /// Speed against accuracy in one word: sets `sweep.cast`, `drive.contact`, `slam` and the sub-rays of mixed pixels, as far as
    /// the config does not name them itself. Absent = the defaults of each key.
    #[garde(skip)]
    #[serde(default)]
    pub fidelity: Option<Fidelity>,
    /// Licence, authors and citation, for the corpus's card. Changes no row and no id.
    #[garde(dive)]
    #[serde(default)]
    pub card: Option<CardParams>,
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SceneParams")]
    pub scene: Option<SceneParams>,
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "DriveParams")]
    pub drive: Option<DriveParams>,
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SweepParams")]
    pub sweep: Option<SweepParams>,
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SlamParams")]
    pub slam: Option<SlamParams>,
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "CellParams")]
    pub cells: Option<CellParams>,
    /// The tables to write.
    #[garde(length(min = 1))]
    #[serde(default = "default_tables")]
    pub tables: Vec<Table>,
    /// Write the whole covariance of each estimated pose into `poses`: 21 columns more.
    #[garde(skip)]
    #[serde(default)]
    pub pose_covariance: bool,
    /// The run fails when more than this share of its scenes fails.
    #[garde(custom(within(0.0, 1.0)))]
    #[serde(default = "default_max_failed_share")]
    pub max_failed_share: f64,
    /// Kinds of yard, rover and sensor to mix: each scene belongs to one of them, drawn by weight.
    #[garde(length(max = MAX_FAMILIES), dive)]
    #[serde(default)]
    pub families: Vec<FamilyDocument>,
}

/// One kind of yard, rover and sensor: what it changes in the document's sections.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "as for the document")]
pub(crate) struct FamilyDocument {
    /// Stands in the `scenes` table.
    #[garde(custom(folder_name))]
    pub name: String,
    /// Share of the scenes, relative to the other families' weights.
    #[garde(custom(within(0.0, 1e6)))]
    #[serde(default = "default_weight")]
    pub weight: f64,
    /// Keep its scenes out of training: only test shards hold them.
    #[garde(skip)]
    #[serde(default)]
    pub hold_out: bool,
    /// What differs from the document's `scene`; null takes an optional part away.
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SceneParams")]
    pub scene: Option<SceneParams>,
    /// What differs from the document's `drive`.
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "DriveParams")]
    pub drive: Option<DriveParams>,
    /// What differs from the document's `sweep`.
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SweepParams")]
    pub sweep: Option<SweepParams>,
    /// What differs from the document's `slam`.
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "SlamParams")]
    pub slam: Option<SlamParams>,
    /// What differs from the document's `cells`.
    #[garde(skip)]
    #[serde(default, skip_serializing)]
    #[schemars(with = "CellParams")]
    pub cells: Option<CellParams>,
}

fn default_tables() -> Vec<Table> {
    vec![Table::Cells, Table::Scenes, Table::Poses]
}

fn default_max_failed_share() -> f64 {
    0.05
}

fn default_weight() -> f64 {
    1.0
}

fn this_format(version: &u32, _: &()) -> garde::Result {
    if *version == FORMAT {
        Ok(())
    } else {
        Err(garde::Error::new(format!("must be {FORMAT}, the format this program reads, got {version}")))
    }
}

fn folder_name(name: &str, _: &()) -> garde::Result {
    if names::is_folder_name(name) { Ok(()) } else { Err(garde::Error::new(names::RULE)) }
}
