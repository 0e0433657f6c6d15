//! Features of a real scan beside what a model saw in training -> which of them it never saw.

/// How much of one feature lies outside the training range.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outside {
    pub feature: String,
    /// Least and greatest value in training.
    pub least: f64,
    pub greatest: f64,
    /// Share of the rows below the least, and above the greatest.
    pub below: f64,
    pub above: f64,
    /// Share of the rows outside the quantiles 0.1 % and 99.9 %.
    pub rare: f64,
}

/// One entry a feature. `rows`: their features one after another; `quantiles` as `About::quantiles`.
pub(crate) fn outside(names: &[String], quantiles: &[[f64; 7]], rows: &[f32]) -> Vec<Outside> {
    let count = (rows.len() / names.len().max(1)).max(1) as f64;
    let one = |(k, (name, quantiles)): (usize, (&String, &[f64; 7]))| {
        let [least, low, .., high, greatest] = *quantiles;
        // Features are f32, quantiles f64: a value that is the extreme itself must not count as beyond it.
        let [least, low, high, greatest] = [least, low, high, greatest].map(|q| f64::from(q as f32));
        let values = || rows.iter().skip(k).step_by(names.len()).map(|&v| f64::from(v));
        let share = |of: &dyn Fn(f64) -> bool| values().filter(|&v| of(v)).count() as f64 / count;
        Outside {
            feature: name.clone(),
            least,
            greatest,
            below: share(&|v| v < least),
            above: share(&|v| v > greatest),
            // A NaN is outside of everything.
            rare: share(&|v| !(low..=high).contains(&v)),
        }
    };
    names.iter().zip(quantiles).enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_shares_of_four_rows_of_two_features() {
        let names = ["a".to_string(), "b".to_string()];
        let quantiles = [[0.0, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0], [0.1; 7]];
        let rows = [-1.0, 0.1, 0.05, 0.1, 0.5, 0.1, 2.0, 0.3];
        let found = outside(&names, &quantiles, &rows);
        assert_eq!((found[0].below, found[0].above, found[0].rare), (0.25, 0.25, 0.75));
        assert_eq!((found[1].below, found[1].above, found[1].rare), (0.0, 0.25, 0.25));
    }
}
