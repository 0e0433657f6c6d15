//! Settings -> a filter.

use super::backprop::Backprop;
use super::diagonal::Diagonal;
use super::ekf::Ekf;
use super::groups::groups;
use super::guarded::CheckedFilter;
use super::kronecker::Kronecker;
use super::lanes::{Isa, Real};
use super::linearised::Linearised;
use super::noise::Noise;
use super::ud::Ud;
use super::ukf::{MOST_WEIGHTS, Ukf};
use super::{Filter, FilterError};
use crate::corpus::limits::COVARIANCE_BYTES;
use crate::train::Layout;
use crate::train::params::{DecoupledParams, EkfParams, FilterParams, Groups, Precision};

/// The filter that the settings ask for, at its start. Refuses, with the reason, settings that it cannot hold. `clip`: what the
/// inputs were clipped to; rows that reach it are counted.
pub fn build(params: &FilterParams, layout: &Layout, clip: f64) -> Result<Box<dyn Filter>, FilterError> {
    check(params, layout)?;
    Ok(build_unchecked(params, layout, clip))
}

/// As [`build`], without the check of ranges: to see what the guards do at settings that it refuses.
pub fn build_unchecked(params: &FilterParams, layout: &Layout, clip: f64) -> Box<dyn Filter> {
    match params {
        FilterParams::Ekf(ekf) => match ekf.precision {
            Precision::F32 => one_group::<f32>(ekf, layout, clip),
            Precision::F64 => one_group::<f64>(ekf, layout, clip),
        },
        FilterParams::Decoupled(decoupled) => match decoupled.precision {
            Precision::F32 => several_groups::<f32>(decoupled, layout, clip),
            Precision::F64 => several_groups::<f64>(decoupled, layout, clip),
        },
        FilterParams::Backprop(backprop) => {
            Box::new(Linearised::new(Backprop { rate: backprop.rate }, Noise::none(), layout.weights(), clip))
        }
        FilterParams::Ukf(ukf) => Box::new(Ukf::new(ukf, layout.weights(), clip)),
        FilterParams::Kronecker(kronecker) => Box::new(Kronecker::new(kronecker, layout, clip)),
    }
}

fn one_group<T: Real>(params: &EkfParams, layout: &Layout, clip: f64) -> Box<dyn Filter> {
    let (noise, size, isa) = (Noise::of(&params.noise), layout.weights(), Isa::detect());
    if params.robust {
        Box::new(Linearised::new(Ud::<T>::new(size, noise.p0, params.batch, isa), noise, size, clip))
    } else {
        let plain = Ekf::<T>::new("ekf", groups(layout, Groups::One), noise.p0, params.batch, isa);
        Box::new(Linearised::new(CheckedFilter::new(plain, isa), noise, size, clip))
    }
}

fn several_groups<T: Real>(params: &DecoupledParams, layout: &Layout, clip: f64) -> Box<dyn Filter> {
    let (noise, size) = (Noise::of(&params.noise), layout.weights());
    let name = match params.groups {
        Groups::One => "decoupled-one",
        Groups::Layer => "decoupled-layer",
        Groups::Node => "decoupled-node",
        Groups::InputNode => "decoupled-input_node",
        Groups::Weight => return Box::new(Linearised::new(Diagonal::new(size, noise.p0, 1), noise, size, clip)),
    };
    let learner = Ekf::<T>::new(name, groups(layout, params.groups), noise.p0, 1, Isa::detect());
    Box::new(Linearised::new(learner, noise, size, clip))
}

/// Layers hold eight arrays and what steps are made in: six of the weights' size and three of each side's square, of f32.
fn bytes_of_layers(layout: &Layout) -> u64 {
    let of_layer = |(inputs, neurons): (usize, usize)| {
        let (rows, columns) = (neurons as u64, inputs as u64 + u64::from(layout.bias));
        4 * (6 * rows * columns + 3 * (rows * rows + columns * columns))
    };
    layout.members as u64 * layout.layers().map(of_layer).sum::<u64>()
}

/// Refuses what cannot be held; `what`: with its verb.
fn check_bytes(bytes: u64, what: &str, cure: &str) -> Result<(), FilterError> {
    if bytes > COVARIANCE_BYTES {
        let (there, most) = (bytes >> 30, COVARIANCE_BYTES >> 30);
        return Err(FilterError::OutOfRange(format!("{what} {there} GiB, more than {most}: {cure}")));
    }
    Ok(())
}

fn check(params: &FilterParams, layout: &Layout) -> Result<(), FilterError> {
    let size = layout.weights();
    let (by, precision) = match params {
        FilterParams::Ekf(ekf) => {
            if !ekf.robust {
                Noise::of(&ekf.noise)
                    .check(ekf.precision, "set `robust: true`, or a smaller ratio (10 is the default)")?;
            }
            (Groups::One, ekf.precision)
        }
        FilterParams::Decoupled(decoupled) => {
            let cure = "set a smaller ratio (10 is the default), or the filter `ekf` with `robust: true`";
            Noise::of(&decoupled.noise).check(decoupled.precision, cure)?;
            (decoupled.groups, decoupled.precision)
        }
        FilterParams::Backprop(_) => return Ok(()),
        FilterParams::Kronecker(_) => {
            return check_bytes(
                bytes_of_layers(layout),
                "the covariances of the layers take",
                "set fewer neurons or members",
            );
        }
        FilterParams::Ukf(ukf) => {
            Noise::of(&ukf.noise).check(Precision::F64, "set a smaller ratio (10 is the default)")?;
            if size > MOST_WEIGHTS {
                return Err(FilterError::OutOfRange(format!(
                    "the unscented filter runs the network {} times a row with {size} weights; it takes {MOST_WEIGHTS} weights \
                     at most: set fewer neurons, or the filter `ekf`",
                    2 * size + 1
                )));
            }
            (Groups::One, Precision::F64)
        }
    };
    let element = if precision == Precision::F32 { 4 } else { 8 };
    let bytes = match by {
        Groups::Weight => size as u64 * 8,
        // A bound first, so that no list of groups is made for a network that cannot be held anyway.
        Groups::One => size as u64 * (size as u64 + 1) / 2 * element,
        by => groups(layout, by).iter().map(|g| g.len() as u64 * (g.len() as u64 + 1) / 2 * element).sum(),
    };
    let what = format!("the covariance of {size} weights takes");
    check_bytes(bytes, &what, "set fewer neurons, or `decoupled` with smaller groups")
}
