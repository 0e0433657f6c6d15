//! A wheel over ground and solid bodies -> how high its centre stands when it is set down there.
//!
//! In: a place, a heading, the bodies near. Out: the height of the wheel's centre and its derivative by the place. Source: the offset
//! surface of a rolling ball (Tarokh & McDermott 2005 for a single point of contact); the highest of what each feature of the
//! bodies (faces, edges, corners) would hold the wheel at, each in closed form, so that boxes and planes are exact. Deviations: the wheel is a
//! ball flattened to half its width across the heading; its flanks, from 75 degrees on, run out straight to one and a half radii, and beside
//! bodies higher than 2.7 radii so much steeper that they end on the ground there, so that every wall is a ramp and the height has no jump: a
//! stand exists beside it; rasters are rolled over along the heading alone, by chords between their grid lines; a trunk has 16 corners. On
//! polynomials the ground is felt as `surface` has it. Frame: world, metres. Not modelled: what lies under an overhanging side, soil, tyres.

use super::surface::{Surface, WheelContact};
use crate::geometry::{DVec2, DVec3};
use crate::scene::{Convex, Cylinder, Ground, Obstacle, Raster, Shape};

/// The wheel ends this many radii from its centre.
pub(super) const REACH_RADII: f64 = 1.5;
/// Sine, cosine and tangent of 75 degrees, from which the flank runs straight.
const FLANK_SIN: f64 = 0.965_925_826_289_068_3;
const FLANK_COS: f64 = 0.258_819_045_102_520_74;
const FLANK_TAN: f64 = 3.732_050_807_568_877;
/// How much wider a wheel looks across its heading than it is: half as wide as a ball.
const ACROSS: f64 = 2.0;

/// The wheels of one stand: what lies near, and which way they look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rolling<'a> {
    pub bodies: &'a [&'a Obstacle],
    /// Unit vector of the heading.
    pub ahead: DVec2,
    pub radius_m: f64,
}

/// The height of a wheel's centre, and its derivative along the heading and, widened, across it.
#[derive(Clone, Copy)]
struct Held {
    centre_m: f64,
    gradient: DVec2,
}

/// The highest that anything holds the wheel's centre, over one place.
struct Highest<'a> {
    rolling: &'a Rolling<'a>,
    at_m: DVec2,
    /// On the ground under it alone: where the flanks end.
    floor: Held,
    /// The slope of the flanks beside the body at hand.
    flank: f64,
    highest: Held,
}

impl Rolling<'_> {
    /// The ground and the bodies under a wheel, as a level contact as far below its centre as its radius; `None` without ground.
    pub(super) fn touch(&self, surface: &Surface, x_m: f64, y_m: f64) -> Option<WheelContact> {
        match surface.ground() {
            Ground::Polynomial(_) => {
                let ground = surface.touch_ground(x_m, y_m)?;
                Some(self.held(DVec2::new(x_m, y_m), ground.height_m, ground.slope).unwrap_or(ground))
            }
            Ground::Raster(raster) => {
                let ground = surface.touch_ground(x_m, y_m)?;
                let floor =
                    Held { centre_m: ground.height_m + self.radius_m, gradient: self.seen_slope(ground.gradient) };
                let mut highest = Highest::over(self, DVec2::new(x_m, y_m), floor);
                highest.roll_over_raster(raster);
                highest.roll_over_bodies();
                Some(highest.contact()).filter(|held| held.height_m.is_finite() && held.gradient.is_finite())
            }
        }
    }

    /// What bodies hold a wheel at over smooth ground of this height and slope; `None` where the ground holds it.
    pub(super) fn held(&self, at_m: DVec2, ground_m: f64, slope: DVec2) -> Option<WheelContact> {
        // What holds the wheel no higher than the ground does is never asked further.
        let centre_m = ground_m + self.radius_m * (1.0 + slope.length_squared()).sqrt();
        let mut highest = Highest::over(self, at_m, Held { centre_m, gradient: self.seen_slope(slope) });
        highest.roll_over_bodies();
        (highest.highest.centre_m > centre_m).then(|| highest.contact())
    }

    /// A slope of the world along the heading and, widened, across it.
    fn seen_slope(&self, slope: DVec2) -> DVec2 {
        DVec2::new(self.ahead.dot(slope), self.ahead.perp_dot(slope) / ACROSS)
    }
}

impl<'a> Highest<'a> {
    /// Held by the ground under it, which needs no asking.
    fn over(rolling: &'a Rolling, at_m: DVec2, floor: Held) -> Highest<'a> {
        Highest { rolling, at_m, floor, flank: FLANK_TAN, highest: floor }
    }

    fn contact(&self) -> WheelContact {
        let Held { centre_m, gradient } = self.highest;
        WheelContact {
            height_m: centre_m - self.rolling.radius_m,
            gradient: self.rolling.ahead.rotate(gradient * DVec2::new(1.0, ACROSS)),
            slope: DVec2::ZERO,
            slope_by_x: DVec2::ZERO,
            slope_by_y: DVec2::ZERO,
        }
    }

    /// A point of the world as the wheel sees it: ahead, widened to the left, and up.
    fn seen(&self, point_m: DVec3) -> DVec3 {
        let (away, ahead) = (point_m.truncate() - self.at_m, self.rolling.ahead);
        DVec3::new(ahead.dot(away), ACROSS * ahead.perp_dot(away), point_m.z)
    }

    fn take(&mut self, centre_m: f64, gradient: DVec2) {
        if centre_m > self.highest.centre_m {
            self.highest = Held { centre_m, gradient };
        }
    }

    /// A point holds the wheel.
    fn take_point(&mut self, point: DVec3) {
        let radius_m = self.rolling.radius_m;
        let away_m = point.truncate().length();
        if away_m > REACH_RADII * radius_m {
            return;
        }
        // The wheel goes up as it comes nearer.
        if away_m <= FLANK_SIN * radius_m {
            let over_m = (radius_m * radius_m - away_m * away_m).sqrt();
            self.take(point.z + over_m, point.truncate() / over_m);
            return;
        }
        let flank_m = away_m - FLANK_SIN * radius_m;
        let mut gradient = point.truncate() * (self.flank / away_m);
        if self.flank > FLANK_TAN {
            // Its foot moves with the ground.
            gradient += self.floor.gradient * (flank_m / ((REACH_RADII - FLANK_SIN) * radius_m));
        }
        self.take(point.z + FLANK_COS * radius_m - self.flank * flank_m, gradient);
    }

    /// The flanks beside a body: those of the wheel, or steeper, so that the highest of it ends on the ground.
    fn meet(&mut self, corners_m: &[DVec3]) {
        let top_m = corners_m.iter().fold(f64::NEG_INFINITY, |top_m, corner| top_m.max(corner.z));
        let radius_m = self.rolling.radius_m;
        let drop_m = top_m + FLANK_COS * radius_m - self.floor.centre_m;
        self.flank = FLANK_TAN.max(drop_m / ((REACH_RADII - FLANK_SIN) * radius_m));
    }

    /// An edge holds it, between its ends.
    fn take_edge(&mut self, from: DVec3, to: DVec3) {
        let (along, radius_m) = ((to - from).truncate(), self.rolling.radius_m);
        let length_m = along.length();
        if length_m < 1e-9 * radius_m {
            return;
        }
        let (unit, rise) = (along / length_m, (to.z - from.z) / length_m);
        let foot_m = -from.truncate().dot(unit);
        let aside_m = from.truncate().perp_dot(unit).abs();
        if aside_m > REACH_RADII * radius_m {
            return;
        }
        let point = |way_m: f64| {
            let at_m = foot_m + way_m;
            (0.0..=length_m).contains(&at_m).then(|| from + (to - from) * (at_m / length_m))
        };
        let on_ball_m = (radius_m * radius_m - aside_m * aside_m).max(0.0).sqrt() * rise / (1.0 + rise * rise).sqrt();
        let rim_m = (FLANK_SIN * FLANK_SIN * radius_m * radius_m - aside_m * aside_m).max(0.0).sqrt();
        if on_ball_m.abs() <= rim_m {
            point(on_ball_m).into_iter().for_each(|point| self.take_point(point));
            return;
        }
        // An edge as steep as the flank touches by its ends first.
        let steeper = self.flank * self.flank - rise * rise;
        if steeper <= 0.0 {
            return;
        }
        let on_flank_m = aside_m * rise / steeper.sqrt();
        if on_flank_m.abs() > rim_m {
            point(on_flank_m).into_iter().for_each(|point| self.take_point(point));
        } else if let Some(point) = point(rim_m.copysign(rise)) {
            // The rim between ball and flank, along which the point of contact slides as the wheel moves.
            let across = unit.perp() * -from.truncate().perp_dot(unit).signum();
            let gradient = unit * rise + across * (rise.abs() * aside_m / rim_m);
            self.take(point.z + FLANK_COS * radius_m, gradient);
        }
    }

    /// A face that looks up holds it, within its edges, and each of its edges and corners does.
    fn take_face(&mut self, count: usize, corner_m: impl Fn(usize) -> DVec3) {
        let radius_m = self.rolling.radius_m;
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = (0..count)
            .map(|k| self.seen(corner_m(k)))
            .fold(none, |(low, high), corner| (low.min(corner), high.max(corner)));
        // No point of a face holds the wheel's centre higher than a radius above the highest corner (a hair more, for rounding), and none
        // that lies beyond the flanks holds it at all.
        let most_m = high.z + radius_m;
        let reach_m = REACH_RADII * radius_m;
        let is_away = low.x > reach_m || low.y > reach_m || high.x < -reach_m || high.y < -reach_m;
        if count == 0 || is_away || most_m + 1e-9 * (radius_m + most_m.abs()) < self.highest.centre_m {
            return;
        }
        let first = self.seen(corner_m(0));
        let mut normal = DVec3::ZERO;
        let mut corner = first;
        for k in 1..=count {
            let next = if k < count { self.seen(corner_m(k)) } else { first };
            self.take_point(corner);
            self.take_edge(corner, next);
            normal += (corner - first).cross(next - first);
            corner = next;
        }
        let slope = -normal.truncate() / normal.z;
        let steepness = slope.length();
        if !(normal.z > 0.0 && steepness < self.flank) {
            return;
        }
        // By the ball where the face is no steeper than it gets, else by its rim.
        let lean = (1.0 + steepness * steepness).sqrt();
        let (touched, over_m) = if steepness < FLANK_TAN {
            (slope * (radius_m / lean), radius_m / lean)
        } else {
            (slope * (FLANK_SIN * radius_m / steepness), FLANK_COS * radius_m)
        };
        let is_within = (0..count).all(|k| {
            let [a, b] = [k, (k + 1) % count].map(|k| self.seen(corner_m(k)).truncate());
            (b - a).perp_dot(touched - a) >= 0.0
        });
        if is_within {
            self.take(first.z + slope.dot(touched - first.truncate()) + over_m, slope);
        }
    }

    fn roll_over_bodies(&mut self) {
        let (Rolling { bodies, radius_m, .. }, at_m) = (*self.rolling, self.at_m);
        for obstacle in bodies.iter().filter(|body| !body.is_beyond(at_m, REACH_RADII * radius_m)) {
            match &obstacle.body().shape {
                Shape::Convex(body) => self.roll_over_convex(body),
                Shape::Cylinder(body) => self.roll_over_cylinder(body),
            }
        }
    }

    fn roll_over_convex(&mut self, body: &Convex) {
        self.meet(&body.vertices_m);
        for (face, _) in body.faces.iter().zip(&body.planes).filter(|(_, plane)| plane.faces_up()) {
            self.take_face(face.len(), |k| body.vertices_m[face[k] as usize]);
        }
    }

    fn roll_over_cylinder(&mut self, body: &Cylinder) {
        let rim = body.rim_m();
        self.meet(&rim);
        self.take_face(rim.len(), |k| rim[k]);
    }

    fn roll_over_raster(&mut self, raster: &Raster) {
        let reach_m = REACH_RADII * self.rolling.radius_m;
        let ahead = self.rolling.ahead;
        let mut crossings_m = vec![-reach_m, 0.0, reach_m];
        for (place, step) in [(self.at_m.x - raster.origin_m.x, ahead.x), (self.at_m.y - raster.origin_m.y, ahead.y)] {
            if step.abs() < 1e-9 {
                continue;
            }
            let ends = [place - reach_m * step, place + reach_m * step].map(|end| end / raster.spacing_m);
            let lines = ends[0].min(ends[1]).ceil() as i64..=ends[0].max(ends[1]).floor() as i64;
            crossings_m.extend(lines.map(|line| (line as f64 * raster.spacing_m - place) / step));
        }
        crossings_m.sort_unstable_by(f64::total_cmp);
        let point = |way_m: f64| {
            let at = self.at_m + ahead * way_m;
            DVec3::new(way_m, 0.0, raster.height_m(at.x, at.y))
        };
        let points: Vec<DVec3> = crossings_m.into_iter().map(point).collect();
        self.meet(&points);
        points.iter().for_each(|&point| self.take_point(point));
        points.windows(2).for_each(|pair| self.take_edge(pair[0], pair[1]));
    }
}
