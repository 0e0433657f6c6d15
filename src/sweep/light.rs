//! Received light -> whether a return is seen, and how bright it looks.
//!
//! In: reflectance and the geometric gain cos(incidence) / range^2 of a return (summed over sub-rays where there are any).
//! Out: probability of a return, intensity. Source: the lidar equation for extended diffuse targets (Hoefle & Pfeifer 2007),
//! with the threshold at the datasheet's range on 10 % reflectance. Not modelled: atmosphere, the roll-off of near ranges,
//! specular and retroreflecting surfaces.

use super::cast::Hit;
use super::{Status, SweepParams, TrueReturn};
use crate::math;
use crate::random::{Dist, Drawn, Purpose, Stream, Streams};

/// Reflectances of a scene: the ground's, and each object's at its own address.
struct Reflectance<'a> {
    ground: f64,
    objects: &'a Dist,
    /// By object id; NaN until it is asked for.
    drawn: Vec<f64>,
    stream: Stream,
}

impl<'a> Reflectance<'a> {
    /// Objects keep their reflectance over all sweeps and attempts of a scene: their draws have no step.
    fn new(ground: f64, objects: &'a Dist, streams: &Streams) -> Reflectance<'a> {
        let whole_scene = Streams { attempt: 0, step: 0, ..*streams };
        Reflectance { ground, objects, drawn: Vec::new(), stream: whole_scene.open(Purpose::SweepObjectReflectance) }
    }

    fn of(&mut self, object: i32) -> f64 {
        if object <= Hit::GROUND {
            return self.ground;
        }
        let id = object as usize;
        if id >= self.drawn.len() {
            self.drawn.resize(id + 1, f64::NAN);
        }
        if self.drawn[id].is_nan() {
            self.drawn[id] = self.objects.at(&self.stream, id as u64);
        }
        self.drawn[id]
    }
}

/// The dropout of one sweep.
pub(super) struct DropoutModel<'a> {
    reflectance: Reflectance<'a>,
    draws: Stream,
    rate: f64,
    range_at_10_percent_m: f64,
    softness: f64,
}

impl<'a> DropoutModel<'a> {
    /// `None` where the effect is off.
    pub(super) fn new(params: &'a SweepParams, drawn: &Drawn, streams: &Streams) -> Option<DropoutModel<'a>> {
        let dropout = params.effects.dropout.as_ref()?;
        let ground = drawn[Purpose::SweepDropoutGround];
        Some(DropoutModel {
            reflectance: Reflectance::new(ground, &dropout.object_reflectance, streams),
            draws: streams.open(Purpose::SweepDropout),
            rate: drawn[Purpose::SweepDropoutRate],
            range_at_10_percent_m: params.sensor.range_at_10_percent_m,
            softness: dropout.softness,
        })
    }

    /// Takes the light of some slots away. The slots are those from `first` on; `draws` is room.
    pub(super) fn drop_out(
        &mut self,
        first: usize,
        truth: &[TrueReturn],
        gain_per_m2: &[f64],
        draws: &mut Vec<f64>,
        status: &mut [Status],
    ) {
        draws.resize(status.len(), 0.0);
        self.draws.fill_uniform(first as u64, draws);
        for (slot, status) in status.iter_mut().enumerate().filter(|(_, status)| **status == Status::Hit) {
            let rho = self.reflectance.of(truth[slot].object);
            let seen = chance_of_return(rho, gain_per_m2[slot], self.range_at_10_percent_m, self.softness);
            if draws[slot] >= (1.0 - self.rate) * seen {
                *status = Status::Dropped;
            }
        }
    }
}

/// The received intensities of one sweep.
pub(super) struct IntensityModel<'a> {
    reflectance: Reflectance<'a>,
    draws: Stream,
    sigma: f64,
}

impl<'a> IntensityModel<'a> {
    /// `None` where the effect is off.
    pub(super) fn new(params: &'a SweepParams, drawn: &Drawn, streams: &Streams) -> Option<IntensityModel<'a>> {
        let intensity = params.effects.intensity.as_ref()?;
        let ground = drawn[Purpose::SweepIntensityGround];
        Some(IntensityModel {
            reflectance: Reflectance::new(ground, &intensity.object_reflectance, streams),
            draws: streams.open(Purpose::SweepIntensity),
            sigma: drawn[Purpose::SweepIntensitySigma],
        })
    }

    /// Appends the intensities of the slots from `first` on; `draws` is room.
    pub(super) fn receive(
        &mut self,
        first: usize,
        truth: &[TrueReturn],
        gain_per_m2: &[f64],
        draws: &mut Vec<f64>,
        status: &[Status],
        received: &mut Vec<f32>,
    ) {
        draws.resize(status.len(), 0.0);
        self.draws.fill_normal(first as u64, draws);
        received.extend(status.iter().enumerate().map(|(slot, status)| match status {
            Status::Hit => {
                let rho = self.reflectance.of(truth[slot].object);
                intensity(rho, gain_per_m2[slot], self.sigma * draws[slot])
            }
            _ => f32::NAN,
        }));
    }
}

/// cos / range^2: what a surface of reflectance 1 sends back, against one met squarely at 1 m.
pub(super) fn gain(cos_incidence: f64, range_m: f64) -> f64 {
    // A micrometre keeps light from a blade against the lens finite.
    let range_m = range_m.max(1e-6);
    cos_incidence / (range_m * range_m)
}

/// Chance that a return is strong enough: one half where its power is that of a 10 % target met squarely at
/// `range_at_10_percent_m`.
///
/// P = 1 / (1 + exp(-(ln P_r - ln P_th) / s)), P_r / P_th = (reflectance / 0.1) * gain * range_at_10_percent^2.
fn chance_of_return(reflectance: f64, gain_per_m2: f64, range_at_10_percent_m: f64, softness: f64) -> f64 {
    let power = reflectance / 0.1 * gain_per_m2 * range_at_10_percent_m * range_at_10_percent_m;
    // ln 0 is minus infinity, whose exponential gives a chance of 0.
    1.0 / (1.0 + math::exp(-math::ln(power) / softness))
}

/// I = reflectance * cos / range^2 * (1 + noise), never negative.
fn intensity(reflectance: f64, gain_per_m2: f64, noise: f64) -> f32 {
    (reflectance * gain_per_m2 * (1.0 + noise)).max(0.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Law;
    use crate::sweep::fixtures::streams;

    #[test]
    fn exact_a_ten_percent_target_at_its_range_is_seen_half_the_time() {
        let gain_at = |cos: f64, range_m: f64| cos / (range_m * range_m);
        assert_eq!(chance_of_return(0.1, gain_at(1.0, 18.0), 18.0, 0.3), 0.5);
        // R_max(rho, alpha) = R_10 sqrt(rho cos(alpha) / 0.1).
        let range_m = 18.0 * (0.4 * 0.5 / 0.1f64).sqrt();
        assert!((chance_of_return(0.4, gain_at(0.5, range_m), 18.0, 0.01) - 0.5).abs() < 1e-12);
        // One softness above the threshold: 1 / (1 + 1/e).
        let chance = chance_of_return(0.1 * math::exp(0.3), gain_at(1.0, 18.0), 18.0, 0.3);
        assert!((chance - 1.0 / (1.0 + math::exp(-1.0))).abs() < 1e-12);
    }

    #[test]
    fn extreme_no_light_is_never_seen_and_plenty_always() {
        assert_eq!(chance_of_return(0.3, 0.0, 18.0, 0.3), 0.0);
        assert_eq!(chance_of_return(0.3, f64::INFINITY, 18.0, 0.3), 1.0);
        assert_eq!(chance_of_return(1.0, 1e12, 18.0, 1e-3), 1.0);
        assert_eq!(intensity(0.3, 1.0, -5.0), 0.0);
    }

    #[test]
    fn law_objects_keep_their_reflectance_over_steps_attempts_and_order_of_asking() {
        let law = Dist::Law(Law::Uniform([0.1, 0.9]));
        let mut first = Reflectance::new(0.3, &law, &streams(5));
        let (seven, two) = (first.of(7), first.of(2));
        let later = Streams { attempt: 4, ..streams(5).at_step(3) };
        let mut second = Reflectance::new(0.3, &law, &later);
        assert_eq!((second.of(2), second.of(7), second.of(-1)), (two, seven, 0.3));
        assert_ne!(two, seven);
    }
}
