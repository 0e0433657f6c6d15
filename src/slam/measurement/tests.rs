use super::*;
use crate::geometry::{DVec3, Pose};

fn mounting() -> Mounting {
    let pose = Pose { position_m: DVec3::new(0.3, -0.1, 0.8), roll_rad: 0.1, pitch_rad: 0.2, yaw_rad: -0.4 };
    Mounting::new(&pose.transform())
}

const POSES: [Vector<6>; 4] = [
    [0.0; 6],
    [1.0, -2.0, 0.3, 0.2, -0.3, 3.1],
    [-4.0, 0.5, 0.1, -0.7, 0.7, -1.9],
    [10.0, 3.0, -2.0, 0.75, -0.75, 0.01],
];

#[test]
fn exact_jacobians_against_central_differences() {
    let mounting = mounting();
    for pose in POSES {
        for landmark in [[2.0, 1.0, 0.4], [-3.0, 2.5, -0.7], [0.5, -6.0, 1.0]] {
            let prediction = SensorView::new(&pose, &mounting).predict(&landmark).expect("usable");
            let step = 1e-6;
            let slope = |plus: Option<Prediction>, minus: Option<Prediction>| {
                innovation(&plus.expect("usable").polar, &minus.expect("usable").polar).map(|v| v / (2.0 * step))
            };
            for i in 0..6 {
                let moved = |by: f64| {
                    let mut pose = pose;
                    pose[i] += by;
                    SensorView::new(&pose, &mounting).predict(&landmark)
                };
                for (r, got) in slope(moved(step), moved(-step)).iter().enumerate() {
                    let want = prediction.by_pose[r][i];
                    assert!((got - want).abs() < 1e-6 * want.abs().max(1.0), "pose {i}, row {r}: {got} {want}");
                }
            }
            for i in 0..3 {
                let moved = |by: f64| {
                    let mut landmark = landmark;
                    landmark[i] += by;
                    SensorView::new(&pose, &mounting).predict(&landmark)
                };
                for (r, got) in slope(moved(step), moved(-step)).iter().enumerate() {
                    let want = prediction.by_landmark[r][i];
                    assert!((got - want).abs() < 1e-6 * want.abs().max(1.0), "landmark {i}, row {r}: {got} {want}");
                }
            }
        }
    }
}

#[test]
fn equal_prediction_and_the_geometry_of_transforms() {
    let rover_from_sensor =
        Pose { position_m: DVec3::new(0.3, -0.1, 0.8), pitch_rad: 0.2, ..Pose::default() }.transform();
    for p in POSES {
        let pose = Pose { position_m: DVec3::new(p[0], p[1], p[2]), roll_rad: p[3], pitch_rad: p[4], yaw_rad: p[5] };
        let world_from_sensor = pose.transform() * rover_from_sensor;
        let q = DVec3::new(2.0, -1.0, 0.5);
        let landmark = world_from_sensor.point(q).to_array();
        let view = SensorView::new(&p, &Mounting::new(&rover_from_sensor));
        let polar = view.predict(&landmark).expect("usable").polar;
        assert!((polar[0] - q.length()).abs() < 1e-12);
        assert!((polar[1] - math::atan2(q.y, q.x)).abs() < 1e-12);
        let (back, _) = view.locate(&polar, &[1.0; 3]);
        assert!((0..3).all(|i| (back[i] - landmark[i]).abs() < 1e-12), "{back:?} {landmark:?}");
    }
}

#[test]
fn exact_first_landmark_covariance_maps_back_to_the_measurement_noise() {
    let variances = [0.01, 0.002, 0.003];
    let view = SensorView::new(&POSES[1], &mounting());
    let polar = [3.0, 0.4, -0.2];
    let (landmark, covariance) = view.locate(&polar, &variances);
    let h = view.predict(&landmark).expect("usable").by_landmark;
    let back = product(&product(&h, &covariance), &transpose(&h));
    for r in 0..3 {
        for c in 0..3 {
            let want = if r == c { variances[r] } else { 0.0 };
            assert!((back[r][c] - want).abs() < 1e-15, "{back:?}");
        }
    }
}

#[test]
fn extreme_features_without_a_bearing_are_unusable() {
    assert!(!is_usable(&[0.1, 0.0, 0.0]));
    assert!(!is_usable(&[2.0, 0.0, 1.5]));
    assert!(!is_usable(&[f64::NAN, 0.0, 0.0]));
    assert!(!is_usable(&[f64::INFINITY, 0.0, 0.0]));
    let identity = Mounting::new(&Transform::IDENTITY);
    assert!(SensorView::new(&[0.0; 6], &identity).predict(&[0.0, 0.0, 1.0]).is_none());
}
