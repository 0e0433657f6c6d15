//! The ground at its extremes, beside what a textbook form gives there.
//!
//! Expected values: the surface that was sampled, the convolution of Garcia & Stoll written out, white noise given back, the
//! Gaussian law in closed form, a dense search. SI units, the yard's frame.

use nalgebra::{DMatrix, DVector};
use rustfft::num_complex::Complex32;

use super::ground;
use super::params::{GroundParams, GroundShape, GroundSource, PolynomialShape, RandomGround, RawShape};
use super::polynomial::{term_count, terms};
use super::{Ground, Polynomial, RandomField, Raster, SceneError, SceneParams};
use crate::extremes::{Family, row};
use crate::math;
use crate::random::{Drawn, Purpose, Stage, Stream, Streams};

const EXTENT_M: f64 = 20.0;

fn streams(scene: u64) -> Streams {
    Streams { seed: 17, scene, attempt: 0, stage: Stage::Scene, step: 0 }
}

fn noise(scene: u64) -> Stream {
    streams(scene).open(Purpose::GroundNoise)
}

fn grown(source: GroundSource, shape: GroundShape, max_slope_deg: f64, scene: u64) -> Result<Ground, SceneError> {
    let ground = GroundParams { source, shape, max_slope_deg, ..GroundParams::default() };
    let params = SceneParams {
        extent_m: EXTENT_M,
        ground: ground.clone(),
        rocks: None,
        boxes: None,
        trees: None,
        vegetation: None,
    };
    ground::build(&ground, EXTENT_M, &Drawn::draw(&streams(scene), params.dists()), &streams(scene))
}

fn random(rms_height_m: f64, correlation_length_m: f64) -> GroundSource {
    GroundSource::Random(RandomGround {
        rms_height_m: rms_height_m.into(),
        correlation_length_m: correlation_length_m.into(),
    })
}

fn polynomial(degree: u32) -> GroundShape {
    GroundShape::Polynomial(PolynomialShape { degree })
}

/// Places all over the yard, its corners among them.
fn places() -> impl Iterator<Item = (f64, f64)> {
    (0..41 * 41).map(|k| (f64::from(k % 41) * 0.5, f64::from(k / 41) * 0.5))
}

#[test]
fn extreme_a_fit_of_degree_12() {
    let degree = 12;
    let coefficients =
        terms(degree).enumerate().map(|(n, (i, j))| math::sin(3.0 * n as f64) / (1 + i + j) as f64).collect();
    let truth = Polynomial::new(EXTENT_M, degree, coefficients);
    let nodes = 64;
    let fit = Polynomial::fit_surface(EXTENT_M, degree, nodes, |x, y| truth.height_m(x, y));
    let worst = |height_m: &dyn Fn(f64, f64) -> f64| {
        places().fold(0.0_f64, |worst, (x, y)| worst.max((height_m(x, y) - truth.height_m(x, y)).abs()))
    };
    let own_m = worst(&|x, y| fit.height_m(x, y));
    assert!(own_m < 1e-12, "{own_m:e}");

    // Monomials of metres from the yard's corner, by the normal equations.
    let power = |x: f64, n: usize| (0..n).fold(1.0, |p, _| p * x);
    let at = |k: usize| -2.0 + (k as f64 + 0.5) * 24.0 / nodes as f64;
    let monomials: Vec<(usize, usize)> = terms(degree).collect();
    let design = DMatrix::from_fn(nodes * nodes, monomials.len(), |node, term| {
        power(at(node % nodes), monomials[term].0) * power(at(node / nodes), monomials[term].1)
    });
    let heights = DVector::from_fn(nodes * nodes, |node, _| truth.height_m(at(node % nodes), at(node / nodes)));
    let normal = design.transpose() * &design;
    let found = normal.lu().solve(&(design.transpose() * heights));
    let textbook = match found {
        Some(found) => {
            let height_m =
                |x: f64, y: f64| monomials.iter().zip(&found).map(|(&(i, j), c)| c * power(x, i) * power(y, j)).sum();
            let off_m = worst(&height_m);
            assert!(off_m > 1e3 * own_m, "the textbook form is fine here: {off_m:e}");
            format!("monomials in metres, normal equations: off by {off_m:.1e} m")
        }
        None => "monomials in metres: the normal equations are singular".to_string(),
    };
    row(Family::Ground, "degree 12", &textbook, &format!("orthonormal Legendre basis: off by {own_m:.1e} m"));
}

/// E (z1 - z2)^2 over h^2 of the textbook field: exp(-2 r^2 / cl^2) convolved with white noise on a period of one yard,
/// scaled by the continuum's 2 D / (sqrt(pi) cl). No noise is drawn: the sum over the kernel is the expectation.
fn textbook_difference(correlation_length_m: f64, spacing_m: f64, count: usize, apart: usize) -> f64 {
    let kernel: Vec<f64> = (0..count)
        .map(|k| {
            let r = (k as f64 - (count / 2) as f64) * spacing_m / correlation_length_m;
            math::exp(-2.0 * r * r)
        })
        .collect();
    let scale = 2.0 * spacing_m / (std::f64::consts::PI.sqrt() * correlation_length_m);
    let lag = |lag: usize| -> f64 { (0..count).map(|k| kernel[k] * kernel[(k + lag) % count]).sum() };
    2.0 * scale * scale * (lag(0) * lag(0) - lag(apart) * lag(0))
}

#[test]
fn extreme_correlation_lengths_of_a_cell_and_of_100_yards() {
    let (count, spacing_m, yards) = (24, 0.5, 4000);
    let side_m = spacing_m * count as f64;
    for (name, correlation_length_m) in [("one cell", spacing_m), ("100 yards", 100.0 * side_m)] {
        let field = RandomField { rms_height_m: 1.0, correlation_length_m };
        for apart in [1, 12] {
            let r = apart as f64 * spacing_m / correlation_length_m;
            let law = -2.0 * math::exp_m1(-r * r);
            let mut sum = 0.0;
            for scene in 0..yards {
                let heights_m = field.cut_out(spacing_m, count, &noise(scene));
                sum += (heights_m[0] - heights_m[apart]) * (heights_m[0] - heights_m[apart]);
            }
            let (own, textbook) =
                (sum / yards as f64 / law, textbook_difference(correlation_length_m, spacing_m, count, apart) / law);
            // The mean square of 4000 normal draws is known to 2.2 %: four of these.
            assert!((own - 1.0).abs() < 0.09, "{name}, {apart} cells: {own}");
            row(
                Family::Ground,
                &format!(
                    "correlation length of {name}: mean square of a height difference over {} m",
                    0.5 * apart as f64
                ),
                &format!("one period a yard, the continuum's scale: {textbook:.1e} of the law"),
                &format!("{own:.2} of the law (4000 yards: 0.09)"),
            );
        }
    }
}

#[test]
fn extreme_rms_heights_of_0_and_of_10_m() {
    for shape in [polynomial(5), polynomial(12), GroundShape::Raw(RawShape { spacing_m: 0.25 })] {
        let flat = grown(random(0.0, 8.0), shape.clone(), 0.1, 0).unwrap();
        assert!(places().all(|(x, y)| flat.height_m(x, y) == 0.0 && flat.gradient(x, y).length() == 0.0));
    }
    // A field is linear in its rms height: 10 m is a thousand times 1 cm.
    let degree = 12;
    let [low, high] = [0.01, 10.0].map(|rms| grown(random(rms, 200.0), polynomial(degree), 60.0, 1).unwrap());
    let relative = places()
        .fold(0.0_f64, |worst, (x, y)| worst.max((high.height_m(x, y) / (1000.0 * low.height_m(x, y)) - 1.0).abs()));
    assert!(relative < 1e-12, "{relative:e}");
    // The same ground as Taylor monomials in f32 from the yard's corner.
    let Ground::Polynomial(ground) = &high else { panic!("not fitted") };
    let taylor: Vec<f32> = ground.taylor_at(0.0, 0.0).iter().map(|c| *c as f32).collect();
    let single = |x: f64, y: f64| -> f32 {
        let power = |x: f64, n: usize| (0..n).fold(1.0_f32, |p, _| p * x as f32);
        terms(degree as usize).zip(&taylor).map(|((i, j), c)| c * power(x, i) * power(y, j)).sum()
    };
    let off_m =
        places().fold(0.0_f64, |worst, (x, y)| worst.max((f64::from(single(x, y)) - high.height_m(x, y)).abs()));
    assert_eq!(term_count(12), taylor.len());
    row(
        Family::Ground,
        "rms height 10 m, degree 12",
        &format!("monomials from the corner in f32: off by {off_m:.1e} m"),
        &format!("a thousand times the ground of 1 cm, to {relative:.0e}"),
    );
    // Heights brought to their rms by what they measure: 0 over 0 on flat ground.
    let measured = [0.0_f64; 16];
    let rms = (measured.iter().map(|h| h * h).sum::<f64>() / 16.0).sqrt();
    let scaled: Vec<f64> = measured.iter().map(|h| h / rms * 0.0).collect();
    assert!(scaled[0].is_nan());
    row(
        Family::Ground,
        "rms height 0, flat ground",
        "heights divided by their own rms: NaN",
        "height 0 and slope 0 everywhere, exactly",
    );
}

#[test]
fn extreme_slopes_at_the_cap() {
    let (mut least, mut nodes_see) = (f64::INFINITY, f64::INFINITY);
    for scene in 0..10 {
        for shape in [polynomial(8), GroundShape::Raw(RawShape { spacing_m: 0.25 })] {
            let source = || random(0.3, 5.0);
            let first = grown(source(), shape.clone(), 60.0, scene).unwrap();
            let certified = match &first {
                Ground::Polynomial(polynomial) => polynomial.max_slope(),
                Ground::Raster(raster) => raster.max_slope(),
            };
            // A hair above its own slope the ground is kept, a hair below it is drawn again.
            let cap_deg = math::atan(certified).to_degrees();
            let kept = grown(source(), shape.clone(), cap_deg * (1.0 + 1e-12), scene).unwrap();
            assert_eq!(kept.height_m(3.0, 4.0).to_bits(), first.height_m(3.0, 4.0).to_bits());
            match grown(source(), shape, cap_deg * (1.0 - 1e-12), scene) {
                Ok(other) => assert_ne!(other.height_m(3.0, 4.0), first.height_m(3.0, 4.0)),
                Err(error) => assert!(matches!(error, SceneError::TooSteep { .. }), "{error}"),
            }
            let sampled = |step_m: f64| {
                let count = (EXTENT_M / step_m) as usize;
                (0..=count * count + 2 * count).fold(0.0_f64, |steepest, k| {
                    let (x, y) = ((k % (count + 1)) as f64 * step_m, (k / (count + 1)) as f64 * step_m);
                    steepest.max(first.gradient(x, y).length())
                })
            };
            let dense = sampled(0.02);
            assert!(certified >= dense * (1.0 - 1e-12), "{certified} below {dense}");
            if matches!(first, Ground::Polynomial(_)) {
                assert!(certified <= dense * 1.003, "{certified} far above {dense}");
                least = least.min(certified / dense);
                nodes_see = nodes_see.min(sampled(2.0) / dense);
            }
        }
    }
    assert!(nodes_see < 0.99);
    row(
        Family::Ground,
        "slope at the cap",
        &format!("steepest of nodes 2 m apart: {:.0} % of the truth, so that steeper yards pass", 100.0 * nodes_see),
        &format!(
            "a certified bound, {least:.4} of a dense search at least; kept 1e-12 above the cap, redrawn 1e-12 below"
        ),
    );
}

/// Forward and back by the radix-2 FFT of the textbooks in f32, twiddles by repeated multiplication: the worst error.
fn textbook_round_trip(values: &[f64]) -> f64 {
    fn transform(values: &mut [Complex32], sign: f32) {
        let n = values.len();
        let bits = n.ilog2();
        for k in 0..n {
            let other = k.reverse_bits() >> (usize::BITS - bits);
            if other > k {
                values.swap(k, other);
            }
        }
        let mut half = 1;
        while half < n {
            let angle = f64::from(sign) * std::f64::consts::PI / half as f64;
            let turn = Complex32::new(math::cos(angle) as f32, math::sin(angle) as f32);
            let mut twiddle = Complex32::new(1.0, 0.0);
            for k in 0..half {
                for low in (k..n).step_by(2 * half) {
                    let moved = values[low + half] * twiddle;
                    (values[low], values[low + half]) = (values[low] + moved, values[low] - moved);
                }
                twiddle *= turn;
            }
            half *= 2;
        }
    }
    let mut work: Vec<Complex32> = values.iter().map(|v| Complex32::new(*v as f32, 0.0)).collect();
    transform(&mut work, -1.0);
    transform(&mut work, 1.0);
    let n = values.len() as f32;
    work.iter().zip(values).fold(0.0, |worst, (got, v)| worst.max((f64::from(got.re / n) - v).abs()))
}

/// White noise comes back, and a smooth field is the convolution of Garcia & Stoll, written out at a few nodes.
fn field_of(nodes: usize) {
    let white = RandomField { rms_height_m: 1.0, correlation_length_m: 0.1 }.period(1.0, nodes, &noise(9));
    let draw = |row: usize, col: usize| noise(9).normal(((row as u64) << 24) + col as u64);
    let few: Vec<(usize, usize)> =
        vec![(0, 0), (0, nodes - 1), (nodes - 1, 0), (nodes / 2, nodes / 3), (nodes - 1, nodes - 1), (7, nodes / 2)];
    let white_off = few.iter().fold(0.0_f64, |worst, &(r, c)| worst.max((white[r * nodes + c] - draw(r, c)).abs()));
    drop(white);
    let field = RandomField { rms_height_m: 1.0, correlation_length_m: 6.0 };
    let smooth = field.period(1.0, nodes, &noise(9));
    let reach = 27_i64;
    let gain = |k: i64| math::exp(-2.0 * (k * k) as f64 / (6.0 * 6.0));
    let power: f64 = (-reach..=reach).map(|k| gain(k) * gain(k)).sum();
    let wrap = |at: usize, k: i64| (at as i64 + k).rem_euclid(nodes as i64) as usize;
    let smooth_off = few.iter().fold(0.0_f64, |worst, &(row, col)| {
        let mut sum = 0.0;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                sum += gain(dy) * gain(dx) * draw(wrap(row, dy), wrap(col, dx));
            }
        }
        worst.max((smooth[row * nodes + col] - sum / power).abs())
    });
    assert!(white_off < 1e-12, "{nodes} nodes: {white_off:e}");
    // The kernel of exp(-40) that is left out, and images of the sampled spectrum: 1e-9 at six cells a length.
    assert!(smooth_off < 2e-9, "{nodes} nodes: {smooth_off:e}");
    let mut line = vec![0.0; nodes];
    noise(9).fill_normal(0, &mut line);
    row(
        Family::Ground,
        &format!("FFT of {nodes} x {nodes} nodes"),
        &format!(
            "radix 2 in f32, twiddles by recurrence, one line there and back: off by {:.1e}",
            textbook_round_trip(&line)
        ),
        &format!("noise given back to {white_off:.1e}; equal to the convolution written out to {smooth_off:.1e}"),
    );
}

#[test]
fn extreme_fft_sizes() {
    for nodes in [64, 512, 1024] {
        field_of(nodes);
    }
}

#[test]
#[ignore = "1.5 GB and some seconds: cargo test --release --lib extreme_fft -- --ignored --nocapture"]
fn extreme_fft_size_of_4096() {
    field_of(4096);
}

#[test]
fn extreme_rasters_at_the_limit_of_memory_are_made_and_beyond_it_refused() {
    let spacing_m = EXTENT_M / 4096.0;
    let source = || GroundSource::Flat;
    let Ground::Raster(Raster { cols, .. }) =
        grown(source(), GroundShape::Raw(RawShape { spacing_m }), 60.0, 0).unwrap()
    else {
        panic!("not a raster")
    };
    assert_eq!(cols, 4097);
    let finer = GroundShape::Raw(RawShape { spacing_m: 0.999 * spacing_m });
    assert!(matches!(grown(source(), finer, 60.0, 0), Err(SceneError::TooFine { cells: 4101, limit: 4096, .. })));
}
