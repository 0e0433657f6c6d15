//! Where a sweep looked, and how far it saw -> whether a landmark should have been seen.
//!
//! In: a pattern and the ranges of one sweep. Out: yes or no for a point in the sensor frame. Directions are binned on the
//! unfolded octahedron (Cigolle et al. 2014): a few additions and one division a beam, where azimuth and elevation would
//! cost two arc tangents; bins of 2 to 5 degrees a side. Which beams lie in a bin is worked out once for a pattern; how far they
//! saw, when a landmark lies there.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::matrix::Vector;
use crate::geometry::DVec3;
use crate::sweep::{Pattern, Returns, Status};

const SIDE: usize = 64;
/// A surface this much nearer than a landmark hides it, metres: a rock's own front is nearer than its centre.
const HIDING_M: f64 = 0.5;

/// The farthest that a sweep saw in each direction.
#[derive(Clone, Debug)]
pub struct Visibility<'s> {
    /// Landmarks farther away are not expected.
    pub max_range_m: f64,
    reach: Reach<'s>,
}

/// How far each direction saw.
#[derive(Clone, Debug)]
enum Reach<'s> {
    /// Per bin, metres; 0 where no beam went, infinite where one met nothing.
    Told(Vec<f64>),
    Sweep(&'s Returns, Arc<Bins>),
}

/// The beams of a pattern, bin by bin.
#[derive(Debug)]
pub(crate) struct Bins {
    /// Where the slots of each bin begin, and where the last one's end.
    starts: Vec<u32>,
    slots: Vec<u32>,
}

impl Bins {
    /// Of a pattern; the same as last time while the pattern lives.
    pub(crate) fn of(pattern: &Arc<Pattern>) -> Arc<Bins> {
        static KNOWN: Mutex<Vec<(Weak<Pattern>, Arc<Bins>)>> = Mutex::new(Vec::new());
        // A thread that panicked while it held the list has left it whole.
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(pattern, _)| pattern.strong_count() > 0);
        if let Some((_, bins)) = known.iter().find(|(other, _)| std::ptr::eq(other.as_ptr(), Arc::as_ptr(pattern))) {
            return bins.clone();
        }
        let bins = Arc::new(Bins::new(&pattern.directions));
        known.push((Arc::downgrade(pattern), bins.clone()));
        bins
    }

    fn new(directions: &[DVec3]) -> Bins {
        let bins: Vec<u16> = directions.iter().map(|d| direction_bin(d.x, d.y, d.z) as u16).collect();
        let mut starts = vec![0; SIDE * SIDE + 1];
        for &bin in &bins {
            starts[usize::from(bin) + 1] += 1;
        }
        for bin in 0..SIDE * SIDE {
            starts[bin + 1] += starts[bin];
        }
        let (mut next, mut slots) = (starts.clone(), vec![0; bins.len()]);
        for (slot, &bin) in bins.iter().enumerate() {
            let place = &mut next[usize::from(bin)];
            slots[*place as usize] = slot as u32;
            *place += 1;
        }
        Bins { starts, slots }
    }

    fn slots(&self, bin: usize) -> &[u32] {
        &self.slots[self.starts[bin] as usize..self.starts[bin + 1] as usize]
    }
}

/// The bin of a direction (of any length but 0).
#[inline]
pub(super) fn direction_bin(x: f64, y: f64, z: f64) -> usize {
    let scale = 1.0 / (x.abs() + y.abs() + z.abs());
    let (mut u, mut v) = (x * scale, y * scale);
    if z < 0.0 {
        (u, v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    }
    let cell = |t: f64| (((t + 1.0) * (0.5 * SIDE as f64)) as usize).min(SIDE - 1);
    cell(v) * SIDE + cell(u)
}

impl<'s> Visibility<'s> {
    /// Nothing seen.
    pub fn blind(max_range_m: f64) -> Visibility<'s> {
        Visibility { max_range_m, reach: Reach::Told(vec![0.0; SIDE * SIDE]) }
    }

    /// Free sight up to `max_range_m` in each of the directions.
    pub fn free(max_range_m: f64, directions: &[DVec3]) -> Visibility<'s> {
        let mut reach_m = vec![0.0; SIDE * SIDE];
        for d in directions {
            reach_m[direction_bin(d.x, d.y, d.z)] = f64::INFINITY;
        }
        Visibility { max_range_m, reach: Reach::Told(reach_m) }
    }

    /// What a sweep saw; `bins` are those of its pattern.
    pub(crate) fn of_sweep(max_range_m: f64, returns: &'s Returns, bins: Arc<Bins>) -> Visibility<'s> {
        Visibility { max_range_m, reach: Reach::Sweep(returns, bins) }
    }

    /// Whether a thing at a point of the sensor frame would have been in view.
    #[inline]
    pub fn sees(&self, point_m: &Vector<3>) -> bool {
        let [x, y, z] = *point_m;
        let range_m = (x * x + y * y + z * z).sqrt();
        if !(range_m > 0.0 && range_m <= self.max_range_m) {
            return false;
        }
        let reach_m = self.reach_m(direction_bin(x, y, z));
        reach_m > 0.0 && range_m < reach_m + HIDING_M
    }

    /// The farthest that the beams of a bin saw, metres; 0 where none went.
    fn reach_m(&self, bin: usize) -> f64 {
        match &self.reach {
            Reach::Told(reach_m) => reach_m[bin],
            Reach::Sweep(returns, bins) => {
                let saw_m = |&slot: &u32| {
                    let slot = slot as usize;
                    match (returns.status.get(slot), returns.range_m.get(slot)) {
                        (Some(Status::None), Some(_)) => f64::INFINITY,
                        (Some(Status::Hit), Some(&range_m)) if range_m.is_finite() => range_m,
                        _ => 0.0,
                    }
                };
                bins.slots(bin).iter().map(saw_m).fold(0.0, |most, saw| if saw > most { saw } else { most })
            }
        }
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

    /// A sweep of some beams by what each met: its range, or nothing.
    fn sweep(directions: Vec<DVec3>, met: &[(Status, f64)]) -> Returns {
        let beams = directions.len() as u32;
        Returns {
            pattern: Arc::new(Pattern { lines: 1, beams, directions, times_s: Vec::new() }),
            range_m: met.iter().map(|met| met.1).collect(),
            status: met.iter().map(|met| met.0).collect(),
            intensity: None,
        }
    }

    #[test]
    fn exact_hidden_far_and_unswept_places_are_not_seen() {
        let way = DVec3::new(0.9, 0.3, -0.1f64.sqrt());
        let along = |range_m: f64| (way * range_m).to_array();
        let nearly = way + DVec3::new(1e-3, 0.0, 0.0);
        let seen = |met: &[(Status, f64)], point_m: Vector<3>| {
            let sweep = sweep(vec![way, nearly, -way], met);
            Visibility::of_sweep(4.0, &sweep, Bins::of(&sweep.pattern)).sees(&point_m)
        };
        let near = [(Status::Hit, 2.0), (Status::Hit, 1.0), (Status::None, f64::NAN)];
        assert!(seen(&near, along(1.9)) && seen(&near, along(2.4)), "the farthest of a bin counts");
        assert!(!seen(&near, along(3.0)), "hidden");
        assert!(!seen(&near, [-1.0, 0.02, 0.02]), "never swept");
        assert!(seen(&near, along(-3.0)) && !seen(&near, along(-4.1)), "free, and too far");
        for nothing in [(Status::Dropped, 2.0), (Status::OutOfRange, 2.0), (Status::Hit, f64::NAN), (Status::Hit, -1.0)]
        {
            assert!(!seen(&[nothing; 3], along(1.0)), "{nothing:?}");
        }
        assert!(!seen(&[(Status::Hit, f64::INFINITY); 3], along(1.0)), "no range");
        assert!(!seen(&[], along(1.0)), "a sweep cut short");
    }

    #[test]
    fn law_a_patterns_bins_are_worked_out_once_and_hold_each_beam_once() {
        let pattern = sweep(vec![DVec3::X, DVec3::Y, DVec3::X, DVec3::NEG_Z], &[]).pattern;
        let bins = Bins::of(&pattern);
        assert!(Arc::ptr_eq(&bins, &Bins::of(&pattern)));
        assert_eq!(bins.slots(direction_bin(1.0, 0.0, 0.0)), [0, 2]);
        let mut all = bins.slots.clone();
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3]);
        assert!(!Arc::ptr_eq(&bins, &Bins::of(&Arc::new((*pattern).clone()))), "another pattern's are its own");
    }
}
