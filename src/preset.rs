//! A rover or sensor in a config: the name of a preset, a path to one's own YAML file, or written out in place.

use std::ops::Deref;

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A preset as the document gives it. `config` writes every name out before any stage runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(untagged)]
#[schemars(rename = "{T}Preset")]
#[garde(context(()))]
pub enum Preset<T: Validate<Context = ()>> {
    /// The name of a shipped preset, or a path (with a `/` or ending in `.yaml`) relative to the config file.
    Name(#[garde(length(min = 1))] String),
    /// Written out in place.
    Inline(#[garde(dive)] Box<T>),
}

impl<T: Validate<Context = ()>> Preset<T> {
    /// The name it was given by; empty for one written out in place.
    pub fn name(&self) -> String {
        match self {
            Preset::Name(name) => name.clone(),
            Preset::Inline(_) => String::new(),
        }
    }
}

impl<T: Validate<Context = ()>> Deref for Preset<T> {
    type Target = T;

    /// # Panics
    /// Where `config` left a name unresolved: a bug there, not in the user's file.
    fn deref(&self) -> &T {
        match self {
            Preset::Inline(value) => value,
            Preset::Name(name) => panic!("preset '{name}' was not written out by config"),
        }
    }
}
