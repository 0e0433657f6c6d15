use garde::Validate;

use super::*;
use crate::sweep::fixtures::{SHIPPED, shipped};

fn angles_deg(d: DVec3) -> (f64, f64) {
    (math::atan2(d.y, d.x).to_degrees(), math::asin(d.z).to_degrees())
}

fn with_pattern(pattern: PatternParams) -> Sensor {
    Sensor { pattern, ..shipped("urg-04lx") }
}

#[test]
fn exact_urg_on_its_tilt_unit_has_100_lines_of_682_beams() {
    let pattern = Pattern::build(&shipped("urg-04lx")).unwrap();
    assert_eq!((pattern.lines, pattern.beams, pattern.directions.len()), (100, 682, 68_200));
    // Beam 340 is step 384, straight ahead; its line's elevation is the tilt.
    for line in 0..100 {
        let (azimuth, elevation) = angles_deg(pattern.directions[line * 682 + 340]);
        assert!(azimuth.abs() < 1e-12, "{azimuth}");
        assert!((elevation - (-45.0 + 0.5 * line as f64)).abs() < 1e-12, "{elevation}");
    }
    // The level fan, line 90: bearings on the encoder's steps of 360 / 1024 degrees.
    for (beam, d) in pattern.directions[90 * 682..91 * 682].iter().enumerate() {
        let (azimuth, elevation) = angles_deg(*d);
        assert!((azimuth - (beam as f64 - 340.0) * 360.0 / 1024.0).abs() < 1e-12, "{beam}: {azimuth}");
        assert!(elevation.abs() < 1e-12);
    }
    // A tilted fan lies in the plane through y: its foot angle is the tilt for every beam ahead.
    for d in &pattern.directions[100..582] {
        assert!((d.z + d.x).abs() < 1e-15, "line 0 looks down by 45 degrees");
    }
    assert!((pattern.times_s[682] - 0.1).abs() < 1e-15);
}

#[test]
fn exact_counts_and_fields_of_every_shipped_sensor() {
    // Lines, beams, lowest and highest elevation of any beam. A fan that reaches behind the sensor looks up there as
    // it looks down ahead: sin(highest) = cos(119.883) sin(-45) for the URG, cos(135) sin(-45) = 1/2 for the others.
    let urg_highest_deg = math::asin(-math::cos(119.882_812_5f64.to_radians()) / 2.0f64.sqrt()).to_degrees();
    let expected = [
        ("urg-04lx", 100, 682, -45.0, urg_highest_deg),
        ("utm-30lx", 100, 1081, -45.0, 30.0),
        ("lms111", 121, 541, -45.0, 30.0),
        ("lms291", 121, 361, -45.0, 15.0),
        ("vlp-16", 16, 1800, -15.0, 15.0),
        ("os1-64", 64, 1024, -16.6, 16.6),
        ("raster", 360, 480, -25.0, 5.0),
        ("rosette", 1, 100_000, -55.0, 15.0),
    ];
    assert_eq!(expected.len(), SHIPPED.len());
    for (name, lines, beams, lowest_deg, highest_deg) in expected {
        let sensor = shipped(name);
        sensor.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(sensor.name, name);
        assert!(sensor.source.contains("ssumed"), "{name} says what is assumed");
        let pattern = Pattern::build(&sensor).unwrap();
        assert_eq!((pattern.lines, pattern.beams), (lines, beams), "{name}");
        assert_eq!((pattern.directions.len(), pattern.times_s.len()), (pattern.slots(), pattern.slots()));
        assert!(pattern.directions.iter().all(|d| (d.length_squared() - 1.0).abs() < 1e-15), "{name}");
        assert!(pattern.times_s.iter().all(|t| t.is_finite()));
        let elevations = pattern.directions.iter().map(|d| angles_deg(*d).1);
        let (low, high) = elevations.fold((90.0f64, -90.0f64), |(l, h), e| (l.min(e), h.max(e)));
        // The rosette reaches its edge to a hundredth of a degree in one second.
        let tolerance_deg = if name == "rosette" { 0.02 } else { 1e-12 };
        assert!((low - lowest_deg).abs() < tolerance_deg, "{name}: {low}");
        assert!((high - highest_deg).abs() < tolerance_deg, "{name}: {high}");
    }
}

#[test]
fn exact_two_prisms_turn_the_beam_by_the_sum_of_their_deflections() {
    let sensor = shipped("rosette");
    let PatternParams::Rosette(p) = &sensor.pattern else { panic!("a rosette") };
    let level = with_pattern(PatternParams::Rosette(RosetteParams { centre_elevation_deg: 0.0, ..p.clone() }));
    let pattern = Pattern::build(&level).unwrap();
    for (d, t) in pattern.directions.iter().zip(&pattern.times_s) {
        // |e^(i a t) + e^(i b t)| = 2 |cos((a - b) t / 2)|, each prism a quarter of the field.
        let half_turn = TAU / 60.0 * (p.first_rpm - p.second_rpm) * t / 2.0;
        let off_axis = 35.0f64.to_radians() * math::cos(half_turn).abs();
        assert!((math::acos(d.x.min(1.0)) - off_axis).abs() < 1e-7, "{t}");
    }
    // The centre is reached, and the edge.
    assert!(pattern.directions.iter().any(|d| d.x > 0.99999) && pattern.directions.iter().any(|d| d.x < 0.8195));
}

#[test]
fn exact_raster_reads_like_a_picture_from_edge_to_edge() {
    let raster = RasterParams {
        width_deg: 40.0,
        height_deg: 20.0,
        columns: 5,
        rows: 3,
        centre_elevation_deg: -10.0,
        frame_time_s: 3.0,
    };
    let pattern = Pattern::build(&with_pattern(PatternParams::Raster(raster.clone()))).unwrap();
    let angles: Vec<_> = pattern.directions.iter().map(|d| angles_deg(*d)).collect();
    for (slot, expected) in [(0, (20.0, 0.0)), (4, (-20.0, 0.0)), (7, (0.0, -10.0)), (14, (-20.0, -20.0))] {
        assert!((angles[slot].0 - expected.0).abs() < 1e-12 && (angles[slot].1 - expected.1).abs() < 1e-12);
    }
    assert_eq!(pattern.times_s[5], 1.0);
    let one = RasterParams { columns: 1, rows: 1, ..raster };
    let pattern = Pattern::build(&with_pattern(PatternParams::Raster(one))).unwrap();
    let (azimuth, elevation) = angles_deg(pattern.directions[0]);
    assert!(azimuth == 0.0 && (elevation + 10.0).abs() < 1e-12);
}

#[test]
fn exact_tilt_may_go_down_and_stops_short_of_a_broken_step() {
    let tilted = TiltedParams {
        beams: 3,
        beam_step_deg: 10.0,
        first_beam_deg: None,
        tilt_from_deg: 10.0,
        tilt_to_deg: -11.0,
        tilt_step_deg: 4.0,
        line_time_s: 1.0,
    };
    let pattern = Pattern::build(&with_pattern(PatternParams::Tilted(tilted))).unwrap();
    assert_eq!(pattern.lines, 6);
    let tilts: Vec<f64> = (0..6).map(|line| angles_deg(pattern.directions[line * 3 + 1]).1.round()).collect();
    assert_eq!(tilts, [10.0, 6.0, 2.0, -2.0, -6.0, -10.0]);
    assert!((angles_deg(pattern.directions[0]).0 + angles_deg(pattern.directions[2]).0).abs() < 1e-12);
}

#[test]
fn exact_listed_beams_keep_their_order_and_times() {
    let file = PatternFile { path: "my.csv".into(), beams: vec![[0.0, 90.0, 0.0], [0.5, 0.0, -90.0]] };
    let pattern = Pattern::build(&with_pattern(PatternParams::File(file))).unwrap();
    assert!((pattern.directions[0] - DVec3::Y).length() < 1e-15);
    assert!((pattern.directions[1] + DVec3::Z).length() < 1e-15);
    assert_eq!(pattern.times_s, [0.0, 0.5]);
}

#[test]
fn extreme_patterns_that_cannot_be_are_named() {
    let file = |beams| with_pattern(PatternParams::File(PatternFile { path: "my.csv".into(), beams }));
    assert!(matches!(Pattern::build(&file(vec![])), Err(PatternError::Empty { .. })));
    for beam in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [0.0, 0.0, f64::NAN], [0.0, 0.0, 90.1]] {
        let error = Pattern::build(&file(vec![[0.0; 3], beam])).unwrap_err();
        assert!(matches!(error, PatternError::NotADirection { row: 1, .. }), "{error}");
    }
    let huge = RasterParams {
        width_deg: 90.0,
        height_deg: 90.0,
        columns: 100_000,
        rows: 100_000,
        centre_elevation_deg: 0.0,
        frame_time_s: 1.0,
    };
    let error = Pattern::build(&with_pattern(PatternParams::Raster(huge))).unwrap_err();
    assert!(matches!(error, PatternError::TooLarge { slots: 10_000_000_000, .. }), "{error}");
}

#[test]
fn exact_a_thinned_pattern_holds_every_second_line_and_beam_and_spares_what_has_few() {
    let whole = Pattern::build(&shipped("urg-04lx")).unwrap();
    let thinned = whole.thinned(2);
    assert_eq!((thinned.lines, thinned.beams, thinned.slots()), (50, 341, thinned.directions.len()));
    for line in 0..50 {
        for beam in 0..341 {
            let (slot, of_whole) = (line * 341 + beam, 2 * line * 682 + 2 * beam);
            assert_eq!(thinned.directions[slot], whole.directions[of_whole]);
            assert_eq!(thinned.times_s[slot], whole.times_s[of_whole]);
        }
    }
    assert_eq!(whole.thinned(1).directions, whole.directions);
    // 100 lines may be taken thrice as far apart, not more: 32 are left at least.
    assert_eq!((whole.thinned(8).lines, whole.thinned(8).beams), (34, 86));
    // Sixteen rings stay sixteen, and a single line one.
    for (name, lines) in [("vlp-16", 16), ("os1-64", 32), ("rosette", 1)] {
        let whole = Pattern::build(&shipped(name)).unwrap();
        let thinned = whole.thinned(2);
        assert_eq!((thinned.lines, thinned.beams), (lines, whole.beams.div_ceil(2)), "{name}");
    }
}
