//! The line that a wheel rolls along -> whether a step or a gap on it is beyond the limits.
//!
//! In: ground and solid bodies, where the level rover's wheel begins and ends its way through a cell, the range of the rover's own
//! slope. Out: whether, wherever it stands on the way, what lies a radius ahead differs by no more than a step, or is bridged within a
//! gap. The line is cut into bins of 5 mm, each with the least and the greatest height in it, so that no place between two samples is
//! missed: the ground at the bins' borders, bodies exactly (a convex body's top along a line is a chain of pieces that rise and then
//! fall, one a face). A wheel before a gap, and one in it, is bridged where the lip across lies within the gap's limit and comes back
//! to less than a step. Frame: world, metres. Not modelled: the wheel's width, and ground that changes its slope within a bin.

use super::params::Limits;
use crate::geometry::DVec2;
use crate::scene::{Convex, Obstacle, Scene, Shape};
use crate::wide::{LANES, Work, widest};

/// Length of a bin; a whole number of them is searched for a far lip.
const BIN_M: f64 = 0.005;

/// Heights along one line; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// Of each bin, levelled by the rover's slope.
    low_m: Vec<f64>,
    high_m: Vec<f64>,
    /// Of each border between bins: the ground, and one body.
    ground_m: Vec<f64>,
    body_m: Vec<f64>,
}

/// One wheel's way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rolled<'a> {
    pub scene: &'a Scene,
    pub bodies: &'a [&'a Obstacle],
    /// The wheel's place where the rover stands in the cell's middle, and the heading.
    pub middle_m: DVec2,
    pub ahead: DVec2,
    /// How far the way goes to both sides.
    pub half_m: f64,
    /// Least and greatest slope of the rover along its heading.
    pub rise: [f64; 2],
}

/// A line cut into bins.
struct Line<'a> {
    rolled: &'a Rolled<'a>,
    /// Where the first bin begins, from the middle.
    first_m: f64,
    slope: f64,
}

impl Track {
    /// Whether the wheel keeps the limits; not where a place has no height.
    pub(super) fn is_kept(&mut self, rolled: &Rolled, limits: &Limits) -> bool {
        let Rolled { half_m, rise, .. } = *rolled;
        let bins = |length_m: f64| (length_m / BIN_M * (1.0 - 1e-9)).ceil() as usize;
        let (gap, way, reach_m) = (bins(limits.gap_m), bins(2.0 * half_m), limits.wheel_radius_m);
        let line = Line { rolled, first_m: -half_m - gap as f64 * BIN_M, slope: 0.5 * (rise[0] + rise[1]) };
        self.sample(&line, gap + way + bins(reach_m) + gap + 2);
        if !self.low_m.iter().chain(&self.high_m).all(|height_m| height_m.is_finite()) {
            return false;
        }
        let turned_m = 0.5 * (rise[1] - rise[0]);
        let widest = (limits.gap_m / BIN_M) as usize;
        let most_m = limits.step_m - turned_m * reach_m;
        (gap..gap + way).all(|here| {
            // A place a radius on lies in one of two bins.
            let there = here + (reach_m / BIN_M) as usize;
            let low_m = self.low_m[there].min(self.low_m[there + 1]);
            let high_m = self.high_m[there].max(self.high_m[there + 1]);
            let is_far_lip = |away: usize| {
                let slack_m = turned_m * (reach_m + away as f64 * BIN_M);
                let lip_m = self.low_m[there + away].min(self.low_m[there + away + 1]);
                lip_m >= self.high_m[here] - limits.step_m + slack_m
            };
            let is_near_lip = |away: usize| {
                let slack_m = turned_m * (reach_m + away as f64 * BIN_M);
                self.low_m[here - away] >= high_m - limits.step_m + slack_m
            };
            (self.high_m[here] - low_m <= most_m || (1..=widest).any(is_far_lip))
                && (high_m - self.low_m[here] <= most_m || (1..=widest).any(is_near_lip))
        })
    }

    fn sample(&mut self, line: &Line, bins: usize) {
        let scene = line.rolled.scene;
        self.ground_m.clear();
        self.ground_m.resize(bins + 1, 0.0);
        widest(Borders { line, scene, out: &mut self.ground_m });
        let pairs = || self.ground_m.windows(2);
        self.low_m.clear();
        self.low_m.extend(pairs().map(|pair| if pair[0] < pair[1] { pair[0] } else { pair[1] }));
        self.high_m.clear();
        self.high_m.extend(pairs().map(|pair| if pair[0] > pair[1] { pair[0] } else { pair[1] }));
        let half_m = 0.5 * bins as f64 * BIN_M;
        let middle_m = line.place(line.first_m + half_m);
        for obstacle in line.rolled.bodies.iter().filter(|body| !body.is_beyond(middle_m, half_m)) {
            self.body_m.clear();
            self.body_m.resize(bins + 1, f64::NEG_INFINITY);
            match &obstacle.body().shape {
                Shape::Convex(body) => self.cross_convex(line, body),
                Shape::Cylinder(body) => {
                    let (middle, top_m) = (body.base_m.truncate() - line.place(0.0), body.base_m.z + body.height_m);
                    let aside_m = line.rolled.ahead.perp_dot(middle);
                    let chord_m = (body.radius_m * body.radius_m - aside_m * aside_m).max(0.0).sqrt();
                    let foot_m = line.rolled.ahead.dot(middle);
                    if aside_m.abs() <= body.radius_m {
                        self.cross(line, [foot_m - chord_m, foot_m + chord_m], |_| top_m);
                    }
                }
            }
            // A bin that the body fills lies no lower than the body at its borders: a convex top has no hollow.
            for (low_m, pair) in self.low_m.iter_mut().zip(self.body_m.windows(2)) {
                *low_m = low_m.max(pair[0].min(pair[1]));
            }
        }
    }

    fn cross_convex(&mut self, line: &Line, body: &Convex) {
        let (start, ahead) = (line.place(0.0), line.rolled.ahead);
        for (face, plane) in body.faces.iter().zip(&body.planes).filter(|(_, plane)| plane.faces_up()) {
            let mut chord_m = [f64::NEG_INFINITY, f64::INFINITY];
            for (k, &from) in face.iter().enumerate() {
                let [from, to] = [from, face[(k + 1) % face.len()]].map(|k| body.vertices_m[k as usize].truncate());
                // To the left of each edge: inside.
                let (inside_m, by_way) = ((to - from).perp_dot(start - from), (to - from).perp_dot(ahead));
                if by_way > 0.0 {
                    chord_m[0] = chord_m[0].max(-inside_m / by_way);
                } else if by_way < 0.0 {
                    chord_m[1] = chord_m[1].min(-inside_m / by_way);
                } else if inside_m < 0.0 {
                    chord_m[1] = f64::NEG_INFINITY;
                }
            }
            self.cross(line, chord_m, |way_m| {
                let at = line.place(way_m);
                -(plane.offset_m + plane.normal.x * at.x + plane.normal.y * at.y) / plane.normal.z
            });
        }
    }

    /// A piece of a body's top between two places of the way.
    fn cross(&mut self, line: &Line, [from_m, to_m]: [f64; 2], top_m: impl Fn(f64) -> f64) {
        let last_m = line.way_m(self.body_m.len() - 1);
        if !(from_m <= to_m && from_m <= last_m && to_m >= line.first_m) {
            return;
        }
        let [from_m, to_m] = [from_m.max(line.first_m), to_m.min(last_m)];
        let bins = self.high_m.len();
        let level_m = |way_m: f64| top_m(way_m) - line.slope * way_m;
        for end_m in [from_m, to_m] {
            let bin = (((end_m - line.first_m) / BIN_M) as usize).min(bins - 1);
            self.high_m[bin] = self.high_m[bin].max(level_m(end_m));
        }
        let [first, last] = [((from_m - line.first_m) / BIN_M).ceil(), ((to_m - line.first_m) / BIN_M).floor()];
        for border in first as usize..(last as usize + 1).min(bins + 1) {
            let here_m = level_m(line.way_m(border));
            self.body_m[border] = self.body_m[border].max(here_m);
            for bin in border.saturating_sub(1)..(border + 1).min(bins) {
                self.high_m[bin] = self.high_m[bin].max(here_m);
            }
        }
    }
}

/// The ground at the borders between bins.
struct Borders<'a> {
    line: &'a Line<'a>,
    scene: &'a Scene,
    out: &'a mut [f64],
}

impl Work for Borders<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let Borders { line, scene, out } = self;
        for (block, out) in out.chunks_mut(LANES).enumerate() {
            let way_m: [f64; LANES] = std::array::from_fn(|l| line.way_m(block * LANES + l));
            let at = way_m.map(|way_m| line.place(way_m));
            let ground_m = scene.grounds_below_m(&at.map(|at| at.x), &at.map(|at| at.y));
            for ((out, ground_m), way_m) in out.iter_mut().zip(ground_m).zip(way_m) {
                *out = ground_m - line.slope * way_m;
            }
        }
    }
}

impl Line<'_> {
    fn way_m(&self, border: usize) -> f64 {
        self.first_m + border as f64 * BIN_M
    }

    fn place(&self, way_m: f64) -> DVec2 {
        self.rolled.middle_m + self.rolled.ahead * way_m
    }
}
