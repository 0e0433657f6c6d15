//! Two surfaces and a placement -> which points of the one lie on which of the other, and their normal equations.
//!
//! In: [`Surface`]s, a [`Placement`] of the newer in the older's axes, metres, and a [`Stage`]. Out: [`NormalEquations`], kind by kind: of what
//! stands up, whose points are laid on the nearest point, and of the ground, whose planes are laid on the plane at the same place. Source: as of the
//! registration. Not modelled: that a point may lie between two surfaces.

use super::Surface;
use super::equations::{NormalEquations, Pair};
use super::ground::GroundPlane;
use super::placement::Placement;
use crate::geometry::DVec3;
use crate::wide::{Work, in_fours};

/// Fewer points tell no place.
pub(super) const LEAST_POINTS: usize = 20;
/// Fewer planes of ground tell none.
pub(super) const LEAST_PLANES: usize = 50;
/// Of the newer surface so many points, and so many planes, are laid on the older, evenly drawn.
const MOST_POINTS: usize = 600;
/// A plane of ground farther than this from the older one is of other ground, metres.
const GROUND_REACH_M: f64 = 0.2;
/// Side of a spot, metres: what its points err together is seen in the spread of the spots' pulls.
pub(super) const SPOT_M: f64 = 0.4;

/// What the distances of one kind of pair err.
pub(super) struct Kind {
    /// Standard deviation of a point across its surface, metres, at least and at most: bent surfaces have normals of a neighbourhood.
    pub least_sigma_m: f64,
    pub most_sigma_m: f64,
    /// So many pairs err as one, beyond what the spread of the spots finds; by the NEES of fixes on the shipped configs.
    pub correlated: f64,
    /// Fewer of a surface tell nothing.
    pub least: usize,
    /// Weight of the pairs over the number that was tried, at least: fewer are found on anything.
    pub least_share: f64,
}

const STANDING: Kind =
    Kind { least_sigma_m: 0.02, most_sigma_m: 0.1, correlated: 2.0, least: LEAST_POINTS, least_share: 0.2 };
/// A plane shares most of its cells with its neighbours.
const GROUND: Kind =
    Kind { least_sigma_m: 0.004, most_sigma_m: 0.03, correlated: 4.0, least: LEAST_PLANES, least_share: 0.3 };
pub(super) const KINDS: [Kind; 2] = [STANDING, GROUND];

/// Which points are taken for the same while the steps come nearer.
pub(super) struct Stage {
    /// Distance at most, in all and within the surface, metres.
    pub reach_m: f64,
    pub aside_m: f64,
    /// Cosine between the normals at least.
    pub least_cosine: f64,
    /// Stride over the newer surface's points, once they are no more than [`MOST_POINTS`].
    pub every: usize,
    pub steps: usize,
}

/// From what the guess allows to what only the same spot passes; the first reach is by the guess.
pub(super) const STAGES: [Stage; 3] = [
    Stage { reach_m: 0.5, aside_m: f64::INFINITY, least_cosine: 0.3, every: 2, steps: 6 },
    Stage { reach_m: 0.2, aside_m: 0.1, least_cosine: 0.5, every: 2, steps: 5 },
    Stage { reach_m: 0.2, aside_m: 0.05, least_cosine: 0.7, every: 1, steps: 10 },
];

impl Stage {
    /// Of so many points of a surface every so-manieth is tried.
    pub(super) fn stride(&self, count: usize) -> usize {
        self.every * count.div_ceil(MOST_POINTS).max(1)
    }
}

/// Which points of the newer surface, placed, lie on which of the older.
pub(super) struct Laid<'a> {
    pub newer: &'a Surface,
    pub older: &'a Surface,
    pub placed: &'a Placement,
    pub stage: &'a Stage,
    pub takes_part: [bool; 2],
}

impl Laid<'_> {
    /// Of what stands up, and of the ground.
    pub(super) fn equations(self, &[standing_m2, ground_m2]: &[f64; 2]) -> [NormalEquations; 2] {
        let [stands, lies] = self.takes_part;
        let ground = if lies { self.ground_pairs() } else { Vec::new() };
        let standing = if stands { in_fours(self) } else { Vec::new() };
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
        let Laid { newer, older, placed, stage, .. } = self;
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
