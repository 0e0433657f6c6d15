//! The scene's random laws against their closed forms.
//!
//! Seeds are fixed, so each test either holds or does not; the standard error of each figure stands beside its band.

use marsyard::random::{Purpose, Stage, Stream, Streams};
use marsyard::scene::{Polynomial, RandomField};

fn noise(scene: u64) -> Stream {
    Streams { seed: 1, scene, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::GroundNoise)
}

/// The whole periodic field: 256 cells, 12.8 of them a correlation length (1/20 of the field).
const FIELD: RandomField = RandomField { rms_height_m: 0.3, correlation_length_m: 3.2 };
const CELLS: usize = 256;
const SPACING_M: f64 = 0.25;

#[test]
fn dist_rms_height_and_slope_follow_garcia_and_stoll() {
    for (correlation_length_m, cells) in [(3.2, 256), (1.25, 256), (2.5, 512)] {
        let field = RandomField { correlation_length_m, ..FIELD };
        let (mut height2, mut slope2) = (0.0, [0.0; 2]);
        for scene in 0..200 {
            let heights_m = field.period(SPACING_M, cells, &noise(scene));
            let at = |row: usize, col: usize| heights_m[(row % cells) * cells + col % cells];
            for row in 0..cells {
                for col in 0..cells {
                    height2 += at(row, col) * at(row, col);
                    // Fourth-order central differences: their own error is (k D)^4 / 30, 0.1 % at five cells a length.
                    let slope = |back2: f64, back: f64, on: f64, on2: f64| {
                        (8.0 * (on - back) - (on2 - back2)) / (12.0 * SPACING_M)
                    };
                    let along_x =
                        slope(at(row, col + cells - 2), at(row, col + cells - 1), at(row, col + 1), at(row, col + 2));
                    let along_y =
                        slope(at(row + cells - 2, col), at(row + cells - 1, col), at(row + 1, col), at(row + 2, col));
                    slope2[0] += along_x * along_x;
                    slope2[1] += along_y * along_y;
                }
            }
        }
        let nodes = (200 * cells * cells) as f64;
        // About the field's mean, zero. Standard error 0.33 % at 1/20 of the field.
        let rms = (height2 / nodes).sqrt() / field.rms_height_m;
        assert!((rms - 1.0).abs() < 0.02, "cl {correlation_length_m}: rms height {rms} of the law's");
        let law = 2.0_f64.sqrt() * field.rms_height_m / correlation_length_m;
        for slope2 in slope2 {
            let rms = (slope2 / nodes).sqrt() / law;
            assert!((rms - 1.0).abs() < 0.03, "cl {correlation_length_m}: rms slope {rms} of the law's");
        }
    }
}

#[test]
fn dist_autocovariance_is_gaussian() {
    let lags = 32;
    let mut covariance = vec![0.0; lags];
    for scene in 0..200 {
        let heights_m = FIELD.period(SPACING_M, CELLS, &noise(scene));
        for (lag, sum) in covariance.iter_mut().enumerate() {
            for row in 0..CELLS {
                for col in 0..CELLS {
                    *sum += heights_m[row * CELLS + col]
                        * (heights_m[row * CELLS + (col + lag) % CELLS]
                            + heights_m[((row + lag) % CELLS) * CELLS + col]);
                }
            }
        }
    }
    let h2 = FIELD.rms_height_m * FIELD.rms_height_m;
    for (lag, sum) in covariance.iter().enumerate() {
        let got = sum / (2 * 200 * CELLS * CELLS) as f64 / h2;
        let r = lag as f64 * SPACING_M / FIELD.correlation_length_m;
        let law = libm::exp(-r * r);
        // 200 fields of 255 correlation areas each (sum of squared correlations pi cl^2 / 2): standard error 0.7 % of h^2 at
        // lag 0, below that elsewhere; four of them.
        assert!((got - law).abs() < 0.028, "lag {lag}: {got} against {law}");
    }
}

#[test]
fn dist_a_cut_out_has_the_law_of_the_field_at_every_correlation_length() {
    // Height differences between nodes of a yard, over many yards: E (z1 - z2)^2 = 2 h^2 (1 - exp(-r^2 / cl^2)). Lengths
    // from below a cell (white noise) to a hundred yards (a tilted plane).
    let (count, spacing_m) = (24, 0.5);
    for correlation_length_m in [0.1, 0.4, 0.6, 2.0, 4.0, 12.0, 100.0, 1200.0] {
        let field = RandomField { rms_height_m: 1.0, correlation_length_m };
        let pairs = [((0, 0), (0, 1)), ((0, 0), (0, 23)), ((5, 5), (12, 5)), ((0, 0), (23, 23)), ((23, 0), (0, 23))];
        let yards = 20_000;
        let mut sums = [0.0; 5];
        for scene in 0..yards {
            let heights_m = field.cut_out(spacing_m, count, &noise(scene));
            for (sum, ((row, col), (row2, col2))) in sums.iter_mut().zip(pairs) {
                let difference = heights_m[row * count + col] - heights_m[row2 * count + col2];
                *sum += difference * difference;
            }
        }
        for (sum, ((row, col), (row2, col2))) in sums.iter().zip(pairs) {
            let (dy, dx) = (row as f64 - row2 as f64, col as f64 - col2 as f64);
            let r2 = (dx * dx + dy * dy) * spacing_m * spacing_m / (correlation_length_m * correlation_length_m);
            let law = -2.0 * libm::expm1(-r2);
            // A squared normal's mean over 20,000 yards: standard error 1 %; four of them.
            let share = sum / yards as f64 / law;
            assert!((share - 1.0).abs() < 0.04, "cl {correlation_length_m}, ({row},{col})-({row2},{col2}): {share}");
        }
    }
}

#[test]
fn dist_fits_retain_the_variance_of_the_table() {
    // Computed apart from this code: rows by degree, columns by cl over the side of the fitted square.
    let shares = [0.1, 0.2, 0.3, 0.5];
    let table = [
        (3, [0.18, 0.47, 0.72, 0.93]),
        (5, [0.31, 0.73, 0.94, 0.99]),
        (8, [0.60, 0.94, 0.99, 1.0]),
        (12, [0.81, 0.99, 1.0, 1.0]),
    ];
    let (extent_m, nodes) = (20.0, 64);
    let side_m = 1.2 * extent_m;
    for (k, share) in shares.into_iter().enumerate() {
        let field = RandomField { rms_height_m: 0.3, correlation_length_m: share * side_m };
        let (mut residual, mut about_mean) = ([0.0; 4], 0.0);
        for scene in 0..200 {
            let heights_m = field.cut_out(side_m / nodes as f64, nodes, &noise(scene));
            let mean = heights_m.iter().sum::<f64>() / heights_m.len() as f64;
            about_mean += heights_m.iter().map(|h| (h - mean) * (h - mean)).sum::<f64>();
            for (residual, (degree, _)) in residual.iter_mut().zip(table) {
                let fit = Polynomial::fit(extent_m, degree, nodes, &heights_m);
                let place = |k: usize| (k as f64 + 0.5) * side_m / nodes as f64 - 0.1 * extent_m;
                for (node, height) in heights_m.iter().enumerate() {
                    let off = height - fit.height_m(place(node % nodes), place(node / nodes));
                    *residual += off * off;
                }
            }
        }
        for (residual, (degree, retained)) in residual.iter().zip(table) {
            let got = 1.0 - residual / about_mean;
            assert!((got - retained[k]).abs() < 0.06, "degree {degree}, cl / L {share}: {got} against {}", retained[k]);
            // The second computation, in two digits.
            let second = match (degree, k) {
                (5, 0) => 0.36,
                (5, 1) => 0.75,
                (5, 2) => 0.93,
                (3, 1) => 0.51,
                _ => continue,
            };
            assert!((got - second).abs() < 0.02, "degree {degree}, cl / L {share}: {got} against {second}");
        }
    }
}
