use proptest::prelude::*;

use super::*;
use crate::math;
use crate::train::filter::lanes::{Isa, Kernel};

#[test]
fn exact_quantiles_of_the_normal_distribution_as_scipy_has_them() {
    let of_scipy = [
        (0.5, 0.0),
        (0.25, -0.674_489_750_196_081_7),
        (0.025, -1.959_963_984_540_054_5),
        (1.0 / 128.0, -2.417_559_016_236_505),
        (1e-3, -3.090_232_306_167_813),
        (1e-9, -5.997_807_015_007_687),
    ];
    for (share, z) in of_scipy {
        assert!((normal_quantile(share) - z).abs() < 1e-12, "{share}: {} and {z}", normal_quantile(share));
        if share > 1e-3 {
            assert!((normal_quantile(1.0 - share) + z).abs() < 1e-12, "{share}");
        }
    }
}

/// Values that are the quantiles of an exponential distribution, every rank once.
fn exponential(count: usize) -> Vec<f64> {
    (0..count).map(|k| -math::ln(1.0 - (k as f64 + 0.5) / count as f64)).collect()
}

#[test]
fn law_scores_are_normal_whatever_the_distribution_of_the_values() {
    let scores = NormalScores::of_sample(exponential(100_000), 8.0);
    assert_eq!((scores.at.len(), scores.score.len()), (PARTS + 1, PARTS + 1));
    // The same scale for all, by which the cut at the outermost parts makes up for the variance.
    let stretch = scores.score(-math::ln(0.25)) / normal_quantile(0.75);
    assert!((1.0..1.05).contains(&stretch), "{stretch}");
    for share in [0.02, 0.1, 0.5, 0.8, 0.95] {
        let (score, z) = (scores.score(-math::ln(1.0 - share)), normal_quantile(share));
        assert!((score - stretch * z).abs() < 0.02, "{share}: {score} and {z}");
    }
}

#[test]
fn exact_knots_are_quantiles_and_values_between_two_have_their_score_in_proportion() {
    let scores = NormalScores::of_sample((0..=64).rev().map(f64::from).collect(), 8.0);
    assert_eq!(scores.at, (0..=64).map(f64::from).collect::<Vec<_>>());
    let raw = |part: f64| normal_quantile(part.clamp(0.5, 63.5) / 64.0);
    let (slope, middle) = (scores.score[40] / raw(40.0), scores.score[32]);
    assert!(middle.abs() < 1e-12, "{middle}");
    for part in 0..=64 {
        let (score, wanted) = (scores.score[part], slope * raw(part as f64));
        assert!((score - wanted).abs() < 1e-12, "{part}: {score} and {wanted}");
    }
    let between = 0.75 * scores.score[10] + 0.25 * scores.score[11];
    assert!((scores.score(10.25) - between).abs() < 1e-15);
    assert_eq!([-1.0, 65.0, 1e300].map(|x| scores.score(x)), [scores.score[0], scores.score[64], scores.score[64]]);
    let moments = (0..=64).fold(Moments::default(), |mut moments, x| {
        moments.add(scores.score(f64::from(x)));
        moments
    });
    assert!(moments.mean.abs() < 1e-12 && (moments.variance() - 1.0).abs() < 1e-12);
}

#[test]
fn exact_equal_values_share_the_middle_of_their_shares() {
    // Three quarters are nought: their middle is at three eighths.
    let values: Vec<f64> = (0..1000).map(|k| f64::from((k - 750).max(0))).collect();
    let scores = NormalScores::of_sample(values, 8.0);
    let (nought, far) = (scores.score(0.0), scores.score(125.0));
    let (wanted_nought, wanted_far) = (normal_quantile(0.375), normal_quantile(0.875));
    let stretch = (far - nought) / (wanted_far - wanted_nought);
    assert!(stretch > 0.9 && stretch < 1.6, "{stretch}");
    // The last of the ties lies within a part of three quarters.
    assert!((scores.score(250.0) - nought) / stretch > normal_quantile(0.98) - wanted_nought);
}

#[test]
fn extreme_no_values_one_value_and_values_that_are_not_finite() {
    for values in [vec![], vec![7.0], vec![7.0; 1000]] {
        let scores = NormalScores::of_sample(values, 8.0);
        assert_eq!(scores.fault(8.0, 1e100), None);
        assert_eq!([-1e300, 0.0, 7.0, f64::INFINITY].map(|x| scores.score(x)), [0.0; 4]);
        assert!(scores.score(f64::NAN).is_nan());
    }
    let with_others = [exponential(1000), vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY]].concat();
    let scores = NormalScores::of_sample(with_others, 2.0);
    assert_eq!(scores, NormalScores::of_sample(exponential(1000), 2.0));
    assert!(scores.score(f64::NAN).is_nan());
    assert_eq!([f64::NEG_INFINITY, f64::INFINITY].map(|x| scores.score(x).abs()), [2.0; 2]);
    // One value in a thousand differs: it lies between the quantiles, and all the same no score is beyond the clip.
    let mut rare = vec![0.0; 999];
    rare.push(1e9);
    let scores = NormalScores::of_sample(rare, 8.0);
    assert_eq!(scores.fault(8.0, 1e100), None);
    assert!(scores.score(1e9) > scores.score(0.0));
}

#[test]
fn extreme_files_of_other_scores_are_refused() {
    let fault = |at: &[f64], score: &[f64]| {
        NormalScores { at: at.to_vec(), score: score.to_vec(), unseen: None }.fault(8.0, 1e100)
    };
    assert_eq!(fault(&[0.0, 1.0], &[-1.0, 1.0]), None);
    for (at, score) in [
        (&[0.0, 1.0][..], &[0.0][..]),
        (&[], &[]),
        (&[0.0, 0.0], &[0.0, 1.0]),
        (&[1.0, 0.0], &[0.0, 1.0]),
        (&[0.0, 1.0], &[1.0, 0.0]),
        (&[0.0, 1.0], &[0.0, 9.0]),
        (&[0.0, 1e101], &[0.0, 1.0]),
        (&[f64::NAN, 1.0], &[0.0, 1.0]),
        (&[0.0, 5e-324], &[0.0, 1.0]),
        (&[0.0, 1.0], &[0.0, f64::NAN]),
        (&[0.0; 1025], &[0.0; 1025]),
    ] {
        assert!(fault(at, score).is_some(), "{at:?} {score:?}");
    }
}

#[test]
fn exact_a_neighbour_without_points_has_a_score_of_its_own_and_moves_no_other() {
    let seen: Vec<f64> = exponential(1000).into_iter().map(|x| x - 1.0).collect();
    let with_unseen = [vec![0.0; 500], seen.clone(), vec![-0.0; 500]].concat();
    let (scores, of_seen) = (NormalScores::of_heights_above(with_unseen, 8.0), NormalScores::of_sample(seen, 8.0));
    assert_eq!((&scores.at, &scores.score), (&of_seen.at, &of_seen.score));
    assert_eq!([0.0, -0.0].map(|x| scores.score(x)), [-3.5; 2]);
    // Below that of any height, however low.
    assert!(scores.score(-1e300) > -3.0);
    for x in [-0.9, f64::MIN_POSITIVE, -f64::MIN_POSITIVE, 0.1, 1e300] {
        assert_eq!(scores.score(x), of_seen.score(x), "{x}");
    }
    assert!(scores.score(f64::NAN).is_nan());
    assert_eq!(scores.fault(8.0, 1e100), None);
}

#[test]
fn extreme_no_neighbour_with_points_and_a_narrow_clip() {
    let scores = NormalScores::of_heights_above(vec![0.0; 100], 2.0);
    assert_eq!([0.0, 1.0, -1e300].map(|x| scores.score(x)), [-2.0, 0.0, 0.0]);
    assert_eq!(scores.fault(2.0, 1e100), None);
    for unseen in [-2.5, f64::NAN, f64::INFINITY] {
        assert!(NormalScores { unseen: Some(unseen), ..scores.clone() }.fault(2.0, 1e100).is_some(), "{unseen}");
    }
}

proptest! {
    #[test]
    fn law_scores_rise_with_values_and_stay_within_the_clip(
        values in prop::collection::vec(-1e6..1e6f64, 1..400),
        a in -2e6..2e6f64,
        b in -2e6..2e6f64,
    ) {
        let scores = NormalScores::of_sample(values, 8.0);
        prop_assert_eq!(scores.fault(8.0, 1e100), None);
        let (low, high) = (a.min(b), a.max(b));
        prop_assert!(scores.score(low) <= scores.score(high));
        prop_assert!(scores.score(low).abs() <= 8.0 && scores.score(high).abs() <= 8.0);
    }
}

struct ScoresOf<'a> {
    scores: &'a NormalScores,
    values: &'a [f64],
}

impl Kernel<f64> for ScoresOf<'_> {
    type Out = Vec<u64>;

    #[inline(always)]
    fn run<V: Simd<f64>>(self) -> Vec<u64> {
        let knots = self.scores.knots();
        self.values.iter().map(|x| knots.score::<V>(*x).to_bits()).collect()
    }
}

#[test]
fn equal_scores_for_any_number_of_knots_in_all_forms_and_by_a_search_from_the_first() {
    for count in [1, 2, 3, 8, 9, 10, 64, 65, 66, 129, 513, MOST_KNOTS] {
        let at: Vec<f64> = (0..count).map(|k| f64::from(k as u32) * 0.37 - 5.0).collect();
        let score = at.iter().map(|x| x * x * x).collect();
        let scores = NormalScores { at, score, unseen: (count % 2 == 0).then_some(-3.5) };
        let last = count - 1;
        let between = scores.at.iter().flat_map(|x| [*x, x + 0.1, x.next_up(), x.next_down()]);
        let ends = [0.0, -0.0, f64::MIN, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-310];
        let values: Vec<f64> = between.chain(ends).collect();
        let expected = values.iter().map(|&x| {
            let (at, score) = (&scores.at, &scores.score);
            if scores.unseen.is_some() && x == 0.0 {
                return -3.5;
            }
            if last == 0 || x.is_nan() {
                return if x.is_nan() { x } else { score[0] };
            }
            let x = x.clamp(at[0], at[last]);
            let below = (1..last).filter(|&k| at[k] <= x).count();
            let share = (x - at[below]) / (at[below + 1] - at[below]);
            (score[below] + (score[below + 1] - score[below]) * share).clamp(score[below], score[below + 1])
        });
        let expected: Vec<u64> = expected.map(f64::to_bits).collect();
        for isa in Isa::available() {
            assert_eq!(isa.run(ScoresOf { scores: &scores, values: &values }), expected, "{isa:?}, {count} knots");
        }
    }
}
