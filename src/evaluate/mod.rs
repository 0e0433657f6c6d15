//! Outputs and labels -> honest numbers: confusion, Table 1, density, comparison.
//!
//! In: a [`Model`](crate::train::Model) and the cells of one split of a corpus, row group by row group, or scans from elsewhere
//! through [`Judge`]. Out: a [`Report`], as a table for people, as JSON, and as figures. Source: Hewitt et al. 2017, "Results",
//! table 1 and figures 9 and 13 (A57 to A63 in `docs/paper.md`). Deviation: prevalence, majority baseline, balanced accuracy, MCC
//! and AUC stand beside accuracy, and one tuned threshold on the height difference stands beside the network, so that no number
//! looks better than it is. Memory: two row groups and a few MB for each family and sensor.
//!
//! Not here: training, and the drawing of scans (`cloud` and `picture` do that).

mod by_scene;
mod cell;
mod columns;
mod confusion;
mod corpus;
mod figures;
mod judge;
mod lead;
mod places;
mod reading;
mod reliability;
mod report;
mod run_folder;
mod spread;
mod table;
mod tally;
#[cfg(test)]
mod tests;
mod threshold;
mod tops;

pub use self::corpus::{EvaluateError, FamilyFacts, Options, evaluate};
pub use by_scene::OverScenes;
pub use cell::Cell;
pub use confusion::{Confusion, FiveRows, Rates, Table1};
pub use judge::Judge;
pub use lead::FamilySummary;
pub use places::{PlacesReport, Square};
pub use reliability::{Doubt, ReliabilityBin, ReliabilityReport};
pub use report::{AtThreshold, ClassReport, DataFacts, GroupReport, Judged, ModelFacts, Panels, Report, SpreadReport};
pub(crate) use run_folder::{evaluate_into, evaluation_folder};
pub use spread::Bin;
pub(crate) use table::Brief;
pub use threshold::{Group, Threshold, ThresholdOrigin};
pub use tops::MissedTops;

pub use crate::statistics::scores::RocPoint;
