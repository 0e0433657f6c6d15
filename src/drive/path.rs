//! The config's path -> a start and a guide along it.
//!
//! Lengths, radius and goal are the scene's drawn values; a random walk's legs and turns are drawn as they come. Source:
//! Hewitt et al. 2017, "Rover model" (a limited drive; a path planner as an option).

use std::collections::VecDeque;

use super::contact::ContactPose;
use super::footing::Footing;
use super::guide::{DrawnPath, PathFollower, PathPieces, Piece, Points, StepLimits};
use super::outline::unit;
use super::params::{DriveParams, PathParams};
use super::yard::Yard;
use super::{DriveError, route, start};
use crate::geometry::{DVec2, Pose};
use crate::random::{Drawn, Purpose, Streams};

/// The tightest arc, metres: below it, steps would be too many.
const MIN_RADIUS_M: f64 = 0.1;
/// Starts from which a way is looked for.
const MAX_STARTS: u32 = 8;
/// Directions in which a goal is looked for.
const MAX_GOALS: u64 = 64;

/// A start, and a guide from there. Where no goal can be reached from one start, another is looked for.
pub(super) fn begin(
    params: &DriveParams,
    yard: &Yard,
    footing: &Footing,
    drawn: &Drawn,
    streams: &Streams,
) -> Result<(ContactPose, PathFollower), DriveError> {
    let mut tries = 0;
    for _ in 1..MAX_STARTS {
        let start = start::choose(params, yard, footing, drawn, streams, &mut tries)?;
        if let Ok(guide) = guide(params, yard, &start.pose, drawn, streams) {
            return Ok((start, guide));
        }
    }
    let start = start::choose(params, yard, footing, drawn, streams, &mut tries)?;
    Ok((start, guide(params, yard, &start.pose, drawn, streams)?))
}

fn guide(
    params: &DriveParams,
    yard: &Yard,
    start: &Pose,
    drawn: &Drawn,
    streams: &Streams,
) -> Result<PathFollower, DriveError> {
    let drive = |length_m: f64, curvature_radpm: f64| {
        PathPieces::Pieces(VecDeque::from([Piece::Drive { length_m, curvature_radpm }]))
    };
    let way = match &params.path {
        PathParams::Straight(_) => drive(drawn[Purpose::StraightLength], 0.0),
        PathParams::TowardObstacle(_) => drive(drawn[Purpose::TowardLength], 0.0),
        PathParams::Arc(_) => {
            let radius_m = drawn[Purpose::ArcRadius];
            drive(drawn[Purpose::ArcLength], 1.0 / radius_m.abs().max(MIN_RADIUS_M).copysign(radius_m))
        }
        PathParams::Waypoints(path) => through(path.points_m[1..].iter().map(|&p| DVec2::from(p))),
        PathParams::RandomWalk(path) => PathPieces::DrawnPath(DrawnPath {
            left_m: drawn[Purpose::WalkLength],
            leg_m: path.leg_m.clone(),
            turn_deg: path.turn_deg.clone(),
            legs: streams.open(Purpose::WalkLeg),
            turns: streams.open(Purpose::WalkTurn),
            next_leg: 0,
            next_turn: 0,
            now: None,
            detours: 0,
        }),
        PathParams::Planned(path) => {
            let distance_m = params.rover.turning_radius_m() + path.clearance_m;
            through(planned(yard, start, drawn[Purpose::PlannedGoal], distance_m, streams)?.into_iter().skip(1))
        }
    };
    let fastest_mps = params.rover.max_speed_mps;
    let speed_mps = if params.speed_mps.is_some() { drawn[Purpose::DriveSpeed].min(fastest_mps) } else { fastest_mps };
    let max_yaw_rate_radps = params.rover.max_yaw_rate_degps.to_radians();
    Ok(PathFollower { pace: StepLimits { step_m: params.step_m, speed_mps, max_yaw_rate_radps }, way })
}

fn through(points: impl Iterator<Item = DVec2>) -> PathPieces {
    // The first point may lie anywhere: the turn to it goes all the way.
    PathPieces::Points(Points { left_m: points.collect(), turning: true })
}

/// The points of a way to the first goal, of those drawn, that can be reached; the first is the start.
fn planned(
    yard: &Yard,
    start: &Pose,
    goal_m: f64,
    distance_m: f64,
    streams: &Streams,
) -> Result<Vec<DVec2>, DriveError> {
    let from = DVec2::new(start.position_m.x, start.position_m.y);
    let directions = streams.open(Purpose::GoalDirection);
    let goals = (0..MAX_GOALS).map(|k| from + unit(std::f64::consts::TAU * directions.uniform(k)) * goal_m);
    let free = goals.filter(|&goal| yard.clear_circle(goal, distance_m));
    let way = free.take(8).find_map(|goal| route::around(yard, from, goal, distance_m));
    way.ok_or_else(|| DriveError::NoWay {
        reason: format!(
            "no goal {goal_m:.2} m from the start can be reached with {distance_m:.2} m to every obstacle; lower goal_m, \
             clearance_m or the number of obstacles"
        ),
    })
}
