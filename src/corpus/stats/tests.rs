use super::*;
use crate::extremes::{Family, row};
use crate::math;

fn of(values: &[f64]) -> Moments {
    let mut moments = Moments::default();
    values.iter().for_each(|&v| moments.add(v));
    moments
}

fn direct(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum())
}

#[test]
fn equal_running_moments_and_two_passes() {
    let values: Vec<f64> = (0..5000).map(|i| 3.0 + math::sin(f64::from(i) * 0.37)).collect();
    let (mean, m2) = direct(&values);
    let moments = of(&values);
    assert!((moments.mean - mean).abs() < 1e-12 && (moments.m2 / m2 - 1.0).abs() < 1e-11);
    assert_eq!(moments.count, 5000);
    let folded = |of: fn(f64, f64) -> f64| values.iter().copied().reduce(of);
    assert_eq!((moments.min, moments.max), (folded(f64::min), folded(f64::max)));
}

#[test]
fn equal_merged_parts_and_the_whole() {
    let values: Vec<f64> = (0..1000).map(|i| math::cos(f64::from(i))).collect();
    let whole = of(&values);
    for cut in [0, 1, 10, 500, 999, 1000] {
        let merged = of(&values[..cut]).merge(&of(&values[cut..]));
        assert_eq!((merged.count, merged.min, merged.max), (whole.count, whole.min, whole.max));
        assert!((merged.mean - whole.mean).abs() < 1e-14 && (merged.m2 / whole.m2 - 1.0).abs() < 1e-12, "cut {cut}");
    }
}

#[test]
fn extreme_a_small_spread_on_a_large_mean_keeps_its_variance() {
    let values: Vec<f64> = (0..1000).map(|i| 1e9 + f64::from(i % 2)).collect();
    assert!((of(&values).variance() - 0.25).abs() < 1e-9);
    let merged = of(&values[..300]).merge(&of(&values[300..]));
    assert!((merged.variance() - 0.25).abs() < 1e-9);
    let mean_square = values.iter().map(|v| v * v).sum::<f64>() / 1000.0;
    let textbook = mean_square - merged.mean * merged.mean;
    assert!((textbook - 0.25).abs() > 0.1, "{textbook}");
    row(
        Family::Sums,
        "a spread of 0.5 on a mean of 1e9: variance 0.25",
        &format!("mean square less squared mean: {textbook}"),
        &format!("{}, merged from two parts as well", merged.variance()),
    );
}

/// 100,000 shards of 10,000 rows: multiples of 2^-10 m about a height of a thousand kilometres, so that whole numbers
/// hold every sum exactly.
#[test]
fn extreme_a_billion_rows_merged_from_shards() {
    const SHARDS: u64 = 100_000;
    const ROWS: u64 = 10_000;
    const KINDS: u64 = 1000;
    let unit = 1.0 / 1024.0;
    let whole = |kind: u64, row: u64| (1 << 30) + i128::from(kind) + i128::from(row);
    // The shards' own statistics, row by row; there are a thousand different ones.
    let kinds: Vec<Moments> = (0..KINDS)
        .map(|kind| {
            let mut moments = Moments::default();
            (0..ROWS).for_each(|row| moments.add(whole(kind, row) as f64 * unit));
            moments
        })
        .collect();
    let kind = |shard: u64| shard * 7919 % KINDS;
    let merged = (0..SHARDS).fold(Moments::default(), |sum, shard| sum.merge(&kinds[kind(shard) as usize]));

    let (mut sum, mut squares) = (0_i128, 0_i128);
    let mut of_kind = vec![(0_i128, 0_i128); KINDS as usize];
    for (kind, sums) in of_kind.iter_mut().enumerate() {
        for row in 0..ROWS {
            let v = whole(kind as u64, row);
            *sums = (sums.0 + v, sums.1 + v * v);
        }
    }
    // The textbook keeps a sum and a sum of squares, each rounded.
    let (mut rounded_sum, mut rounded_squares) = (0.0_f64, 0.0_f64);
    for shard in 0..SHARDS {
        let (of_values, of_squares) = of_kind[kind(shard) as usize];
        (sum, squares) = (sum + of_values, squares + of_squares);
        (rounded_sum, rounded_squares) =
            (rounded_sum + of_values as f64 * unit, rounded_squares + of_squares as f64 * unit * unit);
    }
    let rows = i128::from(SHARDS * ROWS);
    let mean = sum as f64 / rows as f64 * unit;
    let m2 = (rows * squares - sum * sum) as f64 / rows as f64 * (unit * unit);
    let variance = m2 / rows as f64;
    assert_eq!(i128::from(merged.count), rows);
    assert_eq!(merged.min, Some(f64::from(1 << 30) * unit));
    assert_eq!(merged.max, Some(whole(KINDS - 1, ROWS - 1) as f64 * unit));
    let (mean_off, own_off) = ((merged.mean / mean - 1.0).abs(), (merged.variance() / variance - 1.0).abs());
    assert!(mean_off < 1e-13 && own_off < 1e-9, "{mean_off:e} {own_off:e}");
    let textbook_mean = rounded_sum / rows as f64;
    let textbook = rounded_squares / rows as f64 - textbook_mean * textbook_mean;
    let textbook_off = (textbook / variance - 1.0).abs();
    assert!(textbook_off > 1e3 * own_off, "{textbook_off:e}");
    row(
        Family::Sums,
        "a billion rows from 100,000 shards, heights about 1e6 m",
        &format!("sum and sum of squares in f64: variance {textbook:.4} for {variance:.4}"),
        &format!("mean off by a share of {mean_off:.0e}, variance by {own_off:.0e}, count exact"),
    );
}

#[test]
fn extreme_values_that_are_not_finite_are_counted_apart() {
    let moments = of(&[1.0, f64::NAN, f64::INFINITY, 3.0]);
    assert_eq!((moments.count, moments.mean, moments.not_finite), (2, 2.0, 2));
    let none = Moments::default().merge(&of(&[f64::NAN]));
    assert_eq!((none.count, none.min, none.not_finite), (0, None, 1));
}

#[test]
fn equal_moments_survive_json_to_the_last_bit() {
    let moments = of(&[0.1, 0.2, 1.0 / 3.0, 1e-300, 7e22]);
    let text = serde_json::to_string(&moments).unwrap();
    assert_eq!(serde_json::from_str::<Moments>(&text).unwrap(), moments);
}
