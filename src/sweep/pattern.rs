//! A sensor's pattern -> the unit direction and the time of every beam slot.
//!
//! In: [`Sensor`]. Out: [`Pattern`], sensor frame (x forward, y left, z up). Beams beside each other on a line are
//! neighbours in angle, and so are lines. Source: Hewitt et al. 2017, figure 6 (tilted fans); two thin prisms turned
//! against each other (Risley) for the rosette, to first order in the deflection. Angles are those that the sensor reports,
//! free of error. Not modelled: offsets between emitters (every beam leaves the origin), prism dispersion, mirror tolerances.

use std::f64::consts::TAU;

use super::Pattern;
use super::sensor::{PatternFile, PatternParams, RasterParams, RosetteParams, Sensor, SpinningParams, TiltedParams};
use crate::geometry::DVec3;
use crate::math;

/// Most slots of a pattern: 16 times a full OS1-64 second fits; more is a slip of the pen.
pub const MAX_SLOTS: u64 = 1 << 24;

/// Why a pattern cannot be built.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum PatternError {
    #[error("the pattern of sensor '{sensor}' has {slots} beams; at most {MAX_SLOTS} are allowed: use larger steps")]
    TooLarge { sensor: String, slots: u64 },
    #[error(
        "the pattern file '{path}' of sensor '{sensor}' holds no beams: give it rows of time_s, azimuth_deg, elevation_deg"
    )]
    Empty { sensor: String, path: String },
    #[error(
        "beam {row} of the pattern file '{path}' ({time_s}, {azimuth_deg}, {elevation_deg}) is not a direction: azimuth must lie in [-360, 360] and elevation in [-90, 90] degrees"
    )]
    NotADirection { path: String, row: usize, time_s: f64, azimuth_deg: f64, elevation_deg: f64 },
}

/// Of lines, and of the beams of a line, at least so many are left of a pattern that is thinned; of fewer none is left out.
const LEAST_LEFT: u32 = 32;

impl Pattern {
    /// Builds the beam directions of a sensor; once per plan.
    pub fn build(sensor: &Sensor) -> Result<Pattern, PatternError> {
        let pattern = match &sensor.pattern {
            PatternParams::Tilted(p) => Pattern::allocate(sensor, tilt_lines(p), p.beams.into())?.tilted(p),
            PatternParams::Spinning(p) => {
                Pattern::allocate(sensor, p.elevations_deg.len() as u64, p.columns.into())?.spinning(p)
            }
            PatternParams::Raster(p) => Pattern::allocate(sensor, p.rows.into(), p.columns.into())?.raster(p),
            PatternParams::Rosette(p) => Pattern::allocate(sensor, 1, p.beams.into())?.rosette(p),
            PatternParams::File(p) if p.beams.is_empty() => {
                return Err(PatternError::Empty { sensor: sensor.name.clone(), path: p.path.clone() });
            }
            PatternParams::File(p) => Pattern::allocate(sensor, 1, p.beams.len() as u64)?.listed(p)?,
        };
        debug_assert_eq!(pattern.directions.len(), pattern.slots(), "one direction a slot");
        Ok(pattern)
    }

    /// Every so-manieth line, and of it every so-manieth beam, where so many are left of either that surfaces are still seen.
    pub fn thinned(&self, every: u32) -> Pattern {
        let stride = |count: u32| (1..=every.max(1)).rev().find(|by| count / by >= LEAST_LEFT).unwrap_or(1);
        let (by_line, by_beam) = (stride(self.lines), stride(self.beams));
        let (lines, beams) = (self.lines.div_ceil(by_line), self.beams.div_ceil(by_beam));
        let left = (0..self.lines).step_by(by_line as usize).flat_map(|line| {
            (0..self.beams)
                .step_by(by_beam as usize)
                .map(move |beam| line as usize * self.beams as usize + beam as usize)
        });
        let (mut directions, mut times_s) = (Vec::new(), Vec::new());
        for slot in left {
            directions.push(self.directions[slot]);
            times_s.extend(self.times_s.get(slot));
        }
        Pattern { lines, beams, directions, times_s }
    }

    /// Number of beam slots.
    pub fn slots(&self) -> usize {
        self.lines as usize * self.beams as usize
    }

    fn allocate(sensor: &Sensor, lines: u64, beams: u64) -> Result<Pattern, PatternError> {
        let slots = lines.saturating_mul(beams);
        if slots > MAX_SLOTS {
            return Err(PatternError::TooLarge { sensor: sensor.name.clone(), slots });
        }
        Ok(Pattern {
            lines: lines as u32,
            beams: beams as u32,
            directions: Vec::with_capacity(slots as usize),
            times_s: Vec::with_capacity(slots as usize),
        })
    }

    fn push(&mut self, direction: DVec3, time_s: f64) {
        self.directions.push(direction);
        self.times_s.push(time_s);
    }

    /// Each fan lies in a plane that holds the y axis; the tilt unit turns it about that axis.
    fn tilted(mut self, p: &TiltedParams) -> Pattern {
        let first_deg = p.first_beam_deg.unwrap_or(-0.5 * f64::from(self.beams - 1) * p.beam_step_deg);
        let azimuths = sin_cos_table(self.beams, |k| first_deg + k * p.beam_step_deg);
        let step_deg = p.tilt_step_deg.copysign(p.tilt_to_deg - p.tilt_from_deg);
        for line in 0..self.lines {
            let (st, ct) = math::sin_cos((p.tilt_from_deg + f64::from(line) * step_deg).to_radians());
            for (beam, &(sa, ca)) in azimuths.iter().enumerate() {
                let share = beam as f64 / f64::from(self.beams);
                self.push(DVec3::new(ca * ct, sa, ca * st), (f64::from(line) + share) * p.line_time_s);
            }
        }
        self
    }

    /// A ring is a line; its columns begin behind the sensor, so that the view ahead has no seam.
    fn spinning(mut self, p: &SpinningParams) -> Pattern {
        let step_deg = 360.0 / f64::from(p.columns);
        let azimuths = sin_cos_table(self.beams, |k| k * step_deg - 180.0);
        for elevation_deg in &p.elevations_deg {
            let (se, ce) = math::sin_cos(elevation_deg.to_radians());
            for (beam, &(sa, ca)) in azimuths.iter().enumerate() {
                self.push(DVec3::new(ce * ca, ce * sa, se), beam as f64 / f64::from(self.beams) * p.turn_time_s);
            }
        }
        self
    }

    /// As a picture is read: from the left, from the top. The outermost samples lie on the edges of the field.
    fn raster(mut self, p: &RasterParams) -> Pattern {
        let (across_deg, down_deg) = (spacing(p.width_deg, p.columns), spacing(p.height_deg, p.rows));
        let left_deg = 0.5 * across_deg * f64::from(p.columns - 1);
        let top_deg = p.centre_elevation_deg + 0.5 * down_deg * f64::from(p.rows - 1);
        let azimuths = sin_cos_table(self.beams, |k| left_deg - k * across_deg);
        let slots = self.slots() as f64;
        for row in 0..self.lines {
            let (se, ce) = math::sin_cos((top_deg - f64::from(row) * down_deg).to_radians());
            for &(sa, ca) in &azimuths {
                let time_s = self.directions.len() as f64 / slots * p.frame_time_s;
                self.push(DVec3::new(ce * ca, ce * sa, se), time_s);
            }
        }
        self
    }

    /// Two prisms of one deflection, a quarter of the field each: their deflections add as vectors.
    fn rosette(mut self, p: &RosetteParams) -> Pattern {
        let deflection_rad = (0.25 * p.field_deg).to_radians();
        let (sc, cc) = math::sin_cos(p.centre_elevation_deg.to_radians());
        for beam in 0..self.beams {
            let time_s = f64::from(beam) / p.rate_hz;
            // Whole turns are dropped before the sine, so that an hour of scanning loses no digits.
            let turned = |rpm: f64| math::sin_cos((rpm / 60.0 * time_s).fract() * TAU);
            let ((s1, c1), (s2, c2)) = (turned(p.first_rpm), turned(p.second_rpm));
            let (left, up) = (deflection_rad * (c1 + c2), deflection_rad * (s1 + s2));
            let off_axis_rad = (left * left + up * up).sqrt();
            let (so, co) = math::sin_cos(off_axis_rad);
            let scale = if off_axis_rad > 0.0 { so / off_axis_rad } else { 1.0 };
            let (y, z) = (left * scale, up * scale);
            self.push(DVec3::new(co * cc - z * sc, y, co * sc + z * cc).normalize(), time_s);
        }
        self
    }

    fn listed(mut self, p: &PatternFile) -> Result<Pattern, PatternError> {
        for (row, &[time_s, azimuth_deg, elevation_deg]) in p.beams.iter().enumerate() {
            // Written so that NaN fails too.
            let fine = time_s.is_finite() && azimuth_deg.abs() <= 360.0 && elevation_deg.abs() <= 90.0;
            if !fine {
                let path = p.path.clone();
                return Err(PatternError::NotADirection { path, row, time_s, azimuth_deg, elevation_deg });
            }
            let (sa, ca) = math::sin_cos(azimuth_deg.to_radians());
            let (se, ce) = math::sin_cos(elevation_deg.to_radians());
            self.push(DVec3::new(ce * ca, ce * sa, se), time_s);
        }
        Ok(self)
    }
}

/// Fans from the first tilt to the last, both included where the step divides the way (to a part in 10^9).
fn tilt_lines(p: &TiltedParams) -> u64 {
    ((p.tilt_to_deg - p.tilt_from_deg).abs() / p.tilt_step_deg + 1e-9).floor() as u64 + 1
}

/// Angle between samples that reach from edge to edge of a field; one sample sits in its middle.
fn spacing(field_deg: f64, samples: u32) -> f64 {
    if samples > 1 { field_deg / f64::from(samples - 1) } else { 0.0 }
}

fn sin_cos_table(count: u32, angle_deg: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..count).map(|k| math::sin_cos(angle_deg(f64::from(k)).to_radians())).collect()
}

#[cfg(test)]
mod tests;
