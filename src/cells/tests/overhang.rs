//! The overhang rule: slabs and crowns at their limit from both sides, walls and boulders that stay, the definition over all pairs, and
//! what is left in rows, labels and counts.

use proptest::prelude::*;

use super::*;
use crate::cells::overhang::Overhangs;
use crate::cells::params::OverhangParams;

const ABOVE_M: f64 = 0.8;
/// Of the sensor above the ground's foot below it.
const SENSOR_M: f64 = 0.6;

/// Marks of places seen from the sensor.
fn hanging(above_m: f64, places_m: &[DVec3]) -> Vec<bool> {
    let estimate = crate::slam::truth(&Pose::default());
    let cloud = cloud_of(places_m, &estimate);
    Overhangs::default().of_cloud(above_m, &cloud).to_vec()
}

fn cloud_of<'a>(points_m: &'a [DVec3], estimate: &'a Estimate) -> WindowCloud<'a> {
    WindowCloud {
        points_m,
        in_map: false,
        intensity: None,
        obstacle: None,
        estimate,
        map_from_sensor: Transform::IDENTITY,
    }
}

/// A point `height_m` above ground that rises by `slope` along x, as the sensor sees it; all lie in one upright plane through it.
fn over(slope: f64, x_m: f64, height_m: f64) -> DVec3 {
    DVec3::new(x_m, 0.01 * x_m, slope * x_m + height_m - SENSOR_M)
}

#[test]
fn exact_straight_behind_is_one_column_on_both_sides_of_the_half_turn() {
    // The half turn read as such (y = 0), and as its opposite (y = -0).
    for [crown_y_m, ground_y_m] in [[0.0, 0.0], [0.0, -0.0], [-0.0, 0.0]] {
        let crown = DVec3::new(-2.0, crown_y_m, 1.5);
        let ground = [2.5, 3.0].map(|x_m: f64| DVec3::new(-x_m, ground_y_m, -SENSOR_M));
        assert_eq!(hanging(ABOVE_M, &[crown, ground[0], ground[1]]), [true, false, false], "{crown_y_m} {ground_y_m}");
    }
}

#[test]
fn exact_a_slab_leaves_a_nanometre_above_the_limit_and_stays_as_much_below() {
    for slope in [0.0, math::tan(20f64.to_radians()), -math::tan(20f64.to_radians())] {
        for (off_m, expected) in [(1e-9, true), (-1e-9, false)] {
            // Two returns of the ground in each place under the slab.
            let places_m: Vec<DVec3> = (20..60)
                .map(|k| 0.1 * f64::from(k))
                .flat_map(|x_m| [0.0, 0.0, ABOVE_M + off_m].map(|height_m| over(slope, x_m, height_m)))
                .collect();
            let marks = hanging(ABOVE_M, &places_m);
            assert!(marks.chunks(3).all(|marks| marks == [false, false, expected]), "slope {slope}, off by {off_m}");
        }
    }
}

#[test]
fn exact_a_crown_over_ground_that_nobody_saw_leaves_by_the_lines_to_the_ground_behind() {
    // Ground is seen before the crown and from 6 m on: at 5 m the lowest line passes a tenth of the sensor's height and more above it.
    let line_m = SENSOR_M * (1.0 - 5.0 / 6.0);
    for (off_m, expected) in [(1e-9, true), (-1e-9, false)] {
        let ground = (10..40).chain(60..90).map(|k| 0.1 * f64::from(k)).map(|x_m| over(0.0, x_m, 0.0));
        let crown_m = over(0.0, 5.0, line_m + ABOVE_M + off_m);
        // Another return of the ground there: two are asked for.
        let places_m: Vec<DVec3> = ground.chain([over(0.0, 6.0, 0.0), crown_m]).collect();
        let marks = hanging(ABOVE_M, &places_m);
        assert_eq!(marks.iter().filter(|&&marked| marked).count(), usize::from(expected));
        assert_eq!(marks.last(), Some(&expected));
    }
}

#[test]
fn exact_one_stray_return_below_the_ground_takes_nothing_away() {
    let level: Vec<DVec3> = (10..80).map(|k| over(0.0, 0.1 * f64::from(k), 0.0)).collect();
    for x_m in [1.0, 4.0, 9.0] {
        let mut places_m = level.clone();
        places_m.push(over(0.0, x_m, -5.0));
        assert!(!hanging(ABOVE_M, &places_m).contains(&true));
    }
}

/// What a fan of beams within 20 degrees to either side meets, seen from `sensor_m` above level ground: the nearer of ground and of an upright
/// front at x = `front_m`, `height_m` tall, with a level top that reaches to `back_m`; each with whether it is of the body.
fn fan(sensor_m: f64, front_m: f64, back_m: f64, height_m: f64) -> Vec<(DVec3, bool)> {
    let mut returns = Vec::new();
    for azimuth in (-80..=80).map(|k| (0.25 * f64::from(k)).to_radians()) {
        for elevation in (-160..=160).map(|k| (0.25 * f64::from(k)).to_radians()) {
            let (ahead, side) = (math::cos(azimuth), math::sin(azimuth));
            let rise = math::tan(elevation);
            let at_front_m = sensor_m + rise * front_m / ahead;
            let to_level_m = |level_m: f64| if rise < 0.0 { (level_m - sensor_m) / rise } else { f64::INFINITY };
            let top = height_m < sensor_m && (front_m..back_m).contains(&(to_level_m(height_m) * ahead));
            let (range_m, of_body) = match () {
                () if (0.0..=height_m).contains(&at_front_m) => (front_m / ahead, true),
                () if top => (to_level_m(height_m), true),
                () => (to_level_m(0.0), false),
            };
            if range_m < 15.0 {
                returns.push((DVec3::new(range_m * ahead, range_m * side, rise * range_m), of_body));
            }
        }
    }
    returns
}

/// The cells of returns that carry whether they are an obstacle's, and how many of them hang.
fn cells_of(returns: &[(DVec3, bool)], above_m: Option<f64>) -> Cells {
    let points_m: Vec<DVec3> = returns.iter().map(|&(point_m, _)| point_m).collect();
    let verdicts: Vec<Option<bool>> = returns.iter().map(|&(_, of_body)| Some(of_body)).collect();
    let estimate = crate::slam::truth(&Pose::default());
    let cloud = WindowCloud { obstacle: Some(&verdicts), ..cloud_of(&points_m, &estimate) };
    let overhang = above_m.map(|above_m| OverhangParams { above_m: Some(above_m) });
    let params = CellParams { overhang, ..CellParams::default() };
    let cells = bin_clouds(&params, &[cloud], 12.0, &mut Scratch::default()).0;
    let dropped = cells.dropped_beyond_range + cells.dropped_off_grid;
    assert_eq!(cells.points_in, cells.points_binned + dropped + cells.overhanging);
    assert_eq!(cells.points_in, points_m.len() as u64);
    cells
}

#[test]
fn law_a_wall_of_3_m_stays_untraversable_by_its_foot() {
    let returns = fan(SENSOR_M, 4.0, 4.2, 3.0);
    let (plain, ruled) = (cells_of(&returns, None), cells_of(&returns, Some(ABOVE_M)));
    assert!(ruled.overhanging > 0, "what is higher than the rover may leave");
    let labels = |cells: &Cells| cells.rows.iter().map(|row| (row.index, row.label)).collect::<Vec<_>>();
    assert_eq!(labels(&plain), labels(&ruled));
    assert!(ruled.rows.iter().filter(|row| row.untraversable()).count() >= 25);
}

#[test]
fn law_the_top_of_a_block_stays_since_nothing_is_seen_beneath_it() {
    // 1.2 m tall, 1.5 m deep, seen from 1.8 m.
    let returns = fan(1.8, 4.0, 5.5, 1.2);
    let (plain, ruled) = (cells_of(&returns, None), cells_of(&returns, Some(ABOVE_M)));
    let labels = |cells: &Cells| cells.rows.iter().map(|row| (row.index, row.label)).collect::<Vec<_>>();
    assert_eq!(labels(&plain), labels(&ruled));
    assert!(ruled.rows.iter().filter(|row| row.untraversable() && row.range_m > 4.6).count() > 100);
}

#[test]
fn exact_a_cell_under_a_crown_is_labelled_by_what_remains_and_one_of_crown_alone_has_no_row() {
    // Object 3 is a volume that bars the rover. The cell at x = 3 holds ground twice and a leaf, that at x = 4 a leaf alone.
    let ground = |x_m: f64| (DVec3::new(x_m, 0.05, -0.5), -1);
    let leaf = |x_m: f64| (DVec3::new(x_m, 0.05, 0.7), 3);
    let points = [ground(3.05), ground(3.05), leaf(3.05), leaf(4.05), ground(5.05), ground(5.15)];
    let with = |overhang| {
        let params = CellParams { overhang, ..CellParams::default() };
        bin_one(&params, &points, Pose::default(), &yard(0.0))
    };
    let told = |cells: &Cells| cells.rows.iter().map(|r| (r.index.col, r.points, r.label)).collect::<Vec<_>>();
    let [free, barred] = [Some(Label::Traversable), Some(Label::Untraversable)];
    assert_eq!(told(&with(None)), [(30, 3, barred), (40, 1, barred), (50, 1, free), (51, 1, free)]);
    let ruled = with(Some(OverhangParams { above_m: Some(ABOVE_M) }));
    assert_eq!(told(&ruled), [(30, 2, free), (50, 1, free), (51, 1, free)]);
    assert_eq!((ruled.points_in, ruled.points_binned, ruled.overhanging), (6, 4, 2));
    // Without a height the rule is none.
    assert_eq!(told(&with(Some(OverhangParams::default()))), told(&with(None)));
}

/// The definition over all pairs.
fn plainly_hanging(above_m: f64, places_m: &[DVec3]) -> Vec<bool> {
    let seen = |place_m: &DVec3| {
        let range_m = math::hypot(place_m.x, place_m.y);
        let turn = (math::atan2(place_m.y, place_m.x) + std::f64::consts::PI) / 4f64.to_radians();
        (turn.floor() as i64, range_m, place_m.z / range_m)
    };
    let is_witness = |of: &DVec3, other: &DVec3| {
        let ((column, range_m, slope), (other_column, behind_m, lower)) = (seen(of), seen(other));
        column == other_column && behind_m >= range_m && (slope - lower) * range_m > above_m
    };
    let finite = |place_m: &DVec3| place_m.is_finite();
    let hangs = |of: &DVec3| {
        finite(of) && places_m.iter().filter(|other| finite(other)).filter(|other| is_witness(of, other)).count() >= 2
    };
    places_m.iter().map(hangs).collect()
}

proptest! {
    #[test]
    fn equal_marks_are_those_of_the_definition(
        places in prop::collection::vec((1..60i32, -20..20i32, -30..30i32, 0..40u8), 0..150),
        above_m in 0.1..2.0f64,
        scale in prop::sample::select(vec![0.01, 0.1, 1e3]),
    ) {
        // Coarse places: many have the same range, and some are no places.
        let place = |(x, y, z, fate): (i32, i32, i32, u8)| match fate {
            0 => DVec3::new(f64::NAN, 1.0, 1.0),
            1 => DVec3::new(1.0, f64::INFINITY, 1.0),
            2 => DVec3::new(f64::from(x) * 1e300, f64::from(y), f64::from(z) * 1e300),
            3 => DVec3::new(0.0, 0.0, f64::from(z)),
            _ => DVec3::new(f64::from(x) * scale, f64::from(y / 7) * scale, 0.1 * f64::from(z)),
        };
        let places_m: Vec<DVec3> = places.into_iter().map(place).collect();
        prop_assert_eq!(hanging(above_m, &places_m), plainly_hanging(above_m, &places_m));
    }
}

#[test]
fn extreme_a_million_returns_in_one_place_take_no_square_of_the_time() {
    let places_m = vec![over(0.0, 3.0, 2.0); 1_000_000];
    assert!(!hanging(ABOVE_M, &places_m).contains(&true));
}

#[test]
fn exact_the_height_follows_from_body_and_mast() {
    use crate::sweep::params::MountParams;
    let kapvik = include_str!("../../../configs/rovers/kapvik.yaml");
    let mut rover: crate::drive::Rover = serde_saphyr::from_str(kapvik).unwrap();
    let height_m = |rover: &crate::drive::Rover, mount: Option<&MountParams>| {
        OverhangParams::default().resolved(rover, mount).above_m.unwrap()
    };
    assert!((height_m(&rover, None) - 0.6).abs() < 1e-12, "the mast of 0.4 m");
    let mount: MountParams = serde_saphyr::from_str("z_m: {uniform: [0.3, 1.8]}").unwrap();
    assert!((height_m(&rover, Some(&mount)) - 2.0).abs() < 1e-12);
    let other: MountParams = serde_saphyr::from_str("pitch_deg: 3").unwrap();
    assert!((height_m(&rover, Some(&other)) - 0.6).abs() < 1e-12);
    rover.height_m = Some(0.7);
    assert!((height_m(&rover, None) - 0.9).abs() < 1e-12, "the body");
    let given = OverhangParams { above_m: Some(0.5) };
    assert_eq!(given.resolved(&rover, Some(&mount)), given);
}
