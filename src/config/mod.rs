//! A YAML document as written -> a [`Plan`] as checked.

pub mod plan;

pub use plan::{Family, Plan};
