//! Cells without points, over a trench that beams cross: which there are, what they hold, and that the others stay as they are.

use super::*;
use crate::cells::params::{BeamParams, CurvatureParams, LocalHeightParams, SurroundingsParams, UnseenParams};
use crate::geometry::{CellIndex, GridSpec};

/// Level ground with a trench across x, from 5 to 5.6 m, half a metre deep.
fn trenched() -> Scene {
    let height = |x: f64, _: f64| if (5.0..5.6).contains(&x) { -0.5 } else { 0.0 };
    Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, 0.02, height)))
}

/// What a fan of beams from (2, 5, 1) meets of upright walls, a level floor and the ground, from the sensor.
fn swept() -> Vec<(DVec3, i32)> {
    let mut points = Vec::new();
    for azimuth in (-40..=40).map(|k| f64::from(k) * 0.25) {
        for elevation in (0..140).map(|k| -40.0 + 0.25 * f64::from(k)) {
            let (sin, cos) = math::sin_cos(azimuth.to_radians());
            let fall = -math::tan(elevation.to_radians());
            // Range where the beam is at x, and how low it is there.
            let at_x = |x: f64| (x - 2.0) / cos;
            let flat = 1.0 / fall;
            let range = if flat < at_x(5.0) || flat > at_x(5.6) && fall * at_x(5.6) < 1.0 {
                flat
            } else {
                (1.5 / fall).min(at_x(5.6))
            };
            if range < 6.5 {
                points.push((DVec3::new(range * cos, range * sin, -fall * range), -1));
            }
        }
    }
    points
}

fn params(unseen: bool) -> CellParams {
    CellParams {
        size_m: 0.1,
        local_height: Some(LocalHeightParams { plane: true, ..LocalHeightParams::default() }),
        surroundings: Some(SurroundingsParams { radii_m: vec![0.2] }),
        curvature: Some(CurvatureParams { radii_m: vec![0.4] }),
        beams: Some(BeamParams { radii_m: vec![0.2] }),
        unseen: unseen.then(UnseenParams::default),
        labels: LabelParams { max_drop_m: Some(0.2), ..LabelParams::default() },
        ..CellParams::default()
    }
}

#[test]
fn exact_a_row_without_points_has_no_intensity_and_the_sigmas_of_every_row() {
    let (scene, points) = (trenched(), swept());
    let pose = Pose { position_m: DVec3::new(2.0, 5.0, 1.0), ..Pose::default() };
    let (mut sweep, estimate) = (sweep_of(&points), estimate_at(pose));
    sweep.returns.intensity = Some(vec![0.5; points.len()]);
    let scan = scan_at(&sweep, &estimate, &Transform::IDENTITY, pose.transform());
    let cells = bin(&params(true), &[scan], 0.1, 1e9, &scene, &mut Scratch::default());
    let columns = feature_columns(&params(true), true);
    assert_eq!(cells.features.len(), cells.rows.len() * columns.len());
    let of_pose = columns.iter().position(|column| column.name == "sigma_z_m").unwrap();
    let gap = columns.iter().position(|column| column.name == "gap_length_m").unwrap();
    assert_eq!(gap, of_pose + 8);
    let mut unseen = 0;
    for (row, features) in cells.rows.iter().zip(cells.features.chunks_exact(columns.len())) {
        assert_eq!(features[of_pose..][..6], [3.0, 4.0, 5.0, 1.0, 2.0, 6.0]);
        let [mean, variance] = [features[gap - 2], features[gap - 1]];
        if row.points == 0 {
            unseen += 1;
            assert_eq!((mean, variance), (0.0, 0.0));
            assert!(features[gap] > 0.0, "a long gap is near each of them");
        } else {
            assert!(mean > 0.0);
        }
    }
    assert!(unseen > 0);
}

#[test]
fn equal_cells_with_points_are_as_they_were_and_those_over_a_trench_are_there() {
    let (scene, points) = (trenched(), swept());
    let pose = Pose { position_m: DVec3::new(2.0, 5.0, 1.0), ..Pose::default() };
    let [before, after] = [false, true].map(|unseen| bin_one(&params(unseen), &points, pose, &scene));
    let [narrow, wide] = [false, true].map(|unseen| feature_columns(&params(unseen), false).len());
    assert_eq!((wide - narrow, after.rows.len() * wide), (16, after.features.len()));
    let seen: Vec<usize> = (0..after.rows.len()).filter(|&k| after.rows[k].points > 0).collect();
    assert_eq!(seen.len(), before.rows.len());
    for (k, &at) in seen.iter().enumerate() {
        assert_eq!(after.rows[at], before.rows[k]);
        assert_eq!(after.features[at * wide..][..narrow], before.features[k * narrow..][..narrow]);
    }
    assert!(after.rows.is_sorted_by_key(|row| row.index) && after.features.iter().all(|value| value.is_finite()));
    // Each empty cell over the trench and within the fan has a row, and falls; of the others some lie around it.
    let found = |row: i32, col: i32| {
        after.rows.binary_search_by_key(&CellIndex { row, col }, |row| row.index).ok().map(|at| &after.rows[at])
    };
    let mut empty = 0;
    for row in 46..54 {
        for col in 50..56 {
            let cell = found(row, col).unwrap_or_else(|| panic!("no row for {row}, {col}"));
            assert!(cell.untraversable() && cell.truth.class == Some(Class::Ground), "{cell:?}");
            assert!((cell.truth.drop_m - 0.5).abs() < 1e-6);
            empty += usize::from(cell.points == 0);
        }
    }
    assert!(empty > 30, "{empty}");
    for row in &after.rows {
        let (x_m, _) = GridSpec { size_m: 0.1 }.centre_m(row.index);
        let (lip, plain) = ((4.75..5.85).contains(&x_m), !(4.65..5.95).contains(&x_m));
        assert!(!lip || row.untraversable(), "{row:?}");
        assert!(!plain || !row.untraversable(), "{row:?}");
    }
}

#[test]
fn exact_a_cell_without_points_has_the_height_of_its_line_and_the_local_ground_of_the_cells_around() {
    let (scene, points) = (trenched(), swept());
    let pose = Pose { position_m: DVec3::new(2.0, 5.0, 1.0), ..Pose::default() };
    let cells = bin_one(&params(true), &points, pose, &scene);
    let columns = feature_columns(&params(true), false);
    let value = |at: usize, name: &str| {
        let column = columns.iter().position(|column| column.name == name).expect("a column");
        f64::from(cells.features[at * columns.len() + column])
    };
    let (mut checked, mut bent) = (0, 0);
    for (at, row) in cells.rows.iter().enumerate().filter(|(_, row)| row.points == 0) {
        // Between the lip, level with the wheels a metre below the rover's z, and the far wall or the floor.
        let height_m = value(at, "mean_height_m");
        let (near_m, far_m) = (value(at, "gap_near_height_m"), value(at, "gap_far_height_m"));
        if value(at, "gap_from_m") > 0.15 && value(at, "gap_to_m") > 0.15 {
            assert!(height_m <= near_m + 1e-6 && height_m >= far_m - 0.05, "{height_m} {near_m} {far_m}");
            assert!(value(at, "gap_length_m") > 0.3 && value(at, "gap_drop_m") > 0.05);
            checked += 1;
        }
        assert_eq!(
            [value(at, "point_count"), value(at, "height_variance_m2"), value(at, "height_difference_m")],
            [0.0; 3]
        );
        let (x_m, y_m) = GridSpec { size_m: 0.1 }.centre_m(row.index);
        assert!((f64::from(row.range_m) - math::hypot(x_m - 2.0, y_m - 5.0)).abs() < 1e-6);
        let mut around: Vec<f64> = (0..cells.rows.len())
            .filter(|&other| {
                let there = cells.rows[other].index;
                let (rows, cols) = (there.row - row.index.row, there.col - row.index.col);
                cells.rows[other].points > 0 && rows * rows + cols * cols <= 100
            })
            .map(|other| value(other, "mean_height_m"))
            .chain([height_m])
            .collect();
        around.sort_by(f64::total_cmp);
        let rank = (0.1 * around.len() as f64).ceil().max(1.0) as usize - 1;
        assert!((value(at, "local_height_m") - (height_m - around[rank])).abs() < 1e-5);
        // Along the trench its empty cells have no pair with points, across it they have walls and ground to both sides.
        let bend_m = [value(at, "curvature_least_40cm_m"), value(at, "curvature_most_40cm_m")];
        assert!(bend_m[0] <= bend_m[1] && bend_m.iter().all(|bend_m| bend_m.abs() < 2.0), "{bend_m:?}");
        bent += usize::from(bend_m[1] > 0.1);
        let near = |there: CellIndex| (there.row - row.index.row).abs() <= 2 && (there.col - row.index.col).abs() <= 2;
        let near = cells.rows.iter().filter(|other| other.points > 0 && near(other.index)).count();
        assert!((value(at, "surroundings_cover_20cm") - near as f64 / 25.0).abs() < 1e-6);
        // Beams came back from before the cell and from behind it, or from beside it within its width.
        let (before_m, behind_m) = (value(at, "beams_before_m"), value(at, "beams_behind_m"));
        assert!(before_m < 2.0 && (0.06..5.0).contains(&behind_m), "{before_m} {behind_m}");
    }
    assert!(checked > 20 && bent > 20, "{checked} {bent}");
}
