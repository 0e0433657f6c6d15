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
mod tests;
