//! The echoes in one beam -> one range.
//!
//! In: echoes (range, received power, what sent it) and the sensor's [`Ranging`]. Out: [`Mixed`]. Source: phase ranging adds
//! the modulation's phasors (Okubo, Ye & Borenstein 2009, for the URG-04LX); pulses that overlap merge to their centroid.
//! Phase: r = r0 + c / (4 pi f) * arg(sum P_j exp(i 4 pi f (r_j - r0) / c)), r0 the strongest echo; the branch next to r0 is
//! taken, as a second frequency would tell. It may lie between the surfaces or beyond them. Not modelled: the pulse's shape,
//! saturation, range walk.

use std::f64::consts::PI;

use super::TrueReturn;
use super::sensor::{Echo as Report, Ranging};
use crate::math;

/// Speed of light in vacuum, metres per second.
const LIGHT_MPS: f64 = 299_792_458.0;

/// Phasors that cancel to less than this share of their sum have no phase a sensor could read.
const CANCELLED: f64 = 1e-6;

/// One surface's answer to one sub-ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    pub ret: TrueReturn,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::sensor::{PhaseRanging, PulseRanging};

    fn echo(sub_ray: usize, object: i32, range_m: f64, power: f64) -> Echo {
        Echo { ret: TrueReturn { range_m, object, class: None, top: false }, power, cos_incidence: 1.0, sub_ray }
    }

    fn phase(modulation_mhz: f64) -> Ranging {
        Ranging::Phase(PhaseRanging { modulation_mhz })
    }

    fn pulse(report: Report) -> Ranging {
        Ranging::Pulse(PulseRanging { pulse_ns: 4.0, report })
    }

    #[test]
    fn law_one_surface_gives_its_own_range_by_every_method() {
        for ranging in [phase(46.55), pulse(Report::First), pulse(Report::Strongest), pulse(Report::Last)] {
            let mut echoes: Vec<Echo> = (0..19).map(|k| echo(k, 4, 2.345_678_9, 0.1 + k as f64)).collect();
            let pixel = combine(&ranging, &mut echoes).unwrap();
            assert_eq!(pixel.range_m, 2.345_678_9);
            assert_eq!((pixel.label.ret.object, pixel.label.sub_ray, pixel.mixed), (4, 0, 0.0));
        }
        assert!(combine(&phase(46.55), &mut []).is_none());
    }

    #[test]
    fn exact_phase_of_two_equal_echoes_lies_midway() {
        // arg(1 + e^(i p)) = p / 2 below half a turn.
        let mut echoes = [echo(0, 1, 1.0, 2.0), echo(1, 2, 1.5, 2.0)];
        let pixel = combine(&phase(46.55), &mut echoes).unwrap();
        assert!((pixel.range_m - 1.25).abs() < 1e-15);
        assert_eq!((pixel.label.ret.object, pixel.mixed), (1, 0.5));
        // The sum's length is 2 cos(p / 2) times each.
        let p = 4.0 * PI * 46.55e6 / LIGHT_MPS * 0.5;
        assert!((pixel.power - 4.0 * math::cos(p / 2.0)).abs() < 1e-14);
    }

    #[test]
    fn exact_phase_of_unequal_echoes_follows_the_phasor_sum_and_may_lie_before_both() {
        let k = 4.0 * PI * 46.55e6 / LIGHT_MPS;
        for gap_m in [0.3, 0.9, 1.7, 2.3] {
            let mut echoes = [echo(0, 1, 1.0, 3.0), echo(1, 2, 1.0 + gap_m, 1.0)];
            let range_m = combine(&phase(46.55), &mut echoes).unwrap().range_m;
            // tan of the sum's phase, from the strongest echo.
            let (s, c) = math::sin_cos(k * gap_m);
            assert!((math::tan(k * (range_m - 1.0)) - s / (3.0 + c)).abs() < 1e-12, "{gap_m}");
        }
        // 2.3 m are 0.71 of the ambiguity of 3.22 m: the far echo pulls the phase back.
        let mut echoes = [echo(0, 1, 1.0, 3.0), echo(1, 2, 3.3, 1.0)];
        assert!(combine(&phase(46.55), &mut echoes).unwrap().range_m < 1.0);
    }

    #[test]
    fn extreme_phasors_that_cancel_have_no_range() {
        let half_wave_m = LIGHT_MPS / 46.55e6 / 4.0;
        let mut echoes = [echo(0, 1, 1.0, 1.0), echo(1, 2, 1.0 + half_wave_m, 1.0)];
        assert!(combine(&phase(46.55), &mut echoes).is_none());
    }

    #[test]
    fn exact_pulses_merge_below_half_their_length_and_are_chosen_beyond() {
        // 4 ns: c tau / 2 = 0.5996 m.
        let near = |gap_m: f64| [echo(0, 1, 2.0, 1.0), echo(1, 2, 2.0 + gap_m, 3.0)];
        let merged = combine(&pulse(Report::First), &mut near(0.59)).unwrap();
        assert!((merged.range_m - (2.0 + 0.59 * 0.75)).abs() < 1e-15);
        assert_eq!((merged.label.ret.object, merged.mixed, merged.power), (2, 0.25, 4.0));
        let of = |report, gap_m| combine(&pulse(report), &mut near(gap_m)).unwrap();
        assert_eq!(of(Report::First, 0.61).range_m, 2.0);
        assert_eq!(of(Report::Last, 0.61).range_m, 2.61);
        let strongest = of(Report::Strongest, 0.61);
        assert_eq!((strongest.range_m, strongest.label.ret.object, strongest.mixed), (2.61, 2, 0.0));
    }

    #[test]
    fn law_the_label_is_the_surface_with_most_energy_in_what_is_reported() {
        // Three weak echoes of the ground outweigh a rock's strong one; the centre is none of them.
        let mut echoes = [echo(0, 7, 1.0, 2.0), echo(1, -1, 1.1, 0.8), echo(2, -1, 1.2, 0.9), echo(3, -1, 1.3, 0.7)];
        let pixel = combine(&phase(10.0), &mut echoes).unwrap();
        assert_eq!((pixel.label.ret.object, pixel.label.sub_ray), (-1, 2));
        assert!((pixel.label_range_m - (0.8 * 1.1 + 0.9 * 1.2 + 0.7 * 1.3) / 2.4).abs() < 1e-15);
        assert!((pixel.mixed - 2.0 / 4.4).abs() < 1e-15);
    }
}
