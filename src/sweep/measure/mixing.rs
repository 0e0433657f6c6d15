//! Mixed pixels: the beams that meet more than one thing, as sub-rays.
//!
//! In: a whole sweep's directions, hits and returns. Out: ranges, gains, incidences and truth of the slots that are mixed, and
//! each slot's share of other surfaces. Sources: [`footprint`](super::super::footprint), [`ranging`](super::super::ranging).

use super::super::footprint::{self, SubRay};
use super::super::light::gain;
use super::super::params::MixedPixels;
use super::super::ranging::{self, Echo};
use super::super::returns::LastFace;
use super::super::vegetation::{Draws, Rays};
use super::{Scratch, Setting, TrueReturn};

/// Grazing light still returns a little: keeps the energies of a beam's echoes from being all zero.
const LEAST_COS: f64 = 1e-6;

impl Setting<'_> {
    /// Casts the sub-rays of the slots that need them and reduces their echoes as the sensor does.
    pub(super) fn mix_pixels(
        &self,
        pixels: &MixedPixels,
        scratch: &mut Scratch,
        truth: &mut [TrueReturn],
        mixed: &mut Vec<f32>,
    ) {
        mixed.extend(truth.iter().map(|ret| if ret.is_hit() { 0.0 } else { f32::NAN }));
        let rays = footprint::sub_rays(pixels.sub_rays);
        let others = rays.len() - 1;
        if others == 0 {
            return;
        }
        self.cast_sub_rays(pixels.only_at_jumps_m, &rays, scratch, truth);
        let Scratch { directions, jumps, sub_directions, sub_returns, echoes, .. } = scratch;
        let beams = sub_directions.chunks(others).zip(sub_returns.chunks(others));
        let mut side = LastFace::default();
        for (&slot, (sub_directions, sub_returns)) in jumps.iter().zip(beams) {
            let slot = slot as usize;
            let beam = std::iter::once((truth[slot], directions[slot]))
                .chain(sub_returns.iter().copied().zip(sub_directions.iter().copied()));
            echoes.clear();
            for (k, (ret, direction)) in beam.enumerate().filter(|(_, (ret, _))| ret.is_hit()) {
                let cos_incidence = ret.cos_incidence(self.caster, self.origin_m, direction).max(LEAST_COS);
                let power = rays[k].weight * gain(cos_incidence, ret.range_m);
                echoes.push(Echo { ret, power, cos_incidence, sub_ray: k });
            }
            if echoes.is_empty() {
                continue;
            }
            let Some(pixel) = ranging::combine(&self.params.sensor.ranging, echoes) else {
                scratch.range_m[slot] = f64::NAN;
                continue;
            };
            scratch.range_m[slot] = pixel.range_m;
            if let Some(gain_per_m2) = scratch.gain_per_m2.get_mut(slot) {
                *gain_per_m2 = pixel.power;
            }
            mixed[slot] = pixel.mixed as f32;
            // Truth follows what is reported; where that is the centre's own return, it is known already.
            if pixel.label.sub_ray != 0 {
                let mut seen = pixel.label.ret;
                seen.mark_top(self.caster, self.origin_m, sub_directions[pixel.label.sub_ray - 1], &mut side);
                truth[slot] = TrueReturn { range_m: pixel.label_range_m, ..seen };
                if let Some(cos) = scratch.cos.get_mut(slot) {
                    *cos = pixel.label.cos_incidence;
                }
            }
        }
    }

    /// What the sub-rays of all slots that need them meet, slot by slot; the centres are known.
    fn cast_sub_rays(&self, jump_m: f64, rays: &[SubRay], scratch: &mut Scratch, centres: &[TrueReturn]) {
        footprint::jumps(self.pattern, &scratch.hits, centres, jump_m, &mut scratch.jumps);
        scratch.sub_directions.clear();
        for &slot in &scratch.jumps {
            let range_m = centres[slot as usize].range_m.min(self.reach_m);
            let half_rad = footprint::half_angle_rad(&self.params.sensor, range_m);
            footprint::spread(scratch.directions[slot as usize], half_rad, rays, &mut scratch.sub_directions);
        }
        self.origin.cast(&scratch.sub_directions, &mut scratch.hits);
        scratch.sub_returns.clear();
        scratch.sub_returns.extend(scratch.hits.iter().map(|&hit| TrueReturn::of(hit, &self.scene.obstacles)));
        if scratch.vegetation.is_empty() {
            return;
        }
        let others = rays.len() - 1;
        let beams = scratch.sub_directions.chunks(others).zip(scratch.sub_returns.chunks_mut(others));
        for (&slot, (directions, returns)) in scratch.jumps.iter().zip(beams) {
            let rays = Rays { origin_m: self.origin_m, directions, draws: Draws::Shared(slot.into()) };
            scratch.vegetation.scatter(self.caster, &rays, &self.foliage, returns);
        }
    }
}
