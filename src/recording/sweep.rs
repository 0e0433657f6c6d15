//! The points of one real sweep -> returns, as the filter reads simulated ones.
//!
//! In: points in the sensor's frame (x forward, y left, z up; metres), in the order of the file; a point at the sensor's own place stands
//! for a beam without a return. Out: [`Returns`] of one line: a slot a point, and an empty slot wherever points that follow one another are
//! no neighbours, so that neither is taken for the other's (mixed pixels, and what hides a part of a rock, are told by neighbours).
//! Files hold a sweep line by line, or column by column, a beam of each ring in turn: of both orders the one that makes more
//! neighbours is taken; the second is seen where beams without a return keep their place. Points in no order lose what neighbours tell.
//! Own construction. Not known: where a beam met nothing, so that free space is known as far as points lie and no farther, and where the
//! field of view ends, so that half a rock at its edge is taken for a whole one.

use std::sync::Arc;

use crate::geometry::DVec3;
use crate::sweep::{Pattern, Returns, Status};

/// Beams farther apart are no neighbours: above the step along a line of the sensors in `configs/sensors`, below that from line to line.
const MOST_STEP_RAD: f64 = 0.45 / 180.0 * std::f64::consts::PI;
/// Points nearer than this are the sensor itself: many drivers write beams without a return as its own place.
const NEAREST_M: f64 = 1e-3;
/// Rings of sensors that are written column by column. One: line by line.
const RINGS: [usize; 6] = [1, 16, 32, 40, 64, 128];

/// A sweep's returns, and what its points were besides.
#[derive(Clone, Debug)]
pub struct SweepPoints {
    pub returns: Returns,
    /// Points that are no returns: at the sensor, or not finite.
    pub no_return: u64,
    /// Points of the rover itself: they hide what lies behind them, and are seen no more than that.
    pub own: u64,
}

/// A point that is a return.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beam {
    direction: DVec3,
    range_m: f64,
    status: Status,
}

/// The returns of a sweep; `is_own`: whether a point is one of the rover itself.
pub fn returns_of_points(points_m: &[DVec3], is_own: impl Fn(DVec3) -> bool) -> SweepPoints {
    let beam = |&point_m: &DVec3| {
        let range_m = point_m.length();
        let status = if is_own(point_m) { Status::Dropped } else { Status::Hit };
        let is_return = range_m.is_finite() && range_m > NEAREST_M;
        is_return.then(|| Beam { direction: point_m / range_m, range_m, status })
    };
    let beams: Vec<Option<Beam>> = points_m.iter().map(beam).collect();
    let neighbours = |rings: &usize| {
        let pairs = beams.iter().zip(beams.iter().skip(*rings));
        pairs.filter(|(one, other)| are_neighbours(one, other)).count()
    };
    // The last of equals is line by line.
    let rings = RINGS.into_iter().rev().max_by_key(neighbours).unwrap_or(1);
    let mut slots = Slots::default();
    for ring in 0..rings {
        slots.before = None;
        beams.iter().skip(ring).step_by(rings).for_each(|beam| slots.push(beam));
    }
    let no_return = beams.iter().filter(|beam| beam.is_none()).count() as u64;
    let own = beams.iter().flatten().filter(|beam| beam.status == Status::Dropped).count() as u64;
    let Slots { directions, range_m, status, .. } = slots;
    let pattern = Arc::new(Pattern { lines: 1, beams: directions.len() as u32, directions, times_s: Vec::new() });
    SweepPoints { returns: Returns { pattern, range_m, status, intensity: None }, no_return, own }
}

fn are_neighbours(one: &Option<Beam>, other: &Option<Beam>) -> bool {
    let apart = one.zip(*other).map(|(one, other)| one.direction.distance_squared(other.direction));
    apart.is_some_and(|apart| apart <= MOST_STEP_RAD * MOST_STEP_RAD)
}

/// Slots in the making.
#[derive(Default)]
struct Slots {
    directions: Vec<DVec3>,
    range_m: Vec<f64>,
    status: Vec<Status>,
    before: Option<Beam>,
}

impl Slots {
    fn push(&mut self, beam: &Option<Beam>) {
        if let Some(beam_here) = *beam {
            if !self.directions.is_empty() && !are_neighbours(&self.before, beam) {
                self.slot(Beam { range_m: f64::NAN, status: Status::Dropped, ..beam_here });
            }
            self.slot(beam_here);
        }
        self.before = *beam;
    }

    fn slot(&mut self, beam: Beam) {
        self.directions.push(beam.direction);
        self.range_m.push(beam.range_m);
        self.status.push(beam.status);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    fn at(azimuth_deg: f64, range_m: f64) -> DVec3 {
        let (sin, cos) = math::sin_cos(azimuth_deg.to_radians());
        DVec3::new(cos, sin, 0.0) * range_m
    }

    /// Slot by slot the point; `None` of empty ones.
    fn told(returns: &Returns) -> Vec<Option<DVec3>> {
        let places = returns.pattern.directions.iter().zip(&returns.range_m);
        let hit =
            |(status, (&way, &range_m)): (&Status, (&DVec3, &f64))| (*status == Status::Hit).then(|| way * range_m);
        returns.status.iter().zip(places).map(hit).collect()
    }

    fn assert_same(told: &[Option<DVec3>], expected: &[Option<DVec3>]) {
        assert_eq!(told.len(), expected.len());
        for (told, expected) in told.iter().zip(expected) {
            assert_eq!(told.is_some(), expected.is_some(), "{told:?} {expected:?}");
            let off_m = told.unwrap_or_default().distance(expected.unwrap_or_default());
            assert!(off_m < 1e-14, "{off_m}");
        }
    }

    #[test]
    fn exact_points_keep_their_places_and_gaps_stand_between_those_that_are_no_neighbours() {
        let points =
            [at(0.0, 2.0), at(0.36, 3.0), at(1.5, 4.0), at(1.75, 4.0), DVec3::ZERO, at(2.0, 1.0), at(-170.0, 5.0)];
        let SweepPoints { returns, no_return, own } = returns_of_points(&points, |_| false);
        let [a, b, c, d, _, e, f] = points.map(Some);
        assert_same(&told(&returns), &[a, b, None, c, d, None, e, None, f]);
        assert_eq!((returns.pattern.lines, returns.pattern.beams, no_return, own), (1, 9, 1, 0));
    }

    #[test]
    fn exact_what_the_rover_sees_of_itself_keeps_its_range_and_is_no_return() {
        let points = [at(0.0, 4.0), at(0.3, 0.5), at(0.6, 4.0)];
        let SweepPoints { returns, no_return, own } = returns_of_points(&points, |p| p.length() < 1.0);
        assert_eq!(returns.status, [Status::Hit, Status::Dropped, Status::Hit]);
        assert!((returns.range_m[1] - 0.5).abs() < 1e-15 && (no_return, own) == (0, 1), "{returns:?}");
    }

    #[test]
    fn law_a_sweep_stored_column_by_column_is_read_ring_by_ring() {
        let elevation_deg = |ring: usize| -15.0 + 2.0 * ring as f64;
        let point = |ring: usize, column: usize| {
            let (sin, cos) = math::sin_cos(elevation_deg(ring).to_radians());
            let flat = at(0.2 * column as f64, cos);
            (flat + DVec3::Z * sin) * (2.0 + 0.01 * (ring + 16 * column) as f64)
        };
        let (rings, columns) = (16, 100);
        let by_column: Vec<DVec3> = (0..rings * columns).map(|k| point(k % rings, k / rings)).collect();
        let by_ring: Vec<DVec3> = (0..rings * columns).map(|k| point(k / columns, k % columns)).collect();
        let expected = told(&returns_of_points(&by_ring, |_| false).returns);
        assert_same(&told(&returns_of_points(&by_column, |_| false).returns), &expected);
        assert_eq!(expected.iter().filter(|slot| slot.is_none()).count(), rings - 1, "a gap after each ring");
    }

    #[test]
    fn extreme_points_that_are_no_returns_leave_nothing_behind() {
        let none = [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e200), DVec3::splat(1e-160)];
        let nothing = returns_of_points(&none, |_| false);
        assert!(nothing.returns.range_m.is_empty() && nothing.no_return == 5, "{nothing:?}");
        assert!(returns_of_points(&[], |_| true).returns.status.is_empty());
        let points = [DVec3::ZERO, at(10.0, 1.0), at(10.1, 1.0), DVec3::NAN, at(10.2, 1.0)];
        let returns = returns_of_points(&points, |_| false).returns;
        assert_eq!(returns.status, [Status::Hit, Status::Hit, Status::Dropped, Status::Hit]);
        assert!(returns.pattern.directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
    }
}
