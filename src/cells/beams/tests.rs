//! Passages against their definition, return by return; bushes and stones; squares by hand; odd returns.

use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;
use crate::cells::fixtures::row_at;
use crate::wide::every_form;

const SENSOR_M: DVec3 = DVec3::new(3.0, -2.0, 1.5);

fn beams(offsets_m: &[DVec3]) -> Beams {
    let mut beams = Beams::default();
    beams.begin(SENSOR_M, 0.5);
    offsets_m.iter().for_each(|&offset_m| beams.add(offset_m));
    beams.finish();
    beams
}

/// A beam that comes back from (azimuth, horizontal range, height above the rover's z).
fn to(azimuth_rad: f64, range_m: f64, height_m: f64) -> DVec3 {
    let (sin, cos) = math::sin_cos(azimuth_rad);
    DVec3::new(range_m * cos, range_m * sin, height_m - 1.0)
}

/// What [`NAMES`] say, return by return, without sectors, by the angle between beam and cell.
fn by_definition(offsets_m: &[DVec3], centre_m: DVec2, size_m: f64, plane_m: f64, top_m: f64) -> [f64; 7] {
    let away = centre_m - SENSOR_M.truncate();
    let (mut ended, mut below, mut high) = (0.0, 0.0, 0.0);
    let (mut lowest, mut behind, mut before) = (1.0, (5.0, 0.0), (2.0, 0.0));
    for offset_m in offsets_m {
        let (towards, range_m) = (offset_m.truncate(), offset_m.truncate().length());
        let angle = towards.angle_to(away);
        let (foot_m, aside_m) = (away.length() * math::sin_cos(angle).1, away.length() * math::sin_cos(angle).0);
        let meets = aside_m.abs() <= 0.5 * size_m && (foot_m >= 0.0 || away.length() <= 0.5 * size_m);
        let height_m = 1.0 + offset_m.z - plane_m;
        match range_m - foot_m {
            _ if !meets => {}
            on if on > 0.6 * size_m => {
                let there_m = 1.0 + offset_m.z * foot_m / range_m - plane_m;
                below += f64::from(there_m < top_m - plane_m);
                high += f64::from(there_m < 0.5);
                lowest = f64::min(lowest, there_m);
                behind = if (on, height_m) < behind { (on, height_m) } else { behind };
            }
            on if on < -0.6 * size_m => before = if (-on, height_m) < before { (-on, height_m) } else { before },
            _ => ended += 1.0,
        }
    }
    let share = |on: f64| if on + ended > 0.0 { on / (on + ended) } else { 0.0 };
    [share(below), share(high), lowest, behind.0, behind.1, before.0, before.1]
}

proptest! {
    #[test]
    fn exact_passages_are_those_of_the_definition_return_by_return(
        returns in prop::collection::vec((0.0..TAU, 0.05..12.0f64, -1.0..2.0f64), 0..400),
        (azimuth, range_m, plane_m, rise_m) in (0.0..TAU, 0.0..9.0f64, -0.5..0.5f64, 0.0..1.0f64),
        size_m in 0.02..0.6f64,
    ) {
        let offsets_m: Vec<DVec3> = returns.into_iter().map(|(azimuth, range_m, height_m)| to(azimuth, range_m, height_m)).collect();
        let centre_m = SENSOR_M.truncate() + to(azimuth, range_m, 0.0).truncate();
        let got = beams(&offsets_m).passage(centre_m, size_m, plane_m, plane_m + rise_m).features();
        let expected = by_definition(&offsets_m, centre_m, size_m, plane_m, plane_m + rise_m);
        prop_assert!(got.iter().zip(expected).all(|(got, expected)| (got - expected).abs() < 1e-9), "{got:?} {expected:?}");
    }
}

#[test]
fn exact_a_turn_grows_with_the_angle_and_sectors_close_the_circle() {
    let turns: Vec<f64> = (0..1000).map(|k| turn(to(TAU * f64::from(k) / 1000.0, 1.0, 0.0).truncate())).collect();
    assert!(turns.is_sorted() && turns[0] == 0.0 && turns[999] < 4.0);
    assert!((turns[250] - 1.0).abs() < 1e-9 && (turns[500] - 2.0).abs() < 1e-9 && (turns[750] - 3.0).abs() < 1e-9);
    // Just below x, where a sum rounds to the whole circle.
    assert_eq!(sector(turn(DVec2::new(1.0, -1e-20))), SECTORS - 1);
}

#[test]
fn exact_a_bush_lets_beams_through_and_a_stone_does_not() {
    // Ten beams of a column that come low over a cell 4 m off; of a bush six come back from behind it, of a stone none.
    let column = |behind: usize| -> Vec<DVec3> {
        (0..10).map(|k| if k < behind { to(0.0, 4.5, 0.1) } else { to(0.0, 4.0, 0.2) }).collect()
    };
    let at = SENSOR_M.truncate() + DVec2::new(4.0, 0.0);
    let seen = |behind| beams(&column(behind)).passage(at, 0.1, 0.0, 0.3).features();
    assert_eq!((seen(6)[0], seen(0)[0]), (0.6, 0.0));
    assert!((seen(6)[3] - 0.5).abs() < 1e-12 && (seen(6)[4] - 0.1).abs() < 1e-12);
    assert!((seen(6)[2] - (1.0 - 0.9 * 4.0 / 4.5)).abs() < 1e-12, "the line from 1 m to 0.1 m in 4.5 m");
    assert_eq!(seen(0)[2..], [1.0, 5.0, 0.0, 2.0, 0.0]);
}

#[test]
fn exact_squares_count_the_beams_of_all_their_cells() {
    let rows: Vec<_> = [(0, 0), (0, 1), (0, 5), (1, 0), (7, 7)].map(|(row, col)| row_at(row, col)).into();
    let of =
        |ended, below_top, low, high| Passage { counts: Counts { ended, below_top, low, high }, ..Passage::default() };
    let cells = [of(3, 1, 0, 5), of(1, 1, 1, 1), of(100, 0, 0, 0), of(0, 2, 1, 4), of(0, 0, 0, 0)];
    let (mut squares, mut passages) = (Squares::default(), Passages::default());
    squares.take(&rows);
    passages.take(cells.into_iter());
    assert_eq!(passages.of_cells(), cells);
    let params = BeamParams { radii_m: vec![0.1, 0.5] };
    let around = |cell: usize| -> Vec<f32> {
        passages.of(&params, 0.1, &squares, rows[cell].index, &cells[cell]).skip(NAMES.len()).collect()
    };
    let shares = |ended: f32, on: [f32; 3]| on.map(|on| on / (on + ended));
    assert_eq!(around(0)[..3], shares(4.0, [4.0, 2.0, 10.0]));
    assert_eq!(around(0)[3..], shares(104.0, [4.0, 2.0, 10.0]));
    assert_eq!(around(4)[..3], [0.0; 3], "no beam is no share");
}

#[test]
fn extreme_returns_at_the_sensor_far_away_and_that_are_no_numbers() {
    let odd = [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, DVec3::new(0.0, 0.0, -1.0), DVec3::new(1e150, 0.0, -1e150)];
    assert_eq!(beams(&odd).returns.len(), 1, "a beam straight down has no way, seen from above");
    let mut all = odd.to_vec();
    all.extend((0..100).map(|k| to(TAU * f64::from(k) / 100.0, 2.0, 0.0)));
    for centre_m in [SENSOR_M.truncate(), DVec2::new(1e9, 1e9), DVec2::new(4.0, -2.0), DVec2::NAN] {
        let features = beams(&all).passage(centre_m, 0.1, 0.0, 0.1).features();
        assert!(features.iter().all(|value| value.is_finite()), "{centre_m} {features:?}");
    }
    let under = beams(&all).passage(SENSOR_M.truncate(), 0.1, 0.0, 2.0);
    assert_eq!((under.counts.ended, under.counts.below_top), (0, 101), "every beam leaves from over the cell");
    assert_eq!(beams(&[]).passage(DVec2::ZERO, 0.1, 0.0, 0.0), Passage::default());
}

#[test]
fn equal_passages_in_every_form_and_from_any_place_in_a_block() {
    let offsets_m: Vec<DVec3> =
        (0..300).map(f64::from).map(|k| to(0.1 + 5e-4 * k, 1.0 + k % 7.0, 0.1 * (k % 13.0))).collect();
    for skipped in 0..9 {
        let beams = beams(&offsets_m[skipped..]);
        let meeting = || Meeting {
            blocks: &beams.blocks,
            spans: [skipped..beams.returns.len() - 5, 0..skipped],
            away_m: DVec2::new(3.0, 0.5),
            half_m: 0.3,
            least_foot_m: 0.0,
            ends_within_m: 0.4,
            sensor_m: 0.1,
            top_m: 0.4,
        };
        // One return at a time: what is out of the spans is never met.
        let [first, second] = meeting().spans;
        let alone: Vec<Passage> =
            first.chain(second).map(|k| widest(Meeting { spans: [k..k + 1, 0..0], ..meeting() })).collect();
        let sum = |of: fn(&Counts) -> u32| alone.iter().map(|passage| of(&passage.counts)).sum::<u32>();
        let nearest = |of: fn(&Passage) -> (f64, f64)| alone.iter().map(of).reduce(nearer).unwrap();
        let expected = Passage {
            counts: Counts {
                ended: sum(|c| c.ended),
                below_top: sum(|c| c.below_top),
                low: sum(|c| c.low),
                high: sum(|c| c.high),
            },
            lowest_m: alone.iter().map(|passage| passage.lowest_m).fold(f64::INFINITY, f64::min),
            behind: nearest(|passage| passage.behind),
            before: nearest(|passage| passage.before),
        };
        assert!(
            expected.counts.ended > 0 && expected.counts.low > 0 && expected.before.0 < BEFORE_MOST_M,
            "{expected:?}"
        );
        for passage in every_form(meeting) {
            assert_eq!(passage, expected, "{skipped}");
        }
    }
}
