//! The sweep itself: beams out, light back, effects in their order.
//!
//! In: parameters, pattern, a prepared scene, `world_from_sensor`, drawn values, streams at the sweep's step. Out: [`Sweep`].
//! Order: directions (with the tilt's error), first hits, vegetation, mixed pixels, dropout, range errors, intensity. An
//! effect that is not named costs nothing and draws nothing; each has its own purpose and one draw a slot (or line, object or
//! sweep), so that no effect moves another's draws. Sub-rays have no draws of their own: they share their beam's.
//!
//! Truth of a mixed pixel: the surface with most energy in what is reported; its range is the centre ray's where that met the
//! same surface, else the energy-weighted mean of the sub-rays that did.

use std::sync::Arc;

use super::cast::{Caster, Hit, Inside, Origin};
use super::footprint::{self, SubRay};
use super::light::{self, Reflectance};
use super::range_error::RangeError;
use super::ranging::{self, Echo};
use super::returns::Return;
use super::vegetation::{BLOCK, Draws, Rays, Vegetation};
use super::{Pattern, Status, Sweep, SweepError, SweepParams, TrueReturn};
use crate::geometry::{DVec3, Transform};
use crate::math;
use crate::random::{Drawn, Purpose, Stream, Streams};
use crate::scene::Scene;

/// Grazing light still returns a little: keeps the energies of a beam's echoes from being all zero.
const LEAST_COS: f64 = 1e-6;

/// Room that one sweep leaves to the next; holds no meaning between them.
#[derive(Debug, Default)]
pub struct Scratch {
    directions: Vec<DVec3>,
    hits: Vec<Hit>,
    returns: Vec<Return>,
    /// Per slot: cosine of the incidence, and cos / range^2 summed over what is reported.
    cos: Vec<f64>,
    gain_per_m2: Vec<f64>,
    /// Per slot: range before errors; NaN where light came back but no range could be made of it.
    range_m: Vec<f64>,
    draws: Vec<f64>,
    vegetation: Vegetation,
    jumps: Vec<u32>,
    sub_directions: Vec<DVec3>,
    sub_returns: Vec<Return>,
    echoes: Vec<Echo>,
    reflectance: Vec<f64>,
    /// A sweep that nobody needs any more: its lists are filled anew.
    spare: Option<Sweep>,
}

impl Scratch {
    /// Takes a sweep that nobody needs any more, for the room it has.
    pub fn reuse(&mut self, sweep: Sweep) {
        self.spare = Some(sweep);
    }
}

/// What all steps of one sweep look at.
struct Setting<'a> {
    params: &'a SweepParams,
    pattern: &'a Pattern,
    caster: &'a Caster<'a>,
    scene: &'a Scene,
    world_from_sensor: &'a Transform,
    origin_m: DVec3,
    reach_m: f64,
    origin: Origin<'a>,
    drawn: &'a Drawn,
    streams: &'a Streams,
    /// Draws of patches and of volumes, one a slot.
    foliage: [Stream; 2],
}

/// Casts one sweep and measures it. `streams` stand at the sweep's step; the pattern is the sensor's own.
pub fn sweep(
    params: &SweepParams,
    pattern: &Arc<Pattern>,
    caster: &Caster,
    world_from_sensor: &Transform,
    drawn: &Drawn,
    streams: &Streams,
    scratch: &mut Scratch,
) -> Result<Sweep, SweepError> {
    let origin_m = world_from_sensor.translation_m;
    check_place(caster, world_from_sensor)?;
    let reach_m = RangeError::reach_m(&params.sensor, &params.effects);
    let setting = Setting {
        params,
        pattern,
        caster,
        scene: caster.scene(),
        world_from_sensor,
        origin_m,
        reach_m,
        origin: caster.from(origin_m, reach_m),
        drawn,
        streams,
        foliage: [streams.open(Purpose::SweepPatch), streams.open(Purpose::SweepVolume)],
    };

    let (mut truth, mut status, mut range_m) = match scratch.spare.take() {
        Some(spare) => (spare.truth, spare.status, spare.range_m),
        None => Default::default(),
    };
    setting.aim(scratch);
    setting.meet(scratch);
    setting.truth(scratch, &mut truth);
    setting.light(scratch);
    let mixed = setting.mix(scratch, &mut truth);
    setting.drop_out(scratch, &truth, &mut status);
    setting.report(scratch, &mut status, &mut range_m);
    let intensity = setting.intensity(scratch, &truth, &status);
    Ok(Sweep { pattern: Arc::clone(pattern), range_m, status, intensity, mixed, truth })
}

/// Refuses places where no sensor can be.
fn check_place(caster: &Caster, world_from_sensor: &Transform) -> Result<(), SweepError> {
    let place_m = world_from_sensor.translation_m;
    if !place_m.is_finite() || !world_from_sensor.rotation.is_finite() {
        return Err(SweepError::NoPose { x_m: place_m.x, y_m: place_m.y, z_m: place_m.z });
    }
    match caster.inside(place_m) {
        Some(Inside::Ground { depth_m }) => Err(SweepError::Buried { x_m: place_m.x, y_m: place_m.y, depth_m }),
        Some(Inside::Obstacle(object)) => Err(SweepError::Inside { object }),
        None => Ok(()),
    }
}

impl Setting<'_> {
    /// World directions of all slots, each line tilted by the error of its encoder.
    fn aim(&self, scratch: &mut Scratch) {
        let world_from_sensor = &self.world_from_sensor.rotation;
        scratch.directions.clear();
        if self.params.effects.tilt_jitter_deg.is_none() {
            scratch.directions.extend(self.pattern.directions.iter().map(|&d| *world_from_sensor * d));
            return;
        }
        let sigma_rad = self.drawn[Purpose::SweepTiltSigma].to_radians();
        scratch.draws.clear();
        scratch.draws.resize(self.pattern.lines as usize, 0.0);
        self.streams.open(Purpose::SweepTilt).fill_normal(0, &mut scratch.draws);
        let lines = self.pattern.directions.chunks(self.pattern.beams as usize);
        for (line, draw) in lines.zip(&scratch.draws) {
            // The tilt axis is y; a positive error looks higher.
            let (s, c) = math::sin_cos(sigma_rad * draw);
            let tilted = |d: &DVec3| DVec3::new(d.x * c - d.z * s, d.y, d.x * s + d.z * c);
            scratch.directions.extend(line.iter().map(|d| *world_from_sensor * tilted(d)));
        }
    }

    /// First hits on solid things, then what vegetation makes of them.
    fn meet(&self, scratch: &mut Scratch) {
        self.origin.cast(&scratch.directions, &mut scratch.hits);
        let obstacles = &self.scene.obstacles;
        scratch.returns.clear();
        scratch.returns.extend(scratch.hits.iter().map(|&hit| Return::of(hit, obstacles)));
        scratch.vegetation.reach(self.scene, self.origin_m, self.reach_m);
        if scratch.vegetation.is_empty() {
            return;
        }
        let blocks = scratch.directions.chunks(BLOCK).zip(scratch.returns.chunks_mut(BLOCK));
        for (k, (directions, returns)) in blocks.enumerate() {
            let rays = Rays { origin_m: self.origin_m, directions, draws: Draws::From((k * BLOCK) as u64) };
            scratch.vegetation.scatter(self.caster, &rays, &self.foliage, returns);
        }
    }

    fn truth(&self, scratch: &Scratch, truth: &mut Vec<TrueReturn>) {
        let seen = scratch.returns.iter().zip(&scratch.directions);
        truth.clear();
        truth.extend(seen.map(|(ret, &direction)| self.true_return(ret, direction)));
    }

    fn true_return(&self, ret: &Return, direction: DVec3) -> TrueReturn {
        let top = ret.is_top(&self.scene.obstacles, self.caster, self.origin_m + direction * ret.range_m);
        TrueReturn { range_m: ret.range_m, object: ret.object, class: ret.class, top }
    }

    /// Range, incidence and gain of every slot, as far as an effect asks for them.
    fn light(&self, scratch: &mut Scratch) {
        let effects = &self.params.effects;
        let oblique = effects.range_noise.as_ref().is_some_and(|noise| noise.incidence);
        let wanted = oblique || effects.dropout.is_some() || effects.intensity.is_some();
        let Scratch { returns, directions, range_m, cos, gain_per_m2, .. } = scratch;
        range_m.clear();
        range_m.extend(returns.iter().map(|ret| ret.range_m));
        cos.clear();
        gain_per_m2.clear();
        if wanted {
            let seen = returns.iter().zip(&*directions);
            cos.extend(seen.map(|(ret, &d)| ret.cos_incidence(self.caster, self.origin_m, d)));
            gain_per_m2.extend(returns.iter().zip(&*cos).map(|(ret, &c)| gain(c, ret.range_m)));
        } else {
            cos.resize(returns.len(), 1.0);
            gain_per_m2.resize(returns.len(), 0.0);
        }
    }

    /// Casts the sub-rays of the slots that need them and reduces their echoes as the sensor does.
    fn mix(&self, scratch: &mut Scratch, truth: &mut [TrueReturn]) -> Option<Vec<f32>> {
        let pixels = self.params.effects.mixed_pixels.as_ref()?;
        let mut mixed: Vec<f32> = scratch.returns.iter().map(|ret| if ret.is_hit() { 0.0 } else { f32::NAN }).collect();
        let rays = footprint::sub_rays(pixels.sub_rays);
        let others = rays.len() - 1;
        if others == 0 {
            return Some(mixed);
        }
        self.cast_sub_rays(pixels.only_at_jumps_m, &rays, scratch);
        let Scratch { directions, returns, jumps, sub_directions, sub_returns, echoes, .. } = scratch;
        let beams = sub_directions.chunks(others).zip(sub_returns.chunks(others));
        for (&slot, (sub_directions, sub_returns)) in jumps.iter().zip(beams) {
            let slot = slot as usize;
            let beam = std::iter::once((returns[slot], directions[slot]))
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
            scratch.gain_per_m2[slot] = pixel.power;
            mixed[slot] = pixel.mixed as f32;
            // Truth follows what is reported; where that is the centre's own return, it is known already.
            if pixel.label.sub_ray != 0 {
                let seen = self.true_return(&pixel.label.ret, sub_directions[pixel.label.sub_ray - 1]);
                truth[slot] = TrueReturn { range_m: pixel.label_range_m, ..seen };
                scratch.cos[slot] = pixel.label.cos_incidence;
            }
        }
        Some(mixed)
    }

    /// What the sub-rays of all slots that need them meet, slot by slot; the centres are known.
    fn cast_sub_rays(&self, jump_m: f64, rays: &[SubRay], scratch: &mut Scratch) {
        footprint::jumps(self.pattern, &scratch.hits, &scratch.returns, jump_m, &mut scratch.jumps);
        scratch.sub_directions.clear();
        for &slot in &scratch.jumps {
            let range_m = scratch.returns[slot as usize].range_m.min(self.reach_m);
            let half_rad = footprint::half_angle_rad(&self.params.sensor, range_m);
            footprint::spread(scratch.directions[slot as usize], half_rad, rays, &mut scratch.sub_directions);
        }
        self.origin.cast(&scratch.sub_directions, &mut scratch.hits);
        scratch.sub_returns.clear();
        scratch.sub_returns.extend(scratch.hits.iter().map(|&hit| Return::of(hit, &self.scene.obstacles)));
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

    /// Which slots light came back from, and how many of them the sensor saw.
    fn drop_out(&self, scratch: &mut Scratch, truth: &[TrueReturn], status: &mut Vec<Status>) {
        status.clear();
        status.extend(scratch.range_m.iter().map(|range_m| light_status(*range_m)));
        let Some(dropout) = &self.params.effects.dropout else { return };
        let rate = self.drawn[Purpose::SweepDropoutRate];
        let reach_m = self.params.sensor.range_at_10_percent_m;
        let Scratch { draws, reflectance, gain_per_m2, .. } = scratch;
        let mut reflectance = Reflectance::new(
            self.drawn[Purpose::SweepDropoutGround],
            &dropout.object_reflectance,
            reflectance,
            self.streams,
        );
        draws.clear();
        draws.resize(status.len(), 0.0);
        self.streams.open(Purpose::SweepDropout).fill_uniform(0, draws);
        for (slot, status) in status.iter_mut().enumerate().filter(|(_, status)| **status == Status::Hit) {
            let rho = reflectance.of(truth[slot].object);
            let seen = light::chance_of_return(rho, gain_per_m2[slot], reach_m, dropout.softness);
            if draws[slot] >= (1.0 - rate) * seen {
                *status = Status::Dropped;
            }
        }
    }

    /// The ranges that the sensor reports; gates change the status.
    fn report(&self, scratch: &mut Scratch, status: &mut [Status], measured_m: &mut Vec<f64>) {
        let error = RangeError::new(&self.params.sensor, &self.params.effects, self.drawn, self.streams);
        let Scratch { draws, range_m, cos, .. } = scratch;
        draws.clear();
        draws.resize(status.len(), 0.0);
        if error.noisy {
            self.streams.open(Purpose::SweepRangeNoise).fill_normal(0, draws);
        }
        measured_m.clear();
        measured_m.resize(status.len(), f64::NAN);
        for (slot, status) in status.iter_mut().enumerate().filter(|(_, status)| **status == Status::Hit) {
            (measured_m[slot], *status) = error.report(range_m[slot], cos[slot], draws[slot]);
        }
    }

    fn intensity(&self, scratch: &mut Scratch, truth: &[TrueReturn], status: &[Status]) -> Option<Vec<f32>> {
        let intensity = self.params.effects.intensity.as_ref()?;
        let sigma = self.drawn[Purpose::SweepIntensitySigma];
        let Scratch { draws, reflectance, gain_per_m2, .. } = scratch;
        let mut reflectance = Reflectance::new(
            self.drawn[Purpose::SweepIntensityGround],
            &intensity.object_reflectance,
            reflectance,
            self.streams,
        );
        draws.clear();
        draws.resize(status.len(), 0.0);
        self.streams.open(Purpose::SweepIntensity).fill_normal(0, draws);
        let received = status.iter().enumerate().map(|(slot, status)| match status {
            Status::Hit => light::intensity(reflectance.of(truth[slot].object), gain_per_m2[slot], sigma * draws[slot]),
            _ => f32::NAN,
        });
        Some(received.collect())
    }
}

/// cos / range^2: what a surface of reflectance 1 sends back, against one met squarely at 1 m.
fn gain(cos_incidence: f64, range_m: f64) -> f64 {
    // A micrometre keeps light from a blade against the lens finite.
    let range_m = range_m.max(1e-6);
    cos_incidence / (range_m * range_m)
}

fn light_status(range_m: f64) -> Status {
    if range_m.is_nan() {
        Status::Dropped
    } else if range_m.is_finite() {
        Status::Hit
    } else {
        Status::None
    }
}

#[cfg(test)]
mod tests;
