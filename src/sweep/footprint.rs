//! A beam -> the sub-rays of its footprint, and the slots that need them.
//!
//! In: a direction, the beam's angular radius. Out: sub-ray directions with weights that sum to 1. Source: the rings of
//! HELIOS++ (Winiwarter et al. 2022) and its Gaussian profile exp(-2 (r/w)^2), w = half the divergence at 1/e^2. The disc of
//! radius w is cut into a centre disc of radius w / (2 n + 1) and n rings of twice that width; ring k holds 6 k sub-rays in
//! its middle. Deviation: all sub-rays leave one point; the width at the exit is folded into the angle at the range of the
//! centre ray.

use std::f64::consts::TAU;

use super::Pattern;
use super::TrueReturn;
use super::cast::Hit;
use super::sensor::Sensor;
use crate::geometry::DVec3;
use crate::math;

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

/// The slots whose neighbours (on the line, or on the next lines) met another thing, or whose solid hit departs in range from
/// the straight line through two opposite neighbours' by more than `jump_m` (0 = every slot).
///
/// The straight line is what keeps ground at grazing angles from counting as one long jump; beside a step of height J the
/// departure is J. Foliage scatters at every beam: only its borders count.
pub(super) fn jumps(pattern: &Pattern, solid: &[Hit], returns: &[TrueReturn], jump_m: f64, out: &mut Vec<u32>) {
    out.clear();
    let (lines, beams) = (pattern.lines as usize, pattern.beams as usize);
    if jump_m == 0.0 {
        out.extend(0..(lines * beams) as u32);
        return;
    }
    for line in 0..lines {
        for beam in 0..beams {
            let slot = line * beams + beam;
            let neighbours = [(beam > 0, beam + 1 < beams, 1), (line > 0, line + 1 < lines, beams)];
            let jump = neighbours.iter().any(|&(before, after, stride)| {
                let other = |neighbour: usize| returns[neighbour].object != returns[slot].object;
                // NaN, of a hit beside nothing, is no bend; that the things differ tells enough.
                let bend_m =
                    || (solid[slot - stride].range_m - 2.0 * solid[slot].range_m + solid[slot + stride].range_m).abs();
                before && other(slot - stride) || after && other(slot + stride) || before && after && bend_m() > jump_m
            });
            if jump {
                out.push(slot as u32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::fixtures::shipped;

    #[test]
    fn exact_rings_hold_1_7_and_19_sub_rays_of_weight_1() {
        for (count, radii) in [(1, vec![0.0]), (7, vec![0.0, 2.0 / 3.0]), (19, vec![0.0, 0.4, 0.8])] {
            let rays = sub_rays(count);
            assert_eq!(rays.len(), count as usize);
            assert!((rays.iter().map(|r| r.weight).sum::<f64>() - 1.0).abs() < 1e-15);
            for (ring, radius) in radii.iter().enumerate() {
                let on_ring = rays.iter().filter(|r| (r.radius - radius).abs() < 1e-15).count();
                assert_eq!(on_ring, if ring == 0 { 1 } else { 6 * ring });
            }
            // Balanced about the axis.
            let (x, y) = rays.iter().fold((0.0, 0.0), |(x, y), r| (x + r.radius * r.across, y + r.radius * r.along));
            assert!(f64::max(x, y).abs() < 1e-14);
        }
        // Gaussian profile: weight per area falls by exp(-2 r^2).
        let rays = sub_rays(19);
        assert!((rays[7].weight / rays[1].weight - math::exp(-2.0 * (0.64 - 0.16))).abs() < 1e-15);
        assert!((rays[1].weight / rays[0].weight - 4.0 / 3.0 * math::exp(-0.32)).abs() < 1e-15);
    }

    #[test]
    fn equal_rings_have_the_second_moment_of_the_gaussian_beam_within_3_percent() {
        // Mean of r^2 under exp(-2 r^2) cut at r = 1: (1 - 3 e^-2) / (2 (1 - e^-2)).
        let cut = math::exp(-2.0);
        let exact = (1.0 - 3.0 * cut) / (2.0 * (1.0 - cut));
        for count in [7, 19] {
            let moment: f64 = sub_rays(count).iter().map(|r| r.weight * r.radius * r.radius).sum();
            assert!((moment / exact - 1.0).abs() < 0.03, "{count}: {moment} against {exact}");
        }
    }

    #[test]
    fn exact_sub_rays_leave_the_axis_by_their_share_of_the_half_angle() {
        let axis = DVec3::new(0.6, -0.48, 0.64);
        let rays = sub_rays(19);
        let mut out = Vec::new();
        spread(axis, 0.005, &rays, &mut out);
        for (ray, d) in rays[1..].iter().zip(&out) {
            assert!((d.length() - 1.0).abs() < 1e-15);
            assert!((d.cross(axis).length() - math::sin(0.005 * ray.radius)).abs() < 1e-15);
        }
        out.clear();
        spread(axis, 0.0, &rays, &mut out);
        assert!(out.iter().all(|d| *d == axis), "a beam without width is its axis, bit for bit");
    }

    #[test]
    fn exact_beam_width_is_exit_plus_divergence_times_range() {
        let sensor = shipped("lms111");
        for range_m in [0.5, 2.0, 18.0] {
            let width_m = 2.0 * half_angle_rad(&sensor, range_m) * range_m;
            assert!((width_m - (0.015 * range_m + 0.008)).abs() < 1e-15);
        }
        assert!(half_angle_rad(&sensor, 0.0).is_finite());
    }

    #[test]
    fn exact_jumps_are_steps_and_borders_of_things_not_slopes() {
        let grid = |lines: u32, beams: u32| Pattern { lines, beams, directions: vec![], times_s: vec![] };
        let at = |range_m: f64, object: i32| TrueReturn { range_m, object, class: None, top: false };
        let found = |pattern: &Pattern, returns: &[TrueReturn]| {
            let mut out = Vec::new();
            let solid: Vec<Hit> = returns.iter().map(|r| Hit { range_m: r.range_m, object: r.object }).collect();
            jumps(pattern, &solid, returns, 0.05, &mut out);
            out
        };
        let line = grid(1, 8);
        let slope: Vec<_> = (0..8).map(|k| at(1.0 + 0.3 * f64::from(k), -1)).collect();
        assert_eq!(found(&line, &slope), [0u32; 0]);
        let step: Vec<_> = (0..8).map(|k| at(if k < 4 { 1.0 } else { 1.06 }, -1)).collect();
        assert_eq!(found(&line, &step), [3, 4]);
        let rock: Vec<_> = (0..8).map(|k| at(1.0, if k < 5 { -1 } else { 3 })).collect();
        assert_eq!(found(&line, &rock), [4, 5]);
        let edge: Vec<_> = (0..8).map(|k| if k < 5 { at(1.0, -1) } else { TrueReturn::NOTHING }).collect();
        assert_eq!(found(&line, &edge), [4, 5]);
        // The same column on three lines.
        let column = grid(3, 1);
        assert_eq!(found(&column, &[at(1.0, -1), at(1.0, 2), at(1.0, 2)]), [0, 1]);
        let mut all = Vec::new();
        jumps(&line, &[], &slope, 0.0, &mut all);
        assert_eq!(all, [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}
