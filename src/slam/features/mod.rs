//! One sweep -> the rocks in it, as seen: range, bearing, elevation of each.
//!
//! In: a [`Sweep`]'s ranges and statuses (never its truth), and the believed roll and pitch, which only level it. Out:
//! [`Feature`]s in the sensor frame, and where the sweep looked. Source: ground-plane fitting and clustering after Di et al.
//! 2013. What stands up from the ground is clustered; a cluster's centroid lies on the near side of its rock and moves with
//! the viewpoint, so it is pushed back along the ray by a fitted share of the half width. Not modelled: walls, crater
//! rims, trees thinner than 6 cm; slopes and dunes give no features by design.

mod clusters;
mod ground;

use std::sync::Arc;

use super::measurement::Polar;
use super::particle::Feature;
use super::visibility::{Visibility, direction_bin};
use crate::geometry::{DMat3, DVec3, Pose, Transform};
use crate::math;
use crate::sweep::{Pattern, Status, Sweep};
use crate::wide::{LANES, Work, widest};
use clusters::{Cluster, grow};
use ground::GroundGrid;

/// Side of a grid cell, metres.
const CELL_M: f64 = 0.1;
/// Points this much beyond the features' range still tell of the ground.
const MARGIN_M: f64 = 0.5;
/// A point that jumps this far from both its neighbours lies on neither surface.
const JUMP_M: f64 = 0.3;
/// A cell holds an object when its highest point stands this far above the ground; points count from the lower figure on.
const OBJECT_M: f64 = 0.08;
const ABOVE_GROUND_M: f64 = 0.03;
const LEAST_POINTS: usize = 8;
const LEAST_WIDTH_M: f64 = 0.06;
const MOST_WIDTH_M: f64 = 1.0;
/// Longer than this for its breadth: a wall or a rim.
const MOST_ASPECT: f64 = 4.0;
/// A neighbouring ray that ends this much nearer hides a part of the cluster.
const HIDDEN_M: f64 = 0.2;
/// Share of its half width that a rock's centre lies behind its visible centroid. Fitted on marsyard's own polyhedra by
/// `dist_features_of_polyhedra_lie_at_their_rocks_whatever_the_size` (tests/statistics); smooth ellipsoids want 0.72.
const PUSH_BACK: f64 = 0.58;
/// The landmark's height: this share of the cluster's points lie below.
const TOP_SHARE: f64 = 0.95;
/// Landmarks are expected up to this share of the greatest range.
const EXPECTED_SHARE: f64 = 0.9;

/// Finds features; keeps its memory and what it knows of the pattern from sweep to sweep.
#[derive(Clone, Debug)]
pub struct Extractor {
    rover_from_sensor: DMat3,
    range_m: f64,
    pattern: Option<Arc<Pattern>>,
    /// Direction bin of each slot.
    bins: Vec<u16>,
    points: Vec<Point>,
    grid: GroundGrid,
    features: Vec<Feature>,
    visibility: Visibility,
}

/// A block of slots in levelled axes with the sensor as origin; nonsense where a slot has no range.
struct Levelled {
    x_m: [f64; LANES],
    y_m: [f64; LANES],
    z_m: [f64; LANES],
    col: [f64; LANES],
    row: [f64; LANES],
}

impl Levelled {
    #[inline(always)]
    fn new(grid: &GroundGrid, sweep: &Sweep, level: &DMat3, slots: std::ops::Range<usize>) -> Levelled {
        let (ranges_m, ways) = (&sweep.range_m[slots.clone()], &sweep.pattern.directions[slots]);
        let (range_m, directions) = match (ranges_m.first_chunk::<LANES>(), ways.first_chunk::<LANES>()) {
            (Some(range_m), Some(directions)) => (*range_m, *directions),
            _ => (
                std::array::from_fn(|l| ranges_m.get(l).copied().unwrap_or(0.0)),
                std::array::from_fn(|l| ways.get(l).copied().unwrap_or(DVec3::ZERO)),
            ),
        };
        let [mut x_m, mut y_m, mut z_m, mut col, mut row] = [[0.0; LANES]; 5];
        for l in 0..LANES {
            let place_m = *level * (directions[l] * range_m[l]);
            (x_m[l], y_m[l], z_m[l]) = (place_m.x, place_m.y, place_m.z);
        }
        for l in 0..LANES {
            [col[l], row[l]] = grid.place(x_m[l], y_m[l]);
        }
        Levelled { x_m, y_m, z_m, col, row }
    }

    #[inline(always)]
    fn place_m(&self, l: usize) -> DVec3 {
        DVec3::new(self.x_m[l], self.y_m[l], self.z_m[l])
    }

    #[inline(always)]
    fn on_grid(&self, l: usize) -> [f64; 2] {
        [self.col[l], self.row[l]]
    }
}

/// [`Extractor::gather`], in the machine's widest form.
struct Gather<'a> {
    extractor: &'a mut Extractor,
    sweep: &'a Sweep,
    level: &'a DMat3,
}

impl Work for Gather<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.extractor.gather(self.sweep, self.level);
    }
}

/// A return in levelled axes with the sensor as origin.
#[derive(Clone, Copy, Debug)]
struct Point {
    place_m: DVec3,
    slot: u32,
    cell: u32,
}

impl Extractor {
    /// Features up to `range_m` from the sensor.
    pub fn new(range_m: f64, rover_from_sensor: &Transform) -> Extractor {
        Extractor {
            rover_from_sensor: rover_from_sensor.rotation,
            range_m,
            pattern: None,
            bins: Vec::new(),
            points: Vec::new(),
            grid: GroundGrid::new(range_m + MARGIN_M, CELL_M),
            features: Vec::new(),
            visibility: Visibility::blind(EXPECTED_SHARE * range_m),
        }
    }

    /// The features of a sweep, and where it looked.
    pub fn extract(&mut self, sweep: &Sweep, roll_rad: f64, pitch_rad: f64) -> (&[Feature], &Visibility) {
        let level = Pose { roll_rad, pitch_rad, ..Pose::default() }.rotation() * self.rover_from_sensor;
        self.learn(&sweep.pattern);
        widest(Gather { extractor: self, sweep, level: &level });
        self.grid.fit();
        self.features.clear();
        for cluster in self.objects() {
            self.features.extend(self.feature(&cluster, sweep, &level));
        }
        (&self.features, &self.visibility)
    }

    fn learn(&mut self, pattern: &Arc<Pattern>) {
        if self.pattern.as_ref().is_some_and(|known| Arc::ptr_eq(known, pattern)) {
            return;
        }
        self.bins.clear();
        self.bins.extend(pattern.directions.iter().map(|d| direction_bin(d.x, d.y, d.z) as u16));
        self.pattern = Some(pattern.clone());
    }

    /// Levels the usable points and enters them into the grid; notes how far each direction saw.
    #[inline(always)]
    fn gather(&mut self, sweep: &Sweep, level: &DMat3) {
        self.points.clear();
        self.grid.clear();
        self.visibility = Visibility::blind(EXPECTED_SHARE * self.range_m);
        let slots = sweep.range_m.len().min(sweep.status.len()).min(self.bins.len());
        let beams = sweep.pattern.beams.max(1) as usize;
        self.points.reserve(slots);
        let mut beam = 0;
        for first in (0..slots).step_by(LANES) {
            let block = Levelled::new(&self.grid, sweep, level, first..(first + LANES).min(slots));
            for l in 0..LANES.min(slots - first) {
                let inner = beam > 0 && beam + 1 < beams;
                beam = if beam + 1 < beams { beam + 1 } else { 0 };
                self.gather_slot(sweep, first + l, inner, block.place_m(l), block.on_grid(l));
            }
        }
    }

    /// One slot: where it lies, on the grid too, and whether it has neighbours on both sides in its line.
    #[inline(always)]
    fn gather_slot(&mut self, sweep: &Sweep, slot: usize, inner: bool, place_m: DVec3, on_grid: [f64; 2]) {
        let bin = usize::from(self.bins[slot]);
        match sweep.status[slot] {
            Status::None => self.visibility.note(bin, f64::INFINITY),
            Status::Dropped | Status::OutOfRange => {}
            Status::Hit => {
                let range_m = sweep.range_m[slot];
                if !(range_m > 0.0 && range_m < f64::INFINITY) {
                    return;
                }
                self.visibility.note(bin, range_m);
                if range_m > self.range_m + MARGIN_M || inner && stands_alone(&sweep.range_m, slot) {
                    return;
                }
                if let Some(cell) = self.grid.enter(on_grid, place_m.z) {
                    self.points.push(Point { place_m, slot: slot as u32, cell });
                }
            }
        }
    }

    /// The points of each thing that stands up from the ground.
    fn objects(&self) -> Vec<Cluster> {
        let mut clusters = grow(&self.grid, OBJECT_M);
        for point in &self.points {
            let Some(cluster) = clusters.of_cell(point.cell) else { continue };
            if point.place_m.z - self.grid.ground_m(point.place_m.x, point.place_m.y) > ABOVE_GROUND_M {
                cluster.points.push(*point);
            }
        }
        clusters.into_clusters()
    }

    fn feature(&self, cluster: &Cluster, sweep: &Sweep, level: &DMat3) -> Option<Feature> {
        if cluster.points.len() < LEAST_POINTS {
            return None;
        }
        let seen = cluster.seen_from_origin()?;
        let (width_m, depth_m) = (seen.left_m - seen.right_m, seen.far_m - seen.near_m);
        if width_m < LEAST_WIDTH_M || width_m.max(depth_m) > MOST_WIDTH_M || seen.aspect > MOST_ASPECT {
            return None;
        }
        if hidden_beside(sweep, seen.leftmost) || hidden_beside(sweep, seen.rightmost) {
            return None;
        }
        let half_width_m = 0.5 * width_m;
        let place_m = seen.centroid_m + seen.away * (PUSH_BACK * half_width_m);
        let sensor_m = level.transpose() * place_m.with_z(cluster.height_quantile_m(TOP_SHARE));
        let range_m = sensor_m.length();
        (range_m <= self.range_m).then(|| Feature {
            polar: polar(sensor_m, range_m),
            points: cluster.points.len() as u32,
            half_width_m,
            known: None,
        })
    }
}

fn polar(sensor_m: DVec3, range_m: f64) -> Polar {
    [range_m, math::atan2(sensor_m.y, sensor_m.x), math::atan2(sensor_m.z, math::hypot(sensor_m.x, sensor_m.y))]
}

/// A mixed pixel: a jump to both neighbours in its line.
#[inline(always)]
fn stands_alone(range_m: &[f64], slot: usize) -> bool {
    let jumps = |other: usize| range_m.get(other).is_some_and(|&other_m| (range_m[slot] - other_m).abs() > JUMP_M);
    jumps(slot - 1) && jumps(slot + 1)
}

/// A ray beside this one ends well before it, or there is none: the cluster goes on where it cannot be seen.
fn hidden_beside(sweep: &Sweep, slot: u32) -> bool {
    let (slot, beams) = (slot as usize, sweep.pattern.beams.max(1) as usize);
    let beam = slot % beams;
    if beam == 0 || beam + 1 == beams {
        return true;
    }
    let nearer = |other: usize| sweep.range_m.get(other).is_some_and(|&r| r < sweep.range_m[slot] - HIDDEN_M);
    nearer(slot - 1) || nearer(slot + 1)
}

#[cfg(test)]
mod tests;
