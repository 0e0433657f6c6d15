//! White noise -> a random rough surface: a Gaussian field of Gaussian autocovariance h^2 exp(-r^2 / cl^2).
//!
//! In: rms height h, correlation length cl, a stream of noise. Out: heights at the nodes of a square grid, a cut-out of a
//! periodic field at least twice as wide as the cut-out, and wider by four correlation lengths, so that its
//! edges are not correlated across the period.
//! Source: Garcia & Stoll, PRL 52, 1798 (1984): white noise convolved with exp(-2 r^2 / cl^2) through the FFT. Deviations,
//! both without effect where cl spans three cells or more: the filter is the root of the *sampled* autocovariance's spectrum,
//! so that the law is right at any cl, down to white noise; and noise is drawn on a grid of cl / 3 to cl / 6 only and
//! brought to finer nodes by zero-padding its spectrum, which leaves out no more than 2e-10 of the field's power.
//!
//! Draws: node (row, col) of the noise has its own index, so that another size moves no draw. The first node lies in the
//! south-west corner. Not modelled: anisotropy, fractal spectra.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use crate::math;
use crate::random::Stream;

/// Indices of one noise row: more than any field is wide.
const ROW_STRIDE: u64 = 1 << 24;
/// Cells of the noise per correlation length, where the field is finer than that.
const CELLS_PER_LENGTH: f64 = 3.0;
/// Correlation lengths between a cut-out and its periodic image.
const APART: f64 = 4.0;

/// A random field's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomField {
    pub rms_height_m: f64,
    pub correlation_length_m: f64,
}

impl RandomField {
    /// Heights at `count` x `count` nodes `spacing_m` apart, row by row.
    pub fn cut_out(&self, spacing_m: f64, count: usize, stream: &Stream) -> Vec<f64> {
        // The noise grid: coarser than the nodes by a power of two where the field is smooth enough.
        let mut finer = 1;
        // 1e-9: 0.6 m spans three cells of 0.2 m, whatever the last bit says.
        let length_m = self.correlation_length_m * (1.0 + 1e-9);
        while 2.0 * finer as f64 * spacing_m * CELLS_PER_LENGTH <= length_m {
            finer *= 2;
        }
        let noise_spacing_m = spacing_m * finer as f64;
        let side_m = count as f64 * spacing_m;
        let period_m = (2.0 * side_m).max(side_m + APART * self.correlation_length_m);
        let nodes = ((period_m / noise_spacing_m).ceil() as usize).next_power_of_two();
        self.synthesize(noise_spacing_m, nodes, finer, count, stream)
    }

    /// One whole period: `nodes` x `nodes` (a power of two) heights `spacing_m` apart.
    pub fn period(&self, spacing_m: f64, nodes: usize, stream: &Stream) -> Vec<f64> {
        self.synthesize(spacing_m, nodes, 1, nodes, stream)
    }

    fn synthesize(&self, spacing_m: f64, nodes: usize, finer: usize, count: usize, stream: &Stream) -> Vec<f64> {
        let spectrum = self.spectrum(spacing_m, nodes, stream);
        let mut inverse = Inverse::new(nodes, nodes * finer, count);
        // Along x for the rows that hold anything, then along y for the columns that are wanted.
        let mut line = vec![Complex64::ZERO; count];
        let mut columns = vec![Complex64::ZERO; count * nodes];
        for row in 0..nodes {
            inverse.line(&spectrum[row * nodes..][..nodes], &mut line);
            for col in 0..count {
                columns[col * nodes + row] = line[col];
            }
        }
        let mut heights_m = vec![0.0; count * count];
        for col in 0..count {
            inverse.line(&columns[col * nodes..][..nodes], &mut line);
            for row in 0..count {
                heights_m[row * count + col] = line[row].re;
            }
        }
        heights_m
    }

    /// The filtered noise's Fourier coefficients, [wave along y][wave along x].
    fn spectrum(&self, spacing_m: f64, nodes: usize, stream: &Stream) -> Vec<Complex64> {
        let forward = FftPlanner::new().plan_fft_forward(nodes);
        let mut scratch = vec![Complex64::ZERO; forward.get_inplace_scratch_len()];
        let mut noise = vec![0.0; nodes];
        let mut by_row = Vec::with_capacity(nodes * nodes);
        for row in 0..nodes {
            stream.fill_normal(row as u64 * ROW_STRIDE, &mut noise);
            by_row.extend(noise.iter().map(|&z| Complex64::new(z, 0.0)));
        }
        forward.process_with_scratch(&mut by_row, &mut scratch);
        let mut by_column: Vec<Complex64> =
            (0..nodes * nodes).map(|k| by_row[(k % nodes) * nodes + k / nodes]).collect();
        forward.process_with_scratch(&mut by_column, &mut scratch);
        let filter = self.filter(spacing_m, nodes);
        // Both transforms unscaled: one over the number of nodes.
        let scale = self.rms_height_m / (nodes as f64 * nodes as f64);
        (0..nodes * nodes)
            .map(|k| by_column[(k % nodes) * nodes + k / nodes] * (scale * filter[k / nodes] * filter[k % nodes]))
            .collect()
    }

    /// The filter's gain per wave along one axis; its mean square is 1.
    fn filter(&self, spacing_m: f64, nodes: usize) -> Vec<f64> {
        let cells = self.correlation_length_m / spacing_m;
        // Autocovariance exp(-36) between neighbours: white.
        if cells < 1.0 / 6.0 {
            return vec![1.0; nodes];
        }
        // The spectrum of sampled exp(-r^2 / cl^2): its images at every multiple of the sampling rate (Poisson), as far as
        // exp(-40) reaches.
        let images = (2.1 / cells).ceil() as i32;
        let power = |wave: usize| -> f64 {
            let wave = if 2 * wave > nodes { wave as f64 - nodes as f64 } else { wave as f64 };
            let image = |k: i32| PI * cells * (wave / nodes as f64 + f64::from(k));
            (-images..=images).map(|k| math::exp(-image(k) * image(k))).sum()
        };
        let power: Vec<f64> = (0..nodes).map(power).collect();
        let mean = power.iter().sum::<f64>() / nodes as f64;
        power.into_iter().map(|p| (p / mean).sqrt()).collect()
    }
}

/// The inverse transform of a line of few waves onto the first nodes of a finer grid.
enum Inverse {
    /// A long FFT of the zero-padded line.
    Fft { plan: Arc<dyn Fft<f64>>, padded: Vec<Complex64>, scratch: Vec<Complex64> },
    /// A plain sum, where the yard is so small a part of the period that the FFT would be far longer: the phases by node,
    /// then by wave.
    Sum { phases: Vec<Complex64> },
}

impl Inverse {
    fn new(waves: usize, fine: usize, count: usize) -> Inverse {
        if waves * count < fine * fine.ilog2() as usize && waves < fine {
            let phase = |node: usize, wave: usize| {
                // Whole turns are taken off in whole numbers.
                let turn = (node * signed_place(wave, waves, fine)) % fine;
                let (sin, cos) = math::sin_cos(TAU * turn as f64 / fine as f64);
                Complex64::new(cos, sin)
            };
            let phases = (0..count).flat_map(|node| (0..waves).map(move |wave| (node, wave)));
            return Inverse::Sum { phases: phases.map(|(node, wave)| phase(node, wave)).collect() };
        }
        let plan = FftPlanner::new().plan_fft_inverse(fine);
        let scratch = vec![Complex64::ZERO; plan.get_inplace_scratch_len()];
        Inverse::Fft { plan, padded: vec![Complex64::ZERO; fine], scratch }
    }

    fn line(&mut self, spectrum: &[Complex64], out: &mut [Complex64]) {
        match self {
            Inverse::Fft { plan, padded, scratch } => {
                padded.fill(Complex64::ZERO);
                let fine = padded.len();
                for (wave, value) in spectrum.iter().enumerate() {
                    padded[signed_place(wave, spectrum.len(), fine)] = *value;
                }
                plan.process_with_scratch(padded, scratch);
                out.copy_from_slice(&padded[..out.len()]);
            }
            Inverse::Sum { phases } => {
                for (value, phases) in out.iter_mut().zip(phases.chunks_exact(spectrum.len())) {
                    *value = spectrum.iter().zip(phases).map(|(wave, phase)| wave * phase).sum();
                }
            }
        }
    }
}

/// Where a wave of a coarse spectrum stands in a finer one: negative waves at the end. The middle wave, which has no partner
/// there, holds next to no power.
fn signed_place(wave: usize, waves: usize, fine: usize) -> usize {
    if 2 * wave < waves { wave } else { fine - (waves - wave) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};

    fn stream(scene: u64) -> Stream {
        Streams { seed: 5, scene, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::GroundNoise)
    }

    /// The convolution of Garcia & Stoll written out: white noise with exp(-2 r^2 / cl^2), on a torus.
    fn by_convolution(field: &RandomField, spacing_m: f64, nodes: usize, stream: &Stream) -> Vec<f64> {
        let noise = |row: usize, col: usize| stream.normal(row as u64 * ROW_STRIDE + col as u64);
        let gain: Vec<f64> = (0..nodes)
            .map(|k| {
                let r = k.min(nodes - k) as f64 * spacing_m / field.correlation_length_m;
                math::exp(-2.0 * r * r)
            })
            .collect();
        // c^2 times the sum of squares is h^2.
        let power: f64 = gain.iter().map(|g| g * g).sum();
        let c = field.rms_height_m / power;
        let noise: Vec<f64> = (0..nodes * nodes).map(|k| noise(k / nodes, k % nodes)).collect();
        let mut out = vec![0.0; nodes * nodes];
        for (k, value) in out.iter_mut().enumerate() {
            for (other, z) in noise.iter().enumerate() {
                let (dy, dx) =
                    ((nodes + k / nodes - other / nodes) % nodes, (nodes + k % nodes - other % nodes) % nodes);
                *value += c * gain[dy] * gain[dx] * z;
            }
        }
        out
    }

    #[test]
    fn equal_field_and_the_convolution_of_garcia_and_stoll() {
        let field = RandomField { rms_height_m: 0.3, correlation_length_m: 5.0 };
        let (fast, slow) = (field.period(1.0, 32, &stream(0)), by_convolution(&field, 1.0, 32, &stream(0)));
        for (a, b) in fast.iter().zip(&slow) {
            // The sampled Gaussian's spectrum and the root of its square differ by 1e-9 at five cells a length.
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
    }

    #[test]
    fn equal_finer_nodes_interpolate_the_same_field() {
        // 8 m at 0.25 m: noise at 2 m, so that every eighth node of the finer cut-out is a node of the coarser.
        let field = RandomField { rms_height_m: 1.0, correlation_length_m: 8.0 };
        let (fine, coarse) = (field.cut_out(0.25, 80, &stream(1)), field.cut_out(2.0, 10, &stream(1)));
        for row in 0..10 {
            for col in 0..10 {
                let (a, b) = (fine[8 * row * 80 + 8 * col], coarse[row * 10 + col]);
                assert!((a - b).abs() < 1e-7, "{a} {b}");
            }
        }
    }

    #[test]
    fn equal_long_fft_and_plain_sum() {
        let spectrum: Vec<Complex64> =
            (0..16).map(|k| Complex64::new(math::sin(f64::from(k)), math::cos(2.0 * f64::from(k)))).collect();
        let (mut by_sum, mut by_fft) = (vec![Complex64::ZERO; 10], vec![Complex64::ZERO; 10]);
        let mut sum = Inverse::new(16, 1024, 10);
        assert!(matches!(sum, Inverse::Sum { .. }));
        sum.line(&spectrum, &mut by_sum);
        let plan = FftPlanner::new().plan_fft_inverse(1024);
        let scratch = vec![Complex64::ZERO; plan.get_inplace_scratch_len()];
        Inverse::Fft { plan, padded: vec![Complex64::ZERO; 1024], scratch }.line(&spectrum, &mut by_fft);
        for (a, b) in by_sum.iter().zip(&by_fft) {
            assert!((a - b).norm() < 1e-12);
        }
    }

    #[test]
    fn law_another_size_moves_no_draw() {
        // White noise shows its draws as they are.
        let white = RandomField { rms_height_m: 1.0, correlation_length_m: 0.1 };
        let (small, large) = (white.period(1.0, 16, &stream(2)), white.period(1.0, 64, &stream(2)));
        for row in 0..16 {
            for col in 0..16 {
                assert!((small[row * 16 + col] - large[row * 64 + col]).abs() < 1e-12);
                let draw = stream(2).normal(row as u64 * ROW_STRIDE + col as u64);
                assert!((small[row * 16 + col] - draw).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn extreme_lengths_from_nothing_to_a_million_metres_give_finite_heights() {
        for rms_height_m in [0.0, 10.0] {
            for correlation_length_m in [1e-3, 0.1, 0.3, 2000.0, 1e6] {
                let heights_m = RandomField { rms_height_m, correlation_length_m }.cut_out(0.375, 40, &stream(3));
                let most = heights_m.iter().fold(0.0_f64, |most, h| most.max(h.abs()));
                assert!(most <= 6.0 * rms_height_m && heights_m.iter().all(|h| h.is_finite()));
                // A yard far smaller than the correlation length is a plane, tilted by about sqrt(2) h / cl.
                let rise = heights_m[39] - heights_m[0];
                let per_metre = rms_height_m / correlation_length_m;
                assert!(correlation_length_m < 1000.0 || rise.abs() <= 6.0 * 1.5 * per_metre * 15.0, "{rise}");
                assert!(correlation_length_m < 1000.0 || rise.abs() >= 1e-3 * per_metre * 15.0, "{rise}");
            }
        }
    }
}
