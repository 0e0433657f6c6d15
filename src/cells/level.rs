//! The points of a scan (sensor frame, metres) and the height of their sensor -> the ground's plane, and with it a levelled map frame under
//! the sensor.
//!
//! For scans without a pose (`marsyard classify --sensor-height`) and for corpora that train on the like (`cells.frame: fitted_plane`):
//! one code, so that both make the same errors. Own construction. Planes through three points are tried (3000 triples, the same every time); one is ground if it
//! lies about as far below the sensor as was said, tilts by less than 60 degrees from the sensor's own x-y plane, and has many points near it
//! and few below it. The best is refined by least squares with Tukey's biweight (Beaton & Tukey 1974). What it
//! cannot know is which way is up: ground that slopes as a whole comes out level, and pitch and roll are those of a rover that stands
//! on the plane, 0.

use crate::geometry::{DMat3, DVec3, Transform};
use crate::math;

/// The fitted ground, and the map frame that stands on it below the sensor, its x axis under the sensor's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levelled {
    pub map_from_sensor: Transform,
    /// Of the sensor above the plane.
    pub height_m: f64,
    /// Between the sensor's z axis and the plane's normal.
    pub tilt_rad: f64,
    /// Share of the thinned points within 0.1 m of the plane, and their root mean square distance.
    pub near_share: f64,
    pub rms_m: f64,
}

/// A second plane that may be the ground as well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RivalGround {
    /// Of the sensor above it.
    pub height_m: f64,
    /// Between it and the plane that was taken.
    pub angle_rad: f64,
    /// Points that speak for it and not for the other, as a share of those that speak for the other.
    pub share: f64,
}

const TRIPLES: u32 = 3000;
/// Points that planes are judged by, one a voxel.
const MOST_POINTS: usize = 4000;
const FEWEST_POINTS: usize = 30;
/// Half width of the band in which points speak for a plane.
const BAND_M: f64 = 0.1;
/// Of the points that speak for the ground that was taken, as many must speak for a rival alone.
const RIVAL_SHARE: f64 = 0.5;
/// A rival stands at another angle, or at another height below the sensor.
const RIVAL_ANGLE_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;
const RIVAL_STEP_M: f64 = 0.15;
/// Points this far below speak against it.
const BELOW_M: f64 = 0.3;
const COS_MOST_TILT: f64 = 0.5;

/// Plane n . p + h = 0 of the sensor frame, n up: h is the sensor's height above it.
#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: DVec3,
    height_m: f64,
}

impl Plane {
    fn above_m(&self, point_m: DVec3) -> f64 {
        self.normal.dot(point_m) + self.height_m
    }

    fn score(&self, points: &[DVec3]) -> f64 {
        let vote = |p: &DVec3| {
            let above = self.above_m(*p);
            let u = above / BAND_M;
            if u.abs() < 1.0 { (1.0 - u * u) * (1.0 - u * u) } else { -f64::from(u8::from(above < -BELOW_M)) }
        };
        points.iter().map(vote).sum()
    }
}

/// Why no plane can be taken for the ground.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no ground to level by: {reason}")]
pub struct NoGround {
    pub reason: String,
}

/// The ground of a scan in the sensor frame.
pub fn level(points_m: &[DVec3], sensor_height_m: f64) -> Result<Levelled, NoGround> {
    let none = |reason: String| NoGround { reason };
    if !(0.02..=100.0).contains(&sensor_height_m) {
        return Err(none(format!("a sensor height of {sensor_height_m} m; it must be within 0.02 and 100 m")));
    }
    let points = thinned(points_m, sensor_height_m);
    let tolerance_m = tolerance_m(sensor_height_m);
    if points.len() < FEWEST_POINTS {
        return Err(none(format!("{} spread points near the sensor, {FEWEST_POINTS} are needed", points.len())));
    }
    let Some(mut plane) = best_plane(&points, sensor_height_m) else {
        return Err(none(format!(
            "no plane lies {sensor_height_m} m (to within {tolerance_m:.2} m) below the sensor; is the height right, and z up?"
        )));
    };
    for _ in 0..20 {
        plane = refined(plane, &points).ok_or_else(|| none("the points near it lie on a line".into()))?;
    }
    // The tried plane was at about the right height; what it was refined to may be another.
    if !(is_about_there(&plane, sensor_height_m, 2.0 * tolerance_m) && plane.height_m > 0.0) {
        return Err(none(format!(
            "the points that lie on a plane lie {:.2} m below the sensor, tilted by {:.0} degrees, where {sensor_height_m} m (to within {:.2} m) was said; is the height right, and z up?",
            plane.height_m,
            math::acos(plane.normal.z.clamp(-1.0, 1.0)).to_degrees(),
            2.0 * tolerance_m
        )));
    }
    let near: Vec<f64> = points.iter().map(|&p| plane.above_m(p)).filter(|above| above.abs() < BAND_M).collect();
    let rms_m = (near.iter().map(|a| a * a).sum::<f64>() / near.len().max(1) as f64).sqrt();
    let up = plane.normal;
    let forward = (DVec3::X - up * up.x).normalize();
    let rotation = DMat3::from_cols(forward, up.cross(forward), up).transpose();
    Ok(Levelled {
        map_from_sensor: Transform { rotation, translation_m: DVec3::new(0.0, 0.0, plane.height_m) },
        height_m: plane.height_m,
        tilt_rad: math::acos(up.z.clamp(-1.0, 1.0)),
        near_share: near.len() as f64 / points.len() as f64,
        rms_m,
    })
}

/// A plane at about the same height, at another angle or step, for which half as many points speak that do not lie on the ground that was taken:
/// a ramp beside a floor, two levels of a yard. `found`: what [`level`] found of these points.
pub(crate) fn rival(points_m: &[DVec3], sensor_height_m: f64, found: &Levelled) -> Option<RivalGround> {
    let points = thinned(points_m, sensor_height_m);
    let ground = Plane { normal: found.map_from_sensor.inverse().direction(DVec3::Z), height_m: found.height_m };
    let near = |plane: &Plane, points: &[DVec3]| points.iter().filter(|p| plane.above_m(**p).abs() < BAND_M).count();
    let others: Vec<DVec3> = points.iter().copied().filter(|p| ground.above_m(*p).abs() >= BAND_M).collect();
    if others.len() < FEWEST_POINTS {
        return None;
    }
    let mut plane = best_plane(&others, sensor_height_m)?;
    for _ in 0..20 {
        plane = refined(plane, &others)?;
    }
    let angle_rad = math::acos(plane.normal.dot(ground.normal).clamp(-1.0, 1.0));
    let step_m = (plane.height_m - ground.height_m).abs();
    let share = near(&plane, &others) as f64 / near(&ground, &points).max(1) as f64;
    let differs = angle_rad > RIVAL_ANGLE_RAD || step_m > RIVAL_STEP_M;
    let may_be_ground = step_m <= 2.0 * tolerance_m(sensor_height_m) && plane.normal.z >= COS_MOST_TILT;
    (differs && may_be_ground && share >= RIVAL_SHARE).then_some(RivalGround {
        height_m: plane.height_m,
        angle_rad,
        share,
    })
}

/// How far the ground may lie from where it was said to be.
fn tolerance_m(sensor_height_m: f64) -> f64 {
    (0.25 * sensor_height_m).max(0.1)
}

/// Whether a plane lies about as far below the sensor as was said, and is not a wall.
fn is_about_there(plane: &Plane, sensor_height_m: f64, tolerance_m: f64) -> bool {
    plane.normal.z >= COS_MOST_TILT && (plane.height_m - sensor_height_m).abs() <= tolerance_m
}

/// Of the planes through triples of the points that may be the ground, that for which the most points speak.
fn best_plane(points: &[DVec3], sensor_height_m: f64) -> Option<Plane> {
    let fits = |plane: &Plane| is_about_there(plane, sensor_height_m, tolerance_m(sensor_height_m));
    let tried = triples(points.len()).filter_map(|triple| through(triple.map(|i| points[i]))).filter(fits);
    let best =
        tried.map(|plane| (plane.score(points), plane)).fold(None, |best: Option<(f64, Plane)>, one| match best {
            Some(best) if best.0 >= one.0 => Some(best),
            _ => Some(one),
        });
    best.filter(|(score, _)| *score > 0.0).map(|(_, plane)| plane)
}

/// One point a voxel near the sensor, so that the dense first rings do not outvote the rest.
fn thinned(points_m: &[DVec3], sensor_height_m: f64) -> Vec<DVec3> {
    let voxel_m = (0.2 * sensor_height_m).clamp(0.02, 0.3);
    let reach_m = (10.0 * sensor_height_m).clamp(5.0, 20.0);
    let mut near: Vec<([i32; 3], usize)> = points_m
        .iter()
        .enumerate()
        .filter(|(_, p)| p.length() < reach_m)
        .map(|(i, p)| ((*p / voxel_m).floor().to_array().map(|v| v as i32), i))
        .collect();
    near.sort_unstable();
    near.dedup_by_key(|(voxel, _)| *voxel);
    let step = near.len().div_ceil(MOST_POINTS).max(1);
    near.into_iter().step_by(step).map(|(_, i)| points_m[i]).collect()
}

/// Triples of different indices below `count`: a Kronecker sequence by the roots of x^4 = x + 1 (Roberts 2018), which covers the
/// cube of triples evenly and is the same every time.
fn triples(count: usize) -> impl Iterator<Item = [usize; 3]> {
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];
    (1..=TRIPLES)
        .map(move |k| STEPS.map(|step| ((f64::from(k) * step).fract() * count as f64) as usize))
        .filter(|[a, b, c]| a != b && b != c && a != c)
}

/// The plane through three points, its normal up.
fn through([a, b, c]: [DVec3; 3]) -> Option<Plane> {
    let normal = (b - a).cross(c - a);
    let normal = if normal.z < 0.0 { -normal } else { normal }.try_normalize()?;
    Some(Plane { normal, height_m: -normal.dot(a) })
}

/// One step of least squares, each point weighted by how near it lies; `None` where the points do not span a plane.
fn refined(plane: Plane, points: &[DVec3]) -> Option<Plane> {
    let (u, v) = plane.normal.any_orthonormal_pair();
    let near =
        points.iter().map(|&p| (p.dot(u), p.dot(v), plane.above_m(p))).filter(|(_, _, r)| r.abs() < 2.0 * BAND_M);
    let weight = |r: f64| {
        let t = 1.0 - (r / (2.0 * BAND_M)) * (r / (2.0 * BAND_M));
        t * t
    };
    // Normal equations of r = a u + b v + c about the origin below the sensor: a few metres across, so well scaled.
    let (mut m, mut y) = (DMat3::ZERO, DVec3::ZERO);
    for (s, t, r) in near {
        let row = DVec3::new(s, t, 1.0);
        m += DMat3::from_cols(row * s, row * t, row) * weight(r);
        y += row * (r * weight(r));
    }
    let scale = m.z_axis.z * m.x_axis.x * m.y_axis.y;
    (m.determinant() > 1e-9 * scale && scale > 0.0).then_some(())?;
    let [a, b, c] = (m.inverse() * y).to_array();
    // Points lie at r = a u + b v + c above the plane: the better one is n - a u - b v, scaled to a unit normal.
    let normal = plane.normal - u * a - v * b;
    let length = normal.length();
    Some(Plane { normal: normal / length, height_m: (plane.height_m - c) / length })
}

#[cfg(test)]
mod tests;
