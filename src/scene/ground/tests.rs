use std::sync::Arc;

use super::super::params::{ExcavationParams, FeatureParams, LandformParams, RandomGround, RoughnessParams};
use super::*;
use crate::geometry::DVec2;
use crate::random::Stage;

const EXTENT_M: f64 = 20.0;

fn streams(scene: u64) -> Streams {
    Streams { seed: 3, scene, attempt: 0, stage: Stage::Scene, step: 0 }
}

fn grown(params: &GroundParams, scene: u64) -> Result<Ground, SceneError> {
    let scene_params = super::super::SceneParams {
        extent_m: EXTENT_M,
        ground: params.clone(),
        rocks: None,
        boxes: None,
        trees: None,
        vegetation: None,
    };
    let drawn = Drawn::draw(&streams(scene), scene_params.dists());
    build(params, EXTENT_M, &drawn, &streams(scene))
}

fn random_ground(rms_height_m: f64, correlation_length_m: f64, shape: GroundShape) -> GroundParams {
    let source = RandomGround { rms_height_m: rms_height_m.into(), correlation_length_m: correlation_length_m.into() };
    GroundParams { source: GroundSource::Random(source), shape, ..GroundParams::default() }
}

fn polynomial(degree: u32) -> GroundShape {
    GroundShape::Polynomial(PolynomialShape { degree })
}

fn raw(spacing_m: f64) -> GroundShape {
    GroundShape::Raw(RawShape { spacing_m })
}

#[test]
fn law_grounds_of_the_default_config_keep_their_slope() {
    let limit = math::tan(25.0_f64.to_radians());
    for scene in 0..50 {
        let Ground::Polynomial(ground) = grown(&GroundParams::default(), scene).unwrap() else { panic!("not fitted") };
        for k in 0..400 {
            let (x, y) = (f64::from(k % 20) * 20.0 / 19.0, f64::from(k / 20) * 20.0 / 19.0);
            assert!(ground.gradient(x, y).length() <= limit);
        }
    }
}

#[test]
fn law_a_ground_that_is_too_steep_is_drawn_again_and_then_refused() {
    // Slope rms 5.7 degrees per axis: some of these yards exceed 15 degrees at the first draw, none in 100.
    let mut params = random_ground(0.5, 7.0, polynomial(5));
    params.max_slope_deg = 60.0;
    let steepest = |ground: &Ground| match ground {
        Ground::Polynomial(polynomial) => polynomial.max_slope(),
        Ground::Raster(raster) => raster.max_slope(),
    };
    let limit = math::tan(15.0_f64.to_radians());
    let mut redrawn = 0;
    for scene in 0..20 {
        let first = grown(&GroundParams { max_slope_deg: 60.0, ..params.clone() }, scene).unwrap();
        let kept = grown(&GroundParams { max_slope_deg: 15.0, ..params.clone() }, scene).unwrap();
        assert!(steepest(&kept) <= limit);
        if steepest(&first) <= limit {
            assert_eq!(first.height_m(3.0, 4.0), kept.height_m(3.0, 4.0));
        } else {
            redrawn += 1;
            assert_ne!(first.height_m(3.0, 4.0), kept.height_m(3.0, 4.0));
        }
    }
    assert!(redrawn > 0, "no yard was steep enough to test the second draw");
    let steep = GroundParams { max_slope_deg: 1.0, ..params };
    let Err(SceneError::TooSteep { limit_deg, best_deg, tries }) = grown(&steep, 0) else { panic!("not refused") };
    assert!(limit_deg == 1.0 && tries == TRIES && best_deg > 1.0 && best_deg < 30.0);
}

#[test]
fn law_the_fit_keeps_to_its_field() {
    // Correlation length 0.4 of the fitted square: degree 12 retains all but 10^-3 of the variance.
    let field = RandomField { rms_height_m: 1.0, correlation_length_m: 9.6 };
    let noise = streams(1).open(Purpose::GroundNoise);
    let Ground::Polynomial(fit) = random_shape(&field, &polynomial(12), EXTENT_M, &streams(1)) else { panic!() };
    let heights_m = field.cut_out(24.0 / 64.0, 64, &noise);
    for (k, height) in heights_m.iter().enumerate() {
        let place = |k: usize| -2.0 + (k as f64 + 0.5) * 24.0 / 64.0;
        let (x, y) = (place(k % 64), place(k / 64));
        assert!((fit.height_m(x, y) - height).abs() < 0.05, "at {x}, {y}: {} {height}", fit.height_m(x, y));
    }
}

#[test]
fn law_roughness_and_landforms_add_to_an_unmoved_shape() {
    let plain = random_ground(0.2, 8.0, polynomial(5));
    let shape = grown(&plain, 4).unwrap();
    let landform =
        LandformParams { count: 2.0.into(), height_m: 0.3.into(), width_m: 1.5.into(), length_m: Some(6.0.into()) };
    let roughness = RoughnessParams { rms_height_m: 0.02.into(), correlation_length_m: 0.5.into(), spacing_m: 0.1 };
    let rough = GroundParams { roughness: Some(roughness), ..plain.clone() };
    let banked = GroundParams { features: vec![FeatureParams::Ridge(landform.clone())], ..plain.clone() };
    let both = GroundParams {
        features: vec![FeatureParams::Crater(landform.clone()), FeatureParams::Ridge(landform)],
        ..rough.clone()
    };
    let [rough, banked, both] = [rough, banked, both].map(|params| grown(&params, 4).unwrap());
    let (mut sum, mut raised) = (0.0, 0);
    let Ground::Raster(raster) = &rough else { panic!("roughness makes a raster") };
    for (k, height) in raster.heights_m.iter().enumerate() {
        let (x, y) = ((k % raster.cols) as f64 * raster.spacing_m, (k / raster.cols) as f64 * raster.spacing_m);
        let difference = height - shape.height_m(x, y);
        sum += difference * difference;
        let bank = banked.height_m(x, y) - shape.height_m(x, y);
        raised += usize::from(bank > 0.1);
        // Within the raster's own sampling: the ridge stands where it stood, a crater added or not.
        assert!(bank > -1e-3);
    }
    // 1600 correlation areas: the rms scatters by 2 %.
    let rms = (sum / raster.heights_m.len() as f64).sqrt();
    assert!((rms / 0.02 - 1.0).abs() < 0.1, "{rms}");
    assert!(raised > 0 && both.height_m(1.0, 1.0).is_finite());
}

#[test]
fn equal_nodes_of_forms_added_where_they_reach_and_of_all_forms_everywhere() {
    let landform = |length_m: Option<f64>| LandformParams {
        count: 4.0.into(),
        height_m: 0.3.into(),
        width_m: crate::random::Dist::Law(crate::random::Law::Uniform([0.3, 3.0])),
        length_m: length_m.map(Into::into),
    };
    let excavated = |length_m: Option<f64>| ExcavationParams {
        count: 4.0.into(),
        depth_m: 0.5.into(),
        width_m: crate::random::Dist::Law(crate::random::Law::Uniform([0.3, 3.0])),
        length_m: length_m.map(Into::into),
        rounding_m: crate::random::Dist::Law(crate::random::Law::Uniform([0.05, 1.0])),
        lip_m: 0.05.into(),
    };
    for length_m in [None, Some(4.0)] {
        let features = vec![
            FeatureParams::Ridge(landform(length_m)),
            FeatureParams::Step(landform(length_m)),
            FeatureParams::Ditch(landform(length_m)),
            FeatureParams::Crater(landform(None)),
            FeatureParams::Trench(excavated(length_m)),
            FeatureParams::Hole(excavated(None)),
            FeatureParams::DropOff(excavated(length_m)),
        ];
        let (formed, dug) =
            (landforms::place(&features, EXTENT_M, &streams(2)), excavation::place(&features, EXTENT_M, &streams(2)));
        assert_eq!((formed.len(), dug.len()), (16, 12));
        for shape in [polynomial(5), raw(0.25)] {
            let plain = random_ground(0.2, 8.0, shape);
            let under = grown(&plain, 2).unwrap();
            let params = GroundParams { features: features.clone(), ..plain };
            let Ground::Raster(raster) = grown(&params, 2).unwrap() else { panic!("forms make a raster") };
            let nodes_m = Raster::nodes_m(EXTENT_M, raster.spacing_m);
            for (k, height) in raster.heights_m.iter().enumerate() {
                let (x, y) = (nodes_m[k % raster.cols], nodes_m[k / raster.cols]);
                let formed = formed.iter().fold(under.height_m(x, y), |height, form| height + form.height_m(x, y));
                let whole = dug.iter().fold(formed, |height, form| height + form.height_m(x, y));
                assert_eq!(height.to_bits(), whole.to_bits(), "at {x}, {y}");
            }
        }
    }
}

#[test]
fn equal_landforms_of_one_kind_whatever_other_kinds_there_are() {
    let landform = LandformParams { count: 3.0.into(), height_m: 0.3.into(), width_m: 1.5.into(), length_m: None };
    let ridge = FeatureParams::Ridge(landform.clone());
    let alone = landforms::place(std::slice::from_ref(&ridge), EXTENT_M, &streams(0));
    let step = FeatureParams::Step(landform);
    let among = landforms::place(&[step.clone(), ridge, step], EXTENT_M, &streams(0));
    for k in 0..3 {
        assert_eq!(format!("{:?}", alone[k]), format!("{:?}", among[3 + k]));
    }
}

#[test]
fn exact_a_plane_from_a_file_is_the_plane() {
    // 5 x 3 nodes of a plane, stretched over the yard: z = 0.5 + 0.1 x - 0.05 y.
    let heights_m = (0..15).map(|k| 0.5 + 0.1 * 5.0 * f64::from(k % 5) - 0.05 * 10.0 * f64::from(k / 5)).collect();
    let raster = Arc::new(Raster::new(DVec2::ZERO, 1.0, 3, 5, heights_m));
    for shape in [polynomial(4), raw(0.5)] {
        let file = FileGround { path: "plane.npy".into(), height_m: None, blake3: None, raster: Some(raster.clone()) };
        let params = GroundParams { source: GroundSource::File(file), shape, ..GroundParams::default() };
        let ground = grown(&params, 0).unwrap();
        for (x, y) in [(0.0, 0.0), (20.0, 20.0), (7.3, 1.9)] {
            assert!((ground.height_m(x, y) - (0.5 + 0.1 * x - 0.05 * y)).abs() < 1e-12);
        }
    }
}

#[test]
fn extreme_files_that_are_missing_or_not_finite_are_refused() {
    let bad = Raster::new(DVec2::ZERO, 1.0, 2, 2, vec![0.0, f64::NAN, 0.0, 0.0]);
    for raster in [None, Some(Arc::new(bad))] {
        let file = FileGround { path: "bad.npy".into(), height_m: None, blake3: None, raster };
        let params = GroundParams { source: GroundSource::File(file), ..GroundParams::default() };
        assert!(matches!(grown(&params, 0), Err(SceneError::GroundFile { .. })));
    }
    let fine = GroundParams { shape: raw(0.001), ..GroundParams::default() };
    assert!(matches!(grown(&fine, 0), Err(SceneError::TooFine { cells: 20_000, .. })));
}

#[test]
fn extreme_fields_from_flat_to_wild_are_finite_or_refused() {
    for shape in [polynomial(2), polynomial(12), raw(0.25)] {
        for rms_height_m in [0.0, 1e-9, 10.0] {
            for correlation_length_m in [0.05, 0.25, 8.0, 2000.0] {
                let mut params = random_ground(rms_height_m, correlation_length_m, shape.clone());
                params.max_slope_deg = 60.0;
                match grown(&params, 0) {
                    Ok(ground) => {
                        for (x, y) in [(0.0, 0.0), (20.0, 20.0), (0.0, 20.0), (10.1, 3.3)] {
                            let (height, gradient) = ground.height_and_gradient(x, y);
                            assert!(height.is_finite() && gradient.length() < 1.74, "{height} {gradient}");
                        }
                    }
                    Err(SceneError::TooSteep { best_deg, .. }) => assert!(rms_height_m == 10.0 && best_deg > 60.0),
                    Err(other) => panic!("{other}"),
                }
            }
        }
    }
}
