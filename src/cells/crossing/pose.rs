//! A cell and eight headings -> can the rover drive through there: the truth of the pose, `cells.labels.rover.pose`.
//!
//! In: a lattice (gaps bridged, bodies raised), limits, the contact solver on ground and bodies. Out: [`PoseTruth`]: a bit a heading, a
//! cost, and the worst tilt and the least clearance of the passable headings. Heading k looks along k times 45 degrees of the map,
//! counter-clockwise from its x axis; the rover's origin is over the cell's middle, and goes half the way to the next cells' middles ahead
//! and behind. A heading is passable where, over the middle, no node under the level rover's wheels has a step or gap beyond the limit
//! within reach (`step_share`, as the truth of the cell has them), and where all along the way the rover stands with all wheels in the
//! yard, its tilt and the slope across it are within the limits, nothing reaches its belly, a plate of its outline, and no wheel meets a
//! step or a gap beyond its limit (`tracks`). So a drive from cell to cell over passable headings keeps the limits between them too.
//!
//! Source: ACE (Otsu et al. 2020): heights' ranges under each wheel and under the belly bound all stands on the way first (`bounds`); the
//! solver is asked only where the bounds leave the verdict open (`way`). Cost, tilt and clearance are those of the cell's middle;
//! deviation: what bounds decide has the middle of the bounds. Frames: headings and cells in `map`, the stand in `world`. Not modelled:
//! how the rover comes there, turns on the spot, ways beside the cells' middles.

use super::bounds::{Around, Bound, Bounds, LEVEL, Plane, Verdict, Way};
use super::gaps::Gaps;
use super::headings::Axis;
use super::lattice::Lattice;
use super::outlines::Outlines;
use super::params::Limits;
use super::patch::Patch;
use super::placement::Placement;
use super::tracks::{Rolled, Track};
use super::way::Driven;
use crate::drive::params::ContactSolver;
use crate::drive::{GroundContact, Rover};
use crate::geometry::DVec2;
use crate::math;
use crate::scene::{Obstacle, Scene};

/// Headings, a bit each.
const HEADINGS: usize = 8;
/// The way to a diagonal neighbour, in cells.
const DIAGONAL: f64 = std::f64::consts::SQRT_2;

/// How a rover stands that is centred in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseTruth {
    /// Bit k set: it can drive through the cell, looking along k times 45 degrees of the map.
    pub headings: u8,
    /// The mean over the headings of the largest share of a limit that is taken up; 1 for a heading that is not passable.
    pub cost: f32,
    /// The worst tilt and the least clearance under the belly of the passable headings; `None` where no heading is.
    pub worst: Option<PoseWorst>,
}

/// What a rover meets at worst by a passable heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseWorst {
    pub tilt_rad: f32,
    pub clearance_m: f32,
}

/// What one heading takes up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Demand {
    pub tilt_rad: f64,
    /// Rise over run across the heading.
    pub side_slope: f64,
    pub clearance_m: f64,
}

/// Judges poses on one scene.
pub(super) struct PoseAssessor<'a> {
    scene: &'a Scene,
    rover: &'a Rover,
    limits: Limits,
    contact: GroundContact<'a>,
    bounds: Bounds,
    /// Off, the solver is asked at every heading: what the bounds are checked against.
    pub has_bounds: bool,
}

/// A square of the map and the truths of its cells that poses read.
pub(super) struct Square<'a> {
    pub lattice: &'a Lattice,
    pub gaps: &'a Gaps,
    pub axes: &'a [Axis; 4],
    pub placement: &'a Placement,
    /// A cell's side.
    pub cell_m: f64,
}

/// What the cells of a square are judged in; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    patch: Patch,
    outlines: Outlines,
    track: Track,
}

/// One cell.
struct Here<'a, 'b> {
    square: &'a Square<'a>,
    plane: Plane,
    /// The cell's middle in the world.
    at: DVec2,
    /// What is near.
    bodies: Vec<&'b Obstacle>,
}

impl Demand {
    pub(super) fn is_within(&self, limits: &Limits) -> bool {
        // Written so that NaN fails.
        math::tan(self.tilt_rad) <= limits.tilt && self.side_slope <= limits.side_slip && self.clearance_m >= 0.0
    }

    fn share(&self, limits: &Limits, step_share: f64) -> f64 {
        let tilt = math::tan(self.tilt_rad) / limits.tilt;
        let belly = 1.0 - self.clearance_m / limits.belly_m;
        tilt.max(self.side_slope / limits.side_slip).max(belly).max(step_share).clamp(0.0, 1.0)
    }
}

impl<'a> PoseAssessor<'a> {
    pub(super) fn new(rover: &'a Rover, limits: Limits, scene: &'a Scene) -> PoseAssessor<'a> {
        let contact = GroundContact::new(rover, scene, ContactSolver::GaussNewton).over_bodies(true);
        PoseAssessor { scene, rover, limits, contact, bounds: Bounds::new(rover), has_bounds: true }
    }

    /// How far from a cell's middle a pose reads the lattice, metres.
    pub(super) fn reach_m(&self, cell_m: f64) -> f64 {
        self.bounds.reach_m(DIAGONAL * 0.5 * cell_m)
    }

    /// The truth of the pose over a place of the map.
    pub(super) fn assess(&self, square: &Square, middle_m: DVec2, scratch: &mut Scratch) -> PoseTruth {
        let plane = self.bounds.ground(square, middle_m);
        let at = square.placement.world(middle_m);
        let most_m = DIAGONAL * 0.5 * square.cell_m;
        let here = Here { square, plane, at, bodies: self.contact.bodies_near(at, most_m) };
        if self.has_bounds {
            let [reach, window] = self.bounds.patch_nodes(square.lattice.spacing_m, most_m);
            scratch.patch.fill(square, &here.plane, middle_m, reach, window);
            scratch.outlines.fill(&here.bodies, square.placement, at);
        }
        let mut truth = PoseTruth { headings: 0, cost: 0.0, worst: None };
        let mut cost = 0.0;
        let mut worst: Option<Demand> = None;
        for heading in 0..HEADINGS {
            let half_m = if heading % 2 == 0 { 0.5 * square.cell_m } else { most_m };
            let way = Way { heading, middle_m, half_m };
            let share = self.step_share(square, middle_m, heading).filter(|&share| share <= 1.0);
            let demand = share.and_then(|share| Some((self.through(&here, &way, scratch)?, share)));
            let Some((demand, step_share)) = demand else {
                cost += 1.0;
                continue;
            };
            truth.headings |= 1 << heading;
            cost += demand.share(&self.limits, step_share);
            let so_far = worst.get_or_insert(demand);
            so_far.tilt_rad = so_far.tilt_rad.max(demand.tilt_rad);
            so_far.clearance_m = so_far.clearance_m.min(demand.clearance_m);
        }
        truth.cost = (cost / HEADINGS as f64) as f32;
        let narrow =
            |worst: Demand| PoseWorst { tilt_rad: worst.tilt_rad as f32, clearance_m: worst.clearance_m as f32 };
        PoseTruth { worst: worst.map(narrow), ..truth }
    }

    /// What a heading takes up over the cell's middle; `None` where anything on its way is beyond a limit.
    fn through(&self, here: &Here<'_, 'a>, way: &Way, scratch: &mut Scratch) -> Option<Demand> {
        let Here { square, plane, at, bodies } = here;
        let Scratch { patch, outlines, track } = scratch;
        let around = Around { lattice: square.lattice, patch, plane, bodies: outlines };
        let bound = self.has_bounds.then(|| self.bounds.bound(&around, way, &self.limits));
        let (demand, rise) = match bound {
            Some(Bound { verdict: Verdict::Barred, .. }) => return None,
            Some(Bound { verdict: Verdict::Passable(demand), rise, is_even }) if self.is_inside(*at, way.half_m) => {
                if is_even {
                    return Some(demand);
                }
                (demand, rise)
            }
            _ => self.driven(bodies, *at, square.placement, way).through()?,
        };
        self.rolls(bodies, square.placement, way, rise, track).then_some(demand)
    }

    /// Whether every wheel of a rover that goes so far from a place is in the yard, whatever its heading and tilt.
    fn is_inside(&self, at: DVec2, way_m: f64) -> bool {
        let reach_m = self.bounds.wheels_reach_m(way_m);
        at.min_element() >= reach_m && at.max_element() <= self.scene.extent_m - reach_m
    }

    fn yaw_rad(&self, placement: &Placement, heading: usize) -> f64 {
        let turn_rad = math::atan2(placement.turn.y, placement.turn.x);
        math::wrap_angle(turn_rad + heading as f64 * std::f64::consts::FRAC_PI_4)
    }

    /// The way as the solver takes it.
    fn driven<'b>(&'b self, bodies: &'b [&Obstacle], middle_m: DVec2, placement: &Placement, way: &Way) -> Driven<'b> {
        Driven {
            scene: self.scene,
            contact: &self.contact,
            limits: &self.limits,
            outline_m: 0.5 * DVec2::new(self.rover.length_m, self.rover.width_m),
            bodies,
            middle_m,
            yaw_rad: self.yaw_rad(placement, way.heading),
            half_m: way.half_m,
        }
    }

    /// Whether every wheel keeps the limits of steps and gaps all along the way.
    fn rolls(&self, bodies: &[&Obstacle], placement: &Placement, way: &Way, rise: [f64; 2], track: &mut Track) -> bool {
        let level = LEVEL[way.heading];
        let ahead = placement.turn.rotate(level);
        self.bounds.level_places_m().all(|place| {
            let middle_m = placement.world(way.middle_m + level.rotate(place));
            let rolled = Rolled { scene: self.scene, bodies, middle_m, ahead, half_m: way.half_m, rise };
            track.is_kept(&rolled, &self.limits)
        })
    }

    /// The largest share of the step and gap limits that a wheel takes up along the heading; `None` where a node has no height.
    fn step_share(&self, square: &Square, middle_m: DVec2, heading: usize) -> Option<f64> {
        let Square { lattice, axes, .. } = square;
        let axis = &axes[heading % 4];
        let ahead = DVec2::new(axis.cols as f64, axis.rows as f64).normalize() * if heading < 4 { 1.0 } else { -1.0 };
        let mut most = 0.0_f64;
        for place in self.bounds.level_places_m() {
            // A place between two nodes stands on both: headings turned by a quarter take the turned nodes.
            for [col, row] in lattice.nodes_at(middle_m + ahead.rotate(place)) {
                most = most.max(self.step_share_at(square, axis, col, row)?);
            }
        }
        Some(most)
    }

    /// The same of one node.
    fn step_share_at(&self, square: &Square, axis: &Axis, col: usize, row: usize) -> Option<f64> {
        let Square { lattice, gaps, .. } = square;
        let own = row * lattice.side + col;
        let step = axis.rows * lattice.side as i64 + axis.cols;
        let top = |nodes: i64| lattice.top_m[(own as i64 + nodes * step) as usize];
        if !top(0).is_finite() {
            return None;
        }
        let reach = axis.reach as i64;
        // As the truth of the cell has it, less the slope; here what both sides of the wheel's own reach share of it.
        let [up_m, down_m] = [top(reach) - top(0), top(0) - top(-reach)];
        let smaller_m = if up_m.abs() < down_m.abs() { up_m } else { down_m };
        let shared_m = if up_m * down_m > 0.0 { smaller_m } else { 0.0 };
        let mut most_m = 0.0_f64;
        for nodes in 1..=reach {
            let sloped_m = shared_m * nodes as f64 / reach as f64;
            for met_m in [top(nodes) - top(0) - sloped_m, top(0) - top(-nodes) - sloped_m] {
                most_m = most_m.max(met_m.abs());
            }
        }
        let width_m = gaps.width_m.get(own).copied().filter(|width_m| width_m.is_finite()).unwrap_or(0.0);
        Some((most_m / self.limits.step_m).max(width_m / self.limits.gap_m))
    }
}
