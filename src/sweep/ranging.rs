//! The echoes in one beam -> one range.
//!
//! In: echoes (range, received power, what sent it) and the sensor's [`Ranging`]. Out: [`Mixed`]. Source: phase ranging adds
//! the modulation's phasors (Okubo, Ye & Borenstein 2009, for the URG-04LX); pulses that overlap merge to their centroid.
//! Phase: r = r0 + c / (4 pi f) * arg(sum P_j exp(i 4 pi f (r_j - r0) / c)), r0 the strongest echo; the branch next to r0 is
//! taken, as a second frequency would tell. It may lie between the surfaces or beyond them. Not modelled: the pulse's shape,
//! saturation, range walk.

use std::f64::consts::PI;

use super::returns::Return;
use super::sensor::{Echo as Report, Ranging};
use crate::math;

/// Speed of light in vacuum, metres per second.
const LIGHT_MPS: f64 = 299_792_458.0;

/// Phasors that cancel to less than this share of their sum have no phase a sensor could read.
const CANCELLED: f64 = 1e-6;

/// One surface's answer to one sub-ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    pub ret: Return,
    /// Received power, relative: weight * cos(incidence) / range^2.
    pub power: f64,
    pub cos_incidence: f64,
    /// The sub-ray, 0 the centre.
    pub sub_ray: usize,
}

/// What the sensor makes of a beam's echoes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixed {
    pub range_m: f64,
    /// Received power of what is reported: of the sum's amplitude (phase), of the reported pulse (pulse).
    pub power: f64,
    /// Of the surface with most energy in what is reported: the centre's echo, or else the strongest.
    pub label: Echo,
    /// True range of that surface: the centre's, or else the mean of its echoes by energy.
    pub label_range_m: f64,
    /// Share of the energy from other surfaces.
    pub mixed: f64,
}

/// Reduces a beam's echoes to one; `None` where nothing came back or the phasors cancel. Orders the echoes by range.
pub(super) fn combine(ranging: &Ranging, echoes: &mut [Echo]) -> Option<Mixed> {
    if echoes.is_empty() {
        return None;
    }
    // By sub-ray at equal range, so that sums have one order.
    echoes.sort_unstable_by(|a, b| a.ret.range_m.total_cmp(&b.ret.range_m).then(a.sub_ray.cmp(&b.sub_ray)));
    match ranging {
        Ranging::Phase(phase) => summed_phase(echoes, phase.modulation_mhz * 1e6),
        Ranging::Pulse(pulse) => {
            Some(merged(reported_pulse(echoes, 0.5 * LIGHT_MPS * pulse.pulse_ns * 1e-9, pulse.report)))
        }
    }
}

fn summed_phase(echoes: &[Echo], modulation_hz: f64) -> Option<Mixed> {
    let radians_per_m = 4.0 * PI * modulation_hz / LIGHT_MPS;
    let near_m = strongest(echoes.iter()).ret.range_m;
    let (mut re, mut im) = (0.0, 0.0);
    for echo in echoes {
        let (s, c) = math::sin_cos(radians_per_m * (echo.ret.range_m - near_m));
        re += echo.power * c;
        im += echo.power * s;
    }
    let amplitude = math::hypot(re, im);
    let seen = amplitude > CANCELLED * energy(echoes.iter());
    seen.then(|| labelled(echoes, near_m + math::atan2(im, re) / radians_per_m, amplitude))
}

/// The run of echoes, each within `merge_m` of the one before, that the sensor reports.
fn reported_pulse(echoes: &[Echo], merge_m: f64, report: Report) -> &[Echo] {
    let mut pulses = echoes.chunk_by(|a, b| b.ret.range_m - a.ret.range_m < merge_m);
    let pulse = match report {
        Report::First => pulses.next(),
        Report::Last => pulses.last(),
        // Of two alike, the nearer.
        Report::Strongest => {
            pulses.reduce(|best, next| if energy(next.iter()) > energy(best.iter()) { next } else { best })
        }
    };
    pulse.expect("a beam with echoes has a pulse")
}

fn merged(pulse: &[Echo]) -> Mixed {
    labelled(pulse, centroid_m(pulse.iter()), energy(pulse.iter()))
}

/// Names the surface that most energy came from; of two alike, the one met first.
fn labelled(echoes: &[Echo], range_m: f64, power: f64) -> Mixed {
    let of = |object: i32| echoes.iter().filter(move |echo| echo.ret.object == object);
    let most = |best: i32, echo: &Echo| {
        let other = echo.ret.object;
        if other != best && energy(of(other)) > energy(of(best)) { other } else { best }
    };
    let object = echoes.iter().fold(echoes[0].ret.object, most);
    let alone = echoes.iter().all(|echo| echo.ret.object == object);
    let mixed = if alone { 0.0 } else { 1.0 - energy(of(object)) / energy(echoes.iter()) };
    let centre = of(object).find(|echo| echo.sub_ray == 0);
    let label = *centre.unwrap_or_else(|| strongest(of(object)));
    let label_range_m = centre.map_or_else(|| centroid_m(of(object)), |echo| echo.ret.range_m);
    Mixed { range_m, power, label, label_range_m, mixed }
}

fn energy<'a>(echoes: impl Iterator<Item = &'a Echo>) -> f64 {
    echoes.map(|echo| echo.power).sum()
}

fn strongest<'a>(echoes: impl Iterator<Item = &'a Echo>) -> &'a Echo {
    echoes.reduce(|best, next| if next.power > best.power { next } else { best }).expect("at least one echo")
}

/// Mean range by energy, counted from the first echo so that one surface at one range gives that range.
fn centroid_m<'a>(echoes: impl Iterator<Item = &'a Echo> + Clone) -> f64 {
    let near_m = echoes.clone().next().expect("at least one echo").ret.range_m;
    let beyond_m: f64 = echoes.clone().map(|echo| echo.power * (echo.ret.range_m - near_m)).sum();
    near_m + beyond_m / energy(echoes)
}
