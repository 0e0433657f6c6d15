//! Address -> stream -> draws at an index.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};

use super::normal::{Normals, normal_from_open_unit};
use super::{Purpose, Stage};
use crate::wide::{Work, widest};

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
        open_unit(self.generator_from(index).next_u64())
    }

    /// A standard normal draw.
    pub fn normal(&self, index: u64) -> f64 {
        normal_from_open_unit(self.uniform(index))
    }

    /// Uniform draws in (0, 1) at `first_index`, `first_index + 1`, ...: the same values as one by one.
    pub fn fill_uniform(&self, first_index: u64, out: &mut [f64]) {
        let mut rng = self.generator_from(first_index);
        let mut words = [[0; 8]; 64];
        for out in out.chunks_mut(words.len()) {
            let words = &mut words[..out.len()];
            rng.fill_bytes(words.as_flattened_mut());
            widest(Units { words, out });
        }
    }

    /// Standard normal draws at `first_index`, `first_index + 1`, ...: the same values as one by one.
    pub fn fill_normal(&self, first_index: u64, out: &mut [f64]) {
        self.fill_uniform(first_index, out);
        widest(Normals(out));
    }

    /// Standard normal vectors in a Latin hypercube (McKay, Beckman & Conover 1979): along each axis one from each of as many equally likely
    /// parts of the line, the parts in an order of their own. Takes 2 N draws a vector.
    pub fn fill_normal_hypercube<const N: usize>(&self, first_index: u64, out: &mut [[f64; N]]) {
        let count = out.len();
        let mut draws = vec![0.0; 2 * count];
        let mut order: Vec<usize> = (0..count).collect();
        (0..N).for_each(|axis| {
            self.fill_uniform(first_index + (axis * draws.len()) as u64, &mut draws);
            let (within, keys) = draws.split_at_mut(count);
            // Of equal keys the first comes first: the same bytes whatever the sort.
            order.sort_unstable_by(|&a, &b| keys[a].total_cmp(&keys[b]).then(a.cmp(&b)));
            for (part, within) in within.iter_mut().enumerate() {
                // The last draw may be rounded up to 1.
                *within = ((part as f64 + *within) / count as f64).min(1.0 - f64::EPSILON / 2.0);
            }
            widest(Normals(within));
            for (&vector, &normal) in order.iter().zip(&*within) {
                out[vector][axis] = normal;
            }
        });
    }

    /// The words of the draws from an index on, two each.
    fn generator_from(&self, first_index: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::from_seed(self.key);
        rng.set_word_pos(u128::from(first_index) * 2);
        rng
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

/// Random words -> uniform draws.
struct Units<'a> {
    words: &'a [[u8; 8]],
    out: &'a mut [f64],
}

impl Work for Units<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        for (out, word) in self.out.iter_mut().zip(self.words) {
            *out = open_unit(u64::from_le_bytes(*word));
        }
    }
}

/// 52 random bits -> the middle of one of 2^52 equal parts of (0, 1); never 0, never 1.
#[inline(always)]
pub(super) fn open_unit(word: u64) -> f64 {
    // The bits behind the point of a number in [1, 2): what is taken off leaves 53 bits, and so all steps are exact.
    f64::from_bits(1.0f64.to_bits() | (word >> 12)) - (1.0 - f64::EPSILON / 2.0)
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
        stream.fill_uniform(5, &mut block);
        for (i, &value) in block.iter().enumerate() {
            assert_eq!(value.to_bits(), stream.uniform(5 + i as u64).to_bits());
        }
    }

    #[test]
    fn exact_a_hypercubes_draws_come_one_from_each_part_of_each_axis() {
        let stream = streams().open(Purpose::GroundNoise);
        for count in [1, 2, 7, 60] {
            let mut vectors = vec![[0.0; 3]; count];
            stream.fill_normal_hypercube(3, &mut vectors);
            for axis in 0..3 {
                let mut draws: Vec<f64> = vectors.iter().map(|vector| vector[axis]).collect();
                draws.sort_by(f64::total_cmp);
                for (part, draw) in draws.iter().enumerate() {
                    let bound = |k: usize| normal_from_open_unit((k as f64 / count as f64).clamp(1e-300, 1.0 - 1e-16));
                    assert!((bound(part)..=bound(part + 1)).contains(draw), "{part} of {count}: {draw}");
                }
            }
        }
    }

    #[test]
    fn equal_a_hypercube_and_the_single_draws_that_it_is_made_of() {
        let stream = streams().open(Purpose::GroundNoise);
        let (first, count) = (5, 60);
        let mut vectors = vec![[0.0; 6]; count];
        stream.fill_normal_hypercube(first, &mut vectors);
        for axis in 0..6 {
            let normals: Vec<f64> = vectors.iter().map(|vector| vector[axis]).collect();
            let draw = |k: usize| stream.uniform(first + (2 * axis * count + k) as u64);
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by(|&a, &b| draw(count + a).total_cmp(&draw(count + b)));
            for (part, &vector) in order.iter().enumerate() {
                let normal = normal_from_open_unit((part as f64 + draw(part)) / count as f64);
                assert_eq!(normals[vector].to_bits(), normal.to_bits(), "{axis} {part}");
            }
        }
        stream.fill_normal_hypercube::<6>(first, &mut []);
    }

    #[test]
    fn law_the_axes_of_a_hypercube_do_not_go_together() {
        // Of 200 hypercubes of 60 vectors: the mean correlation of two axes has a standard deviation of 1 / sqrt(59 * 200).
        let stream = streams().open(Purpose::GroundNoise);
        let (cubes, count) = (200, 60);
        let mut sums = [0.0; 3];
        for cube in 0..cubes {
            let mut vectors = vec![[0.0; 3]; count];
            stream.fill_normal_hypercube((cube * 6 * count) as u64, &mut vectors);
            for (sum, [a, b]) in sums.iter_mut().zip([[0, 1], [0, 2], [1, 2]]) {
                *sum += vectors.iter().map(|v| v[a] * v[b]).sum::<f64>() / (count * cubes) as f64;
            }
        }
        assert!(sums.iter().all(|sum| sum.abs() < 4.0 / ((count - 1) as f64 * cubes as f64).sqrt()), "{sums:?}");
    }

    #[test]
    fn equal_uniform_draws_are_the_middles_of_equal_parts() {
        let words = (0..1000u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).chain([0, u64::MAX, 0xfff, 0x1000]);
        for word in words {
            let middle = ((word >> 12) as f64 + 0.5) / (1u64 << 52) as f64;
            assert_eq!(open_unit(word).to_bits(), middle.to_bits(), "{word:x}");
            assert!(middle > 0.0 && middle < 1.0);
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
