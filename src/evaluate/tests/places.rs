//! Cells by their place from the rover: of a corpus with poses, and drawn.

use super::*;
use crate::episode::PoseRow;
use crate::evaluate::{PlacesReport, Square};
use crate::geometry::{DVec3, Pose};
use crate::slam;

/// The corpus of two scans of one row of cells, seen by a rover 2.05 m to the north of it that looks north: (1.02, 2.1).
fn posed(yaw_rad: f64) -> (tempfile::TempDir, LocalFolder) {
    let tables = [Table::Cells, Table::Scenes, Table::Poses];
    let spec = spec(7, &tables);
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path().join("known"));
    Place::open(&store, &spec).unwrap();
    let pose = Pose { position_m: DVec3::new(1.02, 2.1, 0.3), yaw_rad, ..Pose::default() };
    let estimate = slam::truth(&pose);
    let row = |step: u32, scan_id: Option<u32>| {
        let (estimate, time_s) = (estimate.clone(), f64::from(step));
        PoseRow { step, time_s, stop: scan_id.is_some(), scan_id, truth: Pose::default(), estimate }
    };
    for shard in 0..spec.shards() {
        let poses = vec![row(0, Some(0)), row(1, None), row(2, Some(1))];
        let mut writer = ShardWriter::new(&spec, shard).unwrap();
        writer.push(&SceneOutput { poses, ..scene(shard, &SCAN) }).unwrap();
        writer.finish().unwrap().commit(&store).unwrap();
    }
    finalize(&store, &spec).unwrap();
    (dir, store)
}

/// Left, points, and confusion of each square; all lie in one row of squares.
fn told(places: &PlacesReport) -> Vec<(f64, u64, [u64; 4])> {
    let counts =
        |c: Confusion| [c.true_traversable, c.false_untraversable, c.missed_untraversable, c.true_untraversable];
    places.squares.iter().map(|square| (square.left_m, square.points, counts(square.cells))).collect()
}

#[test]
fn exact_judged_cells_stand_where_the_rover_sees_them() {
    let (_dir, store) = posed(std::f64::consts::FRAC_PI_2);
    let judge = |families: &[FamilyFacts]| {
        let report = evaluate(&steps_model(), &store, families, &Options::of(Split::Test)).unwrap();
        assert!(report.files().iter().any(|(name, _)| name == "error-by-place.csv"));
        report.places.unwrap()
    };
    // Centres 0.97, 0.87, 0.77, 0.67 and 0.57 m to the left, in both scans.
    let places = judge(&families());
    assert!(places.squares.iter().all(|square| square.ahead_m == -2.25), "{places:?}");
    assert_eq!(told(&places), [(0.5, 14, [0, 2, 2, 0]), (0.75, 34, [4, 0, 0, 2])]);
    // A levelled map has the rover at its origin and ahead along x: 0.05, 0.15, 0.25 ... m ahead.
    let levelled: Vec<FamilyFacts> =
        families().into_iter().map(|facts| FamilyFacts { frame: CellFrame::FittedPlane, ..facts }).collect();
    let ahead: Vec<(f64, f64, u64)> =
        judge(&levelled).squares.iter().map(|s| (s.ahead_m, s.left_m, s.cells.total())).collect();
    assert_eq!(ahead.iter().map(|square| square.2).sum::<u64>(), 10);
    assert!(ahead.iter().all(|&(ahead_m, left_m, _)| left_m == 0.0 && (0.0..0.5).contains(&ahead_m)), "{ahead:?}");
}

#[test]
fn exact_without_poses_nothing_is_said_of_places() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    assert_eq!(report.places, None);
    assert!(report.files().iter().all(|(name, _)| !name.contains("place")));
}

#[test]
fn exact_the_map_shades_each_square_by_its_rate_where_the_rover_sees_it() {
    let square = |ahead_m, left_m, false_untraversable: u64, missed_untraversable: u64| Square {
        ahead_m,
        left_m,
        cells: Confusion {
            true_traversable: 100 - false_untraversable,
            false_untraversable,
            missed_untraversable,
            true_untraversable: 10,
        },
        points: 300,
    };
    // A square of many false alarms ahead to the left, one of few behind to the right.
    let places = PlacesReport { square_m: 1.0, squares: vec![square(-1.0, -2.0, 3, 0), square(2.0, 1.0, 60, 12)] };
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    let report = Report { places: Some(places), ..report };
    let figures: std::collections::BTreeMap<_, _> = figures::figures(&report).into_iter().collect();
    let svg = &figures["error-by-place.svg"];
    // Panels: points, false alarms, missed. Of false alarms both squares have a rate, the left one is darker and higher up.
    let tiles = |colour: &str| -> Vec<([f64; 2], f64)> {
        let rects = elements(svg, "rect").map(|(head, _)| head).filter(|head| attribute(head, "fill") == colour);
        let tile = |head: &str| (place_of(head), attribute(head, "opacity").parse::<f64>().unwrap());
        rects.filter(|head| attribute(head, "width") != "12").map(tile).collect()
    };
    let false_alarms = tiles("#D97B29");
    let [(few, light), (many, dark)] = false_alarms[..] else { panic!("{false_alarms:?}") };
    assert!(dark > 0.9 && light < 0.6 && many[0] < few[0] && many[1] < few[1], "{false_alarms:?}");
    // Of 10 untraversable cells no rate is told, of 22 one is.
    assert_eq!(tiles("#B01E3C").len(), 1);
    assert_eq!(tiles("#808080").len(), 1);
    for words in ["to 5 %", "above 50 %", "fewer than 20 cells", "to 4"] {
        assert!(elements(svg, "text").any(|(_, there)| there == words), "{words}");
    }
}
