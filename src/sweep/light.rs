//! Received light -> whether a return is seen, and how bright it looks.
//!
//! In: reflectance and the geometric gain cos(incidence) / range^2 of a return (summed over sub-rays where there are any).
//! Out: probability of a return, intensity. Source: the lidar equation for extended diffuse targets (Hoefle & Pfeifer 2007),
//! with the threshold at the datasheet's range on 10 % reflectance. Not modelled: atmosphere, the roll-off of near ranges,
//! specular and retroreflecting surfaces.

use super::cast::Hit;
use crate::math;
use crate::random::{Dist, Purpose, Streams};

/// Reflectances of a scene: the ground's, and each object's at its own address.
pub(super) struct Reflectance<'a> {
    ground: f64,
    objects: &'a Dist,
    /// By object id; NaN until it is asked for.
    drawn: &'a mut Vec<f64>,
    streams: Streams,
}

impl<'a> Reflectance<'a> {
    /// Objects keep their reflectance over all sweeps and attempts of a scene: their draws have no step.
    pub fn new(ground: f64, objects: &'a Dist, drawn: &'a mut Vec<f64>, streams: &Streams) -> Reflectance<'a> {
        drawn.clear();
        Reflectance { ground, objects, drawn, streams: Streams { attempt: 0, step: 0, ..*streams } }
    }

    pub fn of(&mut self, object: i32) -> f64 {
        if object <= Hit::GROUND {
            return self.ground;
        }
        let id = object as usize;
        if id >= self.drawn.len() {
            self.drawn.resize(id + 1, f64::NAN);
        }
        if self.drawn[id].is_nan() {
            let stream = self.streams.open(Purpose::SweepObjectReflectance);
            self.drawn[id] = self.objects.at(&stream, id as u64);
        }
        self.drawn[id]
    }
}

/// Chance that a return is strong enough: one half where its power is that of a 10 % target met squarely at
/// `range_at_10_percent_m`.
///
/// P = 1 / (1 + exp(-(ln P_r - ln P_th) / s)), P_r / P_th = (reflectance / 0.1) * gain * range_at_10_percent^2.
pub(super) fn chance_of_return(reflectance: f64, gain_per_m2: f64, range_at_10_percent_m: f64, softness: f64) -> f64 {
    let power = reflectance / 0.1 * gain_per_m2 * range_at_10_percent_m * range_at_10_percent_m;
    // ln 0 is minus infinity, whose exponential gives a chance of 0.
    1.0 / (1.0 + math::exp(-math::ln(power) / softness))
}

/// I = reflectance * cos / range^2 * (1 + noise), never negative.
pub(super) fn intensity(reflectance: f64, gain_per_m2: f64, noise: f64) -> f32 {
    (reflectance * gain_per_m2 * (1.0 + noise)).max(0.0) as f32
}
