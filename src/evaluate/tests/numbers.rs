//! Numbers that scikit-learn and SciPy gave for the same cells.

use super::*;
use crate::statistics::scores::Scores;

/// Cells whose numbers Python makes by the same whole-number formulas.
fn many() -> Vec<(Cell, f64)> {
    (0..2000i64)
        .map(|k| {
            let a = k * 7919 % 1009;
            let untraversable = k * 104_729 % 1013 < 150 + a / 2;
            let points = (k * 31 % 17 + 1) as i32;
            (Cell { points, ..Cell::bare(k as i32, 0, untraversable) }, a as f64 / 1024.0)
        })
        .collect()
}

/// Made by scikit-learn and SciPy from the formulas of [`many`]: `accuracy_score`, `balanced_accuracy_score`, `matthews_corrcoef`, and
/// the same with `sample_weight=points`.
#[test]
fn golden_rates_are_scikit_learns() {
    let golden = [
        (0.3, [470, 736, 140, 654], [0.562, 0.6066978290746101, 0.2267760394739803]),
        (0.5, [731, 475, 284, 510], [0.6205, 0.6242266835428232, 0.24315189327469125]),
        (0.75, [1008, 198, 513, 281], [0.6445, 0.5948625888191286, 0.21750863828978106]),
    ];
    let by_points = [
        [0.5649927785801577, 0.6083717030380565, 0.2296671651739779],
        [0.6228752360848795, 0.6261047127267932, 0.2469832456195734],
        [0.6445950449950005, 0.5949982128473102, 0.21877061130620093],
    ];
    let judge = judge_many();
    let all = &judge.groups[&Group::All];
    for ((counts, (_, expected, rates)), points) in all.network.at.iter().zip(golden).zip(by_points) {
        let c = counts.cells[tally::WITH_TOPS];
        let found = [c.true_traversable, c.false_untraversable, c.missed_untraversable, c.true_untraversable];
        assert_eq!(found, expected);
        for (counts, expected) in [(c, rates), (counts.points[tally::WITH_TOPS], points)] {
            let r = counts.rates();
            for (found, expected) in [r.accuracy, r.balanced_accuracy, r.mcc].into_iter().zip(expected) {
                assert!((found.unwrap() - expected).abs() < 1e-14, "{found:?} {expected}");
            }
        }
    }
}

/// `roc_auc_score`, with ties: scores are multiples of 1/1024, so that no two unequal ones share a bin.
#[test]
fn golden_auc_with_ties_is_scikit_learns() {
    let all = |coarse: fn(f64) -> f64| {
        let mut scores = Scores::new(1.0);
        many().iter().for_each(|(cell, output)| scores.add(cell.untraversable(), coarse(*output)));
        scores.auc().unwrap()
    };
    assert!((all(|s| s) - 0.6696163389601112).abs() < 1e-14);
    assert!((all(|s| (s * 16.0).floor() / 16.0) - 0.6688639088353365).abs() < 1e-14);
    assert!((all(|s| f64::from(u8::from(s > 0.5))) - 0.6240115543190847).abs() < 1e-14);
}

/// `scipy.stats.spearmanr(points, wrong)`, and of the traversable cells `spearmanr(points, called)`.
#[test]
fn golden_rank_correlations_are_scipys() {
    let spread = judge_many_from_half().by_points;
    assert!((spread.rho().unwrap() - -0.008993271751772215).abs() < 1e-14);
    assert!((spread.rho_false_untraversable().unwrap() - -0.01535014013464973).abs() < 1e-14);
}

#[test]
fn extreme_cells_with_a_nan_output_are_counted_and_left_out() {
    let mut judge = Judge::new(vec![Threshold { value: 0.5, origin: ThresholdOrigin::Given }], None);
    let bare = Cell::bare(0, 0, false);
    let cells = [Cell { points: 1, range_m: f32::NAN, ..bare }, Cell { points: 2, ..bare }];
    judge.add_scan("", "", &cells, &[f64::NAN, 0.25]);
    assert_eq!((judge.not_finite_cells, judge.groups[&Group::All].cells), (1, 1));
    judge.add_scan("", "", &cells[..1], &[f64::NAN]);
    judge.add_scan("", "", &[], &[]);
    assert_eq!((judge.not_finite_cells, judge.groups[&Group::All].cells), (2, 1));
}

fn judge_at(thresholds: &[f64]) -> Judge {
    let origin = ThresholdOrigin::Given;
    let mut judge = Judge::new(thresholds.iter().map(|&value| Threshold { value, origin }).collect(), None);
    let (cells, outputs): (Vec<Cell>, Vec<f64>) = many().into_iter().unzip();
    // In three scans: the split must not matter.
    for part in [0..500, 500..501, 501..2000] {
        judge.add_scan("", "", &cells[part.clone()], &outputs[part]);
    }
    judge
}

fn judge_many() -> Judge {
    judge_at(&[0.3, 0.5, 0.75])
}

fn judge_many_from_half() -> Judge {
    judge_at(&[0.5])
}
