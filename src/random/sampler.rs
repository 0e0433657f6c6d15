//! Parameters of a law and a generator -> a draw, by rand_distr.
//!
//! In: checked parameters, and a generator that nothing else draws from, since these samplers reject and take a varying number of words.
//! Out: the draw. Source: Marsaglia & Tsang 2000 (gamma), Cheng 1978 (beta, and PERT from it), Ahrens & Dieter 1982 and Knuth (Poisson), all
//! in rand_distr; they compute with [`Pinned`] numbers, so that their draws have the same bits on every machine.
//!
//! Poisson draws are whole numbers and compute with `f64`, as they have since format 1 of corpora: a number type with other normal draws
//! would change the rocks of every yard made by Golombek's law. In the program, those functions too are the pinned ones (`c_symbols`); a
//! program that links marsyard as a library and runs on another C library may draw another number where a comparison falls on a last bit.

use rand_distr::{Beta, Distribution, Gamma, Pert, Triangular};

use super::pinned::Pinned;

/// A window that holds a thousandth of a law is met within so many draws but for one case in 10^434.
const MOST_TRIES: u32 = 1_000_000;

/// Gamma: `shape` times `scale` is the mean.
pub(super) fn gamma(shape: f64, scale: f64, rng: &mut impl rand::Rng) -> f64 {
    Gamma::new(Pinned(shape), Pinned(scale)).expect("checked: shape and scale are positive").sample(rng).0
}

/// Beta on [0, 1].
pub(super) fn beta(alpha: f64, beta: f64, rng: &mut impl rand::Rng) -> f64 {
    Beta::new(Pinned(alpha), Pinned(beta)).expect("checked: alpha and beta are positive").sample(rng).0
}

/// Triangular on [low, high].
pub(super) fn triangular(low: f64, mode: f64, high: f64, rng: &mut impl rand::Rng) -> f64 {
    let [low, mode, high] = [low, mode, high].map(Pinned);
    Triangular::new(low, high, mode).expect("checked: the mode lies between the ends").sample(rng).0
}

/// PERT on [low, high]: a beta law whose mean is (low + shape mode + high) / (shape + 2).
pub(super) fn pert(low: f64, mode: f64, high: f64, shape: f64, rng: &mut impl rand::Rng) -> f64 {
    if low == high {
        return low;
    }
    let [low, mode, high, shape] = [low, mode, high, shape].map(Pinned);
    let pert = Pert::new(low, high).with_shape(shape).with_mode(mode);
    pert.expect("checked: the mode lies between the ends").sample(rng).0
}

/// Poisson: a whole number; 0 where the mean is 0 or below it.
pub fn poisson(mean: f64, rng: &mut impl rand::Rng) -> f64 {
    rand_distr::Poisson::new(mean).map_or(0.0, |poisson| poisson.sample(rng))
}

/// The first draw that lies in [low, high].
pub(super) fn cut(low: f64, high: f64, mut draw: impl FnMut() -> f64) -> f64 {
    if low == high {
        return low;
    }
    let draws = (0..MOST_TRIES).map(|_| draw());
    let mut within = draws.filter(|x| (low..=high).contains(x));
    within.next().expect("checked: a thousandth of the law lies between min and max")
}
