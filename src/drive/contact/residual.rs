//! Unknowns of a stand -> each wheel's distance from touching, and its exact derivatives.
//!
//! Unknowns: z, pitch, roll, beta, rho left, rho right; a rigid chassis has the first three. Lengths in metres, angles in
//! radians. With h = c_z - f and s = sqrt(1 + |g|^2), e = h / s - r and
//! de = dc_z / s + k . dc_xy,  k = -grad f / s - h (dg/dxy)' g / s^3.

use super::super::linkage::{ANGLES, Linkage, MAX_WHEELS, Turn, links_rad};
use super::super::surface::Surface;
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::wide::{LANES, Work, widest};

pub(super) const UNKNOWNS: usize = 6;
pub(super) type Unknowns = [f64; UNKNOWNS];
pub(super) type Residuals = [f64; MAX_WHEELS];
pub(super) type Jacobian = [[f64; UNKNOWNS]; MAX_WHEELS];

/// One rover at one place and heading.
pub(super) struct Problem<'a> {
    linkage: &'a Linkage,
    surface: &'a Surface<'a>,
    place_m: DVec2,
    /// Unit vector of the heading.
    ahead: DVec2,
}

/// Whether the ground under a wheel follows the wheel as the unknowns change.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum GroundDerivatives {
    /// Exact derivatives.
    Moving,
    /// The ground's height and slope held as they are.
    Frozen,
}

impl<'a> Problem<'a> {
    pub(super) fn new(linkage: &'a Linkage, surface: &'a Surface<'a>, x_m: f64, y_m: f64, yaw_rad: f64) -> Problem<'a> {
        let (sin, cos) = math::sin_cos(yaw_rad);
        Problem { linkage, surface, place_m: DVec2::new(x_m, y_m), ahead: DVec2::new(cos, sin) }
    }

    /// How many of the unknowns this chassis has.
    pub(super) fn unknowns(&self) -> usize {
        if self.linkage.articulated() { UNKNOWNS } else { UNKNOWNS - ANGLES }
    }

    pub(super) fn articulated(&self) -> bool {
        self.linkage.articulated()
    }

    /// Each wheel's distance from touching; `None` where a wheel is over no ground.
    pub(super) fn residuals(&self, q: &Unknowns) -> Option<Residuals> {
        widest(Wheels { problem: self, q })
    }

    #[inline(always)]
    fn residuals_plainly(&self, q: &Unknowns) -> Option<Residuals> {
        let [rocker_left, rocker_right, bogie_left, bogie_right] = links_rad(&[q[3], q[4], q[5]]);
        let [sin, cos] =
            math::sin_cos_lanes(&[q[1], q[2], rocker_left, rocker_right, bogie_left, bogie_right, 0.0, 0.0]);
        let turns = std::array::from_fn(|link| Turn { sin: sin[2 + link], cos: cos[2 + link] });
        let centres_m = self.linkage.centres_m(&turns);
        let tilt = Tilt { sin_pitch: sin[0], cos_pitch: cos[0], sin_roll: sin[1], cos_roll: cos[1] };
        let count = self.linkage.wheel_count();
        let (mut below, mut up_m) = ([self.place_m; LANES], [0.0; MAX_WHEELS]);
        for wheel in 0..count {
            let offset = tilt.of(centres_m[wheel]);
            (below[wheel], up_m[wheel]) = (self.below(offset), q[0] + offset.z);
        }
        let ground = self.surface.heights_and_slopes(&below, count)?;
        let mut residuals = [0.0; MAX_WHEELS];
        for wheel in 0..count {
            let (ground_m, slope) = ground[wheel];
            let height = up_m[wheel] - ground_m;
            residuals[wheel] = height / (1.0 + slope.length_squared()).sqrt() - self.linkage.wheel_radius_m;
        }
        Some(residuals)
    }

    /// Sum of the squared residuals.
    pub(super) fn cost(&self, q: &Unknowns) -> Option<f64> {
        self.residuals(q).map(|e| sum_of_squares(&e))
    }

    /// Residuals and their derivatives by the unknowns.
    pub(super) fn linearised(&self, q: &Unknowns, under: GroundDerivatives) -> Option<(Residuals, Jacobian)> {
        let wheels = self.linkage.place(&[q[3], q[4], q[5]]);
        let tilt = Tilt::new(q);
        let mut residuals = [0.0; MAX_WHEELS];
        let mut jacobian = [[0.0; UNKNOWNS]; MAX_WHEELS];
        for wheel in 0..self.linkage.wheel_count() {
            let centre = wheels.centres_m[wheel];
            let offset = tilt.of(centre);
            let at = self.below(offset);
            let touch = self.surface.touch(at.x, at.y)?;
            let height = q[0] + offset.z - touch.height_m;
            let scale = 1.0 / (1.0 + touch.slope.length_squared()).sqrt();
            residuals[wheel] = height * scale - self.linkage.wheel_radius_m;
            let k = match under {
                GroundDerivatives::Moving => {
                    let bend = DVec2::new(touch.slope_by_x.dot(touch.slope), touch.slope_by_y.dot(touch.slope));
                    touch.gradient * -scale - bend * (height * scale * scale * scale)
                }
                GroundDerivatives::Frozen => DVec2::ZERO,
            };
            // World -> heading frame, in which the tilted offsets are.
            let weight = DVec3::new(self.ahead.dot(k), self.ahead.perp_dot(k), scale);
            let row = &mut jacobian[wheel];
            row[0] = scale;
            row[1] = weight.dot(tilt.by_pitch(centre));
            row[2] = weight.dot(tilt.by_roll(centre));
            if self.linkage.articulated() {
                for angle in 0..ANGLES {
                    row[3 + angle] = weight.dot(tilt.of(wheels.by_angle[wheel][angle]));
                }
            }
        }
        Some((residuals, jacobian))
    }

    /// The stand on the plane z = z0 + a x' + b y' that fits the ground under the level rover's wheels best; linkage
    /// angles 0. Exact on planes.
    pub(super) fn plane(&self) -> Option<Unknowns> {
        let centres_m = self.linkage.place(&[0.0; ANGLES]).centres_m;
        let count = self.linkage.wheel_count();
        let mut heights = [0.0; MAX_WHEELS];
        for (height, centre) in heights.iter_mut().zip(&centres_m).take(count) {
            let at = self.below(*centre);
            *height = self.surface.felt_height_m(at.x, at.y)?;
        }
        let n = count as f64;
        let mean = |value: &dyn Fn(usize) -> f64| (0..count).map(value).sum::<f64>() / n;
        let (x0, z0) = (mean(&|i| centres_m[i].x), mean(&|i| heights[i]));
        // Wheels stand in pairs at +y and -y, so that x and y do not mix.
        let spread = |by: &dyn Fn(usize) -> f64| {
            let (over, under) = (0..count)
                .fold((0.0, 0.0), |(over, under), i| (over + by(i) * (heights[i] - z0), under + by(i) * by(i)));
            over / under
        };
        let ahead = spread(&|i| centres_m[i].x - x0);
        let left = spread(&|i| centres_m[i].y);
        let mut q = [0.0; UNKNOWNS];
        q[0] = z0 - ahead * x0;
        q[1] = -math::atan(ahead);
        // The plane's normal is the rover's z axis: sin(roll) = -n_y.
        q[2] = math::asin(left / (1.0 + ahead * ahead + left * left).sqrt());
        q.iter().all(|v| v.is_finite()).then_some(q)
    }

    /// The point of the map below an offset in the heading frame.
    #[inline(always)]
    fn below(&self, offset: DVec3) -> DVec2 {
        self.place_m + self.ahead.rotate(DVec2::new(offset.x, offset.y))
    }
}

/// [`Problem::residuals`], in the machine's widest form.
struct Wheels<'a> {
    problem: &'a Problem<'a>,
    q: &'a Unknowns,
}

impl Work for Wheels<'_> {
    type Out = Option<Residuals>;

    #[inline(always)]
    fn run(self) -> Option<Residuals> {
        self.problem.residuals_plainly(self.q)
    }
}

pub(super) fn sum_of_squares(e: &Residuals) -> f64 {
    e.iter().map(|e| e * e).sum()
}

/// Ry(pitch) Rx(roll): rover frame -> heading frame.
struct Tilt {
    sin_pitch: f64,
    cos_pitch: f64,
    sin_roll: f64,
    cos_roll: f64,
}

impl Tilt {
    fn new(q: &Unknowns) -> Tilt {
        let (sin_pitch, cos_pitch) = math::sin_cos(q[1]);
        let (sin_roll, cos_roll) = math::sin_cos(q[2]);
        Tilt { sin_pitch, cos_pitch, sin_roll, cos_roll }
    }

    #[inline(always)]
    fn rolled(&self, v: DVec3) -> (f64, f64) {
        (v.y * self.cos_roll - v.z * self.sin_roll, v.y * self.sin_roll + v.z * self.cos_roll)
    }

    #[inline(always)]
    fn of(&self, v: DVec3) -> DVec3 {
        let (y, z) = self.rolled(v);
        DVec3::new(v.x * self.cos_pitch + z * self.sin_pitch, y, z * self.cos_pitch - v.x * self.sin_pitch)
    }

    fn by_pitch(&self, v: DVec3) -> DVec3 {
        let (_, z) = self.rolled(v);
        DVec3::new(z * self.cos_pitch - v.x * self.sin_pitch, 0.0, -z * self.sin_pitch - v.x * self.cos_pitch)
    }

    fn by_roll(&self, v: DVec3) -> DVec3 {
        let (y, z) = self.rolled(v);
        DVec3::new(y * self.sin_pitch, -z, y * self.cos_pitch)
    }
}
