//! A physical value of a config: a constant or a distribution, drawn once a scene (or once an object) at its address.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::Law;
use super::{Purpose, Stream, Streams};

/// A constant, or a distribution that is drawn anew for each scene (for each object where the key says so).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Dist {
    /// Always this value.
    Constant(f64),
    /// Drawn from a law.
    Law(Law),
}

impl From<f64> for Dist {
    fn from(value: f64) -> Dist {
        Dist::Constant(value)
    }
}

impl Dist {
    /// The value at one index of a stream.
    pub fn at(&self, stream: &Stream, index: u64) -> f64 {
        match self {
            Dist::Constant(value) => *value,
            Dist::Law(law) => law.draw(stream, index),
        }
    }

    /// The value as a whole number: a uniform law gives each whole number of [a, b] the same chance.
    pub fn count_at(&self, stream: &Stream, index: u64) -> u64 {
        let value = match self {
            Dist::Law(Law::Uniform([a, b])) => {
                let (a, b) = (a.ceil(), b.floor());
                (a + (stream.uniform(index) * (b - a + 1.0)).floor()).min(b)
            }
            other => other.at(stream, index).round(),
        };
        value.max(0.0) as u64
    }

    /// The smallest and largest value that can be drawn.
    pub fn bounds(&self) -> (f64, f64) {
        match self {
            Dist::Constant(value) => (*value, *value),
            Dist::Law(law) => law.bounds(),
        }
    }

    /// What is wrong with the law itself, if anything.
    pub fn fault(&self) -> Option<String> {
        match self {
            Dist::Constant(value) => (!value.is_finite()).then(|| format!("{value} is not a finite number")),
            Dist::Law(law) => law.fault(),
        }
    }
}

/// The values drawn once for a scene, by purpose: what the stages read and the `scenes` table stores.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn(BTreeMap<Purpose, f64>);

impl Drawn {
    /// Draws each value at its address (index 0 of its purpose's stream); counts as whole numbers.
    pub fn draw<'a>(streams: &Streams, dists: impl IntoIterator<Item = (Purpose, &'a Dist)>) -> Drawn {
        let value = |(purpose, dist): (Purpose, &Dist)| {
            let stream = streams.open(purpose);
            let value = if purpose.counts() { dist.count_at(&stream, 0) as f64 } else { dist.at(&stream, 0) };
            (purpose, value)
        };
        Drawn(dists.into_iter().map(value).collect())
    }

    /// Adds the values of another stage.
    pub fn extend(&mut self, other: Drawn) {
        self.0.extend(other.0);
    }

    /// All values, in the order of the register.
    pub fn iter(&self) -> impl Iterator<Item = (Purpose, f64)> + '_ {
        self.0.iter().map(|(&purpose, &value)| (purpose, value))
    }

    /// The value, if the config names it.
    pub fn get(&self, purpose: Purpose) -> Option<f64> {
        self.0.get(&purpose).copied()
    }
}

impl std::ops::Index<Purpose> for Drawn {
    type Output = f64;

    /// # Panics
    /// Where the stage's `dists()` does not list the purpose: a bug of the stage, not of the config.
    fn index(&self, purpose: Purpose) -> &f64 {
        self.0
            .get(&purpose)
            .unwrap_or_else(|| panic!("{} is read but not listed by its stage's dists()", purpose.key()))
    }
}

/// Numbers that a rule can bound: `f64`, a [`Dist`] (all its values), or either of them optional.
pub trait Bounded {
    /// The smallest and largest value, or what is wrong.
    fn extent(&self) -> Result<Option<(f64, f64)>, String>;
}

impl Bounded for f64 {
    fn extent(&self) -> Result<Option<(f64, f64)>, String> {
        if self.is_finite() { Ok(Some((*self, *self))) } else { Err(format!("{self} is not a finite number")) }
    }
}

impl Bounded for Dist {
    fn extent(&self) -> Result<Option<(f64, f64)>, String> {
        self.fault().map_or_else(|| Ok(Some(self.bounds())), Err)
    }
}

impl<T: Bounded> Bounded for Option<T> {
    fn extent(&self) -> Result<Option<(f64, f64)>, String> {
        self.as_ref().map_or(Ok(None), Bounded::extent)
    }
}

/// The garde rule "every value lies in [low, high]"; refuses NaN, infinities and faulty laws too.
pub fn within<T: Bounded>(low: f64, high: f64) -> impl Fn(&T, &()) -> garde::Result {
    move |value, ()| match value.extent() {
        Err(fault) => Err(garde::Error::new(fault)),
        Ok(Some((a, b))) if a < low || b > high => {
            let got = if a == b { format!("{a}") } else { format!("{a} to {b}") };
            Err(garde::Error::new(format!("must lie in [{low}, {high}], got {got}")))
        }
        Ok(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;
    use crate::random::Stage;

    #[test]
    fn dist_laws_stay_in_their_bounds_and_hit_their_means() {
        let streams = Streams { seed: 7, scene: 0, attempt: 0, stage: Stage::Scene, step: 0 };
        let stream = streams.open(Purpose::GroundRmsHeight);
        let cases: [(Dist, f64); 4] = [
            (Dist::Law(Law::Uniform([2.0, 4.0])), 3.0),
            (Dist::Law(Law::LogUniform([0.1, 0.8])), 0.7 / math::ln(8.0)),
            (Dist::Law(Law::Normal { mean: 1.0, sd: 0.5, min: 0.0, max: 2.0 }), 1.0),
            (Dist::Law(Law::Weighted(vec![[1.0, 0.0], [3.0, 4.0]])), 3.0),
        ];
        for (dist, mean) in cases {
            let (low, high) = dist.bounds();
            let draws: Vec<f64> = (0..20_000).map(|i| dist.at(&stream, i)).collect();
            assert!(draws.iter().all(|d| (low..=high).contains(d)), "{dist:?}");
            let got = draws.iter().sum::<f64>() / draws.len() as f64;
            // The widest of these laws has sd 1.73: 4 standard errors of 20,000 draws are 0.05.
            assert!((got - mean).abs() < 0.05, "{dist:?}: {got} against {mean}");
        }
    }

    #[test]
    fn law_whole_number_draws_reach_both_ends_alike() {
        let streams = Streams { seed: 7, scene: 0, attempt: 0, stage: Stage::Scene, step: 0 };
        let stream = streams.open(Purpose::GroundRmsHeight);
        let dist = Dist::Law(Law::Uniform([5.0, 8.0]));
        let mut counts = [0u32; 4];
        for i in 0..8000 {
            counts[(dist.count_at(&stream, i) - 5) as usize] += 1;
        }
        // Binomial sd 39: five of them.
        assert!(counts.iter().all(|&c| c.abs_diff(2000) < 195), "{counts:?}");
    }

    #[test]
    fn law_counts_are_drawn_as_whole_numbers() {
        let dist = Dist::Law(Law::Uniform([5.0, 40.0]));
        for scene in 0..100 {
            let streams = Streams { seed: 7, scene, attempt: 0, stage: Stage::Scene, step: 0 };
            let drawn = Drawn::draw(&streams, [(Purpose::RockCount, &dist), (Purpose::GroundRmsHeight, &dist)]);
            assert_eq!(drawn[Purpose::RockCount], dist.count_at(&streams.open(Purpose::RockCount), 0) as f64);
            assert_ne!(drawn[Purpose::GroundRmsHeight].fract(), 0.0);
        }
    }

    #[test]
    fn extreme_faulty_laws_are_named() {
        assert!(Dist::Constant(f64::NAN).fault().is_some());
        assert!(Dist::Law(Law::Uniform([2.0, 1.0])).fault().is_some());
        assert!(Dist::Law(Law::LogUniform([0.0, 1.0])).fault().is_some());
        assert!(Dist::Law(Law::Weighted(vec![[0.0, 1.0]])).fault().is_some());
        assert!(within::<Dist>(0.0, 1.0)(&Dist::Constant(2.0), &()).is_err());
    }
}
