//! A beam -> the sub-rays of its footprint, and the slots that need them.
//!
//! In: a direction, the beam's angular radius. Out: sub-ray directions with weights that sum to 1. Source: the rings of
//! HELIOS++ (Winiwarter et al. 2022) and its Gaussian profile exp(-2 (r/w)^2), w = half the divergence at 1/e^2. The disc of
//! radius w is cut into a centre disc of radius w / (2 n + 1) and n rings of twice that width; ring k holds 6 k sub-rays in
//! its middle. Deviation: all sub-rays leave one point; the width at the exit is folded into the angle at the range of the
//! centre ray.

use std::f64::consts::TAU;

use super::Pattern;
use super::returns::Return;
use super::sensor::Sensor;
use crate::geometry::DVec3;
use crate::math;

/// Most sub-rays a beam can have; the stride of their draw addresses.
pub(super) const MAX_SUB_RAYS: usize = 19;

/// One sub-ray: where it leaves the axis, and its share of the beam's energy.
#[derive(Clone, Copy, Debug)]
pub(super) struct SubRay {
    /// Offset from the axis in units of w, along two axes across the beam.
    pub across: f64,
    pub along: f64,
    pub radius: f64,
    pub weight: f64,
}

/// The sub-rays of 0, 1 or 2 rings: 1, 7 or 19, the centre first.
pub(super) fn sub_rays(count: u32) -> Vec<SubRay> {
    let rings = match count {
        1 => 0,
        7 => 1,
        _ => 2,
    };
    let width = 2.0 / f64::from(2 * rings + 1);
    let mut rays = vec![SubRay { across: 1.0, along: 0.0, radius: 0.0, weight: 1.0 }];
    for ring in 1..=rings {
        let radius = f64::from(ring) * width;
        // Ring k has the area of 8 k centre discs, shared by 6 k sub-rays.
        let weight = 8.0 / 6.0 * math::exp(-2.0 * radius * radius);
        for k in 0..6 * ring {
            let (along, across) = math::sin_cos(TAU * f64::from(k) / f64::from(6 * ring));
            rays.push(SubRay { across, along, radius, weight });
        }
    }
    let total: f64 = rays.iter().map(|ray| ray.weight).sum();
    rays.iter_mut().for_each(|ray| ray.weight /= total);
    rays
}

/// Angular radius of the beam at 1/e^2, radians, so that its width at `range_m` is exit + divergence * range.
pub(super) fn half_angle_rad(sensor: &Sensor, range_m: f64) -> f64 {
    let exit_rad =
        if sensor.exit_diameter_m > 0.0 { sensor.exit_diameter_m / range_m.max(sensor.exit_diameter_m) } else { 0.0 };
    0.5 * (sensor.divergence_mrad * 1e-3 + exit_rad)
}

/// Writes the directions of all sub-rays but the centre.
pub(super) fn spread(axis: DVec3, half_angle_rad: f64, rays: &[SubRay], out: &mut Vec<DVec3>) {
    let (u, v) = axis.any_orthonormal_pair();
    let (mut ring, mut sc) = (0.0, (0.0, 1.0));
    for ray in &rays[1..] {
        if ray.radius != ring {
            (ring, sc) = (ray.radius, math::sin_cos(ray.radius * half_angle_rad));
        }
        // Not normalised: the sum of squares is 1 to a few ulp, and a beam without width stays the axis bit for bit.
        out.push(axis * sc.1 + (u * ray.across + v * ray.along) * sc.0);
    }
}

/// The slots whose neighbours (on the line, or on the next lines) met another thing, or whose range departs from the
/// straight line through two opposite neighbours by more than `jump_m` (0 = every slot).
///
/// The straight line is what keeps ground at grazing angles from counting as one long jump; beside a step of height J the
/// departure is J.
pub(super) fn jumps(pattern: &Pattern, returns: &[Return], jump_m: f64, out: &mut Vec<u32>) {
    out.clear();
    let (lines, beams) = (pattern.lines as usize, pattern.beams as usize);
    if jump_m == 0.0 {
        out.extend(0..(lines * beams) as u32);
        return;
    }
    for line in 0..lines {
        for beam in 0..beams {
            let slot = line * beams + beam;
            let before = |there: bool, step: usize| there.then(|| &returns[slot - step]);
            let after = |there: bool, step: usize| there.then(|| &returns[slot + step]);
            let on_line = (before(beam > 0, 1), after(beam + 1 < beams, 1));
            let on_beam = (before(line > 0, beams), after(line + 1 < lines, beams));
            let here = &returns[slot];
            let jump = [on_line, on_beam].iter().any(|(a, b)| {
                let other = |side: &Option<&Return>| side.is_some_and(|r| r.object != here.object);
                let bend = match (a, b) {
                    (Some(a), Some(b)) if here.is_hit() => (a.range_m - 2.0 * here.range_m + b.range_m).abs(),
                    _ => 0.0,
                };
                other(a) || other(b) || bend > jump_m
            });
            if jump {
                out.push(slot as u32);
            }
        }
    }
}
