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
        self.gather(sweep, &level);
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
    fn gather(&mut self, sweep: &Sweep, level: &DMat3) {
        self.points.clear();
        self.grid.clear();
        self.visibility = Visibility::blind(EXPECTED_SHARE * self.range_m);
        let most_m = self.range_m + MARGIN_M;
        let slots = sweep.range_m.len().min(sweep.status.len()).min(self.bins.len());
        let beams = sweep.pattern.beams.max(1) as usize;
        for slot in 0..slots {
            match sweep.status[slot] {
                Status::None => self.visibility.note(usize::from(self.bins[slot]), f64::INFINITY),
                Status::Dropped | Status::OutOfRange => {}
                Status::Hit => {
                    let range_m = sweep.range_m[slot];
                    if !(range_m > 0.0 && range_m < f64::INFINITY) {
                        continue;
                    }
                    self.visibility.note(usize::from(self.bins[slot]), range_m);
                    if range_m > most_m || stands_alone(&sweep.range_m, slot, beams) {
                        continue;
                    }
                    let place_m = *level * (sweep.pattern.directions[slot] * range_m);
                    if let Some(cell) = self.grid.enter(place_m) {
                        self.points.push(Point { place_m, slot: slot as u32, cell });
                    }
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
fn stands_alone(range_m: &[f64], slot: usize, beams: usize) -> bool {
    let beam = slot % beams;
    if beam == 0 || beam + 1 == beams || slot + 1 >= range_m.len() {
        return false;
    }
    let jump_m = |other: usize| (range_m[slot] - range_m[other]).abs();
    jump_m(slot - 1) > JUMP_M && jump_m(slot + 1) > JUMP_M
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
