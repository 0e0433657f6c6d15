//! Where a drive stops: closed forms of ways straight on, of turns in place and of both at once.

use super::Contact;
use super::contact::ContactPose;
use super::fixtures::{driven, params, pioneer, plane, straight, waypoints};
use super::follow::DrivenPath;
use super::params::DriveParams;
use crate::geometry::{DVec2, Pose};
use crate::math;

#[test]
fn exact_stops_are_evenly_spread_from_the_start_to_the_end() {
    let scene = plane(20.0, 0.0, DVec2::ZERO);
    let mut params = params(pioneer(), straight(2.0));
    params.start.margin_m = 4.0;
    for (stops, expected) in [(1, vec![40]), (2, vec![0, 40]), (5, vec![0, 10, 20, 30, 40]), (4, vec![0, 14, 27, 40])] {
        params.stops = stops;
        assert_eq!(driven(&params, &scene, 1).stops, expected);
    }
    params.stops = 1000;
    assert_eq!(driven(&params, &scene, 1).stops, (0..=40).collect::<Vec<_>>(), "no more stops than poses");
}

#[test]
fn exact_of_a_step_that_leads_on_and_turns_the_larger_counts() {
    /// The stops of a way of steps, each so many metres ahead and turned by so many radians.
    fn stops(steps: &[(f64, f64)], count: u32, turn_as_way_m_per_rad: f64) -> Vec<usize> {
        let mut pose = Pose { yaw_rad: 3.0, ..Pose::default() };
        let stance = |pose| ContactPose { pose, contact: Contact::default() };
        let mut stances = vec![stance(pose)];
        for &(ahead_m, turn_rad) in steps {
            pose.position_m.x += ahead_m;
            pose.yaw_rad = math::wrap_angle(pose.yaw_rad + turn_rad);
            stances.push(stance(pose));
        }
        DrivenPath { stances, durations_s: Vec::new(), cut_short: false }.stops(count, turn_as_way_m_per_rad)
    }
    // Through the half turn, where the yaw changes its sign, a turn is as small as it is.
    let turns = [(0.0, 0.1); 8];
    assert_eq!(stops(&turns, 3, 1.0), [0, 4, 8]);
    assert_eq!(stops(&turns, 3, 0.0), [0, 8], "of no way there are no parts");
    // 0.2 m, and a turn of 0.2 radians beside it: at 1 m a radian it adds nothing, at 2 it is 0.4 m.
    let both = [(0.2, 0.0), (0.2, 0.0), (0.2, 0.2), (0.2, 0.2)];
    for (turn_as_way_m_per_rad, middle) in [(0.0, 2), (1.0, 2), (2.0, 3)] {
        assert_eq!(stops(&both, 3, turn_as_way_m_per_rad), [0, middle, 4], "{turn_as_way_m_per_rad}");
    }
}

#[test]
fn exact_plans_of_before_and_plans_that_count_no_turns_are_written_alike() {
    let written = |turn_as_way_m_per_rad: f64| {
        serde_json::to_value(DriveParams { turn_as_way_m_per_rad, ..DriveParams::default() }).expect("plain data")
    };
    assert!(written(0.0).get("turn_as_way_m_per_rad").is_none());
    assert_eq!(written(1.0)["turn_as_way_m_per_rad"], 1.0);
}

#[test]
fn law_a_turn_in_place_counts_as_way_where_stops_are_asked_to() {
    // Two metres, half a turn, two metres back.
    let mut params = params(pioneer(), waypoints(&[[9.0, 10.0], [11.0, 10.0], [9.0, 10.0]]));
    params.stops = 4;
    let pi = std::f64::consts::PI;
    for (turn_as_way_m_per_rad, wanted) in [
        (0.0, [(9.0, 0.0), (9.0 + 4.0 / 3.0, 0.0), (9.0 + 4.0 / 3.0, pi), (9.0, pi)]),
        // 7.14 m in all: a third of it lies 0.38 into the turn, two thirds 2.76.
        (1.0, [(9.0, 0.0), (11.0, 0.38), (11.0, 2.76), (9.0, pi)]),
    ] {
        params.turn_as_way_m_per_rad = turn_as_way_m_per_rad;
        let log = driven(&params, &plane(20.0, 0.0, DVec2::ZERO), 4);
        assert_eq!(log.stops.len(), wanted.len());
        for (&stop, (want_m, want_rad)) in log.stops.iter().zip(wanted) {
            let (x_m, turned_rad) = (log.truth[stop].position_m.x, log.truth[stop].yaw_rad.abs());
            // A control step leads on by 5 cm, or turns by some degrees.
            assert!((x_m - want_m).abs() < 0.06, "{turn_as_way_m_per_rad}: at {x_m} for {want_m}");
            assert!((turned_rad - want_rad).abs() < 0.2, "{turn_as_way_m_per_rad}: {turned_rad} for {want_rad}");
        }
    }
}
