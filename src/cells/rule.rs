//! The rule of a label: a cell's truth -> its label. One implementation labels the cells that are built and relabels those that are stored.
//!
//! In: a [`CellTruth`], made by `labels` from the points of a cell, or read from the `truth_` columns of a corpus. Out: a [`Label`].
//! Source: Hewitt et al. 2017, "Methodology for training". Where cells are built, the obstacles' points are counted by the config's own rule, so
//! that the label is that of [`Obstacle::AsBuilt`].
//!
//! What the stored truth answers of another rule: solid objects (rocks, boxes, trunks) exactly, up to the rounding of
//! `truth_protrusion_m` to f32; the column holds the tallest object among the points, and a cell is untraversable when any of its points
//! belongs to one that is too tall. Not exactly: where plants (grass, bush, crown) stand among them, the column holds what made the corpus's
//! label, and else the tallest; a plant that it names is an obstacle as the corpus counted it, and hides a rock from other rules. Not at
//! all: how many points another rule's obstacles have, which is why `min_obstacle_points` goes with `obstacle: as_built` only
//! ([`LabelRule::check_answerable`]).

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::params::{LabelParams, ObstacleRule};
use super::{CellTruth, Crossing, Label};
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
    /// Of a corpus that a rover labelled (`cells.labels.rover`), and alone: untraversable where the rover keeps less than this from the
    /// nearest of its limits, metres; 0 gives the corpus's own labels, more those of a more careful rover.
    #[garde(custom(within(0.0, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_margin_m: Option<f64>,
    /// Ground that falls by more than this, or lies so deep between two sides, is untraversable too, metres (`truth_drop_m`, of corpora
    /// built with `cells.labels.max_drop_m`); absent = drops do not count.
    #[garde(custom(within(0.0, 100.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_drop_m: Option<f64>,
}

impl Default for LabelRule {
    fn default() -> Self {
        LabelRule {
            obstacle: Obstacle::AsBuilt,
            min_obstacle_points: 1,
            max_ground_slope_deg: None,
            min_margin_m: None,
            max_drop_m: None,
        }
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

/// Solid objects that stand taller than this are obstacles, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TallerThan(f64);

impl TallerThan {
    /// Whatever stands at all.
    const ANY: TallerThan = TallerThan(f64::NEG_INFINITY);

    pub(super) fn is_obstacle(self, protrusion_m: f64) -> bool {
        protrusion_m > self.0
    }
}

impl ObstacleRule {
    /// For a rover with wheels of this diameter.
    pub(super) fn taller_than(self, wheel_diameter_m: f64) -> TallerThan {
        self.height_m(wheel_diameter_m).map_or(TallerThan::ANY, TallerThan)
    }

    /// The height that an obstacle must stand taller than, for a rover with wheels of this diameter, metres; `None`: all are.
    pub(crate) fn height_m(self, wheel_diameter_m: f64) -> Option<f64> {
        match self {
            ObstacleRule::All => None,
            ObstacleRule::TallerThanWheel => Some(wheel_diameter_m),
            ObstacleRule::TallerThanM(height_m) => Some(height_m),
        }
    }
}

impl Obstacle {
    /// `None` where the corpus's own count stands.
    fn taller_than(self) -> Option<TallerThan> {
        match self {
            Obstacle::AsBuilt => None,
            Obstacle::All => Some(TallerThan::ANY),
            Obstacle::TallerThanWheel(height_m) | Obstacle::TallerThanM(height_m) => Some(TallerThan(height_m)),
        }
    }
}

impl LabelParams {
    /// The rule for cells whose obstacle points have been counted by these parameters.
    pub fn of_counted(&self) -> LabelRule {
        let LabelParams { min_obstacle_points, max_ground_slope_deg, max_drop_m, .. } = *self;
        LabelRule { min_obstacle_points, max_ground_slope_deg, max_drop_m, ..LabelRule::default() }
    }
}

impl CellTruth {
    /// Whether the rover that judged the cell must not cross it: beyond a limit, or a plant that is marked untraversable.
    pub(super) fn bars_rover(&self) -> bool {
        self.bars_rover_within(0.0)
    }

    /// The same for a rover that keeps this distance from its limits.
    fn bars_rover_within(&self, margin_m: f64) -> bool {
        let is_plant = self.class.is_some_and(|class| class != Class::Ground && !class.is_solid());
        let is_beyond = |crossing: Crossing| f64::from(crossing.margin_m) < margin_m;
        self.crossing.is_some_and(is_beyond) || is_plant && self.obstacle_points > 0
    }
}

impl LabelRule {
    /// The label of a cell by its truth.
    pub fn label(&self, truth: &CellTruth) -> Label {
        if let Some(margin_m) = self.min_margin_m {
            return Label::untraversable_if(truth.bars_rover_within(margin_m));
        }
        let obstacle = match (self.obstacle.taller_than(), truth.class) {
            (Some(_), Some(Class::Ground)) => false,
            (Some(height), Some(class)) if class.is_solid() => height.is_obstacle(f64::from(truth.protrusion_m)),
            // The corpus's own rule, a plant, or a class that nobody knows.
            _ => self.has_obstacle_points(truth),
        };
        Label::untraversable_if(obstacle || self.is_steep(truth) || self.is_deep(truth))
    }

    /// Whether it gives every cell the other's label: a wheel is a height.
    pub fn same_as(&self, other: &LabelRule) -> bool {
        let height = |rule: &LabelRule| rule.obstacle.taller_than();
        let rest = |rule: &LabelRule| LabelRule { obstacle: Obstacle::AsBuilt, ..rule.clone() };
        height(self) == height(other) && rest(self) == rest(other)
    }

    /// Whether the points that were counted as an obstacle's are as many as the rule asks for.
    pub fn has_obstacle_points(&self, truth: &CellTruth) -> bool {
        i64::from(truth.obstacle_points) >= i64::from(self.min_obstacle_points)
    }

    /// Whether the ground is steeper than the rule's limit, if it has one.
    pub fn is_steep(&self, truth: &CellTruth) -> bool {
        self.max_ground_slope_deg.is_some_and(|limit_deg| f64::from(truth.slope_rad) > limit_deg.to_radians())
    }

    /// Whether the ground falls by more than the rule's limit, if it has one.
    pub fn is_deep(&self, truth: &CellTruth) -> bool {
        self.max_drop_m.is_some_and(|limit_m| f64::from(truth.drop_m) > limit_m)
    }

    /// Whether the stored truth answers the rule: all but the number of points of another rule's obstacles.
    pub fn check_answerable(&self) -> Result<(), Unanswerable> {
        let is_by_rover_alone = *self == LabelRule { min_margin_m: self.min_margin_m, ..LabelRule::default() };
        if self.min_margin_m.is_some() && !is_by_rover_alone {
            return Err(Unanswerable::TwoRules);
        }
        let is_counted = self.min_obstacle_points == 1 || self.obstacle == Obstacle::AsBuilt;
        is_counted.then_some(()).ok_or(Unanswerable::Points)
    }
}

/// A rule that the truth which a corpus keeps does not answer.
#[derive(Debug, thiserror::Error)]
pub enum Unanswerable {
    #[error(
        "min_obstacle_points above 1 goes with `obstacle: as_built` only: the corpus counts the points of its own obstacles alone"
    )]
    Points,
    #[error(
        "no rover labelled {place}: it has no column 'truth_margin_m', and keeps no heights of the true ground to ask one afterwards; build it \
         again with `cells.labels: {{rover: {{}}}}`"
    )]
    NoMargin { place: String },
    #[error(
        "no label of {place} asked how far the ground falls: it has no column 'truth_drop_m', and keeps no heights of the true ground to ask \
         afterwards; build it again with `cells.labels: {{max_drop_m: 0.2}}`"
    )]
    NoDrop { place: String },
    #[error("min_margin_m is a whole rule, by what a rover said of the cell: take the other keys out, or take it out")]
    TwoRules,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::Limit;

    fn rock(protrusion_m: f32, obstacle_points: i32) -> CellTruth {
        CellTruth { obstacle_points, class: Some(Class::Rock), protrusion_m, ..CellTruth::default() }
    }

    fn untraversable(rule: &LabelRule, truth: &CellTruth) -> bool {
        rule.label(truth).is_untraversable()
    }

    fn rule(obstacle: Obstacle) -> LabelRule {
        LabelRule { obstacle, ..LabelRule::default() }
    }

    #[test]
    fn exact_a_rock_between_two_wheels_stops_the_smaller_rover_alone() {
        let cell = rock(0.2, 5);
        for taller_than in [Obstacle::TallerThanWheel, Obstacle::TallerThanM] {
            assert!(untraversable(&rule(taller_than(0.15)), &cell));
            assert!(!untraversable(&rule(taller_than(0.3)), &cell));
        }
        assert!(untraversable(&rule(Obstacle::All), &rock(0.01, 0)));
        assert!(!untraversable(&rule(Obstacle::AsBuilt), &rock(0.01, 0)));
    }

    #[test]
    fn exact_ground_is_untraversable_by_its_slope_alone() {
        let ground = CellTruth { class: Some(Class::Ground), slope_rad: 0.4, ..CellTruth::default() };
        assert!(!untraversable(&rule(Obstacle::All), &ground));
        let steep = |limit| LabelRule { max_ground_slope_deg: Some(limit), ..LabelRule::default() };
        assert!(untraversable(&steep(20.0), &ground));
        assert!(!untraversable(&steep(25.0), &ground));
    }

    #[test]
    fn exact_ground_that_falls_by_more_than_the_limit_is_untraversable_whatever_lies_on_it() {
        let deep = |limit| LabelRule { max_drop_m: limit, ..rule(Obstacle::All) };
        for class in [Class::Ground, Class::Grass] {
            let cell = CellTruth { class: Some(class), drop_m: 0.25, ..CellTruth::default() };
            assert!(untraversable(&deep(Some(0.2)), &cell));
            assert!(!untraversable(&deep(Some(0.25)), &cell) && !untraversable(&deep(None), &cell));
        }
    }

    #[test]
    fn exact_porous_and_unknown_things_stay_as_the_corpus_counted_them() {
        for class in [Some(Class::Grass), Some(Class::Bush), Some(Class::Crown), None] {
            let porous = |points| CellTruth { class, ..rock(0.5, points) };
            for obstacle in [Obstacle::All, Obstacle::TallerThanM(0.1), Obstacle::AsBuilt] {
                assert!(!untraversable(&rule(obstacle), &porous(0)));
                assert!(untraversable(&rule(obstacle), &porous(3)));
            }
        }
    }

    #[test]
    fn exact_a_more_careful_rover_keeps_farther_from_its_limits_and_is_a_whole_rule() {
        let careful = |margin_m| LabelRule { min_margin_m: Some(margin_m), ..LabelRule::default() };
        let crossing = |margin_m| Some(Crossing { margin_m, limit: Limit::Gap });
        let ditch =
            |margin_m| CellTruth { class: Some(Class::Ground), crossing: crossing(margin_m), ..CellTruth::default() };
        assert!(untraversable(&careful(0.05), &ditch(0.04)) && !untraversable(&careful(0.05), &ditch(0.06)));
        assert!(untraversable(&careful(0.0), &ditch(-0.01)) && !untraversable(&careful(0.0), &ditch(0.0)));
        // Points of a rock say nothing, those of a marked bush do.
        assert!(!untraversable(&careful(0.0), &CellTruth { crossing: crossing(0.1), ..rock(0.5, 3) }));
        let bush = CellTruth { class: Some(Class::Bush), crossing: crossing(0.1), ..rock(0.5, 3) };
        assert!(untraversable(&careful(0.0), &bush));
        assert!(careful(0.1).check_answerable().is_ok());
        for other in [rule(Obstacle::All), LabelRule { max_ground_slope_deg: Some(20.0), ..LabelRule::default() }] {
            assert!(LabelRule { min_margin_m: Some(0.1), ..other }.check_answerable().is_err());
        }
    }

    #[test]
    fn exact_more_points_can_be_asked_of_the_corpus_s_own_obstacles_alone() {
        let two = |obstacle| LabelRule { min_obstacle_points: 2, ..rule(obstacle) };
        assert!(two(Obstacle::AsBuilt).check_answerable().is_ok() && two(Obstacle::All).check_answerable().is_err());
        assert!(rule(Obstacle::TallerThanM(0.2)).check_answerable().is_ok());
        assert!(
            untraversable(&two(Obstacle::AsBuilt), &rock(0.2, 2))
                && !untraversable(&two(Obstacle::AsBuilt), &rock(0.2, 1))
        );
    }
}
