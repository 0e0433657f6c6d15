//! A YAML document as written -> a [`Plan`](crate::plan::Plan) (or the parameters of a training) as checked.
//!
//! In: a path and `--set` overrides. Out: a plan with presets, files and families resolved, or a [`ConfigError`] with every
//! fault, its place and its cure. The way: text -> tree (`tree`) -> presets written out (`presets`) -> overrides laid over
//! (`overrides`, `merge`) -> what `fidelity` sets laid under (`fidelity`) -> each family's sections (`families`) -> shape checked against the schema
//! (`shape`, `form`, `schema`) -> types and their own rules (`values`) -> rules between keys (`rules`), and remarks on what is legal and hardly meant (`remarks`); who mistypes a name is told
//! which one was likely meant (`names`). Nothing is written, and nothing but the files that the config names is read.

pub(crate) mod document;
pub(crate) mod error;
mod families;
pub(crate) mod fidelity;
mod form;
mod key_path;
mod load;
mod merge;
mod names;
mod overrides;
mod presets;
mod reader;
mod remarks;
mod resolved;
mod rules;
mod schema;
mod shape;
#[cfg(feature = "train")]
mod train;
mod tree;
mod values;
mod write;

pub use error::{ConfigError, Located};
pub use load::{load, load_with_remarks};
pub use presets::shipped;
pub use schema::{Kind, schema, schema_text};
#[cfg(feature = "train")]
pub use train::load_train;
#[cfg(feature = "train")]
pub(crate) use train::train_yaml;
