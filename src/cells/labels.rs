//! Scene and rule -> which objects are obstacles; true returns -> a cell's truth, from which its label follows (`rule`).
//!
//! Source: Hewitt et al. 2017, "Methodology for training": a cell is untraversable when any of its points belongs to an obstacle (any, or as
//! many as the config says).
//! A point's object is its true one, its cell is where the *estimated* pose puts it: that label noise stays.
//! The label follows from the truth columns alone: obstacle points, or the slope where a config limits it. Of several objects in a cell the
//! truth names the one that made the label, and of those the tallest: a bush that can be crossed says nothing of the rock in it.

use super::params::LabelParams;
use super::rule::TallerThan;
use super::{CellRow, CellTruth, Label};
use crate::math;
use crate::scene::{Class, Scene};
use crate::sweep::Hit;

/// What a label asks of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    untraversable: bool,
    class: Class,
    protrusion_m: f64,
}

impl Verdict {
    /// An obstacle of which nothing else is known.
    pub(super) const OBSTACLE: Verdict = Verdict { untraversable: true, class: Class::Ground, protrusion_m: 0.0 };
    /// Of an obstacle without a return: its body is not worked out, and no point refers to this entry.
    const NOT_SEEN: Verdict = Verdict { protrusion_m: f64::NEG_INFINITY, untraversable: false, ..Verdict::OBSTACLE };
}

/// Solid objects by the rule, porous ones and patches as they are marked; indexed by object id. The bodies of obstacles are asked
/// for where `is_seen` says that a point was returned by the obstacle of that index.
pub(super) fn verdicts(
    scene: &Scene,
    taller_than: TallerThan,
    is_seen: impl Fn(usize) -> bool,
    out: &mut Vec<Verdict>,
) {
    out.clear();
    out.extend(scene.obstacles.iter().enumerate().map(|(index, obstacle)| {
        if !is_seen(index) {
            return Verdict::NOT_SEEN;
        }
        let protrusion_m = obstacle.body().protrusion_m;
        Verdict { untraversable: taller_than.is_obstacle(protrusion_m), class: obstacle.class, protrusion_m }
    }));
    out.extend(scene.volumes.iter().map(|v| Verdict {
        untraversable: v.untraversable,
        class: v.class,
        protrusion_m: v.protrusion_m,
    }));
    // A patch scatters returns; it has no body to stand up.
    let patch = |p: &crate::scene::Patch| Verdict { untraversable: p.untraversable, class: p.class, protrusion_m: 0.0 };
    out.extend(scene.patches.iter().map(patch));
}

/// Per object id: whether its points make a cell untraversable. Solid objects by the rule, others as they are marked.
pub fn obstacles(params: &LabelParams, wheel_diameter_m: f64, scene: &Scene) -> Vec<bool> {
    let mut by_id = Vec::new();
    verdicts(scene, params.obstacle.taller_than(wheel_diameter_m), |_| true, &mut by_id);
    by_id.iter().map(|verdict| verdict.untraversable).collect()
}

/// Gathers the truth of one cell's points.
#[derive(Clone, Copy, Debug)]
pub(super) struct TruthSum {
    truth: CellTruth,
    /// Of the object that the truth names so far: whether it makes the cell untraversable, and its height.
    named: (bool, f64),
    steepest_squared: f64,
}

impl TruthSum {
    /// Of no point.
    pub(super) const NONE: TruthSum = TruthSum {
        truth: CellTruth {
            obstacle_points: 0,
            top_points: 0,
            class: Some(Class::Ground),
            object: Hit::GROUND,
            protrusion_m: 0.0,
            slope_rad: 0.0,
            crossing: None,
            pose: None,
            drop_m: 0.0,
            pit_m: 0.0,
        },
        named: (false, f64::NEG_INFINITY),
        steepest_squared: 0.0,
    };

    /// Adds a point: its true object (-1 ground, -2 nothing) and the ground's slope, squared, where it is ground.
    #[inline(always)]
    pub(super) fn add(&mut self, object: i32, top: bool, slope_squared: f64, verdicts: &[Verdict]) {
        let Some(verdict) = usize::try_from(object).ok().and_then(|id| verdicts.get(id)) else {
            self.steepest_squared = self.steepest_squared.max(slope_squared);
            return;
        };
        self.truth.obstacle_points += i32::from(verdict.untraversable);
        self.truth.top_points += i32::from(verdict.untraversable && top);
        // What makes the label goes before what does not, then the taller; of two as tall, the first by id: the order of points does not
        // matter.
        let verdict_rank = (verdict.untraversable, verdict.protrusion_m);
        if verdict_rank > self.named || (verdict_rank == self.named && object < self.truth.object) {
            self.named = verdict_rank;
            self.truth.class = Some(verdict.class);
            self.truth.object = object;
            self.truth.protrusion_m = verdict.protrusion_m as f32;
        }
    }

    pub(super) fn finish(mut self) -> CellTruth {
        self.truth.slope_rad = math::atan(self.steepest_squared.sqrt()) as f32;
        self.truth
    }
}

impl CellRow {
    /// Whether the label says that a rover must not cross.
    pub fn untraversable(&self) -> bool {
        self.label == Some(Label::Untraversable)
    }
}
