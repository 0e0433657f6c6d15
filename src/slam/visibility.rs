//! Where a sweep looked, and how far it saw -> whether a landmark should have been seen.
//!
//! In: a pattern and the ranges of one sweep. Out: yes or no for a point in the sensor frame. Directions are binned on the
//! unfolded octahedron (Cigolle et al. 2014): a few additions and one division a beam, where azimuth and elevation would
//! cost two arc tangents; bins of 2 to 5 degrees a side.

use super::matrix::Vector;
use crate::geometry::DVec3;

const SIDE: usize = 64;
/// A surface this much nearer than a landmark hides it, metres: a rock's own front is nearer than its centre.
const HIDING_M: f64 = 0.5;

/// The farthest that a sweep saw in each direction.
#[derive(Clone, Debug)]
pub struct Visibility {
    /// Landmarks farther away are not expected.
    pub max_range_m: f64,
    /// Per bin, metres; 0 where no beam went, infinite where one met nothing.
    reach_m: Vec<f64>,
}

/// The bin of a direction (of any length but 0).
#[inline]
pub fn direction_bin(x: f64, y: f64, z: f64) -> usize {
    let scale = 1.0 / (x.abs() + y.abs() + z.abs());
    let (mut u, mut v) = (x * scale, y * scale);
    if z < 0.0 {
        (u, v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    }
    let cell = |t: f64| (((t + 1.0) * (0.5 * SIDE as f64)) as usize).min(SIDE - 1);
    cell(v) * SIDE + cell(u)
}

impl Visibility {
    /// Nothing seen yet.
    pub fn blind(max_range_m: f64) -> Visibility {
        Visibility { max_range_m, reach_m: vec![0.0; SIDE * SIDE] }
    }

    /// Free sight up to `max_range_m` in each of the directions.
    pub fn free(max_range_m: f64, directions: &[DVec3]) -> Visibility {
        let mut visibility = Visibility::blind(max_range_m);
        for d in directions {
            visibility.note(direction_bin(d.x, d.y, d.z), f64::INFINITY);
        }
        visibility
    }

    /// A beam of one bin met its first surface at `range_m`.
    #[inline]
    pub fn note(&mut self, bin: usize, range_m: f64) {
        let reach_m = &mut self.reach_m[bin];
        if range_m > *reach_m {
            *reach_m = range_m;
        }
    }

    /// Whether a thing at a point of the sensor frame would have been in view.
    pub fn sees(&self, point_m: &Vector<3>) -> bool {
        let [x, y, z] = *point_m;
        let range_m = (x * x + y * y + z * z).sqrt();
        if !(range_m > 0.0 && range_m <= self.max_range_m) {
            return false;
        }
        let reach_m = self.reach_m[direction_bin(x, y, z)];
        reach_m > 0.0 && range_m < reach_m + HIDING_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    #[test]
    fn law_a_bin_holds_directions_within_a_few_degrees_only() {
        let mut firsts: Vec<Option<DVec3>> = vec![None; SIDE * SIDE];
        for i in 0..200_000u32 {
            // Points on a spiral cover the sphere evenly.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 200_000.0;
            let (s, c) = math::sin_cos(f64::from(i) * 2.399_963_229_728_653);
            let d = DVec3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z);
            let first = firsts[direction_bin(d.x, d.y, d.z)].get_or_insert(d);
            assert!(first.dot(d) > math::cos(0.15), "{first} {d}");
        }
        assert!(firsts.iter().all(Option::is_some), "every bin stands for a direction");
    }

    #[test]
    fn exact_hidden_far_and_unswept_places_are_not_seen() {
        let mut visibility = Visibility::blind(4.0);
        let along = |range_m: f64| [0.9 * range_m, 0.3 * range_m, -0.1f64.sqrt() * range_m];
        let [x, y, z] = along(1.0);
        visibility.note(direction_bin(x, y, z), 2.0);
        assert!(visibility.sees(&along(1.9)));
        assert!(!visibility.sees(&along(3.0)), "hidden");
        assert!(!visibility.sees(&[-1.0, 0.02, 0.02]), "never swept");
        visibility.note(direction_bin(x, y, z), f64::INFINITY);
        assert!(visibility.sees(&along(3.0)));
        assert!(!visibility.sees(&along(4.1)), "too far");
    }
}
