//! Two sweeps' surfaces and a guess -> where the rover stands relative to where it stood, and how surely.
//!
//! In: [`Surface`]s of what stands up around two stops, each in axes that are level and ahead of the rover, with the rover as origin, and
//! the [`Motion`] between them as reckoned. Out: a [`Fix`] of x, y and heading; metres, radians. Source: point to plane, with the normals of both
//! sides (Rusinkiewicz 2019), by Gauss-Newton steps with Geman-McClure weights. Height and tilt are estimated too and marginalised: instruments tell
//! them better. What stands up takes part point by point; of the ground each stop sees the rings that its own beams draw, which move with the rover, so
//! that it takes part, where a surface has it, by planes fitted over a metre. The
//! fix is without the guess: what normals seem to tell because they err, as along a wall, is taken off the information. Deviation from least squares
//! with known normals: that, and a covariance that lets the points of one spot err together. Not modelled: surfaces that move, like leaves.

mod columns;
mod equations;
mod ground;
mod placement;
mod surface;

use super::matrix::{Matrix, Vector, apply, cholesky, diagonal, half_solve, solve, square, sum, symmetrise, transpose};
use crate::geometry::DVec3;
use crate::math;
use crate::wide::{Work, in_fours};
use equations::{NormalEquations, Pair};
use ground::GroundPlane;
use placement::Placement;
pub(crate) use surface::Surface;

/// Fewer points tell no place.
const LEAST_POINTS: usize = 20;
/// Fewer planes of ground tell none.
const LEAST_PLANES: usize = 50;
/// Of the newer surface so many points, and so many planes, are laid on the older, evenly drawn.
const MOST_POINTS: usize = 600;
/// What no number of points takes away: metres, metres, radians.
const LEAST_FIX: Vector<3> = [4e-3, 4e-3, 2e-3];
/// Side of a spot, metres: what its points err together is seen in the spread of the spots' pulls.
const SPOT_M: f64 = 0.4;
/// Information that no point gives, a place known to ten metres: numbers stay finite along a wall.
const LEAST_INFORMATION: f64 = 0.01;
/// Normals that err seem to tell of directions that no surface tells of, as along a wall. This share of what they add to the information is
/// taken off; the rest is what the estimate of that sum may err by.
const NORMALS_SHARE: f64 = 0.9;
/// Points that lie on the older surface, over those that were tried, at least; fewer are found on anything. And planes that lie where the older has some.
const LEAST_SHARE: f64 = 0.2;
const LEAST_GROUND_SHARE: f64 = 0.3;
/// A plane of ground farther than this from the older one is of other ground, metres.
const GROUND_REACH_M: f64 = 0.2;
/// Chi-square of three degrees of freedom at 99.9 %: a fix farther off what was reckoned is of other things.
const GATE: f64 = 16.3;
/// Least standard deviations of the guess: x, y, z, metres, and the three turns, radians.
const LEAST_GUESS: Vector<6> = [1e-3, 1e-3, 0.01, 2e-3, 2e-3, 1e-3];
/// A step shorter than this, metres and radians, is the last one of its stage.
const SETTLED: f64 = 2e-4;

/// What the distances of one kind of pair err.
struct Kind {
    /// Standard deviation of a point across its surface, metres, at least and at most: bent surfaces have normals of a neighbourhood.
    least_sigma_m: f64,
    most_sigma_m: f64,
    /// So many pairs err as one, beyond what the spread of the spots finds; by the NEES of fixes on the shipped configs.
    correlated: f64,
}

const STANDING: Kind = Kind { least_sigma_m: 0.02, most_sigma_m: 0.1, correlated: 2.0 };
/// A plane shares most of its cells with its neighbours.
const GROUND: Kind = Kind { least_sigma_m: 0.004, most_sigma_m: 0.03, correlated: 4.0 };
const KINDS: [Kind; 2] = [STANDING, GROUND];

/// Which points are taken for the same while the steps come nearer.
struct Stage {
    /// Distance at most, in all and within the surface, metres.
    reach_m: f64,
    aside_m: f64,
    /// Cosine between the normals at least.
    least_cosine: f64,
    /// Stride over the newer surface's points, once they are no more than [`MOST_POINTS`].
    every: usize,
    steps: usize,
}

/// From what the guess allows to what only the same spot passes; the first reach is by the guess.
const STAGES: [Stage; 3] = [
    Stage { reach_m: 0.5, aside_m: f64::INFINITY, least_cosine: 0.3, every: 2, steps: 6 },
    Stage { reach_m: 0.2, aside_m: 0.1, least_cosine: 0.5, every: 2, steps: 5 },
    Stage { reach_m: 0.2, aside_m: 0.05, least_cosine: 0.7, every: 1, steps: 10 },
];
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
    let both_have = |least: usize, count: fn(&Surface) -> usize| count(newer) >= least && count(older) >= least;
    if !both_have(LEAST_POINTS, Surface::len) && !both_have(LEAST_PLANES, |surface| surface.ground.len()) {
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
            let by_kind = Laid { newer, older, placed: &placed, stage: &stage }.equations(&variances_m2);
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
    let by_kind = Laid { newer, older, placed: &placed, stage: last }.equations(&variances_m2);
    let [standing, ground] = &by_kind;
    let enough = |least: usize, share: f64, of: usize| (least as f64).max(share * of.div_ceil(last.stride(of)) as f64);
    let stands = standing.weight >= enough(LEAST_POINTS, LEAST_SHARE, newer.len());
    let lies = ground.pairs.len() as f64 >= enough(LEAST_PLANES, LEAST_GROUND_SHARE, newer.ground.len());
    if !stands && !lies {
        return Registration::Apart;
    }
    match fix(&by_kind, &placed, &information, &guess.from(&placed)) {
        Some(fix) => gated(fix, motion),
        None => Registration::Apart,
    }
}

/// Information and gradient of all kinds of pair.
fn total([standing, ground]: &[NormalEquations; 2]) -> (Matrix<6, 6>, Vector<6>) {
    let gradient = std::array::from_fn(|i| standing.gradient[i] + ground.gradient[i]);
    (sum(&standing.information, &ground.information), gradient)
}

impl Stage {
    /// Of so many points of a surface every so-manieth is tried.
    fn stride(&self, count: usize) -> usize {
        self.every * count.div_ceil(MOST_POINTS).max(1)
    }
}

/// Which points of the newer surface, placed, lie on which of the older.
struct Laid<'a> {
    newer: &'a Surface,
    older: &'a Surface,
    placed: &'a Placement,
    stage: &'a Stage,
}

impl Laid<'_> {
    /// Of what stands up, and of the ground.
    fn equations(self, &[standing_m2, ground_m2]: &[f64; 2]) -> [NormalEquations; 2] {
        let ground = self.ground_pairs();
        let standing = in_fours(self);
        [NormalEquations::of(standing, standing_m2, &STANDING), NormalEquations::of(ground, ground_m2, &GROUND)]
    }

    /// The pair of a point and its normal, if there is one.
    #[inline(always)]
    fn pair(&self, point_m: DVec3, normal: DVec3) -> Option<Pair> {
        let Laid { older, placed, stage, .. } = self;
        let arm_m = placed.turn * point_m;
        let (here_m, own) = (placed.place_m + arm_m, placed.turn * normal);
        let (at, apart_m2) = older.columns.nearest(here_m, stage.reach_m)?;
        let (other_m, other) = (older.columns.places_m()[at], older.normals[at]);
        let cosine = own.dot(other);
        let across_m = other.dot(other_m - here_m);
        let aside_m2 = apart_m2 - across_m * across_m;
        if cosine.abs() < stage.least_cosine || aside_m2 > stage.aside_m * stage.aside_m {
            return None;
        }
        // Normals have no side: both are taken to look the same way.
        Pair::of(arm_m, here_m, own * cosine.signum(), other_m, other)
    }

    /// Planes of the newer ground and those of the older at the same places.
    fn ground_pairs(&self) -> Vec<Pair> {
        let Laid { newer, older, placed, stage } = self;
        let pair = |plane: &GroundPlane| {
            let arm_m = placed.turn * plane.place_m;
            let here_m = placed.place_m + arm_m;
            let other = older.ground.at(here_m)?;
            Pair::of(arm_m, here_m, placed.turn * plane.normal, other.place_m, other.normal)
                .filter(|pair| pair.across_m.abs() < GROUND_REACH_M)
        };
        newer.ground.planes().step_by(stage.stride(newer.ground.len())).filter_map(pair).collect()
    }
}

impl Work for Laid<'_> {
    type Out = Vec<Pair>;

    #[inline(always)]
    fn run(self) -> Vec<Pair> {
        let (newer, stride) = (self.newer, self.stage.stride(self.newer.len()));
        let mut pairs = Vec::with_capacity(newer.len().div_ceil(stride));
        for k in (0..newer.len()).step_by(stride) {
            if let Some(pair) = self.pair(newer.columns.places_m()[k], newer.normals[k]) {
                pairs.push(pair);
            }
        }
        pairs
    }
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
