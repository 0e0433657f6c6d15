//! This module names the limits of a rover, and holds how near a cell comes to the nearest of them.
//!
//! Nothing is computed here. What `assess` finds of a cell comes in, and goes out into the cell's truth: metres, and the limit by its number.

/// How a rover gets over a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance to the nearest limit; negative beyond it.
    pub margin_m: f32,
    pub limit: Limit,
}

/// What bounds a rover; its number is the value of `cells.truth_limit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i8)]
pub enum Limit {
    /// A wheel climbs a step.
    Climb = 0,
    /// A wheel drops down a step.
    Drop = 1,
    /// A wheel bridges a gap.
    Gap = 2,
    /// The belly touches.
    Belly = 3,
    /// The slope under the rover.
    Tilt = 4,
    /// The slope across its heading.
    SideSlip = 5,
}

impl Limit {
    /// By number.
    pub const ALL: [Limit; 6] = [Limit::Climb, Limit::Drop, Limit::Gap, Limit::Belly, Limit::Tilt, Limit::SideSlip];

    pub fn number(self) -> i8 {
        self as i8
    }

    /// The limit with this number; `None` where no limit has it.
    pub fn of_number(number: i8) -> Option<Limit> {
        usize::try_from(number).ok().and_then(|number| Limit::ALL.get(number).copied())
    }

    pub fn name(self) -> &'static str {
        match self {
            Limit::Climb => "climb",
            Limit::Drop => "drop",
            Limit::Gap => "gap",
            Limit::Belly => "belly",
            Limit::Tilt => "tilt",
            Limit::SideSlip => "side slip",
        }
    }
}
