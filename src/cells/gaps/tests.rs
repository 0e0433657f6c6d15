use super::*;

const SENSOR_M: f64 = 1.0;
const SIZE_M: f64 = 0.1;

/// A fan of beams from 1 m above level ground with a trench across x, 0.6 m wide and half a metre deep from x = 3 m, walls
/// upright: (x, z) of each beam's return.
fn fan(step_deg: f64) -> Vec<(f64, f64)> {
    let (near, far, depth) = (3.0, 3.6, 0.5);
    let beams = (0..).map(|k| (-45.0 + step_deg * f64::from(k)).to_radians()).take_while(|&e| e < -0.12);
    beams
        .map(|elevation| {
            let fall = -math::tan(elevation);
            let flat = SENSOR_M / fall;
            if !(near..far + depth / fall).contains(&flat) || flat > far && fall * far < SENSOR_M {
                return (flat, 0.0);
            }
            let floor = (SENSOR_M + depth) / fall;
            if floor < far { (floor, -depth) } else { (far, SENSOR_M - fall * far) }
        })
        .collect()
}

fn columns(returns: &[(f64, f64)]) -> BeamColumns {
    let mut columns = BeamColumns::default();
    // The sensor stands at (5, 7) in the map; the rover's z is 0.
    columns.begin(1.0, DVec3::new(5.0, 7.0, SENSOR_M), 0.0);
    for &(x, z) in returns {
        let (sin, cos) = math::sin_cos(0.5_f64.to_radians());
        columns.add(DVec3::new(x * cos, x * sin, z - SENSOR_M));
    }
    columns.finish(SIZE_M);
    columns
}

fn at(columns: &BeamColumns, range_m: f64) -> std::collections::BTreeMap<&'static str, f64> {
    let (sin, cos) = math::sin_cos(0.5_f64.to_radians());
    let features = columns.features(5.0 + range_m * cos, 7.0 + range_m * sin, 0.25, SIZE_M, 0.5);
    GAP_COLUMNS.iter().map(|column| column.0).zip(features).collect()
}

#[test]
fn extreme_a_gap_without_end_is_visited_as_far_as_is_asked_and_no_farther() {
    let mut visits = Vec::new();
    for far_m in [20.0, 1e4, 1e9, 1e300] {
        let columns = columns(&[(1.0, 0.0), (1.1, 0.0), (1.2, 0.0), (far_m, 0.0)]);
        assert_eq!(columns.gaps.len(), 1, "{far_m}");
        let (mut count, mut farthest_m) = (0_usize, 0.0_f64);
        columns.each_near_gap(0.5, 0.05, 10.0, |x_m, y_m| {
            count += 1;
            farthest_m = farthest_m.max(columns.range_m(x_m, y_m));
        });
        assert!(farthest_m > 9.9 && farthest_m <= 10.0 + 1e-9, "{far_m}: {farthest_m}");
        visits.push(count);
    }
    assert!(visits.iter().all(|&count| count < 200_000), "{visits:?}");
}

#[test]
fn exact_a_trench_in_level_ground_has_the_gap_and_drop_that_are_drawn_by_hand() {
    let returns = fan(0.25);
    let columns = columns(&returns);
    // Behind the trench its wall tilts the plane, and the beams' own spacing counts as gaps for a while; they are short.
    assert!(columns.gaps[1..].iter().all(|gap| gap.near_m > 3.6 && gap.far_m < 4.7 && gap.excess_m < 0.1));
    // By brute force: the last return before the trench, and the one after it.
    let last = returns.iter().rposition(|&(x, _)| x < 3.0).unwrap();
    let (near, (far, far_z)) = (returns[last].0, returns[last + 1]);
    assert!(far > 3.4 && far <= 3.6 + 1e-12, "the beam over the lip meets the far wall: {far}");
    let features = at(&columns, 3.3);
    let expected = [
        ("gap_length_m", far - near),
        ("gap_from_m", 3.3 - near),
        ("gap_to_m", far - 3.3),
        ("gap_near_range_m", near),
        ("gap_near_height_m", 0.0),
        ("gap_far_height_m", far_z),
        ("gap_drop_m", -far_z),
        ("gap_slope", 0.0),
        ("gap_rise_m", 0.0),
        ("gap_shadow_m", 0.0),
        // The wall is seen up to the beam that just passes below the far lip.
        ("gap_wall_m", returns.iter().filter(|p| p.0 > 3.0 && p.0 < 3.9).fold(-1.0_f64, |z, p| z.max(p.1)) - far_z),
        ("gap_beams", returns.iter().filter(|p| p.0 > 3.3).count() as f64),
    ];
    for (name, value) in expected {
        assert!((features[name] - value).abs() < 1e-9, "{name}: {} {value}", features[name]);
    }
    // The plane would have been met one beam further on; below it the beam passes at 3.3 m.
    let fall = (SENSOR_M - far_z) / far;
    assert!((features["gap_excess_m"] - (far - 1.0 / fall)).abs() < 1e-9);
    assert!((features["gap_below_m"] - (fall * 3.3 - SENSOR_M)).abs() < 1e-9 && features["gap_below_m"] > 0.0);
    // Far from the gap nothing is told but beams.
    let away = at(&columns, 2.0);
    assert_eq!((away["gap_length_m"], away["gap_from_m"], away["gap_near_height_m"]), (0.0, 0.5, 0.25));
    assert_eq!(away["gap_beams"], returns.iter().filter(|p| p.0 > 2.0).count() as f64);
    assert!(
        (columns.chord_m(5.0 + 3.3, 7.0 + 3.3 * 0.008_726_9).unwrap() - far_z * (3.3 - near) / (far - near)).abs()
            < 1e-4
    );
}

#[test]
fn law_level_and_sloping_ground_has_no_long_gap_and_a_rock_explains_its_shadow() {
    let plane = |slope: f64, x: f64| {
        let fall = (SENSOR_M - slope * x) / x;
        (x, SENSOR_M - fall * x)
    };
    for slope in [-0.2, 0.0, 0.1] {
        let returns: Vec<_> =
            (0..60).map(|k| plane(slope, 1.0 + 0.05 * f64::from(k) + 0.002 * f64::from(k * k))).collect();
        assert!(columns(&returns).gaps.is_empty(), "{slope}");
    }
    // A rock 0.3 m high at 2 m: its shadow ends where the line over its top meets the ground, at 2 / 0.7 m.
    let mut returns: Vec<_> = (0..20).map(|k| (1.0 + 0.05 * f64::from(k), 0.0)).collect();
    returns.extend((0..=6).map(|k| (2.0 + 0.02 * f64::from(k), 0.05 * f64::from(k))));
    returns.extend((0..20).map(|k| (3.1 + 0.1 * f64::from(k), 0.0)));
    let shadow = columns(&returns);
    assert!(shadow.gaps.is_empty(), "{:?}", shadow.gaps);
    // The ground behind it gone, and a wall below it in its place: more than the shadow.
    returns.retain(|point| point.0 < 3.0);
    returns.extend((0..5).map(|k| (4.2, -0.35 + 0.05 * f64::from(k))));
    let hole = columns(&returns);
    let features = at(&hole, 3.6);
    assert_eq!(hole.gaps.len(), 1);
    assert!((features["gap_rise_m"] - 0.3).abs() < 1e-9 && (features["gap_wall_m"] - 0.2).abs() < 1e-9);
    assert!((features["gap_shadow_m"] - 2.12 * 0.3 / 0.7).abs() < 1e-9);
    assert!(features["gap_below_m"] > 0.0 && features["gap_drop_m"] > 0.5, "{features:?}");
}
