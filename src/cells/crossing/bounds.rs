//! Ranges of height under each wheel and under the belly -> bounds of all stands on the way through a cell, before any solver is asked.
//!
//! In: a lattice around a cell, the chassis as shares (`drive::WheelShare`: the stand of any chassis is linear in the heights of its wheels, for
//! small turns), how far the way goes to both sides of the cell's middle. Out: a [`Bound`] a heading. Source: ACE (Otsu et al. 2020).
//! Heights are taken off a plane through the cell first, so that slopes leave the bounds narrow; each wheel's height lies within those of
//! all nodes that it may touch on its way, wherever a turn against the plane carries it: first for a small turn, whose boxes are small, and
//! where the heights found allow a larger one, for that. Added to it: what the links' arms make of a turn (theta squared over two), and
//! the wheel's own radius. Frames: map, metres. Headings that the bounds leave open are for the contact solver
//! to decide.

use super::lattice::Lattice;
use super::outlines::Outlines;
use super::params::Limits;
use super::patch::{Patch, Under};
use super::pose::{Demand, Square};
use crate::drive::{Rover, WheelShare};
use crate::geometry::{DVec2, DVec3};
use crate::math;

/// Turns against the cell's plane that boxes are made for, one after another; a stand that turns further is left open.
const TURNS_RAD: [f64; 2] = [0.08, MOST_TURN_RAD];
const MOST_TURN_RAD: f64 = 0.3;
/// What ground and faces may rise between the nodes of a box that is a node wider than what it bounds, metres.
const BETWEEN_M: f64 = 0.002;
/// Share of a wheel's radius by which the ground's own slope moves its centre.
const RADIUS_SLACK: f64 = 0.08;

/// A corner this far within the plate's border, and what a turn carries it, is below it for sure, metres.
const INNER_M: f64 = 0.02;

/// How far the contact solver's wheel reaches ahead and to the side, radii: a ball flattened to half its width.
const WHEEL_REACH: DVec2 = DVec2::new(1.5, 0.75);

/// Where the headings look.
pub(super) const LEVEL: [DVec2; 8] = {
    const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        DVec2::X,
        DVec2::new(HALF, HALF),
        DVec2::Y,
        DVec2::new(-HALF, HALF),
        DVec2::NEG_X,
        DVec2::new(-HALF, -HALF),
        DVec2::NEG_Y,
        DVec2::new(HALF, -HALF),
    ]
};

/// What bounds say of a heading: of every stand on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Within every limit, whatever the solver would say; the middle of the bounds.
    Passable(Demand),
    /// Beyond a limit, whatever it would say.
    Barred,
    Open,
}

/// A verdict, and what it leaves to ask of the wheels' tracks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub verdict: Verdict,
    /// Least and greatest slope of the rover along its heading.
    pub rise: [f64; 2],
    /// Whether nothing that a wheel meets on its way differs by more than its step.
    pub is_even: bool,
}

/// The way through a cell along a heading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub heading: usize,
    pub middle_m: DVec2,
    /// Half the way to the next cell's middle, which the rover goes to both sides.
    pub half_m: f64,
}

/// What is around a cell: its nodes, the plane through it, and what lies near.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub lattice: &'a Lattice,
    pub patch: &'a Patch,
    pub plane: &'a Plane,
    pub bodies: &'a Outlines,
}

/// One rover's bounds.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    wheels: Vec<WheelShare>,
    half_m: DVec2,
    radius_m: f64,
    /// Highest pivot, shortest lever between two wheels of a link, metres.
    pivot_m: f64,
    lever_m: f64,
    farthest_m: f64,
}

/// The plane that heights are taken off.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub height_m: f64,
    pub slope: DVec2,
}

/// A value and how far it may be off.
#[derive(Clone, Copy, Debug, Default)]
struct About {
    middle: f64,
    off: f64,
}

impl Bounds {
    pub(super) fn new(rover: &Rover) -> Bounds {
        let wheels = rover.wheel_shares();
        let radius_m = rover.wheel_radius_m();
        let pivot_m = rover.highest_pivot_m();
        let farthest_m = wheels.iter().fold(0.0_f64, |most, wheel| most.max(wheel.place_m.length()));
        let half_m = 0.5 * DVec2::new(rover.length_m, rover.width_m);
        Bounds { wheels, half_m, radius_m, pivot_m, lever_m: rover.shortest_lever_m(), farthest_m }
    }

    /// How far from its place on the plane a turn carries a wheel's centre.
    fn wander_m(&self, turn_rad: f64) -> f64 {
        turn_rad * self.pivot_m + 0.5 * turn_rad * turn_rad * self.farthest_m
    }

    /// What a wheel may touch within a turn and half a way, from its place: ahead, and to the side.
    fn touched_m(&self, turn_rad: f64, way_m: f64) -> DVec2 {
        DVec2::splat(self.wander_m(turn_rad)) + self.radius_m * WHEEL_REACH + DVec2::new(way_m, 0.0)
    }

    /// How far from a cell's middle its headings read the lattice, for ways of up to this half.
    pub(super) fn reach_m(&self, way_m: f64) -> f64 {
        let wheel_m = self.farthest_m + self.touched_m(MOST_TURN_RAD, way_m).length();
        // A node more, and the steps that wheels reach for.
        wheel_m.max(self.half_m.length() + way_m) + 2.0 * self.radius_m + 0.15
    }

    /// How far from a rover's place a wheel's centre may be that goes so far to both sides, whatever the heading and the turn.
    pub(super) fn wheels_reach_m(&self, way_m: f64) -> f64 {
        self.farthest_m + self.wander_m(MOST_TURN_RAD) + self.radius_m + way_m
    }

    /// Where the level rover's wheels stand, ahead and to the left.
    pub(super) fn level_places_m(&self) -> impl Iterator<Item = DVec2> {
        self.wheels.iter().map(|wheel| wheel.place_m)
    }

    /// The plane through the nodes at a cell's middle and the ground half a rover's length around it.
    pub(super) fn ground(&self, square: &Square, middle_m: DVec2) -> Plane {
        let lattice = square.lattice;
        let nodes = (0.7 * self.half_m.y / lattice.spacing_m).round().max(1.0);
        let around_m = nodes * lattice.spacing_m;
        let height_m = |place: DVec2| {
            let nodes = lattice.nodes_at(middle_m + place * around_m);
            0.25 * nodes.map(|[col, row]| lattice.ground_m[row * lattice.side + col]).iter().sum::<f64>()
        };
        let [east, west, north, south] = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(height_m);
        let slope = DVec2::new(east - west, north - south) / (2.0 * around_m);
        let height_m = height_m(DVec2::ZERO);
        Plane { height_m, slope }
    }

    /// Nodes to each side of a cell that its headings read, and nodes along the smallest box that a wheel may touch in, at most.
    pub(super) fn patch_nodes(&self, spacing_m: f64, way_m: f64) -> [usize; 2] {
        let wheel_m = self.farthest_m + self.touched_m(MOST_TURN_RAD, way_m).length() + 2.0 * spacing_m;
        let belly_m = (self.half_m + DVec2::new(way_m, 0.0) + spacing_m).length();
        let narrowest_m = 2.0 * (self.touched_m(TURNS_RAD[0], 0.0).min_element() + spacing_m);
        [(wheel_m.max(belly_m) / spacing_m) as usize + 2, ((narrowest_m / spacing_m) as usize).max(1)]
    }

    pub(super) fn bound(&self, around: &Around, way: &Way, limits: &Limits) -> Bound {
        let open = Bound { verdict: Verdict::Open, rise: [0.0; 2], is_even: false };
        TURNS_RAD.into_iter().find_map(|most_rad| self.bound_within(around, way, limits, most_rad)).unwrap_or(open)
    }

    /// The bound by boxes for turns of up to `most_rad`; `None` where the heights in them allow a larger one.
    fn bound_within(&self, around: &Around, way: &Way, limits: &Limits, most_rad: f64) -> Option<Bound> {
        let Around { lattice, patch, plane, bodies } = *around;
        let level = LEVEL[way.heading];
        let up = DVec3::new(-plane.slope.x, -plane.slope.y, 1.0).normalize();
        let ahead = level.extend(plane.slope.dot(level)).normalize();
        let left = up.cross(ahead);
        let [mut pitch, mut roll, mut rise] = [About::default(); 3];
        let (mut lowest_m, mut highest_m) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut range_m = 0.0_f64;
        let mut ranges = [(About::default(), WheelShare::default()); 6];
        let touched_m = self.touched_m(most_rad, way.half_m);
        let across = level.perp().abs();
        let half_m = level.abs() * touched_m.x + across * touched_m.y + DVec2::splat(lattice.spacing_m);
        for (range_of, wheel) in ranges.iter_mut().zip(&self.wheels) {
            let away = ahead * wheel.place_m.x + left * wheel.place_m.y;
            let place = way.middle_m + away.truncate();
            // The centre stands a radius above the plane; a search begins at the level rover's place, where the tracks are too.
            let centre = (away + up * self.radius_m).truncate();
            let shift_m = (centre - level.rotate(wheel.place_m)).length() + BETWEEN_M;
            let has_bodies = bodies.meet(centre, way.heading, touched_m + DVec2::splat(shift_m));
            // Along the plane's normal.
            let [low_m, high_m] = patch
                .range_m(lattice.node_at(place - half_m), lattice.node_at(place + half_m), has_bodies)
                .map(|off_m| off_m * up.z);
            // Bounds hold on ground without gaps.
            if !(low_m.is_finite() && high_m.is_finite()) {
                return None;
            }
            let [own_low_m, own_high_m] =
                patch.own_range_m(lattice.nodes_at(place), has_bodies).map(|off_m| off_m * up.z);
            let own_m = 0.5 * (own_low_m + own_high_m);
            (lowest_m, highest_m) = (lowest_m.min(low_m), highest_m.max(high_m));
            range_m = range_m.max(high_m - low_m);
            *range_of = (About { middle: own_m, off: (high_m - own_m).max(own_m - low_m) }, *wheel);
        }
        let turn_rad = 2.0 * (highest_m - lowest_m) / self.lever_m;
        if turn_rad > most_rad {
            return None;
        }
        let lean = plane.slope.length_squared();
        let arms_m = 0.5 * turn_rad * turn_rad * self.pivot_m;
        let slack_m = arms_m + RADIUS_SLACK * self.radius_m + self.radius_m * ((1.0 + lean).sqrt() - 1.0) + BETWEEN_M;
        for (about, wheel) in &ranges[..self.wheels.len()] {
            let off = about.off + slack_m;
            for (sum, share) in [(&mut pitch, wheel.ahead), (&mut roll, wheel.left), (&mut rise, wheel.up)] {
                sum.middle += share * about.middle;
                sum.off += share.abs() * off;
            }
        }
        let normal = (up - ahead * pitch.middle - left * roll.middle).normalize();
        let off = math::hypot(pitch.off, roll.off);
        let tilt_rad = math::acos(normal.z.min(1.0));
        // Of the heading's own frame: how the normal leans to the side, and how the rover climbs.
        let side_slope = (normal.dot(DVec3::new(-level.y, level.x, 0.0)) / normal.z).abs();
        let climb = -normal.dot(level.extend(0.0)) / normal.z;
        let slope_off = off * (1.0 + 2.0 * lean) * 1.2;
        let [ahead_m, left_m] = [ahead, left].map(|axis| axis.truncate() + axis.z * plane.slope);
        let under = Under {
            ahead: ahead_m,
            left: left_m,
            half_m: self.half_m + DVec2::new(way.half_m, 0.0) + DVec2::splat(lattice.spacing_m),
            up: up.z,
            rise_m: rise.middle,
            pitch: pitch.middle,
            roll: roll.middle,
        };
        let swept_m = limits.belly_m - patch.highest_under(&under);
        // Beside bodies the plate over the middle is asked alone: the way, and a node more, may reach what it does not.
        let clearance_m = if bodies.is_empty() {
            swept_m
        } else {
            // A hair more: nodes that lie on the border count on every side, so that turned yards are alike.
            let half_m = self.half_m + DVec2::splat(0.500_001 * lattice.spacing_m);
            limits.belly_m - patch.highest_under(&Under { half_m, ..under })
        };
        // At the way's ends the plate has moved with its slope.
        let belly_off_m = rise.off
            + pitch.off * self.half_m.x
            + roll.off * self.half_m.y
            + pitch.middle.abs() * way.half_m
            + BETWEEN_M;
        let demand = Demand { tilt_rad, side_slope, clearance_m };
        let most_rad = tilt_rad + off;
        let is_upright = most_rad < 1.2 && math::tan(most_rad) < limits.tilt;
        let is_clear = swept_m - belly_off_m > 0.0;
        let least_rad = tilt_rad - off;
        let is_tipped = least_rad > 0.0 && math::tan(least_rad.min(1.5)) > limits.tilt;
        // Corners of bodies below the plate of the middle, wherever it is within the bounds.
        let inner_m = self.half_m - DVec2::splat(INNER_M + turn_rad * self.pivot_m);
        let stand_off_m = rise.off + pitch.off * self.half_m.x + roll.off * self.half_m.y + BETWEEN_M;
        let is_touched = || {
            bodies.corners().any(|corner| {
                let at_m = corner.truncate();
                let [x_m, y_m] = [ahead_m, left_m].map(|axis| axis.dot(at_m));
                let off_m = (corner.z - plane.height_m - plane.slope.dot(at_m)) * up.z;
                let above_m = off_m - rise.middle - pitch.middle * x_m - roll.middle * y_m;
                x_m.abs() <= inner_m.x && y_m.abs() <= inner_m.y && above_m - stand_off_m > limits.belly_m
            })
        };
        let verdict = if is_upright && side_slope + slope_off < limits.side_slip && is_clear {
            Verdict::Passable(demand)
        } else if is_tipped || side_slope - slope_off > limits.side_slip || (!is_clear && is_touched()) {
            Verdict::Barred
        } else {
            Verdict::Open
        };
        // What differs within a box, and what the rover's slope may differ from the plane's over a wheel's radius.
        let met_m = range_m / up.z + BETWEEN_M + (pitch.middle.abs() + slope_off) * self.radius_m * 1.5;
        Some(Bound { verdict, rise: [climb - slope_off, climb + slope_off], is_even: met_m < limits.step_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the slacks of a wheel's radius cover: ground this much steeper or flatter than the cell's plane, whichever way.
    const GENTLER: f64 = 0.3;

    #[test]
    fn law_the_radius_slack_covers_what_the_grounds_own_slope_does_to_a_wheels_centre() {
        // A wheel of radius 1 over ground of slope g has its centre sqrt(1 + g^2) above the ground below it, vertically, and the plane of the cell
        // says sqrt(1 + p^2). The slack stands along the plane's normal, where a vertical difference is shorter.
        for steepness in (0..=60).map(|k| 0.01 * f64::from(k)) {
            let plane = DVec2::new(steepness, 0.0);
            let lean = plane.length_squared();
            let slack = RADIUS_SLACK + ((1.0 + lean).sqrt() - 1.0);
            for turn in 0..64 {
                let (sin, cos) = math::sin_cos(std::f64::consts::TAU * f64::from(turn) / 64.0);
                for share in [0.25, 0.5, 1.0] {
                    let ground = plane + GENTLER * share * DVec2::new(cos, sin);
                    let moved = (1.0 + ground.length_squared()).sqrt() - 1.0;
                    let normal = 1.0 / (1.0 + lean).sqrt();
                    // The middle of the bounds counts the wheel's radius as one, along the normal.
                    let off = ((1.0 + moved) * normal - 1.0).abs();
                    assert!(off <= slack, "{plane} {ground}: {off} {slack}");
                }
            }
        }
    }
}
