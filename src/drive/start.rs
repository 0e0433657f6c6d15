//! Yard and path -> where the drive begins, and which way the rover looks.
//!
//! Source: Hewitt et al. 2017, "Rover model": a random position, in general near an obstacle. A place counts where the
//! body is clear of obstacles, the margin is kept and the rover can stand. Near an obstacle: an obstacle is picked, and a
//! point on the curve around it at the wanted distance; it is taken where no other obstacle is nearer.

use super::DriveError;
use super::contact::ContactPose;
use super::footing::Footing;
use super::guide::heading;
use super::outline::Outline;
use super::params::{DriveParams, PathParams};
use super::yard::{Yard, body};
use crate::geometry::DVec2;
use crate::random::{Drawn, Purpose, Streams};

const MAX_TRIES: u32 = 2000;
/// After so many tries, the best place will do.
const ENOUGH_TRIES: u32 = 200;
/// A distance to the nearest obstacle is met when it is off by less, metres.
const MET_M: f64 = 1e-6;

/// The next place to start at, from try `tries` on; counts the tries.
pub(super) fn choose(
    params: &DriveParams,
    yard: &Yard,
    footing: &Footing,
    drawn: &Drawn,
    streams: &Streams,
    tries: &mut u32,
) -> Result<ContactPose, DriveError> {
    if let PathParams::Waypoints(path) = &params.path {
        return at_first_point(params, yard, footing, &path.points_m);
    }
    let (places, headings) = (streams.open(Purpose::StartPlace), streams.open(Purpose::StartHeading));
    let near_m = params.start.near_obstacle_m.is_some().then(|| drawn[Purpose::StartNearObstacle]);
    let outlines: Vec<&Outline> = if near_m.is_some() { yard.outlines().collect() } else { Vec::new() };
    let wanted_m = near_m.filter(|_| !outlines.is_empty());
    // Asked for only where it matters: every outline is made for it.
    let asks_for_nearest = wanted_m.is_some() || matches!(params.path, PathParams::TowardObstacle(_));
    let margin_m = params.start.margin_m;
    let mut best: Option<(f64, ContactPose)> = None;
    let first = *tries;
    while *tries < first + if best.is_some() { ENOUGH_TRIES } else { MAX_TRIES } {
        let index = *tries;
        *tries += 1;
        let draw = |which: u64| places.uniform(u64::from(index) * 4 + which);
        let at = match wanted_m {
            Some(distance_m) => {
                let pick = (draw(2) * outlines.len() as f64) as usize;
                outlines[pick.min(outlines.len() - 1)].around(distance_m, draw(3))
            }
            None => DVec2::splat(margin_m) + DVec2::new(draw(0), draw(1)) * (yard.extent_m - 2.0 * margin_m),
        };
        if !yard.inside(at, margin_m) {
            continue;
        }
        let nearest = if asks_for_nearest { yard.nearest(at) } else { None };
        let off_m = wanted_m.zip(nearest).map_or(0.0, |(wanted_m, (distance_m, _))| (distance_m - wanted_m).abs());
        if best.as_ref().is_some_and(|(least_m, _)| off_m >= *least_m) {
            continue;
        }
        let yaw_rad = match (&params.path, nearest) {
            (PathParams::TowardObstacle(_), Some((_, surface))) => heading(at, surface),
            _ => std::f64::consts::PI * (2.0 * headings.uniform(u64::from(index)) - 1.0),
        };
        let room = match &params.path {
            PathParams::Planned(path) => yard.clear(&[at], params.rover.turning_radius_m() + path.clearance_m),
            PathParams::RandomWalk(_) => yard.clear_circle(at, params.rover.turning_radius_m()),
            _ => true,
        };
        if !room || !yard.clear(&body(&params.rover, at, yaw_rad), 0.0) {
            continue;
        }
        let Ok(stance) = footing.stand(at.x, at.y, yaw_rad, None) else { continue };
        if off_m <= MET_M {
            return Ok(stance);
        }
        best = Some((off_m, stance));
    }
    best.map(|(_, stance)| stance).ok_or(DriveError::NoStart { tries: MAX_TRIES })
}

/// The start that waypoints give, looking to the second point.
fn at_first_point(
    params: &DriveParams,
    yard: &Yard,
    footing: &Footing,
    points_m: &[[f64; 2]],
) -> Result<ContactPose, DriveError> {
    let at = DVec2::from(points_m[0]);
    let next = points_m[1..].iter().map(|&p| DVec2::from(p)).find(|&p| p != at).unwrap_or(at);
    let yaw_rad = heading(at, next);
    if !yard.clear(&body(&params.rover, at, yaw_rad), 0.0) {
        let reason = format!("the first waypoint ({}, {}) is on an obstacle or outside the yard", at.x, at.y);
        return Err(DriveError::NoWay { reason });
    }
    footing.stand(at.x, at.y, yaw_rad, None)
}
