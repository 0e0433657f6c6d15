use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, Int8Array, Int32Array};

use super::*;

fn batch(columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
    RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, array)| (name, array, true))).unwrap()
}

#[test]
fn exact_labels_and_truth_are_types_of_the_core_and_nulls_are_unknown() {
    let batch = batch(vec![
        (LABEL, Arc::new(Int8Array::from(vec![Some(1), None, Some(0)]))),
        (CLASS, Arc::new(Int8Array::from(vec![Some(3), None, Some(-1)]))),
        (OBSTACLE_POINTS, Arc::new(Int32Array::from(vec![Some(7), None, Some(2)]))),
        (PROTRUSION_M, Arc::new(Float32Array::from(vec![0.5, 0.25, 0.0]))),
    ]);
    let cells = CellBatch::of(batch);
    let labels = cells.labels().unwrap();
    let expected = [Some(Label::Untraversable), None, Some(Label::Traversable)];
    assert_eq!([0, 1, 2].map(|row| labels.at(row)), expected);
    let truth = cells.truth(&[CLASS, OBSTACLE_POINTS]).unwrap();
    let of = |obstacle_points, class, protrusion_m| CellTruth {
        obstacle_points,
        class,
        protrusion_m,
        ..CellTruth::default()
    };
    let expected = [of(7, Some(Class::Trunk), 0.5), of(0, None, 0.25), of(2, None, 0.0)];
    assert_eq!([0, 1, 2].map(|row| truth.at(row)), expected);
    assert_eq!(cells.truth(&[SLOPE_RAD]).unwrap_err(), "it has no column 'truth_slope_rad'");
}

#[test]
fn exact_the_truth_of_the_pose_comes_back_with_its_nulls() {
    let real = |values: Vec<Option<f32>>| Arc::new(Float32Array::from(values)) as ArrayRef;
    let batch = batch(vec![
        (HEADINGS, Arc::new(Int32Array::from(vec![Some(255), Some(0), None, Some(300)])) as ArrayRef),
        (COST, real(vec![Some(0.25), Some(1.0), None, Some(0.5)])),
        (TILT_RAD, real(vec![Some(0.1), None, None, None])),
        (CLEARANCE_M, real(vec![Some(0.05), None, None, None])),
    ]);
    let cells = CellBatch::of(batch);
    let truth = cells.truth(&[]).unwrap();
    let worst = Some(PoseWorst { tilt_rad: 0.1, clearance_m: 0.05 });
    let expected = [
        Some(PoseTruth { headings: 255, cost: 0.25, worst }),
        Some(PoseTruth { headings: 0, cost: 1.0, worst: None }),
        None,
        None,
    ];
    assert_eq!([0, 1, 2, 3].map(|row| truth.at(row).pose), expected);
}

#[test]
fn exact_rows_with_a_feature_that_is_null_or_not_finite_are_not_appended() {
    let batch = batch(vec![
        ("a", Arc::new(Float32Array::from(vec![Some(1.0), None, Some(3.0), Some(f32::INFINITY)]))),
        ("b", Arc::new(Float32Array::from(vec![5.0, 6.0, f32::NAN, 8.0]))),
    ]);
    let cells = CellBatch::of(batch);
    let features = cells.features(["b", "a"]).unwrap();
    let mut out = vec![0.5];
    assert_eq!([0, 1, 2, 3].map(|row| features.append_finite(row, &mut out)), [true, false, false, false]);
    assert_eq!(out, [0.5, 5.0, 1.0]);
}

#[test]
fn extreme_numbers_that_stand_for_nothing_and_columns_of_other_types_are_refused_by_name() {
    let one =
        |name: &str, number: i8| batch(vec![(name, Arc::new(Int8Array::from(vec![Some(0), None, Some(number)])))]);
    for number in [-1, 2, 7, i8::MIN] {
        let refused = CellBatch::of(one(LABEL, number)).labels().unwrap_err();
        assert_eq!(refused, format!("its column 'label' holds {number}; labels are 0, 1 or null"));
    }
    for number in [-2, 7, i8::MAX] {
        let refused = CellBatch::of(one(CLASS, number)).truth(&[]).unwrap_err();
        assert_eq!(refused, format!("its column 'truth_class' holds {number}; classes are 0 to 6, -1 or null"));
    }
    assert_eq!(CellBatch::of(one(POINTS, 0)).points().unwrap_err(), "its column 'points' is Int8, not Int32");
    assert_eq!(CellBatch::of(one(POINTS, 0)).labels().unwrap_err(), "it has no column 'label'");
}
