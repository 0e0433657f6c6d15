//! Two sweeps' surfaces and a guess -> where the rover stands relative to where it stood, and how surely.
//!
//! In: [`Surface`]s of what stands up around two stops, each in axes that are level and ahead of the rover, with the rover as origin, and
//! the [`Motion`] between them as reckoned. Out: a [`Fix`] of x, y and heading; metres, radians. Source: point to plane, with the normals of both
//! sides (Rusinkiewicz 2019), by Gauss-Newton steps with Geman-McClure weights. Height and tilt are estimated too and marginalised: instruments tell
//! them better. What stands up takes part point by point; of the ground each stop sees the rings that its own beams draw, which move with the rover, so
//! that it takes part by planes fitted over a metre. The
//! fix is without the guess: what normals seem to tell because they err, as along a wall, is taken off the information. Deviation from least squares
//! with known normals: that, and a covariance that lets the points of one spot err together. Not modelled: surfaces that move, like leaves; and a
//! keyframe with more to lie on than the sweep that replaces it.

mod columns;
mod equations;
mod ground;
mod pairs;
mod placement;
mod surface;

use super::matrix::{
    Matrix, Vector, apply, cholesky, diagonal, half_solve, ln_determinant, solve, square, sum, symmetrise, transpose,
};
use crate::math;
use equations::NormalEquations;
use pairs::{KINDS, Laid, STAGES, Stage};
use placement::Placement;
pub(crate) use surface::Surface;

/// What a fix by the ground alone must at least tell, in nats: less is level ground, and finds nothing again.
const LEAST_TOLD_NATS: f64 = 0.1;
/// What no number of points takes away: metres, metres, radians.
const LEAST_FIX: Vector<3> = [4e-3, 4e-3, 2e-3];
/// Information that no point gives, a place known to ten metres: numbers stay finite along a wall.
const LEAST_INFORMATION: f64 = 0.01;
/// Normals that err seem to tell of directions that no surface tells of, as along a wall. This share of what they add to the information is
/// taken off; the rest is what the estimate of that sum may err by.
const NORMALS_SHARE: f64 = 0.9;
/// Chi-square of three degrees of freedom at 99.9 %: a fix farther off what was reckoned is of other things.
const GATE: f64 = 16.3;
/// Least standard deviations of the guess: x, y, z, metres, and the three turns, radians.
const LEAST_GUESS: Vector<6> = [1e-3, 1e-3, 0.01, 2e-3, 2e-3, 1e-3];
/// A step shorter than this, metres and radians, is the last one of its stage.
const SETTLED: f64 = 2e-4;

/// The first stage reaches so many standard deviations of the guess, within these bounds.
const REACH_SIGMAS: f64 = 3.0;
const LEAST_REACH_M: f64 = 0.2;

/// How the rover came from one stop to another, in the level axes of the first, as reckoned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    /// x, y, heading.
    pub mean: Vector<3>,
    pub covariance: Matrix<3, 3>,
    pub climb_m: f64,
    pub climb_m2: f64,
    /// Of roll and pitch, the errors of both stops together.
    pub tilt_rad2: f64,
}

/// A measurement of x, y and heading, without the guess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fix {
    pub mean: Vector<3>,
    pub covariance: Matrix<3, 3>,
}

impl Fix {
    /// How much surer of the way the fix makes whoever reckoned it: half the logarithm of by how much the covariance's determinant falls.
    fn told_nats(&self, motion: &Motion) -> f64 {
        let [told, all] = [self.covariance, sum(&self.covariance, &motion.covariance)].map(|m| cholesky(&m));
        // |P - P (P + R)^-1 P| = |P| |R| / |P + R|.
        told.zip(all).map_or(0.0, |(told, all)| 0.5 * (ln_determinant(&all) - ln_determinant(&told)))
    }

    /// What the measurement has over a belief.
    pub(super) fn innovation(&self, state: &Vector<3>) -> Vector<3> {
        let [x, y, heading] = self.mean;
        [x - state[0], y - state[1], math::wrap_angle(heading - state[2])]
    }
}

/// What came of a registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Registration {
    Fixed(Fix),
    /// Too few points of the one lie on the other.
    Apart,
    /// Too far off what was reckoned.
    Gated,
}

/// Lays `newer` on `older`.
pub(super) fn register(newer: &Surface, older: &Surface, motion: &Motion) -> Registration {
    let counts = [newer.counts(), older.counts()];
    let takes_part = [0, 1].map(|kind| counts.iter().all(|counts| counts[kind] >= KINDS[kind].least));
    if takes_part == [false; 2] {
        return Registration::Apart;
    }
    let mut placed = Placement::of(motion);
    let guess = placed;
    let information = guess_information(motion);
    let reach_m = REACH_SIGMAS * (motion.covariance[0][0] + motion.covariance[1][1]).max(0.0).sqrt();
    let mut variances_m2 = KINDS.map(|kind| kind.least_sigma_m * kind.least_sigma_m);
    for (k, stage) in STAGES.iter().enumerate() {
        let reach_m = if k == 0 { reach_m.clamp(LEAST_REACH_M, stage.reach_m) } else { stage.reach_m };
        let stage = Stage { reach_m, ..*stage };
        for _ in 0..stage.steps {
            let by_kind = Laid { newer, older, placed: &placed, stage: &stage, takes_part }.equations(&variances_m2);
            for ((variance_m2, equations), kind) in variances_m2.iter_mut().zip(&by_kind).zip(&KINDS) {
                if let Some(told_m2) = equations.told_m2() {
                    let [least_m2, most_m2] = [kind.least_sigma_m, kind.most_sigma_m].map(|sigma_m| sigma_m * sigma_m);
                    *variance_m2 = told_m2.clamp(least_m2, most_m2);
                }
            }
            let pull = apply(&information, &guess.from(&placed));
            let (told, gradient) = total(&by_kind);
            let towards: Vector<6> = std::array::from_fn(|i| gradient[i] + pull[i]);
            let Some(factor) = cholesky(&sum(&told, &information)) else { return Registration::Apart };
            let step = solve(&factor, &towards.map(|t| [t])).map(|[s]| s);
            placed.shift(&step);
            if step.iter().all(|s| s.abs() < SETTLED) {
                break;
            }
        }
    }
    // Once more where it ended, so that gradient and information are of one place.
    let last = &STAGES[STAGES.len() - 1];
    let mut by_kind = Laid { newer, older, placed: &placed, stage: last, takes_part }.equations(&variances_m2);
    for ((equations, kind), count) in by_kind.iter_mut().zip(&KINDS).zip(newer.counts()) {
        let tried = count.div_ceil(last.stride(count)) as f64;
        if equations.weight < (kind.least as f64).max(kind.least_share * tried) {
            *equations = NormalEquations::of(Vec::new(), kind.least_sigma_m * kind.least_sigma_m, kind);
        }
    }
    let [stands, lies] = [0, 1].map(|kind| !by_kind[kind].pairs.is_empty());
    if !stands && !lies {
        return Registration::Apart;
    }
    match fix(&by_kind, &placed, &information, &guess.from(&placed)) {
        Some(fix) if stands || fix.told_nats(motion) >= LEAST_TOLD_NATS => gated(fix, motion),
        _ => Registration::Apart,
    }
}

/// Information and gradient of all kinds of pair.
fn total([standing, ground]: &[NormalEquations; 2]) -> (Matrix<6, 6>, Vector<6>) {
    let gradient = std::array::from_fn(|i| standing.gradient[i] + ground.gradient[i]);
    (sum(&standing.information, &ground.information), gradient)
}

/// The inverse of the guess's covariance, with its least standard deviations.
fn guess_information(motion: &Motion) -> Matrix<6, 6> {
    let least = |k: usize| LEAST_GUESS[k] * LEAST_GUESS[k];
    let plan = sum(&motion.covariance, &diagonal(&[least(0), least(1), least(5)]));
    let inverse = cholesky(&plan).map(|factor| solve(&factor, &diagonal(&[1.0; 3]))).unwrap_or_default();
    let tilt = 1.0 / (motion.tilt_rad2 + least(3));
    let mut information = diagonal(&[0.0, 0.0, 1.0 / (motion.climb_m2 + least(2)), tilt, tilt, 0.0]);
    for (r, &row) in PLAN.iter().enumerate() {
        for (c, &column) in PLAN.iter().enumerate() {
            information[row][column] = inverse[r][c];
        }
    }
    information
}

/// Of the six, those that the fix tells, and those that are marginalised.
const PLAN: [usize; 3] = [0, 1, 5];
const REST: [usize; 3] = [2, 3, 4];

/// Where the points, and of height and tilt the guess, would have the placement, and how surely: what every point errs alone, and what those
/// of one spot err together (the sandwich of White 1980, by spots).
fn fix(by_kind: &[NormalEquations; 2], placed: &Placement, guess: &Matrix<6, 6>, to_guess: &Vector<6>) -> Option<Fix> {
    let [standing, ground] = by_kind;
    let errors = sum(&standing.by_normals(), &ground.by_normals());
    let (told, mut towards) = total(by_kind);
    let mut information: Matrix<6, 6> =
        std::array::from_fn(|r| std::array::from_fn(|c| told[r][c] - NORMALS_SHARE * errors[r][c]));
    for k in PLAN {
        information[k][k] += LEAST_INFORMATION;
    }
    for k in REST {
        information[k][k] += guess[k][k];
        towards[k] += guess[k][k] * to_guess[k];
    }
    let mut scores = information;
    for by_spot in by_kind.iter().map(NormalEquations::by_spot) {
        let spots = by_spot.len() as f64;
        for pull in by_spot.values() {
            for r in 0..6 {
                for c in 0..6 {
                    scores[r][c] += pull[r] * pull[c] * spots / (spots - 1.0).max(1.0);
                }
            }
        }
    }
    let factor = cholesky(&information)?;
    let spread = solve(&factor, &transpose(&solve(&factor, &scores)));
    let step = solve(&factor, &towards.map(|t| [t])).map(|[s]| s);
    let heading_rad = math::wrap_angle(placed.heading_rad() + step[5]);
    let mut covariance = std::array::from_fn(|r| std::array::from_fn(|c| spread[PLAN[r]][PLAN[c]]));
    symmetrise(&mut covariance);
    let covariance = sum(&covariance, &diagonal(&LEAST_FIX.map(|s| s * s)));
    Some(Fix { mean: [placed.place_m.x + step[0], placed.place_m.y + step[1], heading_rad], covariance })
}

/// The fix, unless it lies too far off what was reckoned.
fn gated(fix: Fix, motion: &Motion) -> Registration {
    let innovation = fix.innovation(&motion.mean);
    match cholesky(&sum(&fix.covariance, &motion.covariance)) {
        Some(factor) if square(&half_solve(&factor, &innovation)) <= GATE => Registration::Fixed(fix),
        _ => Registration::Gated,
    }
}

#[cfg(test)]
mod tests;
