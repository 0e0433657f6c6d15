//! Cells that stand up -> connected clusters, and the shape of each as the sensor sees it.
//!
//! In: a fitted [`GroundGrid`] and its points, levelled, sensor at the origin. Out: [`Cluster`]s and what they span across
//! and along the line of sight, metres. Cells join across the eight neighbours and one empty cell between.

use super::Point;
use super::ground::GroundGrid;
use crate::geometry::{DVec2, DVec3};
use crate::wide::LANES;

/// Cells this far apart still touch.
const REACH_CELLS: usize = 2;
const FREE: u32 = u32::MAX;

/// The points of one thing.
#[derive(Clone, Debug, Default)]
pub(super) struct Cluster {
    pub points: Vec<Point>,
}

/// Clusters and the cells they own. Reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Clusters {
    /// Per cell its cluster, [`FREE`] where there is none; an entry more for points that are in no cell.
    owner: Vec<u32>,
    /// The first `count` are of this sweep.
    clusters: Vec<Cluster>,
    count: usize,
    open: Vec<usize>,
}

/// A cluster seen from the origin.
pub(super) struct ClusterView {
    pub centroid_m: DVec3,
    /// Level unit vector from the sensor through the centroid.
    pub away: DVec3,
    /// Extent across and along the line of sight.
    pub left_m: f64,
    pub right_m: f64,
    pub near_m: f64,
    pub far_m: f64,
    /// Slots of the outermost points.
    pub leftmost: u32,
    pub rightmost: u32,
    /// Long over short axis of the points seen from above.
    pub aspect: f64,
}

impl Clusters {
    /// Clusters of cells whose highest point stands more than `above_m` over the ground; without points so far.
    pub(super) fn grow(&mut self, grid: &GroundGrid, above_m: f64) {
        let (rows, width) = grid.rows_and_width();
        self.owner.clear();
        self.owner.resize(rows * width + 1, FREE);
        self.count = 0;
        let Clusters { owner, open, .. } = self;
        let stands = |cell: usize| grid.standing_m(cell) > above_m;
        for seed in 0..rows * width {
            if !stands(seed) || owner[seed] != FREE {
                continue;
            }
            owner[seed] = self.count as u32;
            open.push(seed);
            while let Some(cell) = open.pop() {
                let (row, col) = (cell / width, cell % width);
                for r in row.saturating_sub(REACH_CELLS)..(row + REACH_CELLS + 1).min(rows) {
                    for c in col.saturating_sub(REACH_CELLS)..(col + REACH_CELLS + 1).min(width) {
                        let next = r * width + c;
                        if stands(next) && owner[next] == FREE {
                            owner[next] = self.count as u32;
                            open.push(next);
                        }
                    }
                }
            }
            self.count += 1;
        }
        self.clusters.resize_with(self.count.max(self.clusters.len()), Cluster::default);
        self.clusters.iter_mut().for_each(|cluster| cluster.points.clear());
    }

    /// Whether any of the cells belongs to a cluster.
    #[inline(always)]
    pub(super) fn own_any(&self, cells: &[u32; LANES]) -> bool {
        cells.iter().fold(FREE, |owners, &cell| owners & self.owner[cell as usize]) != FREE
    }

    /// The cluster that owns a cell.
    pub(super) fn of_cell(&mut self, cell: u32) -> Option<&mut Cluster> {
        // A free cell's number is out of bounds.
        self.clusters.get_mut(self.owner[cell as usize] as usize)
    }

    /// In the order of their first cells.
    pub(super) fn found(&self) -> &[Cluster] {
        &self.clusters[..self.count]
    }
}

impl Cluster {
    /// `None` for a cluster right above or below the sensor.
    pub(super) fn seen_from_origin(&self) -> Option<ClusterView> {
        let count = self.points.len() as f64;
        let centroid_m = self.points.iter().map(|p| p.place_m).sum::<DVec3>() / count;
        let away = centroid_m.truncate().try_normalize()?;
        let across = away.perp();
        let (mut left, mut right) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        let (mut near_m, mut far_m) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for point in &self.points {
            let flat: DVec2 = point.place_m.truncate();
            let (aside_m, along_m) = (across.dot(flat), away.dot(flat));
            if aside_m > left.0 {
                left = (aside_m, point.slot);
            }
            if aside_m < right.0 {
                right = (aside_m, point.slot);
            }
            (near_m, far_m) = (near_m.min(along_m), far_m.max(along_m));
            let d = flat - centroid_m.truncate();
            (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
        }
        let (mean, apart) = (0.5 * (xx + yy), (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt());
        let aspect = ((mean + apart) / (mean - apart).max(1e-12)).sqrt();
        Some(ClusterView {
            centroid_m,
            away: away.extend(0.0),
            left_m: left.0,
            right_m: right.0,
            near_m,
            far_m,
            leftmost: left.1,
            rightmost: right.1,
            aspect,
        })
    }

    /// The height below which a share of the points lies.
    pub(super) fn height_quantile_m(&self, share: f64) -> f64 {
        let mut heights: Vec<f64> = self.points.iter().map(|p| p.place_m.z).collect();
        let rank = ((heights.len() - 1) as f64 * share) as usize;
        *heights.select_nth_unstable_by(rank, f64::total_cmp).1
    }
}
