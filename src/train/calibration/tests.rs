use super::*;
use crate::random::{Purpose, Stage, Streams};

const TARGETS: [f64; 2] = [0.1, 0.9];
const EDGE: f64 = 0.01;

fn of(cells: impl IntoIterator<Item = (f64, [u64; 2])>) -> Option<Calibration> {
    let mut scores = Scores::new(1.0);
    for (output, counts) in cells {
        for (class, &count) in [false, true].into_iter().zip(&counts) {
            (0..count).for_each(|_| scores.add(class, output));
        }
    }
    Calibration::of_scores(&scores, TARGETS, EDGE)
}

#[test]
fn equal_the_fit_and_that_of_scipy_and_scikit_learn() {
    let outputs = [0.05, 0.1, 0.15, 0.3, 0.45, 0.5, 0.62, 0.8, 0.88, 0.97];
    let traversable = [40, 300, 120, 60, 20, 9, 6, 3, 2, 1];
    let untraversable = [0, 2, 3, 5, 6, 9, 11, 25, 40, 30];
    let cells = traversable.into_iter().zip(untraversable).map(|(no, yes)| [no, yes]);
    let found = of(outputs.into_iter().zip(cells)).unwrap();
    // scipy.optimize.minimize (BFGS, gtol 1e-10) of Platt's loss over the middles of the bins; sklearn.calibration's own fit agrees to 1e-6.
    let [slope, offset] = [1.062_108_164_455_438_2, -0.606_684_438_071_286_4];
    assert!((found.slope - slope).abs() < 1e-8 && (found.offset - offset).abs() < 1e-8, "{found:?}");
    assert_eq!(found.cells, [561, 131]);
}

#[test]
fn statistics_a_logistic_law_is_found_again_within_its_standard_errors() {
    let (slope, offset) = (1.3, -2.0);
    let mut worst = [0.0f64; 2];
    let seeds = 40;
    let mut covered = 0;
    for seed in 0..seeds {
        let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        let random = streams.open(Purpose::TrainRows);
        let mut information = [0.0; 3];
        let mut scores = Scores::new(1.0);
        for k in 0..4000 {
            let output = 0.12 + 0.76 * random.uniform(2 * k);
            let x = place(output, TARGETS, EDGE);
            let p = sigmoid(slope * x + offset);
            scores.add(random.uniform(2 * k + 1) < p, output);
            for (sum, term) in information.iter_mut().zip([x * x, x, 1.0]) {
                *sum += p * (1.0 - p) * term;
            }
        }
        let found = Calibration::of_scores(&scores, TARGETS, EDGE).unwrap();
        let [a, b, c] = information;
        let determinant = a * c - b * b;
        let sigmas = [(c / determinant).sqrt(), (a / determinant).sqrt()];
        let off = [(found.slope - slope) / sigmas[0], (found.offset - offset) / sigmas[1]];
        covered += usize::from(off[0].abs() < 1.96);
        for (worst, off) in worst.iter_mut().zip(off) {
            *worst = worst.max(off.abs());
        }
    }
    // Of 40 intervals of 95 % 33 or more hold the slope in all but one case of ten thousand.
    assert!(covered >= 33 && worst.iter().all(|off| *off < 4.5), "{covered} {worst:?}");
}

#[test]
fn exact_of_probabilities_the_edge_is_what_the_targets_of_platt_leave() {
    let ([no, yes], edge) = ([0.0, 1.0], 1e-4);
    let mut scores = Scores::new(1.0);
    // Outputs that are exactly 0 and 1 stand at the edge.
    (0..5000).for_each(|_| [false, true].into_iter().for_each(|class| scores.add(class, f64::from(u8::from(class)))));
    let found = Calibration::of_scores(&scores, [no, yes], edge).unwrap();
    assert_eq!((found.edge, found.fault()), (edge, None));
    assert!((found.slope - math::ln(5001.0) / math::ln(9999.0)).abs() < 1e-9 && found.offset.abs() < 1e-9, "{found:?}");
    assert_eq!(found.probability(0.0, [no, yes]), found.probability(0.5 * edge, [no, yes]));
    assert!(found.probability(2.0 * edge, [no, yes]) > found.probability(edge, [no, yes]));
}

#[test]
fn extreme_classes_apart_one_place_and_many_cells_give_finite_numbers() {
    // Apart: Platt's targets are the probabilities, 51/52 at the one edge and 1/52 at the other.
    let apart = of([(0.0, [50, 0]), (1.0, [0, 50])]).unwrap();
    assert!((apart.slope - math::ln(51.0) / math::ln(99.0)).abs() < 1e-9 && apart.offset.abs() < 1e-9, "{apart:?}");
    // One place: its share, by an offset that makes up for whatever the slope is.
    let one = of([(0.5, [30, 10])]).unwrap();
    assert!((one.probability(0.5, TARGETS) - 0.25).abs() < 0.02 && one.slope.abs() < 1e-3, "{one:?}");
    // The wrong way round: the slope says so.
    assert!(of([(0.2, [1, 99]), (0.8, [99, 1])]).unwrap().slope < -1.0);
    // 1e12 cells.
    let bins = [Bin { x: -3.0, cells: [1_000_000_000_000, 7] }, Bin { x: 3.0, cells: [9, 500_000_000_000] }];
    let [slope, offset] = fit(&bins, [1_000_000_000_009, 500_000_000_007]);
    assert!(slope > 5.0 && slope < MOST && offset.abs() < 5.0, "{slope} {offset}");
    for calibration in [apart, one] {
        assert_eq!(calibration.fault(), None);
        let ends = [0.0, 0.1, 0.9, 1.0, f64::MIN_POSITIVE].map(|output| calibration.probability(output, TARGETS));
        assert!(ends.iter().all(|p| (0.0..=1.0).contains(p)), "{ends:?}");
        assert!(calibration.probability(f64::NAN, TARGETS).is_nan());
    }
}

#[test]
fn extreme_a_class_alone_has_no_calibration() {
    assert_eq!(of([]), None);
    assert_eq!(of([(0.2, [5, 0]), (0.8, [3, 0])]), None);
    assert_eq!(of([(0.8, [0, 3])]), None);
}

#[test]
fn exact_thresholds_keep_what_they_promise_and_no_other_is_nearer() {
    let cells: Vec<(f64, [u64; 2])> =
        (0..200u64).map(|k| (k as f64 / 200.0, [(200 - k) * (200 - k) / 50, k * k * k / 4000])).collect();
    let calibration = of(cells.iter().copied()).unwrap();
    let sum = |class: usize, keep: &dyn Fn(f64) -> bool| -> u64 {
        cells.iter().filter(|(output, _)| keep(*output)).map(|(_, counts)| counts[class]).sum()
    };
    let all = [sum(0, &|_| true) as f64, sum(1, &|_| true) as f64];
    assert_eq!(calibration.cells.map(|count| count as f64), all);
    for [threshold, missed, alarms] in &calibration.curve {
        assert_eq!(sum(1, &|output| output < *threshold) as f64 / all[1], *missed);
        assert_eq!(sum(0, &|output| output >= *threshold) as f64 / all[0], *alarms);
    }
    for share in [0.001, 0.01, 0.05, 0.2] {
        let low = calibration.missing_at_most(share).unwrap();
        let high = calibration.alarming_at_most(share).unwrap();
        let missed = |threshold: f64| sum(1, &|output| output < threshold) as f64 / all[1];
        let alarms = |threshold: f64| sum(0, &|output| output >= threshold) as f64 / all[0];
        assert!(missed(low) <= share && missed(low + 0.01) > share, "{share} {low}");
        assert!(alarms(high) <= share && alarms(high - 0.01) > share, "{share} {high}");
    }
    // What the curve does not hold is not promised.
    assert_eq!(calibration.missing_at_most(0.0), None);
    assert_eq!(calibration.fault(), None);
}

#[test]
fn extreme_broken_calibrations_are_found() {
    let sound = of([(0.2, [90, 10]), (0.8, [10, 90])]).unwrap();
    let broken = |change: &dyn Fn(&mut Calibration)| {
        let mut calibration = sound.clone();
        change(&mut calibration);
        calibration.fault()
    };
    assert_eq!(broken(&|_| ()), None);
    assert!(broken(&|c| c.slope = f64::NAN).is_some());
    assert!(broken(&|c| c.offset = f64::INFINITY).is_some());
    assert!(broken(&|c| c.curve[0][0] = -0.1).is_some());
    assert!(broken(&|c| c.curve[0][1] = f64::NAN).is_some());
    assert!(broken(&|c| c.curve.reverse()).is_some());
    assert!(broken(&|c| c.curve = vec![[0.5; 3]; 2]).is_some());
}
