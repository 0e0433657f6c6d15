//! Address -> stream -> draws at an index.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};

use super::normal::{Normals, normal_from_open_unit};
use super::{Purpose, Stage};
use crate::wide::widest;

/// The part of an address that a stage holds; opens one stream per purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Streams {
    pub seed: u64,
    pub scene: u64,
    pub attempt: u32,
    pub stage: Stage,
    pub step: u32,
}

impl Streams {
    /// The same address at another step (a stop, a control step).
    pub fn at_step(self, step: u32) -> Streams {
        Streams { step, ..self }
    }

    /// Opens the stream of one purpose.
    pub fn open(&self, purpose: Purpose) -> Stream {
        let mut hasher = blake3::Hasher::new_derive_key("marsyard 1 random stream");
        hasher.update(&self.seed.to_le_bytes());
        hasher.update(&self.scene.to_le_bytes());
        for word in [self.attempt, self.stage as u32, self.step, purpose as u32] {
            hasher.update(&word.to_le_bytes());
        }
        Stream { key: *hasher.finalize().as_bytes() }
    }
}

/// One purpose's draws. Every index has its own two words; `generator_at` gives an index an endless supply of its own.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u8; 32],
}

impl Stream {
    /// A uniform draw in the open interval (0, 1).
    pub fn uniform(&self, index: u64) -> f64 {
        let mut out = [0.0];
        self.fill_uniform(index, &mut out);
        out[0]
    }

    /// A standard normal draw.
    pub fn normal(&self, index: u64) -> f64 {
        normal_from_open_unit(self.uniform(index))
    }

    /// Uniform draws in (0, 1) at `first_index`, `first_index + 1`, ...: the same values as one by one.
    pub fn fill_uniform(&self, first_index: u64, out: &mut [f64]) {
        let mut rng = ChaCha8Rng::from_seed(self.key);
        rng.set_word_pos(u128::from(first_index) * 2);
        for value in out {
            *value = open_unit(rng.next_u64());
        }
    }

    /// Standard normal draws at `first_index`, `first_index + 1`, ...: the same values as one by one.
    pub fn fill_normal(&self, first_index: u64, out: &mut [f64]) {
        self.fill_uniform(first_index, out);
        widest(Normals(out));
    }

    /// A generator of its own for one index, for laws that take a varying number of words.
    pub fn generator_at(&self, index: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::from_seed(self.key);
        // Stream 0 holds the fixed-width draws.
        rng.set_stream(index.wrapping_add(1));
        rng.set_word_pos(0);
        rng
    }
}

/// 53 random bits -> the middle of one of 2^53 equal parts of (0, 1); never 0, never 1.
#[inline]
fn open_unit(word: u64) -> f64 {
    // The cast is exact below 2^53; adding a half keeps 54 bits at most, and rounds to below 1.
    (((word >> 12) as f64) + 0.5) * (1.0 / (1u64 << 52) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn streams() -> Streams {
        Streams { seed: 0, scene: 3, attempt: 0, stage: Stage::Scene, step: 0 }
    }

    #[test]
    fn equal_block_and_single_draws() {
        let stream = streams().open(Purpose::GroundNoise);
        let mut block = [0.0; 100];
        stream.fill_normal(17, &mut block);
        for (i, &value) in block.iter().enumerate() {
            assert_eq!(value.to_bits(), stream.normal(17 + i as u64).to_bits());
        }
    }

    #[test]
    fn dist_normal_draws_have_the_normal_moments() {
        // 4e5 draws: the standard errors of mean, variance and fourth moment are 1.6e-3, 2.2e-3 and 1.6e-2.
        let stream = streams().open(Purpose::GroundNoise);
        let mut draws = vec![0.0; 400_000];
        stream.fill_normal(0, &mut draws);
        let n = draws.len() as f64;
        let mean = draws.iter().sum::<f64>() / n;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / n;
        let fourth = draws.iter().map(|x| x * x * x * x).sum::<f64>() / n;
        assert!(mean.abs() < 6.4e-3, "{mean}");
        assert!((variance - 1.0).abs() < 9e-3, "{variance}");
        assert!((fourth - 3.0).abs() < 6.4e-2, "{fourth}");
    }

    #[test]
    fn law_addresses_that_differ_in_one_part_give_other_draws() {
        let base = streams();
        let first = base.open(Purpose::GroundNoise).uniform(0);
        for other in [
            Streams { seed: 1, ..base },
            Streams { scene: 4, ..base },
            Streams { attempt: 1, ..base },
            Streams { stage: Stage::Drive, ..base },
            Streams { step: 1, ..base },
        ] {
            assert_ne!(first, other.open(Purpose::GroundNoise).uniform(0));
        }
        assert_ne!(first, base.open(Purpose::GroundRmsHeight).uniform(0));
        assert_ne!(first, base.open(Purpose::GroundNoise).uniform(1));
    }

    #[test]
    fn golden_first_draws() {
        let stream = streams().open(Purpose::GroundNoise);
        insta::assert_snapshot!(format!("{:x} {:x}", stream.uniform(0).to_bits(), stream.normal(1).to_bits()));
    }
}
