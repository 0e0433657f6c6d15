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
        let (mut a, mut b) = (vec![f64::NAN; 3], Vec::new());
        let mut first = Reflectance::new(0.3, &law, &mut a, &streams(5));
        let (seven, two) = (first.of(7), first.of(2));
        let later = Streams { attempt: 4, ..streams(5).at_step(3) };
        let mut second = Reflectance::new(0.3, &law, &mut b, &later);
        assert_eq!((second.of(2), second.of(7), second.of(-1)), (two, seven, 0.3));
        assert_ne!(two, seven);
    }
}
