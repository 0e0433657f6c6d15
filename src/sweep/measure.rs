//! The sweep itself: beams out, light back, effects in their order.
//!
//! In: parameters, pattern, a prepared scene, `world_from_sensor`, drawn values, streams at the sweep's step. Out: [`Sweep`].
//! Order: directions (with the tilt's error), first hits, vegetation, mixed pixels, dropout, range errors, intensity. An
//! effect that is not named costs nothing and draws nothing; each has its own purpose and one draw a slot (or line, object or
//! sweep), so that no effect moves another's draws. Sub-rays have no draws of their own: they share their beam's.
//!
//! The slots go through all steps a [`RUN`] at a time, so that what one step leaves to the next is still at hand. Mixed pixels
//! look at their neighbours: with them the run is the whole sweep.
//!
//! Truth of a mixed pixel: the surface with most energy in what is reported; its range is the centre ray's where that met the
//! same surface, else the energy-weighted mean of the sub-rays that did.

mod mixing;

use std::ops::Range;
use std::sync::Arc;

use super::cast::{Caster, Hit, Inside, Origin, SWEEP_RAYS};
use super::light::{DropoutModel, IntensityModel, gain};
use super::params::Effects;
use super::range_error::{ApplyRangeErrors, MarkStatus, RangeError};
use super::ranging::Echo;
use super::returns::{LastFace, add_cosines};
use super::vegetation::{BLOCK, Draws, Rays, Vegetation};
use super::{Pattern, Returns, Status, Sweep, SweepError, SweepParams, TrueReturn};
use crate::geometry::{DVec3, Transform};
use crate::math;
use crate::random::{Drawn, Purpose, Stream, Streams};
use crate::scene::Scene;
use crate::wide::widest;

/// Slots that go through the steps together: some 200 kB of lists. The caster looks round for no fewer rays, and vegetation's
/// blocks fill it.
const RUN: usize = 2048;
const _: () = assert!(RUN >= SWEEP_RAYS && RUN.is_multiple_of(BLOCK));

/// Room that one sweep leaves to the next; holds no meaning between them.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Per line: sine and cosine of the tilt's error, where there is one.
    tilts: Vec<(f64, f64)>,
    // Lists of one run of slots.
    directions: Vec<DVec3>,
    hits: Vec<Hit>,
    /// Cosine of the incidence, and cos / range^2 summed over what is reported; empty where no effect asks.
    cos: Vec<f64>,
    gain_per_m2: Vec<f64>,
    /// Range before errors; NaN where light came back but no range could be made of it.
    range_m: Vec<f64>,
    draws: Vec<f64>,
    vegetation: Vegetation,
    jumps: Vec<u32>,
    sub_directions: Vec<DVec3>,
    sub_returns: Vec<TrueReturn>,
    echoes: Vec<Echo>,
    /// Sweeps that nobody needs any more: their lists are filled anew.
    spare: Vec<Sweep>,
}

impl Scratch {
    /// Takes a sweep that nobody needs any more, for the room it has.
    pub fn reuse(&mut self, sweep: Sweep) {
        self.spare.push(sweep);
    }

    /// A sweep without slots, with room for those of the pattern.
    fn blank(&mut self, pattern: &Arc<Pattern>, effects: &Effects) -> Sweep {
        let (mut range_m, mut status, mut truth) = Default::default();
        let (mut intensity, mut mixed) = (None, None);
        if let Some(spare) = self.spare.pop() {
            (range_m, status, truth) = (spare.returns.range_m, spare.returns.status, spare.truth);
            (intensity, mixed) = (spare.returns.intensity, spare.mixed);
        }
        let slots = pattern.directions.len();
        let returns = Returns {
            pattern: Arc::clone(pattern),
            range_m: emptied(range_m, slots),
            status: emptied(status, slots),
            intensity: effects.intensity.as_ref().map(|_| emptied(intensity.unwrap_or_default(), slots)),
        };
        Sweep {
            returns,
            mixed: effects.mixed_pixels.as_ref().map(|_| emptied(mixed.unwrap_or_default(), slots)),
            truth: emptied(truth, slots),
        }
    }
}

fn emptied<T>(mut list: Vec<T>, room: usize) -> Vec<T> {
    list.clear();
    list.reserve(room);
    list
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
    error: RangeError,
    noise: Option<Stream>,
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
    if !origin_m.is_finite() || !world_from_sensor.rotation.is_finite() {
        return Err(SweepError::NoPose { x_m: origin_m.x, y_m: origin_m.y, z_m: origin_m.z });
    }
    let effects = &params.effects;
    let reach_m = RangeError::reach_m(&params.sensor, effects);
    // Before it is asked what the sensor is in: the caster's first look about is then as wide as the sweeps need it.
    let origin = caster.from(origin_m, reach_m);
    match caster.inside(origin_m) {
        Some(Inside::Ground { depth_m }) => {
            return Err(SweepError::Buried { x_m: origin_m.x, y_m: origin_m.y, depth_m });
        }
        Some(Inside::Obstacle(object)) => return Err(SweepError::Inside { object }),
        None => {}
    }
    let setting = Setting {
        params,
        pattern,
        caster,
        scene: caster.scene(),
        world_from_sensor,
        origin_m,
        reach_m,
        origin,
        drawn,
        streams,
        foliage: [streams.open(Purpose::SweepPatch), streams.open(Purpose::SweepVolume)],
        error: RangeError::new(&params.sensor, effects, drawn, streams),
        noise: effects.range_noise.as_ref().map(|_| streams.open(Purpose::SweepRangeNoise)),
    };
    let mut losses = DropoutModel::new(params, drawn, streams);
    let mut brightness = IntensityModel::new(params, drawn, streams);
    let mut sweep = scratch.blank(pattern, effects);
    setting.tilt(scratch);
    scratch.vegetation.reach(setting.scene, origin_m, reach_m);

    let slots = pattern.directions.len();
    let run = if effects.mixed_pixels.is_some() { slots.max(1) } else { RUN };
    for first in (0..slots).step_by(run) {
        setting.beam_directions(first..slots.min(first + run), scratch);
        setting.cast_beams(first, scratch, &mut sweep.truth);
        let truth = &mut sweep.truth[first..];
        setting.received_power(scratch, truth);
        if let (Some(pixels), Some(mixed)) = (&effects.mixed_pixels, &mut sweep.mixed) {
            setting.mix_pixels(pixels, scratch, truth, mixed);
        }
        sweep.returns.status.resize(first + truth.len(), Status::None);
        let status = &mut sweep.returns.status[first..];
        widest(MarkStatus { range_m: &scratch.range_m, status });
        let Scratch { draws, gain_per_m2, .. } = scratch;
        if let Some(losses) = &mut losses {
            losses.drop_out(first, truth, gain_per_m2, draws, status);
        }
        setting.apply_range_errors(first, scratch, status, &mut sweep.returns.range_m);
        if let (Some(brightness), Some(intensity)) = (&mut brightness, &mut sweep.returns.intensity) {
            brightness.receive(first, truth, &scratch.gain_per_m2, &mut scratch.draws, status, intensity);
        }
    }
    Ok(sweep)
}

impl Setting<'_> {
    /// Sine and cosine of each line's turn by the error of its encoder.
    fn tilt(&self, scratch: &mut Scratch) {
        let Scratch { tilts, draws, .. } = scratch;
        tilts.clear();
        if self.params.effects.tilt_jitter_deg.is_some() {
            let sigma_rad = self.drawn[Purpose::SweepTiltSigma].to_radians();
            draws.resize(self.pattern.lines as usize, 0.0);
            self.streams.open(Purpose::SweepTilt).fill_normal(0, draws);
            tilts.extend(draws.iter().map(|draw| math::sin_cos(sigma_rad * draw)));
        }
    }

    /// World directions of a run of slots.
    fn beam_directions(&self, slots: Range<usize>, scratch: &mut Scratch) {
        let world_from_sensor = self.world_from_sensor.rotation;
        let Scratch { directions, tilts, .. } = scratch;
        directions.clear();
        if tilts.is_empty() {
            directions.extend(self.pattern.directions[slots].iter().map(|&d| world_from_sensor * d));
            return;
        }
        let beams = self.pattern.beams as usize;
        let mut slot = slots.start;
        while slot < slots.end {
            let line = slot / beams;
            let end = slots.end.min((line + 1) * beams);
            // The tilt axis is y; a positive error looks higher.
            let (s, c) = tilts[line];
            let tilted = |d: &DVec3| DVec3::new(d.x * c - d.z * s, d.y, d.x * s + d.z * c);
            directions.extend(self.pattern.directions[slot..end].iter().map(|d| world_from_sensor * tilted(d)));
            slot = end;
        }
    }

    /// First hits on solid things, then what vegetation makes of them: the truth, but for mixed pixels.
    fn cast_beams(&self, first: usize, scratch: &mut Scratch, truth: &mut Vec<TrueReturn>) {
        let Scratch { directions, hits, vegetation, .. } = scratch;
        self.origin.cast(directions, hits);
        let obstacles = &self.scene.obstacles;
        truth.extend(hits.iter().map(|&hit| TrueReturn::of(hit, obstacles)));
        let truth = &mut truth[first..];
        if !vegetation.is_empty() {
            let blocks = directions.chunks(BLOCK).zip(truth.chunks_mut(BLOCK));
            for (k, (directions, truth)) in blocks.enumerate() {
                let draws = Draws::From((first + k * BLOCK) as u64);
                let rays = Rays { origin_m: self.origin_m, directions, draws };
                vegetation.scatter(self.caster, &rays, &self.foliage, truth);
            }
        }
        let mut side = LastFace::default();
        for (ret, &direction) in truth.iter_mut().zip(&*directions) {
            ret.mark_top(self.caster, self.origin_m, direction, &mut side);
        }
    }

    /// Range of every slot of the run; incidence and gain where an effect asks for them.
    fn received_power(&self, scratch: &mut Scratch, truth: &[TrueReturn]) {
        let effects = &self.params.effects;
        let Scratch { directions, range_m, cos, gain_per_m2, .. } = scratch;
        range_m.clear();
        range_m.extend(truth.iter().map(|ret| ret.range_m));
        cos.clear();
        gain_per_m2.clear();
        if self.error.oblique() || effects.dropout.is_some() || effects.intensity.is_some() {
            add_cosines(self.caster, self.origin_m, directions, truth, cos);
            gain_per_m2.extend(truth.iter().zip(&*cos).map(|(ret, &c)| gain(c, ret.range_m)));
        }
    }

    /// The ranges that the sensor reports; gates change the status.
    fn apply_range_errors(
        &self,
        first: usize,
        scratch: &mut Scratch,
        status: &mut [Status],
        measured_m: &mut Vec<f64>,
    ) {
        let Scratch { draws, range_m, cos, .. } = scratch;
        if let Some(noise) = &self.noise {
            draws.resize(range_m.len(), 0.0);
            noise.fill_normal(first as u64, draws);
        } else {
            draws.clear();
        }
        measured_m.resize(first + range_m.len(), f64::NAN);
        let measured_m = &mut measured_m[first..];
        widest(ApplyRangeErrors { error: &self.error, range_m, cos_incidence: cos, normal: draws, status, measured_m });
    }
}

#[cfg(test)]
mod tests;
