//! A path -> the next command.
//!
//! Straight, arc, random walk and toward-obstacle paths are open loop: what noise does to them stays. Waypoints and planned
//! paths are steered: the guide knows the true pose, turns in place where a point lies to the side, and else drives the arc
//! that leads to it. Turns are counter-clockwise positive; lengths are driven lengths.

use std::collections::VecDeque;

use super::motion::{Command, arc_over_chord};
use crate::geometry::{DVec2, Pose};
use crate::math;
use crate::random::{Dist, Stream};

/// A step turns by at most this, radians (10 degrees), so that a turn in place is seen as it happens.
const STEP_TURN_RAD: f64 = std::f64::consts::PI / 18.0;
/// A point farther to the side than the first is turned to in place until it is no farther than the second, radians (5 and
/// 1 degrees): an arc toward a point 1 degree aside leaves the straight line by a hundredth of its half length at most.
const SIDE_RAD: f64 = 0.5 * STEP_TURN_RAD;
const AHEAD_RAD: f64 = 0.1 * STEP_TURN_RAD;
/// Turns that a walk tries where its way is barred.
const MAX_DETOURS: u32 = 36;
/// Below these, a piece is done: metres, radians.
const DONE_M: f64 = 1e-9;
const DONE_RAD: f64 = 1e-9;

/// Tells the rover what to do, step by step.
pub(super) struct PathFollower {
    pub pace: StepLimits,
    pub way: PathPieces,
}

/// How fast, and in what steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepLimits {
    pub step_m: f64,
    pub speed_mps: f64,
    pub max_yaw_rate_radps: f64,
}

pub(super) enum PathPieces {
    /// Pieces in a row.
    Pieces(VecDeque<Piece>),
    /// Legs and turns drawn as they come.
    DrawnPath(DrawnPath),
    /// Points to reach, in order.
    Points(Points),
}

pub(super) struct Points {
    pub left_m: VecDeque<DVec2>,
    /// Whether a turn in place to the next point has begun.
    pub turning: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    /// Along an arc; curvature in radians a metre, 0 for straight ahead.
    Drive { length_m: f64, curvature_radpm: f64 },
    /// In place.
    Turn { angle_rad: f64 },
}

pub(super) struct DrawnPath {
    pub left_m: f64,
    pub leg_m: Dist,
    pub turn_deg: Dist,
    pub legs: Stream,
    pub turns: Stream,
    pub next_leg: u64,
    pub next_turn: u64,
    pub now: Option<Piece>,
    /// Turns tried since the last leg that led anywhere.
    pub detours: u32,
}

impl PathFollower {
    /// The next command, or `None` at the path's end.
    pub(super) fn next(&mut self, pose: &Pose) -> Option<Command> {
        match &mut self.way {
            PathPieces::Pieces(pieces) => loop {
                match self.pace.begin(pieces.front_mut()?) {
                    Some(command) => return Some(command),
                    None => pieces.pop_front(),
                };
            },
            PathPieces::DrawnPath(walk) => loop {
                let piece = walk.piece()?;
                if let Some(command) = self.pace.begin(piece) {
                    if command.length_m > 0.0 {
                        walk.left_m -= command.length_m;
                    }
                    return Some(command);
                }
                walk.turn_or_go();
            },
            PathPieces::Points(points) => loop {
                let target = *points.left_m.front()?;
                if let Some(command) = self.pace.toward(target, pose, &mut points.turning) {
                    return Some(command);
                }
                points.left_m.pop_front();
            },
        }
    }

    /// Whether the rover must be able to turn in place wherever it goes.
    pub(super) fn needs_turning_room(&self) -> bool {
        matches!(self.way, PathPieces::DrawnPath(_))
    }

    /// Told that the last command could not be carried out: whether there is something else to try.
    pub(super) fn barred(&mut self, command: &Command) -> bool {
        match &mut self.way {
            PathPieces::DrawnPath(walk) => {
                walk.left_m += command.length_m;
                walk.detours += 1;
                walk.now = Some(walk.drawn_turn());
                walk.detours <= MAX_DETOURS
            }
            PathPieces::Pieces(_) | PathPieces::Points(_) => false,
        }
    }

    /// Told that the last command was carried out.
    pub(super) fn done(&mut self, command: &Command) {
        if let PathPieces::DrawnPath(walk) = &mut self.way
            && command.length_m > 0.0
        {
            walk.detours = 0;
        }
    }
}

impl DrawnPath {
    /// The piece in hand; `None` where the walk's length is used up.
    fn piece(&mut self) -> Option<&mut Piece> {
        if self.left_m <= DONE_M {
            return None;
        }
        if self.now.is_none() {
            self.now = Some(self.drawn_leg());
        }
        self.now.as_mut()
    }

    fn turn_or_go(&mut self) {
        self.now = match self.now {
            Some(Piece::Drive { .. }) => Some(self.drawn_turn()),
            _ => Some(self.drawn_leg()),
        };
    }

    fn drawn_leg(&mut self) -> Piece {
        let length_m = self.leg_m.at(&self.legs, self.next_leg).min(self.left_m);
        self.next_leg += 1;
        Piece::Drive { length_m, curvature_radpm: 0.0 }
    }

    fn drawn_turn(&mut self) -> Piece {
        let angle_rad = self.turn_deg.at(&self.turns, self.next_turn).to_radians();
        self.next_turn += 1;
        Piece::Turn { angle_rad }
    }
}

impl StepLimits {
    /// Takes one step off a piece; `None` where nothing is left of it.
    fn begin(&self, piece: &mut Piece) -> Option<Command> {
        match piece {
            Piece::Drive { length_m, curvature_radpm } => {
                if *length_m <= DONE_M {
                    return None;
                }
                let most_m = self.step_m.min(STEP_TURN_RAD / curvature_radpm.abs());
                let step_m = if *length_m < most_m + DONE_M { *length_m } else { most_m };
                *length_m -= step_m;
                Some(self.command(step_m, step_m * *curvature_radpm))
            }
            Piece::Turn { angle_rad } => {
                if angle_rad.abs() <= DONE_RAD {
                    return None;
                }
                let step_rad = angle_rad.clamp(-STEP_TURN_RAD, STEP_TURN_RAD);
                *angle_rad -= step_rad;
                Some(self.command(0.0, step_rad))
            }
        }
    }

    /// A step toward a point; `None` where it is reached.
    fn toward(&self, target: DVec2, pose: &Pose, turning: &mut bool) -> Option<Command> {
        let way = target - DVec2::new(pose.position_m.x, pose.position_m.y);
        let left_m = way.length();
        let aside_rad = math::wrap_angle(math::atan2(way.y, way.x) - pose.yaw_rad);
        let passed = left_m < 2.0 * self.step_m && aside_rad.abs() > std::f64::consts::FRAC_PI_2;
        if left_m < 0.25 * self.step_m || passed {
            return None;
        }
        *turning = aside_rad.abs() > if *turning { AHEAD_RAD } else { SIDE_RAD };
        if *turning {
            return Some(self.command(0.0, aside_rad.clamp(-STEP_TURN_RAD, STEP_TURN_RAD)));
        }
        // The arc that leaves along the nose and ends at the point turns by twice the bearing.
        let arc_m = left_m * arc_over_chord(2.0 * aside_rad) / math::cos(pose.pitch_rad);
        let step_m = arc_m.min(self.step_m);
        Some(self.command(step_m, 2.0 * aside_rad * step_m / arc_m))
    }

    fn command(&self, length_m: f64, turn_rad: f64) -> Command {
        let dt_s = (length_m / self.speed_mps).max(turn_rad.abs() / self.max_yaw_rate_radps);
        Command { length_m, turn_rad, dt_s }
    }
}

/// The heading from one point to another.
pub(super) fn heading(from: DVec2, to: DVec2) -> f64 {
    math::atan2(to.y - from.y, to.x - from.x)
}
