//! `scenes`: one row a scene, failed ones too. The drawn values follow these columns.

use super::{Definition, define};
use crate::cells::Cells;
use crate::corpus::schema::Role::{Info, Key};
use crate::corpus::stats::LabelCounts;
use crate::episode::SceneOutput;

/// A scene and the sums over its kept scans.
pub(crate) struct Row<'a> {
    pub scene: &'a SceneOutput,
    pub labels: LabelCounts,
    pub both_classes: bool,
}

impl<'a> Row<'a> {
    pub(crate) fn of(scene: &'a SceneOutput) -> Row<'a> {
        let per_scan: Vec<LabelCounts> = scene.scans.iter().map(|scan| LabelCounts::of(&scan.cells)).collect();
        let both_classes = per_scan.iter().any(|counts| counts.traversable > 0 && counts.untraversable > 0);
        Row { scene, labels: per_scan.iter().copied().sum(), both_classes }
    }

    /// Over the kept scans.
    pub(crate) fn sum(&self, count: fn(&Cells) -> u64) -> i64 {
        self.scene.scans.iter().map(|scan| count(&scan.cells) as i64).sum()
    }
}

type Extract<'a> = super::Extract<Row<'a>>;

#[rustfmt::skip]
pub(crate) fn definitions<'a>() -> Vec<Definition<Row<'a>>> {
    vec![
        define("scene_id", "1", Key, "Number of the scene in the corpus.", Extract::number(|r| r.scene.scene_id as i64)),
        define("family", "1", Info, "Family of the config that the scene belongs to.", Extract::text(|r| &r.scene.family)),
        define("attempts", "1", Info, "Drives tried in this scene; the last that came to its end is written.", Extract::number(|r| r.scene.attempts as i32)),
        define("status", "1", Info, "ok, or failed (then no scan of the scene is written).", Extract::text(|r| if r.scene.error.is_some() { "failed" } else { "ok" })),
        define("error", "1", Info, "Why the scene failed; null where it did not.", Extract::text_or_null(|r| r.scene.error.as_deref())),
        define("both_classes", "1", Info, "A kept scan holds traversable and untraversable cells.", Extract::flag(|r| r.both_classes)),
        define("rocks", "1", Info, "Rocks in the yard.", Extract::number(|r| r.scene.counts.rocks as i32)),
        define("boxes", "1", Info, "Boxes in the yard (walls, crates, buckets).", Extract::number(|r| r.scene.counts.boxes as i32)),
        define("trees", "1", Info, "Trees in the yard.", Extract::number(|r| r.scene.counts.trees as i32)),
        define("volumes", "1", Info, "Porous volumes in the yard (bushes, crowns).", Extract::number(|r| r.scene.counts.volumes as i32)),
        define("patches", "1", Info, "Patches of grass and low bushes in the yard.", Extract::number(|r| r.scene.counts.patches as i32)),
        define("stops", "1", Info, "Places at which the rover stood and swept.", Extract::number(|r| r.scene.counts.stops as i32)),
        define("kept_scans", "1", Info, "Sweeps that are written.", Extract::number(|r| r.scene.scans.len() as i32)),
        define("points_in", "1", Info, "Lidar points of the kept scans' windows; the next three add up to it.", Extract::number(|r| r.sum(|c| c.points_in))),
        define("points_binned", "1", Info, "Of them, points that are in a cell.", Extract::number(|r| r.sum(|c| c.points_binned))),
        define("points_beyond_range", "1", Info, "Of them, points dropped because they lie beyond cells.max_range_m.", Extract::number(|r| r.sum(|c| c.dropped_beyond_range))),
        define("points_off_grid", "1", Info, "Of them, points dropped because their cell has no index.", Extract::number(|r| r.sum(|c| c.dropped_off_grid))),
        define("cells", "1", Info, "Rows of this scene in the cells table; the next three add up to it.", Extract::number(|r| r.sum(|c| c.rows.len() as u64))),
        define("cells_traversable", "1", Info, "Of them, traversable.", Extract::number(|r| r.labels.traversable as i64)),
        define("cells_untraversable", "1", Info, "Of them, untraversable.", Extract::number(|r| r.labels.untraversable as i64)),
        define("cells_unknown", "1", Info, "Of them, with an unknown label.", Extract::number(|r| r.labels.unknown as i64)),
    ]
}
