//! True points on the ground -> how steep it truly is under them.
//!
//! Most points of a sweep lie on the ground, so a polynomial's gradient is worked out for eight at a time: the Taylor series
//! about the yard's centre (condition below 2e4 at degree 12, so 12 digits stay) by Horner's rule,
//! first along y, then along x. Plain products and sums, never contracted.

use crate::geometry::DVec2;
use crate::scene::polynomial::terms;
use crate::scene::{Ground, Polynomial};
use crate::wide::{LANES, Work, widest};

/// Places on the ground, and after [`GroundPlaces::steepen`] the squared slopes there. Reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct GroundPlaces {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    pub(super) slope_squared: Vec<f64>,
}

impl GroundPlaces {
    pub(super) fn clear(&mut self) {
        self.x_m.clear();
        self.y_m.clear();
    }

    /// Adds a place and returns its number.
    #[inline]
    pub(super) fn push(&mut self, x_m: f64, y_m: f64) -> u32 {
        self.x_m.push(x_m);
        self.y_m.push(y_m);
        (self.x_m.len() - 1) as u32
    }

    /// Adds a block of places and returns the first one's number.
    #[inline(always)]
    pub(super) fn extend(&mut self, x_m: [f64; LANES], y_m: [f64; LANES]) -> u32 {
        let first = self.x_m.len() as u32;
        self.x_m.extend(x_m);
        self.y_m.extend(y_m);
        first
    }

    /// Works out the squared slope (rise over run) of every place.
    pub(super) fn steepen(&mut self, ground: &Ground) {
        match ground {
            Ground::Polynomial(polynomial) => self.steepen_polynomial(polynomial),
            Ground::Raster(raster) => {
                let places = self.x_m.iter().zip(&self.y_m);
                self.slope_squared.clear();
                self.slope_squared.extend(places.map(|(&x, &y)| raster.gradient(x, y).length_squared()));
            }
        }
    }

    fn steepen_polynomial(&mut self, polynomial: &Polynomial) {
        let padded = self.x_m.len().next_multiple_of(LANES);
        self.x_m.resize(padded, 0.0);
        self.y_m.resize(padded, 0.0);
        self.slope_squared.clear();
        self.slope_squared.resize(padded, 0.0);
        let Some(slopes) = Slopes::of(polynomial) else { return };
        widest(SlopeGrid { slopes: &slopes, xs: &self.x_m, ys: &self.y_m, out: &mut self.slope_squared });
    }
}

/// dz/dx and dz/dy as power series about a centre, each of one degree less than the ground.
struct Slopes {
    centre_m: DVec2,
    degree: usize,
    along_x: Vec<f64>,
    along_y: Vec<f64>,
}

impl Slopes {
    /// `None` for level ground.
    fn of(polynomial: &Polynomial) -> Option<Slopes> {
        let degree = polynomial.degree.checked_sub(1)?;
        let taylor = polynomial.taylor_at(polynomial.centre_m.x, polynomial.centre_m.y);
        let coefficient = |i: usize, j: usize| {
            let place = terms(polynomial.degree).position(|term| term == (i, j));
            taylor[place.expect("a term of the ground's degree")]
        };
        let along_x = terms(degree).map(|(i, j)| (i + 1) as f64 * coefficient(i + 1, j)).collect();
        let along_y = terms(degree).map(|(i, j)| (j + 1) as f64 * coefficient(i, j + 1)).collect();
        Some(Slopes { centre_m: polynomial.centre_m, degree, along_x, along_y })
    }

    #[inline(always)]
    fn squared(&self, xs: &[f64], ys: &[f64], out: &mut [f64]) {
        let blocks =
            xs.as_chunks::<LANES>().0.iter().zip(ys.as_chunks::<LANES>().0).zip(out.as_chunks_mut::<LANES>().0);
        for ((xs, ys), out) in blocks {
            let x = xs.map(|x| x - self.centre_m.x);
            let y = ys.map(|y| y - self.centre_m.y);
            let (along_x, along_y) = (self.series(&self.along_x, &x, &y), self.series(&self.along_y, &x, &y));
            for lane in 0..LANES {
                out[lane] = along_x[lane] * along_x[lane] + along_y[lane] * along_y[lane];
            }
        }
    }

    /// sum of c_kl x^k y^l; rows of equal k lie one after another, the longest (k = 0) first.
    #[inline(always)]
    fn series(&self, coefficients: &[f64], x: &[f64; LANES], y: &[f64; LANES]) -> [f64; LANES] {
        let mut sum = [0.0; LANES];
        let mut end = coefficients.len();
        for k in (0..=self.degree).rev() {
            let row = &coefficients[end - (self.degree + 1 - k)..end];
            end -= row.len();
            let mut inner = [0.0; LANES];
            for &c in row.iter().rev() {
                for lane in 0..LANES {
                    inner[lane] = inner[lane] * y[lane] + c;
                }
            }
            for lane in 0..LANES {
                sum[lane] = sum[lane] * x[lane] + inner[lane];
            }
        }
        sum
    }
}

/// Squared slopes to work out.
struct SlopeGrid<'a> {
    slopes: &'a Slopes,
    xs: &'a [f64],
    ys: &'a [f64],
    out: &'a mut [f64],
}

impl Work for SlopeGrid<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.slopes.squared(self.xs, self.ys, self.out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};
    use crate::scene::Raster;
    use crate::scene::polynomial::term_count;

    fn places(count: u32) -> GroundPlaces {
        let mut places = GroundPlaces::default();
        for k in 0..count {
            let share = f64::from(k) / f64::from(count - 1);
            places.push(20.0 * share, 20.0 * (share * 37.0).fract());
        }
        places
    }

    #[test]
    fn equal_slopes_agree_with_the_grounds_own_gradient_and_between_instructions() {
        let stream = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise);
        for degree in [0, 1, 2, 5, 12] {
            let coefficients = (0..term_count(degree) as u64).map(|i| 0.1 * stream.normal(i)).collect();
            let polynomial = Polynomial::new(20.0, degree, coefficients);
            let mut places = places(1003);
            places.steepen(&Ground::Polynomial(polynomial.clone()));
            for k in 0..1003 {
                let direct = polynomial.gradient(places.x_m[k], places.y_m[k]).length();
                assert!((places.slope_squared[k].sqrt() - direct).abs() < 1e-10, "degree {degree}: {direct}");
            }
            if let Some(slopes) = Slopes::of(&polynomial) {
                let mut portable = vec![0.0; places.x_m.len()];
                slopes.squared(&places.x_m, &places.y_m, &mut portable);
                assert!(portable.iter().zip(&places.slope_squared).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        }
    }

    #[test]
    fn exact_a_raster_ramp_is_as_steep_as_it_was_made() {
        let mut places = places(50);
        places.steepen(&Ground::Raster(Raster::sampled(20.0, 0.5, |x, y| 0.3 * x - 0.4 * y)));
        assert!(places.slope_squared.iter().all(|s| (s - 0.25).abs() < 1e-12));
    }
}
