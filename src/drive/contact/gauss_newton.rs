//! Damped Gauss-Newton on the wheels' residuals.
//!
//! Source: Levenberg 1944, Marquardt 1963 (damping by the diagonal); undamped until a step fails to descend. From the step
//! before it takes 3 to 8 linearisations. Where an articulated chassis gets stuck at a kink, the second method takes over: solve
//! with the ground under each wheel held, go a share of the way, look again, repeat, and descend from there. With a share of
//! a half that is a contraction while slope times tangent of tilt stays moderate, kinks or not; beside a wall a wheel that rolls aside
//! falls so steeply that only smaller shares settle.

use super::residual::{GroundDerivatives, Jacobian, Problem, Residuals, UNKNOWNS, Unknowns, sum_of_squares};

const MAX_STEPS: u32 = 60;
/// Unless a tolerance is given, an articulated chassis is done when no wheel lacks more than this, and any when a step
/// changes nothing by more than this, metres and radians.
const TOLERANCE: f64 = 1e-11;
/// Whether so small a step descends is lost in rounding: it is taken on trust if undamped, metres and radians.
///
/// A residual of 5 cm at a height of 10 m is known to 2e-15 m, its square to 2e-16 m2: that hides steps of 5e-8.
const LOST: f64 = 1e-7;
/// What leaves an articulated chassis to the second method, metres.
const STUCK_M: f64 = 1e-9;
/// Shares of a held-ground step that are taken, one after the other: half settles steps that would swing to and fro.
const RELAX: [f64; 3] = [0.5, 0.1, 0.02];
/// So many whole steps are taken in shares.
const LOOKS: f64 = 50.0;
/// Damping: the first, and the one at which no descent is left to find.
const FIRST_DAMPING: f64 = 1e-3;
const LAST_DAMPING: f64 = 1e10;

/// The stand, and the number of linearisations it took.
pub(super) fn solve(problem: &Problem, start: Unknowns, tolerance: Option<f64>) -> (Unknowns, u32) {
    let tolerance = tolerance.unwrap_or(TOLERANCE);
    let (mut q, mut steps) = descend(problem, start, tolerance);
    let touches = |q: &Unknowns| worst_m(problem, q) <= STUCK_M.max(tolerance);
    let mut held = q;
    for share in RELAX {
        if !problem.articulated() || touches(&q) {
            break;
        }
        // Where one stand ends and the next begins a hair away, the descent stays where the first was and looks creep on to the second.
        let looks;
        (held, looks) = hold_and_look(problem, held, share, tolerance);
        steps += looks;
        q = better(problem, q, held);
        if !touches(&q) {
            let (found, more) = descend(problem, held, tolerance);
            steps += more;
            q = better(problem, q, found);
        }
    }
    (q, steps)
}

/// The one of two stands whose wheels lack less of touching; the first if neither does.
fn better(problem: &Problem, a: Unknowns, b: Unknowns) -> Unknowns {
    if worst_m(problem, &b) < worst_m(problem, &a) { b } else { a }
}

fn descend(problem: &Problem, start: Unknowns, tolerance: f64) -> (Unknowns, u32) {
    let mut q = start;
    let Some((mut e, mut jacobian)) = problem.linearised(&q, GroundDerivatives::Moving) else { return (q, 1) };
    let mut cost = sum_of_squares(&e);
    let mut damping = 0.0;
    for steps in 1..MAX_STEPS {
        if problem.articulated() && e.iter().all(|e| e.abs() <= tolerance) {
            return (q, steps);
        }
        let moved = step(&e, &jacobian, problem.unknowns(), damping);
        if let Some(delta) = moved {
            let trial: Unknowns = std::array::from_fn(|i| q[i] + delta[i]);
            if delta.iter().all(|d| d.abs() <= tolerance) {
                return (trial, steps);
            }
            let lost = damping == 0.0 && delta.iter().all(|d| d.abs() <= LOST);
            if let Some((trial_e, trial_jacobian)) = problem.linearised(&trial, GroundDerivatives::Moving) {
                let trial_cost = sum_of_squares(&trial_e);
                // A least sum above zero is flat to rounding long before its place is found to rounding.
                if trial_cost < cost || lost {
                    (q, e, jacobian, cost) = (trial, trial_e, trial_jacobian, trial_cost);
                    damping = if damping <= FIRST_DAMPING { 0.0 } else { 0.1 * damping };
                    continue;
                }
            }
        }
        damping = if damping == 0.0 { FIRST_DAMPING } else { 10.0 * damping };
        if damping > LAST_DAMPING {
            return (q, steps);
        }
    }
    (q, MAX_STEPS)
}

fn hold_and_look(problem: &Problem, start: Unknowns, share: f64, tolerance: f64) -> (Unknowns, u32) {
    let mut q = start;
    let most = (LOOKS / share) as u32;
    for steps in 0..most {
        let Some((e, jacobian)) = problem.linearised(&q, GroundDerivatives::Frozen) else { return (start, steps) };
        let Some(delta) = step(&e, &jacobian, problem.unknowns(), 0.0) else { return (q, steps) };
        q = std::array::from_fn(|i| q[i] + share * delta[i]);
        if delta.iter().all(|d| d.abs() <= tolerance) {
            return (q, steps);
        }
    }
    (q, most)
}

fn worst_m(problem: &Problem, q: &Unknowns) -> f64 {
    problem.residuals(q).map_or(f64::INFINITY, |e| e.iter().fold(0.0, |worst: f64, e| worst.max(e.abs())))
}

/// Solves (J'J + damping diag(J'J)) delta = -J'e by Cholesky; `None` where that matrix is not positive definite.
///
/// The wheels' levers lie within a decade of each other, so that cond(J'J) stays below 1e4.
fn step(e: &Residuals, jacobian: &Jacobian, unknowns: usize, damping: f64) -> Option<Unknowns> {
    let mut a = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut delta = [0.0; UNKNOWNS];
    for (e, row) in e.iter().zip(jacobian) {
        for i in 0..unknowns {
            delta[i] -= row[i] * e;
            for j in 0..=i {
                a[i][j] += row[i] * row[j];
            }
        }
    }
    for i in 0..unknowns {
        a[i][i] *= 1.0 + damping;
        for j in 0..=i {
            let known: f64 = a[i][..j].iter().zip(&a[j][..j]).map(|(x, y)| x * y).sum();
            let sum = a[i][j] - known;
            if i > j {
                a[i][j] = sum / a[j][j];
            } else if sum > 1e-14 * a[i][i] {
                a[i][i] = sum.sqrt();
            } else {
                return None;
            }
        }
    }
    for i in 0..unknowns {
        for k in 0..i {
            delta[i] -= a[i][k] * delta[k];
        }
        delta[i] /= a[i][i];
    }
    for i in (0..unknowns).rev() {
        for k in i + 1..unknowns {
            delta[i] -= a[k][i] * delta[k];
        }
        delta[i] /= a[i][i];
    }
    delta.iter().all(|d| d.is_finite()).then_some(delta)
}
