//! One sweep -> the rocks in it, as seen: range, bearing, elevation of each; and the surface of all that stands up.
//!
//! In: [`Returns`]: ranges and statuses, and the believed roll and pitch, which only level it. Out: [`Feature`]s in the sensor frame, the surface
//! (with the ground, where sweeps are laid on one another by it), and where the sweep looked. Source: ground-plane fitting and clustering after Di et
//! al. 2013. What stands up from the ground is clustered; a cluster's centroid lies on the near side of its rock and moves with the viewpoint, so it
//! is pushed back along the ray by a fitted share of the half width. Not modelled: walls, crater rims, trees thinner than 6 cm; slopes and dunes give
//! no features by design.

mod clusters;
mod ground;

use std::ops::Range;
use std::sync::Arc;

use super::measurement::Polar;
use super::observation::Feature;
use super::registration::Surface;
use super::visibility::{Bins, Visibility};
use crate::geometry::{DMat3, DVec3, Pose, Transform};
use crate::math;
use crate::sweep::{Pattern, Returns, Status};
use crate::wide::{LANES, Work, widest};
use clusters::{Cluster, Clusters};
use ground::GroundGrid;

/// Side of a grid cell, metres.
const CELL_M: f64 = 0.1;
/// Points this much beyond the features' range still tell of the ground.
const MARGIN_M: f64 = 0.5;
/// A point that jumps this far from both its neighbours lies on neither surface: a mixed pixel.
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
/// Slots that are gathered at a time: enough that a loop over them stays a loop, which compilers put into lanes better than
/// eight steps written out.
const BLOCK: usize = 64;

/// Finds features; keeps its memory and what it knows of the pattern from sweep to sweep.
#[derive(Clone, Debug)]
pub struct Extractor {
    rover_from_sensor: Transform,
    range_m: f64,
    pattern: Option<(Arc<Pattern>, Arc<Bins>)>,
    /// The cell of each slot, in blocks.
    cells: Vec<[u32; BLOCK]>,
    grid: GroundGrid,
    clusters: Clusters,
    features: Vec<Feature>,
}

/// What a sweep holds for the filter.
pub struct Sight<'e, 's> {
    pub features: &'e [Feature],
    /// Where the sweep looked.
    pub visibility: Visibility<'s>,
    clusters: &'e Clusters,
    grid: &'e GroundGrid,
    sensor_m: DVec3,
}

impl Sight<'_, '_> {
    /// All that stands up, rocks or not, and the ground, in level axes ahead of the rover with the rover as origin; `None` of an extractor that
    /// does not keep the ground.
    pub(super) fn surface(&self) -> Option<Surface> {
        if !self.grid.keeps_means() {
            return None;
        }
        let points = self.clusters.found().iter().filter(|cluster| cluster.points.len() >= LEAST_POINTS);
        let standing =
            Surface::of(points.flat_map(|cluster| &cluster.points).map(|point| point.place_m + self.sensor_m));
        Some(standing.with_ground(self.grid.means_m(OBJECT_M).map(|cell_m| cell_m + self.sensor_m)))
    }
}

/// A return in levelled axes with the sensor as origin.
#[derive(Clone, Copy, Debug)]
struct Point {
    place_m: DVec3,
    slot: u32,
}

impl Extractor {
    /// Features up to `range_m` from the sensor.
    pub fn new(range_m: f64, rover_from_sensor: &Transform) -> Extractor {
        Extractor {
            rover_from_sensor: *rover_from_sensor,
            range_m,
            pattern: None,
            cells: Vec::new(),
            grid: GroundGrid::new(range_m + MARGIN_M, CELL_M),
            clusters: Clusters::default(),
            features: Vec::new(),
        }
    }

    /// One that keeps the ground, to lay sweeps on one another by it.
    pub(super) fn with_ground(self) -> Extractor {
        Extractor { grid: self.grid.with_means(), ..self }
    }

    /// What a sweep holds.
    pub fn extract<'s>(&mut self, returns: &'s Returns, roll_rad: f64, pitch_rad: f64) -> Sight<'_, 's> {
        let level_from_rover = Pose { roll_rad, pitch_rad, ..Pose::default() }.rotation();
        let level = level_from_rover * self.rover_from_sensor.rotation;
        let bins = self.bins(&returns.pattern);
        widest(ClusterPass { extractor: self, returns, level: &level });
        self.grid.fit();
        self.clusters.grow(&self.grid, OBJECT_M);
        self.collect(returns, &level);
        self.features.clear();
        let features =
            self.clusters.found().iter().filter_map(|cluster| feature(cluster, returns, &level, self.range_m));
        self.features.extend(features);
        Sight {
            features: &self.features,
            visibility: Visibility::of_sweep(EXPECTED_SHARE * self.range_m, returns, bins),
            clusters: &self.clusters,
            grid: &self.grid,
            sensor_m: level_from_rover * self.rover_from_sensor.translation_m,
        }
    }

    fn bins(&mut self, pattern: &Arc<Pattern>) -> Arc<Bins> {
        match &self.pattern {
            Some((known, bins)) if Arc::ptr_eq(known, pattern) => bins.clone(),
            _ => self.pattern.insert((pattern.clone(), Bins::of(pattern))).1.clone(),
        }
    }

    /// Levels the usable points and enters them into the grid.
    #[inline(always)]
    fn gather(&mut self, returns: &Returns, level: &DMat3) {
        self.grid.clear();
        let slots = returns.range_m.len().min(returns.status.len()).min(returns.pattern.directions.len());
        self.cells.clear();
        self.cells.resize(slots.div_ceil(BLOCK), [self.grid.nowhere(); BLOCK]);
        let limit_m = self.range_m + MARGIN_M;
        for (first, cells) in (0..slots).step_by(BLOCK).zip(&mut self.cells) {
            let taken = taken(returns, first..slots, limit_m);
            if taken.iter().fold(false, |any, &taken| any | taken) {
                let [x_m, y_m, z_m] = levelled(level, returns, first);
                self.grid.place(&x_m, &y_m, &taken, cells);
                for (&cell, &z_m) in cells.iter().zip(&z_m) {
                    self.grid.enter(cell, z_m);
                }
                if self.grid.keeps_means() {
                    let nowhere = self.grid.nowhere();
                    for (l, &cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != nowhere) {
                        self.grid.add(cell, DVec3::new(x_m[l], y_m[l], z_m[l]));
                    }
                }
            }
        }
    }

    /// Gives each cluster its points: those of its cells that are above the ground.
    fn collect(&mut self, returns: &Returns, level: &DMat3) {
        let blocks = self.cells.iter().flat_map(|cells| cells.as_chunks().0);
        for (first, cells) in (0..).step_by(LANES).zip(blocks) {
            if !self.clusters.own_any(cells) {
                continue;
            }
            for (slot, &cell) in (first..).zip(cells) {
                let Some(cluster) = self.clusters.of_cell(cell) else { continue };
                let place_m = *level * (returns.pattern.directions[slot] * returns.range_m[slot]);
                if place_m.z - self.grid.ground_m(place_m.x, place_m.y) > ABOVE_GROUND_M {
                    cluster.points.push(Point { place_m, slot: slot as u32 });
                }
            }
        }
    }
}

/// Which of the first slots hold a point near enough that is no mixed pixel: a jump to both neighbours in its line.
#[inline(always)]
fn taken(returns: &Returns, slots: Range<usize>, limit_m: f64) -> [bool; BLOCK] {
    let range_m = around(&returns.range_m, slots.start);
    let mut spare = [Status::None; BLOCK];
    let status = block(&returns.status[slots.clone()], Status::None, &mut spare);
    let inner = inner(slots.start, returns.pattern.beams.max(1) as usize);
    let mut taken = [false; BLOCK];
    for l in 0..BLOCK {
        let own_m = range_m[l + 1];
        let alone = ((own_m - range_m[l]).abs() > JUMP_M) & ((own_m - range_m[l + 2]).abs() > JUMP_M);
        let hit = status[l] == Status::Hit;
        taken[l] = hit & (own_m > 0.0) & (own_m <= limit_m) & !(inner[l] & alone);
    }
    taken
}

/// The first values of a slice; where it ends before, with `none` for the rest in `spare`.
#[inline(always)]
fn block<'a, T: Copy>(values: &'a [T], none: T, spare: &'a mut [T; BLOCK]) -> &'a [T; BLOCK] {
    match values.first_chunk() {
        Some(values) => values,
        None => {
            *spare = std::array::from_fn(|l| values.get(l).copied().unwrap_or(none));
            spare
        }
    }
}

/// The ranges of a block and of its neighbours on both sides; NaN where there is no slot.
#[inline(always)]
fn around(range_m: &[f64], first: usize) -> [f64; BLOCK + 2] {
    let slot = |k: usize| (first + k).checked_sub(1).and_then(|slot| range_m.get(slot)).copied().unwrap_or(f64::NAN);
    match first.checked_sub(1).and_then(|before| range_m[before..].first_chunk()) {
        Some(range_m) => *range_m,
        None => std::array::from_fn(slot),
    }
}

/// Which slots of a block have neighbours on both sides in their line.
#[inline(always)]
fn inner(first: usize, beams: usize) -> [bool; BLOCK] {
    let mut inner = [true; BLOCK];
    // From the last line that begins before the block: its end may lie in it.
    for line in (first / beams * beams..=first + BLOCK).step_by(beams) {
        for edge in [line.wrapping_sub(1), line] {
            if let Some(inner) = edge.checked_sub(first).and_then(|l| inner.get_mut(l)) {
                *inner = false;
            }
        }
    }
    inner
}

/// The points of a block in levelled axes with the sensor as origin, axis by axis; nonsense where a slot has no range.
#[inline(always)]
fn levelled(level: &DMat3, returns: &Returns, first: usize) -> [[f64; BLOCK]; 3] {
    let (mut ranges_m, mut ways) = ([0.0; BLOCK], [DVec3::ZERO; BLOCK]);
    let range_m = block(&returns.range_m[first..], 0.0, &mut ranges_m);
    let directions = block(&returns.pattern.directions[first..], DVec3::ZERO, &mut ways);
    let [mut x_m, mut y_m, mut z_m] = [[0.0; BLOCK]; 3];
    for l in 0..BLOCK {
        let place_m = *level * (directions[l] * range_m[l]);
        (x_m[l], y_m[l], z_m[l]) = (place_m.x, place_m.y, place_m.z);
    }
    [x_m, y_m, z_m]
}

/// [`Extractor::gather`], in the machine's widest form.
struct ClusterPass<'a> {
    extractor: &'a mut Extractor,
    returns: &'a Returns,
    level: &'a DMat3,
}

impl Work for ClusterPass<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.extractor.gather(self.returns, self.level);
    }
}

/// The feature that a cluster is, unless it is too small, too large, hidden in part or more than `most_m` away.
fn feature(cluster: &Cluster, returns: &Returns, level: &DMat3, most_m: f64) -> Option<Feature> {
    if cluster.points.len() < LEAST_POINTS {
        return None;
    }
    let seen = cluster.seen_from_origin()?;
    let (width_m, depth_m) = (seen.left_m - seen.right_m, seen.far_m - seen.near_m);
    if width_m < LEAST_WIDTH_M || width_m.max(depth_m) > MOST_WIDTH_M || seen.aspect > MOST_ASPECT {
        return None;
    }
    if hidden_beside(returns, seen.leftmost) || hidden_beside(returns, seen.rightmost) {
        return None;
    }
    let half_width_m = 0.5 * width_m;
    let place_m = seen.centroid_m + seen.away * (PUSH_BACK * half_width_m);
    let sensor_m = level.transpose() * place_m.with_z(cluster.height_quantile_m(TOP_SHARE));
    let range_m = sensor_m.length();
    (range_m <= most_m).then(|| Feature {
        polar: polar(sensor_m, range_m),
        points: cluster.points.len() as u32,
        half_width_m,
        known: None,
        sigmas: [None; 3],
    })
}

fn polar(sensor_m: DVec3, range_m: f64) -> Polar {
    [range_m, math::atan2(sensor_m.y, sensor_m.x), math::atan2(sensor_m.z, math::hypot(sensor_m.x, sensor_m.y))]
}

/// A ray beside this one ends well before it, or there is none: the cluster goes on where it cannot be seen.
fn hidden_beside(returns: &Returns, slot: u32) -> bool {
    let (slot, beams) = (slot as usize, returns.pattern.beams.max(1) as usize);
    let beam = slot % beams;
    if beam == 0 || beam + 1 == beams {
        return true;
    }
    let nearer = |other: usize| returns.range_m.get(other).is_some_and(|&r| r < returns.range_m[slot] - HIDDEN_M);
    nearer(slot - 1) || nearer(slot + 1)
}

#[cfg(test)]
pub(super) mod tests;
