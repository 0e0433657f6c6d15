//! What only the simulator knows of a cell, and another rover's rule -> the label that this rover would have got.
//!
//! In: the `truth_` columns. Out: 1 untraversable, 0 traversable. Exact for solid objects (rocks, boxes, trunks): the column
//! holds the tallest object among the points, and a cell is untraversable when any of its points belongs to one that is too
//! tall. Not exact: where a porous object (grass, bush, crown) is the tallest, the cell is an obstacle as the corpus counted it,
//! so that a rock beneath it counts by the corpus's rule. Numbers of points are known for the corpus's own obstacles alone, which is
//! why `min_obstacle_points` goes with `obstacle: as_built` only.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::within;
use crate::scene::Class;

/// When a cell is untraversable, by the truth that the corpus keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct LabelRule {
    /// Which objects are obstacles.
    #[garde(dive)]
    pub obstacle: Obstacle,
    /// Points of an obstacle that a cell must hold; more than 1 only with `obstacle: as_built`.
    #[garde(range(min = 1, max = 1_000_000))]
    pub min_obstacle_points: u32,
    /// Ground steeper than this is untraversable too, degrees; absent = ground never is.
    #[garde(custom(within(0.1, 90.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_ground_slope_deg: Option<f64>,
}

impl Default for LabelRule {
    fn default() -> Self {
        LabelRule { obstacle: Obstacle::AsBuilt, min_obstacle_points: 1, max_ground_slope_deg: None }
    }
}

/// Which solid objects count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Obstacle {
    /// Those that the corpus counted.
    AsBuilt,
    /// All (the paper's).
    All,
    /// Those that stand taller than a wheel of this diameter, metres.
    TallerThanWheel(#[garde(custom(within(0.0, 100.0)))] f64),
    /// Those that stand taller than this, metres.
    TallerThanM(#[garde(custom(within(0.0, 100.0)))] f64),
}

/// The columns that a rule reads.
pub const COLUMNS: [&str; 4] = ["truth_obstacle_points", "truth_class", "truth_protrusion_m", "truth_slope_rad"];

/// A cell's truth, as the corpus keeps it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    pub obstacle_points: i32,
    pub class: i8,
    pub protrusion_m: f32,
    pub slope_rad: f32,
}

impl LabelRule {
    /// 1 untraversable, 0 traversable.
    pub fn label(&self, truth: &Truth) -> u8 {
        let as_built = i64::from(truth.obstacle_points) >= i64::from(self.min_obstacle_points);
        let taller_than = |height_m: f64| match truth.class {
            class if class == Class::Ground as i8 => false,
            class if is_solid(class) => f64::from(truth.protrusion_m) > height_m,
            _ => as_built,
        };
        let obstacle = match self.obstacle {
            Obstacle::AsBuilt => as_built,
            Obstacle::All => taller_than(f64::NEG_INFINITY),
            Obstacle::TallerThanWheel(height_m) | Obstacle::TallerThanM(height_m) => taller_than(height_m),
        };
        let steep =
            self.max_ground_slope_deg.is_some_and(|limit_deg| f64::from(truth.slope_rad) > limit_deg.to_radians());
        u8::from(obstacle || steep)
    }

    /// The one combination that the columns cannot answer.
    pub fn is_answerable(&self) -> bool {
        self.min_obstacle_points == 1 || self.obstacle == Obstacle::AsBuilt
    }
}

fn is_solid(class: i8) -> bool {
    [Class::Rock, Class::Box, Class::Trunk].iter().any(|&solid| solid as i8 == class)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rock(protrusion_m: f32, obstacle_points: i32) -> Truth {
        Truth { obstacle_points, class: Class::Rock as i8, protrusion_m, slope_rad: 0.0 }
    }

    fn rule(obstacle: Obstacle) -> LabelRule {
        LabelRule { obstacle, ..LabelRule::default() }
    }

    #[test]
    fn exact_a_rock_between_two_wheels_stops_the_smaller_rover_alone() {
        let cell = rock(0.2, 5);
        assert_eq!(rule(Obstacle::TallerThanWheel(0.15)).label(&cell), 1);
        assert_eq!(rule(Obstacle::TallerThanWheel(0.3)).label(&cell), 0);
        assert_eq!(rule(Obstacle::All).label(&rock(0.01, 0)), 1);
        assert_eq!(rule(Obstacle::AsBuilt).label(&rock(0.01, 0)), 0);
    }

    #[test]
    fn exact_ground_is_untraversable_by_its_slope_alone() {
        let ground = Truth { obstacle_points: 0, class: Class::Ground as i8, protrusion_m: 0.0, slope_rad: 0.4 };
        assert_eq!(rule(Obstacle::All).label(&ground), 0);
        let steep = |limit| LabelRule { max_ground_slope_deg: Some(limit), ..LabelRule::default() };
        assert_eq!(steep(20.0).label(&ground), 1);
        assert_eq!(steep(25.0).label(&ground), 0);
    }

    #[test]
    fn exact_porous_things_stay_as_the_corpus_counted_them() {
        let bush = |points| Truth { class: Class::Bush as i8, ..rock(0.5, points) };
        for obstacle in [Obstacle::All, Obstacle::TallerThanM(0.1), Obstacle::AsBuilt] {
            assert_eq!(rule(obstacle).label(&bush(0)), 0);
            assert_eq!(rule(obstacle).label(&bush(3)), 1);
        }
    }
}
