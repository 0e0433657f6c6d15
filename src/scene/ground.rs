//! The `ground` section of a config -> the ground of one scene.
//!
//! In: parameters, drawn rms height and correlation length, streams. Out: [`Ground`]: a polynomial fitted on 1.2 times the
//! yard (the paper's ground), or a raster. Roughness and landforms lie on top and make the ground a raster.
//! A random shape steeper than `max_slope_deg` anywhere in the yard is drawn again, try k at step k of the noise's address.
//! Roughness and landforms are not judged: they are steep on purpose. Nor are files and flat ground, which no second draw
//! would change.

use super::excavation;
use super::field::RandomField;
use super::fit::MIN_NODES;
use super::landforms::{self, Disc};
use super::params::{FileGround, GroundParams, GroundShape, GroundSource, PolynomialShape, RawShape};
use super::polynomial::FIT_MARGIN;
use super::{Ground, Polynomial, Raster, SceneError};
use crate::math;
use crate::random::{Drawn, Purpose, Streams};

/// How often a ground that is too steep is drawn.
const TRIES: u32 = 100;
/// Fit nodes per correlation length; and the most of them a side: below 0.02 yards of correlation length the fit sees a
/// sample of the field, not all of it.
const NODES_PER_LENGTH: f64 = 4.0;
const MAX_NODES: usize = 256;
/// The finest raster: its periodic field of twice the side must fit in memory.
const MAX_CELLS: usize = 4096;
/// Node distance where landforms stand on a fitted ground and nothing else asks for a raster.
const LANDFORM_SPACING_M: f64 = 0.05;

pub(super) fn build(
    params: &GroundParams,
    extent_m: f64,
    drawn: &Drawn,
    streams: &Streams,
) -> Result<Ground, SceneError> {
    check_spacing(params, extent_m)?;
    let shape = match &params.source {
        GroundSource::Flat => surface(&params.shape, extent_m, |_, _| 0.0),
        GroundSource::File(file) => from_file(file, &params.shape, extent_m)?,
        GroundSource::Random(_) => random(params, extent_m, drawn, streams)?,
    };
    Ok(with_details(shape, params, extent_m, drawn, streams))
}

/// Refuses rasters that would not fit in memory.
fn check_spacing(params: &GroundParams, extent_m: f64) -> Result<(), SceneError> {
    let raw = match &params.shape {
        GroundShape::Raw(raw) => Some(raw.spacing_m),
        GroundShape::Polynomial(_) => None,
    };
    for spacing_m in raw.into_iter().chain(params.roughness.as_ref().map(|r| r.spacing_m)) {
        let cells = Raster::cells_of(extent_m, spacing_m);
        if cells > MAX_CELLS {
            return Err(SceneError::TooFine {
                spacing_m,
                cells,
                limit: MAX_CELLS,
                coarsest_m: extent_m / MAX_CELLS as f64,
            });
        }
    }
    Ok(())
}

/// A shape made of a given surface.
fn surface(shape: &GroundShape, extent_m: f64, height_m: impl Fn(f64, f64) -> f64) -> Ground {
    match shape {
        GroundShape::Polynomial(PolynomialShape { degree }) => {
            Ground::Polynomial(Polynomial::fit_surface(extent_m, *degree as usize, MAX_NODES, height_m))
        }
        GroundShape::Raw(RawShape { spacing_m }) => Ground::Raster(Raster::sampled(extent_m, *spacing_m, height_m)),
    }
}

fn from_file(file: &FileGround, shape: &GroundShape, extent_m: f64) -> Result<Ground, SceneError> {
    let fault = |reason: &str| SceneError::GroundFile { path: file.path.clone(), reason: reason.to_string() };
    let raster = file.raster.as_ref().ok_or_else(|| fault("the height map was not read"))?;
    if raster.heights_m.iter().any(|h| !h.is_finite()) {
        return Err(fault("a height is not a finite number"));
    }
    // Stretched over the yard, whatever its own spacing; beyond the border turned about the border point, so that the
    // slope goes on.
    let (x_scale, y_scale) = ((raster.cols - 1) as f64 / extent_m, (raster.rows - 1) as f64 / extent_m);
    let inside = |x: f64, y: f64| {
        let place = |value: f64, scale: f64, origin: f64| origin + value * scale * raster.spacing_m;
        raster.height_m(place(x, x_scale, raster.origin_m.x), place(y, y_scale, raster.origin_m.y))
    };
    let along_x = |x: f64, y: f64| turned(x, extent_m, |x| inside(x, y));
    Ok(surface(shape, extent_m, |x, y| turned(y, extent_m, |y| along_x(x, y))))
}

/// A function of [0, extent] continued beyond its ends by a half turn about the end points.
fn turned(value: f64, extent: f64, f: impl Fn(f64) -> f64) -> f64 {
    let end = value.clamp(0.0, extent);
    if end == value { f(value) } else { 2.0 * f(end) - f(2.0 * end - value) }
}

/// The first of the random shapes that is not too steep.
fn random(params: &GroundParams, extent_m: f64, drawn: &Drawn, streams: &Streams) -> Result<Ground, SceneError> {
    let field = RandomField {
        rms_height_m: drawn[Purpose::GroundRmsHeight],
        correlation_length_m: drawn[Purpose::GroundCorrelationLength],
    };
    let limit = math::tan(params.max_slope_deg.to_radians());
    let mut flattest = f64::INFINITY;
    for step in 0..TRIES {
        let ground = random_shape(&field, &params.shape, extent_m, &streams.at_step(step));
        let slope = match &ground {
            Ground::Polynomial(polynomial) => polynomial.max_slope(),
            Ground::Raster(raster) => raster.max_slope(),
        };
        if slope <= limit {
            return Ok(ground);
        }
        flattest = flattest.min(slope);
    }
    let best_deg = math::atan(flattest).to_degrees();
    Err(SceneError::TooSteep { limit_deg: params.max_slope_deg, best_deg, tries: TRIES })
}

fn random_shape(field: &RandomField, shape: &GroundShape, extent_m: f64, streams: &Streams) -> Ground {
    let noise = streams.open(Purpose::GroundNoise);
    match shape {
        GroundShape::Polynomial(PolynomialShape { degree }) => {
            let side_m = FIT_MARGIN * extent_m;
            let wanted = (side_m / field.correlation_length_m * NODES_PER_LENGTH).ceil() as usize;
            let nodes = wanted.clamp(MIN_NODES, MAX_NODES);
            let heights_m = field.cut_out(side_m / nodes as f64, nodes, &noise);
            Ground::Polynomial(Polynomial::fit(extent_m, *degree as usize, nodes, &heights_m))
        }
        GroundShape::Raw(RawShape { spacing_m }) => Ground::Raster(raster(field, extent_m, *spacing_m, &noise)),
    }
}

/// A random field as a raster of the yard.
fn raster(field: &RandomField, extent_m: f64, spacing_m: f64, noise: &crate::random::Stream) -> Raster {
    let nodes = Raster::cells_of(extent_m, spacing_m) + 1;
    Raster::of_yard(extent_m, nodes, over_yard(field, extent_m, nodes, noise))
}

/// A random field's heights at so many nodes along each side of the yard.
fn over_yard(field: &RandomField, extent_m: f64, nodes: usize, noise: &crate::random::Stream) -> Vec<f64> {
    field.cut_out(extent_m / (nodes - 1) as f64, nodes, noise)
}

/// The shape with roughness and landforms on top, where the config names them.
fn with_details(shape: Ground, params: &GroundParams, extent_m: f64, drawn: &Drawn, streams: &Streams) -> Ground {
    let landforms = landforms::place(&params.features, extent_m, streams);
    let excavations = excavation::place(&params.features, extent_m, streams);
    if params.roughness.is_none() && landforms.is_empty() && excavations.is_empty() {
        return shape;
    }
    let own_m = match &shape {
        Ground::Raster(raster) => raster.spacing_m,
        Ground::Polynomial(_) => f64::INFINITY,
    };
    let wanted_m = params.roughness.as_ref().map_or(LANDFORM_SPACING_M, |roughness| roughness.spacing_m);
    let spacing_m = wanted_m.min(own_m).max(extent_m / MAX_CELLS as f64);
    let nodes_m = Raster::nodes_m(extent_m, spacing_m);
    let mut heights_m = match &shape {
        Ground::Polynomial(polynomial) => polynomial.heights_on_grid(&nodes_m),
        Ground::Raster(raster) => Raster::heights_on_grid(&nodes_m, |x, y| raster.height_m(x, y)),
    };
    for landform in &landforms {
        add(&mut heights_m, &nodes_m, landform.reach(), |x, y| landform.height_m(x, y));
    }
    for excavation in &excavations {
        add(&mut heights_m, &nodes_m, excavation.reach(), |x, y| excavation.height_m(x, y));
    }
    if params.roughness.is_some() {
        let field = RandomField {
            rms_height_m: drawn[Purpose::RoughnessRmsHeight],
            correlation_length_m: drawn[Purpose::RoughnessCorrelationLength],
        };
        let rough = over_yard(&field, extent_m, nodes_m.len(), &streams.open(Purpose::RoughnessNoise));
        heights_m.iter_mut().zip(rough).for_each(|(height, rough)| *height += rough);
    }
    Ground::Raster(Raster::of_yard(extent_m, nodes_m.len(), heights_m))
}

/// Adds what a form adds, at the nodes that it may reach.
fn add(heights_m: &mut [f64], nodes_m: &[f64], reach: Disc, height_m: impl Fn(f64, f64) -> f64) {
    let Disc { centre_m, radius_m } = reach;
    let reached = |middle_m: f64| {
        let nodes_below = |limit_m: f64| nodes_m.partition_point(|&node_m| node_m < limit_m);
        nodes_below(middle_m - radius_m)..nodes_below(middle_m + radius_m)
    };
    let cols = reached(centre_m.x);
    for row in reached(centre_m.y) {
        let heights_m = &mut heights_m[row * nodes_m.len()..][cols.clone()];
        for (height, &x_m) in heights_m.iter_mut().zip(&nodes_m[cols.clone()]) {
            *height += height_m(x_m, nodes_m[row]);
        }
    }
}

#[cfg(test)]
mod tests {
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
        let source =
            RandomGround { rms_height_m: rms_height_m.into(), correlation_length_m: correlation_length_m.into() };
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
            let Ground::Polynomial(ground) = grown(&GroundParams::default(), scene).unwrap() else {
                panic!("not fitted")
            };
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
            let (formed, dug) = (
                landforms::place(&features, EXTENT_M, &streams(2)),
                excavation::place(&features, EXTENT_M, &streams(2)),
            );
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
            let file =
                FileGround { path: "plane.npy".into(), height_m: None, blake3: None, raster: Some(raster.clone()) };
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
}
