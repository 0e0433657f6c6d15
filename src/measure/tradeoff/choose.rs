//! Costs and losses -> which settings nobody beats, and which is the cheapest that is good enough.

use crate::statistics::Interval;

/// What a choice looks at; lower is better in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub cost: f64,
    pub loss: Interval,
}

/// Whether each candidate is on the Pareto front: no other costs at most as much and loses at most as much, and less of one. A loss counts
/// at the upper end of its interval, so that luck puts none there; one that is not finite is on no front.
pub(crate) fn front(candidates: &[Candidate]) -> Vec<bool> {
    let beats = |a: &Candidate, b: &Candidate| {
        let (ours, theirs) = (a.loss.upper(), b.loss.upper());
        a.cost <= b.cost && ours <= theirs && (a.cost < b.cost || ours < theirs)
    };
    let finite = |c: &Candidate| c.cost.is_finite() && c.loss.upper().is_finite();
    candidates.iter().map(|c| finite(c) && !candidates.iter().any(|other| finite(other) && beats(other, c))).collect()
}

/// The cheapest candidate whose loss is at most this, judged at the upper end of its interval; of equals the first. `None` where none is.
pub(crate) fn cheapest_within(candidates: &[Candidate], max_loss: f64) -> Option<usize> {
    let good = candidates.iter().enumerate().filter(|(_, c)| c.cost.is_finite() && c.loss.upper() <= max_loss);
    good.min_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost)).map(|(k, _)| k)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(cost: f64, mean: f64, half_width: f64) -> Candidate {
        Candidate { cost, loss: Interval { mean, half_width } }
    }

    #[test]
    fn exact_the_front_is_what_nobody_beats() {
        let candidates = [
            candidate(10.0, 0.0, 0.0),
            candidate(5.0, 0.01, 0.0),
            candidate(6.0, 0.01, 0.0), // Dearer than the one before, and no better.
            candidate(2.0, 0.05, 0.0),
            candidate(3.0, 0.06, 0.0),
            candidate(2.0, 0.05, 0.0),   // Equals do not beat each other.
            candidate(9.0, -0.02, 0.05), // Lower in its mean than any, and not surely so.
            candidate(1.0, f64::NAN, 0.0),
            candidate(f64::INFINITY, -1.0, 0.0),
            candidate(0.1, 0.0, f64::INFINITY),
        ];
        assert_eq!(front(&candidates), [true, true, false, true, false, true, false, false, false, false]);
    }

    #[test]
    fn exact_the_cheapest_is_judged_at_the_upper_end() {
        let candidates = [
            candidate(10.0, 0.0, 0.0),
            candidate(4.0, 0.004, 0.007), // Its mean would do, its upper end 0.011 does not.
            candidate(5.0, 0.004, 0.006), // 0.010 is not more than 0.010.
            candidate(5.0, 0.0, 0.001),
            candidate(1.0, 0.0, f64::INFINITY), // One seed says nothing.
        ];
        assert_eq!(cheapest_within(&candidates, 0.01), Some(2));
        assert_eq!(cheapest_within(&candidates, 0.0005), Some(0));
        assert_eq!(cheapest_within(&candidates, 0.02), Some(1));
        assert_eq!(cheapest_within(&candidates, -0.1), None);
        assert_eq!(cheapest_within(&[], 1.0), None);
    }
}
