//! Cells at their extremes, beside what a textbook gives there: casting to whole numbers, one-pass variance, sums in f32.
//!
//! Expected values: whole-number arithmetic on the bits of the coordinates, closed forms, a high-precision sum.

use super::*;
use crate::extremes::{Family, row};
use crate::geometry::{CellIndex, GridSpec};

/// floor(value / size), exactly: both are whole multiples of a power of two.
fn exact_floor(value: f64, size: f64) -> i64 {
    let parts = |x: f64| -> (i128, i32) {
        let bits = x.abs().to_bits();
        let exponent = (bits >> 52) as i32 - 1075;
        let mantissa = i128::from((bits & ((1 << 52) - 1)) | (1 << 52));
        (if x < 0.0 { -mantissa } else { mantissa }, exponent)
    };
    let ((a, low_a), (b, low_b)) = (parts(value), parts(size));
    // Below 2^100: mantissas of 53 bits, moved by 40 at most.
    let shift = low_a - low_b;
    assert!(shift.abs() <= 40, "{value} {size}");
    let (a, b) = if shift > 0 { (a << shift, b) } else { (a, b << -shift) };
    i64::try_from(a.div_euclid(b)).expect("a cell")
}

#[test]
fn extreme_points_on_a_cells_border() {
    // Sizes that are powers of two have borders that are numbers: every answer is exact there.
    let (mut points, mut by_cast, mut by_single) = (0, 0, 0);
    // Elsewhere the quotient may round up to the border, from at most a unit in the last place below it.
    let (mut decimal_points, mut rounded_up) = (0, 0);
    for (size_m, exact_borders) in [(0.25, true), (1.0, true), (0.1, false), (0.3, false)] {
        let grid = GridSpec { size_m };
        for k in (-3000..3000).chain([-9_999_999, 9_999_999]) {
            let border = f64::from(k) * size_m;
            for x in [border.next_down(), border, border.next_up()] {
                if x.abs() < 1e-6 {
                    continue;
                }
                let col = i64::from(grid.cell(x, 0.0).unwrap().col);
                let exact = exact_floor(x, size_m);
                if exact_borders {
                    assert_eq!(col, exact, "{x} / {size_m}");
                    points += 1;
                    by_cast += usize::from((x / size_m) as i64 != exact);
                    by_single += usize::from((x as f32 / size_m as f32).floor() as i64 != exact);
                } else {
                    let border_above = (exact + 1) as f64 * size_m;
                    assert!(col == exact || col == exact + 1 && x.next_up() >= border_above, "{x} / {size_m}");
                    decimal_points += 1;
                    rounded_up += usize::from(col != exact);
                }
            }
        }
    }
    let grid = GridSpec { size_m: 0.25 };
    assert_eq!(grid.cell(-0.0, 0.0), Some(CellIndex { row: 0, col: 0 }));
    assert_eq!(grid.cell(-f64::MIN_POSITIVE, 0.0), Some(CellIndex { row: 0, col: -1 }));
    assert!(by_cast > 0 && by_single > 0);
    row(
        Family::Cells,
        "points on a border, and one unit in the last place beside it",
        &format!(
            "cast to a whole number: {by_cast} of {points} in another cell than whole-number arithmetic says; f32: {by_single}"
        ),
        &format!(
            "none; in cells of 0.1 and 0.3 m {rounded_up} of {decimal_points}, none farther below the border than its rounding"
        ),
    );
}

/// Mean square less squared mean, in one pass.
fn one_pass(values: impl Iterator<Item = f64>) -> f64 {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    values.for_each(|v| (n, sum, squares) = (n + 1.0, sum + v, squares + v * v));
    squares / n - (sum / n) * (sum / n)
}

#[test]
fn extreme_the_variance_of_heights_a_thousand_kilometres_up() {
    // 0.1 m up and down: variance 0.01 m2.
    let up_m = 1e6;
    let heights: Vec<f64> = (0..400).map(|i| up_m + if i % 2 == 0 { 0.1 } else { -0.1 }).collect();
    let points: Vec<(DVec3, i32)> = heights.iter().map(|z| (DVec3::new(0.5, 0.5, z - up_m), -1)).collect();
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    let pose = Pose { position_m: DVec3::new(1e6, -1e6, up_m), ..Pose::default() };
    let cells = bin_one(&params, &points, pose, &yard(0.0));
    let own = f64::from(cells.features[1]);
    assert!(cells.rows.len() == 1 && (own - 0.01).abs() < 1e-9, "{own}");
    let textbook = one_pass(heights.iter().copied());
    assert!((textbook - 0.01).abs() > 1e-5, "{textbook}");
    row(
        Family::Cells,
        "variance of heights a thousand kilometres up (0.01 m2)",
        &format!("one pass, mean square less squared mean: {textbook:.6} m2"),
        &format!("off by {:.0e} m2", (own - 0.01).abs()),
    );
}

#[test]
fn extreme_one_point_a_cell() {
    let points: Vec<(DVec3, i32)> =
        (0..100).map(|i| (DVec3::new(1.05 + 0.1 * f64::from(i), 0.05, 0.3 * f64::from(i % 7) + 0.1), -1)).collect();
    let cells = bin_one(&CellParams::default(), &points, Pose::default(), &yard(0.0));
    assert_eq!(cells.rows.len(), 100);
    assert!(cells.features.chunks(20).all(|f| f[1] == 0.0 && f[2] == 0.0 && f[3] == 1.0));
    // The sample variance divides by n - 1.
    let in_cell = [0.3_f64];
    let sample = (in_cell[0] - in_cell[0]) / (in_cell.len() as f64 - 1.0);
    let below = points.iter().filter(|(p, _)| one_pass([p.z, p.z, p.z].into_iter()) < 0.0).count();
    assert!(sample.is_nan());
    row(
        Family::Cells,
        "one point a cell",
        &format!(
            "variance over n - 1: {sample}; in one pass over three equal heights: negative in {below} of 100 cells"
        ),
        "variance and height difference 0, exactly",
    );
}

/// Heights of a cloud whose sums are known: multiples of 2^-10 m, all in one cell.
fn ladder(i: u64) -> f64 {
    ((i * 7919) % 1024) as f64 / 1024.0
}

/// `count` points in one cell, and the variance and mean in closed form: each of 1024 heights equally often.
fn all_in_one_cell(count: u64) {
    assert_eq!(count % 1024, 0);
    let points_m: Vec<DVec3> = (0..count).map(|i| DVec3::new(0.25, 0.5, ladder(i))).collect();
    let estimate = estimate_at(Pose::default());
    let cloud = WindowCloud {
        points_m: &points_m,
        in_map: true,
        intensity: None,
        obstacle: None,
        estimate: &estimate,
        map_from_sensor: Transform::IDENTITY,
    };
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    let (cells, _) = bin_clouds(&params, &[cloud], 10.0, &mut Scratch::default());
    assert_eq!((cells.rows.len(), cells.rows[0].points as u64, cells.points_binned), (1, count, count));
    let mean = 1023.0 / 2048.0;
    let variance = (1024.0 * 1024.0 - 1.0) / 12.0 / (1024.0 * 1024.0);
    let [own_mean, own_variance, difference, number] = [0, 1, 2, 3].map(|k| f64::from(cells.features[k]));
    // Features are f32: half a unit in their last place.
    assert!(
        (own_mean / mean - 1.0).abs() < 6e-8 && (own_variance / variance - 1.0).abs() < 6e-8,
        "{own_mean} {own_variance}"
    );
    assert_eq!((difference, number), (1023.0 / 1024.0, f64::from(count as f32)));
    let single = points_m.iter().fold(0.0_f32, |sum, p| sum + p.z as f32) / count as f32;
    row(
        Family::Cells,
        &format!("{count} points, all in one cell"),
        &format!("sum in f32: mean off by a share of {:.0e}", (f64::from(single) / mean - 1.0).abs()),
        &format!(
            "mean off by a share of {:.0e}, variance by {:.0e} (columns are f32)",
            (own_mean / mean - 1.0).abs(),
            (own_variance / variance - 1.0).abs()
        ),
    );
}

#[test]
fn extreme_all_points_in_one_cell() {
    all_in_one_cell(1 << 20);
}

#[test]
#[ignore = "10 GB and half a minute: cargo test --release --lib extreme_a_hundred -- --ignored --nocapture"]
fn extreme_a_hundred_million_points_in_one_cell() {
    all_in_one_cell(100_000_768);
}
