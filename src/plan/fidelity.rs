//! The word that a config may choose for speed against accuracy; which keys it sets is [`config`](crate::config)'s to say.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Speed against accuracy in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fidelity {
    /// To see whether a config does what it should, for a quarter of the cost: pose errors are drawn instead of estimated, so that
    /// sweeps that are not kept need not be cast.
    Draft,
    /// The pose as a filter of 100 particles estimates it.
    Standard,
    /// What the others are judged by: as `standard`, with the finest footprints of beams where mixed pixels are modelled.
    Reference,
}

impl Fidelity {
    pub const ALL: [Fidelity; 3] = [Fidelity::Draft, Fidelity::Standard, Fidelity::Reference];

    pub fn name(self) -> &'static str {
        match self {
            Fidelity::Draft => "draft",
            Fidelity::Standard => "standard",
            Fidelity::Reference => "reference",
        }
    }
}
