//! The downhill simplex, as MATLAB's fminsearch does it: the paper's contact solver.
//!
//! Source: Lagarias, Reeds, Wright & Wright 1998 (reflect 1, expand 2, contract 1/2, shrink 1/2, with its tie rules).
//! Deviation from fminsearch: the first simplex has steps given by the caller (its 0.00025 rad is a poor start for an
//! angle), tolerances are tighter, and a contact solve restarts from its result until that no longer improves it, since a
//! simplex in six dimensions may fold flat before it arrives.

use std::cell::Cell;

use super::residual::{Problem, Unknowns};

/// First steps of a contact solve, metres and radians, and how they shrink from one restart to the next.
const STEP_M: f64 = 0.02;
const STEP_RAD: f64 = 0.05;
const RESTART_SHRINK: f64 = 0.25;
const MAX_RESTARTS: u32 = 12;
/// Size of the last simplex unless a tolerance is given, metres and radians.
const TOLERANCE: f64 = 1e-8;
/// Spread of squared residuals over the last simplex, square metres; with a tolerance of one's own, a tenth of its square.
const COST_TOLERANCE_M2: f64 = 1e-17;
const MAX_EVALUATIONS: u32 = 4000;

/// Where a search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Minimum<const N: usize> {
    pub at: [f64; N],
    pub value: f64,
    pub evaluations: u32,
}

/// The stand, and the number of evaluations it took.
pub(super) fn solve(problem: &Problem, start: Unknowns, tolerance: Option<f64>) -> (Unknowns, u32) {
    let ends = tolerance.map_or((TOLERANCE, COST_TOLERANCE_M2), |tolerance| (tolerance, 0.1 * tolerance * tolerance));
    let cost = |q: &Unknowns| problem.cost(q).unwrap_or(f64::INFINITY);
    if problem.articulated() {
        search(cost, start, ends)
    } else {
        let widen = |q: &[f64; 3]| [q[0], q[1], q[2], 0.0, 0.0, 0.0];
        let (q, evaluations) = search(|q: &[f64; 3]| cost(&widen(q)), [start[0], start[1], start[2]], ends);
        (widen(&q), evaluations)
    }
}

fn search<const N: usize>(
    cost: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    (tolerance, cost_tolerance_m2): (f64, f64),
) -> ([f64; N], u32) {
    let mut best = Minimum { at: start, value: cost(&start), evaluations: 1 };
    let mut scale = 1.0;
    for _ in 0..MAX_RESTARTS {
        let steps = std::array::from_fn(|i| scale * if i == 0 { STEP_M } else { STEP_RAD });
        let found = minimise(&cost, best.at, steps, tolerance, cost_tolerance_m2, MAX_EVALUATIONS);
        let moved = (0..N).fold(0.0, |most: f64, i| most.max((found.at[i] - best.at[i]).abs()));
        best = Minimum { evaluations: best.evaluations + found.evaluations, ..found };
        if moved <= 10.0 * tolerance {
            break;
        }
        scale *= RESTART_SHRINK;
    }
    (best.at, best.evaluations)
}

/// Finds a local minimum of `f` from `start`, with a first simplex of `start` and `start` moved by each of `steps`.
///
/// Ends when every vertex is within `tolerance` of the best one in each coordinate and within `value_tolerance` in value,
/// or after `max_evaluations`. Infinite values are allowed; NaN counts as infinite.
pub(super) fn minimise<const N: usize>(
    f: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    steps: [f64; N],
    tolerance: f64,
    value_tolerance: f64,
    max_evaluations: u32,
) -> Minimum<N> {
    let evaluations = Cell::new(0);
    let value_at = |at: [f64; N]| {
        evaluations.set(evaluations.get() + 1);
        let value = f(&at);
        (at, if value.is_nan() { f64::INFINITY } else { value })
    };
    // Ascending in value.
    let mut simplex = vec![value_at(start)];
    for i in 0..N {
        let mut at = start;
        at[i] += steps[i];
        insert(&mut simplex, value_at(at));
    }
    loop {
        let (best, best_value) = simplex[0];
        let near = simplex[1..].iter().all(|(at, value)| {
            (0..N).all(|i| (at[i] - best[i]).abs() <= tolerance) && value - best_value <= value_tolerance
        });
        let worst = simplex[N];
        if near || worst.1 == best_value && best_value.is_infinite() {
            break;
        }
        let mean: [f64; N] = std::array::from_fn(|i| simplex[..N].iter().map(|v| v.0[i]).sum::<f64>() / N as f64);
        let along = |t: f64| std::array::from_fn(|i| mean[i] + t * (mean[i] - worst.0[i]));
        let reflected = value_at(along(1.0));
        let next = if reflected.1 < best_value {
            let expanded = value_at(along(2.0));
            Some(if expanded.1 < reflected.1 { expanded } else { reflected })
        } else if reflected.1 < simplex[N - 1].1 {
            Some(reflected)
        } else if reflected.1 < worst.1 {
            let outside = value_at(along(0.5));
            (outside.1 <= reflected.1).then_some(outside)
        } else {
            let inside = value_at(along(-0.5));
            (inside.1 < worst.1).then_some(inside)
        };
        match next {
            Some(vertex) => {
                simplex.pop();
                insert(&mut simplex, vertex);
            }
            None => {
                let old = std::mem::replace(&mut simplex, vec![(best, best_value)]);
                for (at, _) in &old[1..] {
                    insert(&mut simplex, value_at(std::array::from_fn(|i| best[i] + 0.5 * (at[i] - best[i]))));
                }
            }
        }
        if evaluations.get() >= max_evaluations {
            break;
        }
    }
    let (at, value) = simplex[0];
    Minimum { at, value, evaluations: evaluations.get() }
}

/// Keeps the order; a newcomer stands behind its equals.
fn insert<const N: usize>(simplex: &mut Vec<([f64; N], f64)>, vertex: ([f64; N], f64)) {
    let place = simplex.partition_point(|other| other.1 <= vertex.1);
    simplex.insert(place, vertex);
}
