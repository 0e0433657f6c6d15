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
mod tests {
    use garde::Validate;

    use super::*;
    use crate::sweep::fixtures::{SHIPPED, shipped};

    fn angles_deg(d: DVec3) -> (f64, f64) {
        (math::atan2(d.y, d.x).to_degrees(), math::asin(d.z).to_degrees())
    }

    fn with_pattern(pattern: PatternParams) -> Sensor {
        Sensor { pattern, ..shipped("urg-04lx") }
    }

    #[test]
    fn exact_urg_on_its_tilt_unit_has_100_lines_of_682_beams() {
        let pattern = Pattern::build(&shipped("urg-04lx")).unwrap();
        assert_eq!((pattern.lines, pattern.beams, pattern.directions.len()), (100, 682, 68_200));
        // Beam 340 is step 384, straight ahead; its line's elevation is the tilt.
        for line in 0..100 {
            let (azimuth, elevation) = angles_deg(pattern.directions[line * 682 + 340]);
            assert!(azimuth.abs() < 1e-12, "{azimuth}");
            assert!((elevation - (-45.0 + 0.5 * line as f64)).abs() < 1e-12, "{elevation}");
        }
        // The level fan, line 90: bearings on the encoder's steps of 360 / 1024 degrees.
        for (beam, d) in pattern.directions[90 * 682..91 * 682].iter().enumerate() {
            let (azimuth, elevation) = angles_deg(*d);
            assert!((azimuth - (beam as f64 - 340.0) * 360.0 / 1024.0).abs() < 1e-12, "{beam}: {azimuth}");
            assert!(elevation.abs() < 1e-12);
        }
        // A tilted fan lies in the plane through y: its foot angle is the tilt for every beam ahead.
        for d in &pattern.directions[100..582] {
            assert!((d.z + d.x).abs() < 1e-15, "line 0 looks down by 45 degrees");
        }
        assert!((pattern.times_s[682] - 0.1).abs() < 1e-15);
    }

    #[test]
    fn exact_counts_and_fields_of_every_shipped_sensor() {
        // Lines, beams, lowest and highest elevation of any beam. A fan that reaches behind the sensor looks up there as
        // it looks down ahead: sin(highest) = cos(119.883) sin(-45) for the URG, cos(135) sin(-45) = 1/2 for the others.
        let urg_highest_deg = math::asin(-math::cos(119.882_812_5f64.to_radians()) / 2.0f64.sqrt()).to_degrees();
        let expected = [
            ("urg-04lx", 100, 682, -45.0, urg_highest_deg),
            ("utm-30lx", 100, 1081, -45.0, 30.0),
            ("lms111", 121, 541, -45.0, 30.0),
            ("lms291", 121, 361, -45.0, 15.0),
            ("vlp-16", 16, 1800, -15.0, 15.0),
            ("os1-64", 64, 1024, -16.6, 16.6),
            ("raster", 360, 480, -25.0, 5.0),
            ("rosette", 1, 100_000, -55.0, 15.0),
        ];
        assert_eq!(expected.len(), SHIPPED.len());
        for (name, lines, beams, lowest_deg, highest_deg) in expected {
            let sensor = shipped(name);
            sensor.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(sensor.name, name);
            assert!(sensor.source.contains("ssumed"), "{name} says what is assumed");
            let pattern = Pattern::build(&sensor).unwrap();
            assert_eq!((pattern.lines, pattern.beams), (lines, beams), "{name}");
            assert_eq!((pattern.directions.len(), pattern.times_s.len()), (pattern.slots(), pattern.slots()));
            assert!(pattern.directions.iter().all(|d| (d.length_squared() - 1.0).abs() < 1e-15), "{name}");
            assert!(pattern.times_s.iter().all(|t| t.is_finite()));
            let elevations = pattern.directions.iter().map(|d| angles_deg(*d).1);
            let (low, high) = elevations.fold((90.0f64, -90.0f64), |(l, h), e| (l.min(e), h.max(e)));
            // The rosette reaches its edge to a hundredth of a degree in one second.
            let tolerance_deg = if name == "rosette" { 0.02 } else { 1e-12 };
            assert!((low - lowest_deg).abs() < tolerance_deg, "{name}: {low}");
            assert!((high - highest_deg).abs() < tolerance_deg, "{name}: {high}");
        }
    }

    #[test]
    fn exact_two_prisms_turn_the_beam_by_the_sum_of_their_deflections() {
        let sensor = shipped("rosette");
        let PatternParams::Rosette(p) = &sensor.pattern else { panic!("a rosette") };
        let level = with_pattern(PatternParams::Rosette(RosetteParams { centre_elevation_deg: 0.0, ..p.clone() }));
        let pattern = Pattern::build(&level).unwrap();
        for (d, t) in pattern.directions.iter().zip(&pattern.times_s) {
            // |e^(i a t) + e^(i b t)| = 2 |cos((a - b) t / 2)|, each prism a quarter of the field.
            let half_turn = TAU / 60.0 * (p.first_rpm - p.second_rpm) * t / 2.0;
            let off_axis = 35.0f64.to_radians() * math::cos(half_turn).abs();
            assert!((math::acos(d.x.min(1.0)) - off_axis).abs() < 1e-7, "{t}");
        }
        // The centre is reached, and the edge.
        assert!(pattern.directions.iter().any(|d| d.x > 0.99999) && pattern.directions.iter().any(|d| d.x < 0.8195));
    }

    #[test]
    fn exact_raster_reads_like_a_picture_from_edge_to_edge() {
        let raster = RasterParams {
            width_deg: 40.0,
            height_deg: 20.0,
            columns: 5,
            rows: 3,
            centre_elevation_deg: -10.0,
            frame_time_s: 3.0,
        };
        let pattern = Pattern::build(&with_pattern(PatternParams::Raster(raster.clone()))).unwrap();
        let angles: Vec<_> = pattern.directions.iter().map(|d| angles_deg(*d)).collect();
        for (slot, expected) in [(0, (20.0, 0.0)), (4, (-20.0, 0.0)), (7, (0.0, -10.0)), (14, (-20.0, -20.0))] {
            assert!((angles[slot].0 - expected.0).abs() < 1e-12 && (angles[slot].1 - expected.1).abs() < 1e-12);
        }
        assert_eq!(pattern.times_s[5], 1.0);
        let one = RasterParams { columns: 1, rows: 1, ..raster };
        let pattern = Pattern::build(&with_pattern(PatternParams::Raster(one))).unwrap();
        let (azimuth, elevation) = angles_deg(pattern.directions[0]);
        assert!(azimuth == 0.0 && (elevation + 10.0).abs() < 1e-12);
    }

    #[test]
    fn exact_tilt_may_go_down_and_stops_short_of_a_broken_step() {
        let tilted = TiltedParams {
            beams: 3,
            beam_step_deg: 10.0,
            first_beam_deg: None,
            tilt_from_deg: 10.0,
            tilt_to_deg: -11.0,
            tilt_step_deg: 4.0,
            line_time_s: 1.0,
        };
        let pattern = Pattern::build(&with_pattern(PatternParams::Tilted(tilted))).unwrap();
        assert_eq!(pattern.lines, 6);
        let tilts: Vec<f64> = (0..6).map(|line| angles_deg(pattern.directions[line * 3 + 1]).1.round()).collect();
        assert_eq!(tilts, [10.0, 6.0, 2.0, -2.0, -6.0, -10.0]);
        assert!((angles_deg(pattern.directions[0]).0 + angles_deg(pattern.directions[2]).0).abs() < 1e-12);
    }

    #[test]
    fn exact_listed_beams_keep_their_order_and_times() {
        let file = PatternFile { path: "my.csv".into(), beams: vec![[0.0, 90.0, 0.0], [0.5, 0.0, -90.0]] };
        let pattern = Pattern::build(&with_pattern(PatternParams::File(file))).unwrap();
        assert!((pattern.directions[0] - DVec3::Y).length() < 1e-15);
        assert!((pattern.directions[1] + DVec3::Z).length() < 1e-15);
        assert_eq!(pattern.times_s, [0.0, 0.5]);
    }

    #[test]
    fn extreme_patterns_that_cannot_be_are_named() {
        let file = |beams| with_pattern(PatternParams::File(PatternFile { path: "my.csv".into(), beams }));
        assert!(matches!(Pattern::build(&file(vec![])), Err(PatternError::Empty { .. })));
        for beam in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [0.0, 0.0, f64::NAN], [0.0, 0.0, 90.1]] {
            let error = Pattern::build(&file(vec![[0.0; 3], beam])).unwrap_err();
            assert!(matches!(error, PatternError::NotADirection { row: 1, .. }), "{error}");
        }
        let huge = RasterParams {
            width_deg: 90.0,
            height_deg: 90.0,
            columns: 100_000,
            rows: 100_000,
            centre_elevation_deg: 0.0,
            frame_time_s: 1.0,
        };
        let error = Pattern::build(&with_pattern(PatternParams::Raster(huge))).unwrap_err();
        assert!(matches!(error, PatternError::TooLarge { slots: 10_000_000_000, .. }), "{error}");
    }
}
