//! How well an early rung foretells the last: Spearman's rank correlation (1904), ties at their mean rank (Kendall 1948).

/// Rho of paired numbers; `None` for fewer than two pairs, or where one side is all ties.
pub fn spearman(pairs: &[(f64, f64)]) -> Option<f64> {
    let ranks = |of: fn(&(f64, f64)) -> f64| mean_ranks(&pairs.iter().map(of).collect::<Vec<_>>());
    let (a, b) = (ranks(|pair| pair.0), ranks(|pair| pair.1));
    let middle = 0.5 * (pairs.len() as f64 + 1.0);
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - middle) * (y - middle)).sum::<f64>();
    let scale = (sum(&a, &a) * sum(&b, &b)).sqrt();
    (scale > 0.0).then(|| (sum(&a, &b) / scale).clamp(-1.0, 1.0))
}

/// The rank of each number from 1 on; equal ones share the mean of theirs.
fn mean_ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    for ties in order.chunk_by(|&i, &j| values[i] == values[j]) {
        let mean = from as f64 + 0.5 * (ties.len() as f64 + 1.0);
        ties.iter().for_each(|&i| ranks[i] = mean);
        from += ties.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rho_of_known_pairs() {
        let pairs = |b: [f64; 5]| (0..5).map(|k| (f64::from(k), b[k as usize])).collect::<Vec<_>>();
        assert_eq!(spearman(&pairs([1.0, 10.0, 100.0, 1e3, 1e4])), Some(1.0));
        assert_eq!(spearman(&pairs([5.0, 4.0, 3.0, 2.0, 1.0])), Some(-1.0));
        // 1 - 6 sum d^2 / (n (n^2 - 1)) with d^2 = 1, 1, 0, 1, 1.
        assert!((spearman(&pairs([2.0, 1.0, 3.0, 5.0, 4.0])).unwrap() - 0.8).abs() < 1e-15);
        assert_eq!(mean_ranks(&[3.0, 1.0, 3.0, 0.0]), [3.5, 2.0, 3.5, 1.0]);
        assert_eq!(spearman(&pairs([1.0; 5])), None);
        assert_eq!(spearman(&[(1.0, 2.0)]), None);
    }
}
