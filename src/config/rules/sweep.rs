//! Rules of a family's sweeps: the sensor, how far it sees, and the pose estimate that goes by them.

use super::Rules;
use crate::slam::SlamParams;
use crate::sweep::MAX_SLOTS;
use crate::sweep::sensor::{PatternParams, Sensor};

impl Rules<'_, '_, '_> {
    pub(super) fn sensor(&mut self) {
        let sensor: &Sensor = &self.family.sweep.sensor;
        let key = |rest: &str| format!("sweep.sensor.pattern.{rest}");
        let slots = match &sensor.pattern {
            PatternParams::Tilted(p) => {
                let fan_deg = f64::from(p.beams - 1) * p.beam_step_deg;
                if fan_deg > 360.0 {
                    let rule = format!("{} beams {} degrees apart span {fan_deg:.1} degrees", p.beams, p.beam_step_deg);
                    let also = key("tilted.beam_step_deg");
                    self.fault(&key("tilted.beams"), rule, "a fan spans 360 degrees at most", &[(&also, "the step")]);
                }
                f64::from(p.beams) * ((p.tilt_to_deg - p.tilt_from_deg).abs() / p.tilt_step_deg + 1.0)
            }
            PatternParams::Spinning(p) => f64::from(p.columns) * p.elevations_deg.len() as f64,
            PatternParams::Raster(p) => f64::from(p.columns) * f64::from(p.rows),
            PatternParams::Rosette(p) => f64::from(p.beams),
            PatternParams::File(p) => p.beams.len() as f64,
        };
        if slots > MAX_SLOTS as f64 {
            let rule = format!("one sweep would have {slots:.0} beams; at most {MAX_SLOTS} are held");
            self.fault("sweep.sensor.pattern", rule, "make the pattern coarser", &[]);
        }
        if let Some(mixed) = &self.family.sweep.effects.mixed_pixels
            && mixed.sub_rays > 1
            && sensor.divergence_mrad == 0.0
            && sensor.exit_diameter_m == 0.0
        {
            let rule = format!("mixed_pixels needs a beam with a width, and '{}' has none", sensor.name);
            let also = [("sweep.sensor.divergence_mrad", "no divergence")];
            self.fault(
                "sweep.effects.mixed_pixels",
                rule,
                "give the sensor a divergence, or take the effect out",
                &also,
            );
        }
    }

    pub(super) fn ranges(&mut self) {
        let sensor: &Sensor = &self.family.sweep.sensor;
        let sensor_min = [("sweep.sensor.min_range_m", "the sensor's least range")];
        if sensor.min_range_m >= sensor.max_range_m {
            let rule = format!("the sensor's gates are inverted: {} m to {} m", sensor.min_range_m, sensor.max_range_m);
            self.fault("sweep.sensor.max_range_m", rule, "max_range_m must be above min_range_m", &sensor_min);
        }
        if let Some(gates) = &self.family.sweep.effects.gates {
            let (min_m, max_m) = (gates.min_m.unwrap_or(sensor.min_range_m), gates.max_m.unwrap_or(sensor.max_range_m));
            if min_m >= max_m {
                let own = |value: Option<f64>| if value.is_none() { " (the sensor's)" } else { "" };
                let rule =
                    format!("the gates are inverted: {min_m} m{} to {max_m} m{}", own(gates.min_m), own(gates.max_m));
                let key = if gates.max_m.is_some() { "sweep.effects.gates.max_m" } else { "sweep.effects.gates.min_m" };
                let also = [("sweep.effects.gates.min_m", "the near gate"), sensor_min[0]];
                self.fault(key, rule, "min_m must be below max_m", &also[..1]);
            }
        }
        if let Some(max_m) = self.family.cells.max_range_m
            && max_m <= sensor.min_range_m
        {
            let rule = format!(
                "cells up to {max_m} m are below the sensor's least range of {} m: all would be empty",
                sensor.min_range_m
            );
            self.fault("cells.max_range_m", rule, "take the key out for the sensor's own reach", &sensor_min);
        }
    }

    pub(super) fn slam(&mut self) {
        let sensor: &Sensor = &self.family.sweep.sensor;
        let (name, needs) = match self.family.slam {
            SlamParams::Fastslam(_) => ("fastslam", "features"),
            SlamParams::Registration(_) => ("registration", "surfaces"),
            SlamParams::DeadReckoning | SlamParams::Surrogate(_) | SlamParams::Truth => return,
        };
        let lines = match &sensor.pattern {
            PatternParams::Tilted(p) => ((p.tilt_to_deg - p.tilt_from_deg).abs() / p.tilt_step_deg).floor() + 1.0,
            PatternParams::Spinning(p) => p.elevations_deg.len() as f64,
            PatternParams::Raster(p) => f64::from(p.rows),
            PatternParams::Rosette(_) | PatternParams::File(_) => f64::INFINITY,
        };
        if lines < 2.0 {
            let rule =
                format!("{name} has nothing to read: '{}' sweeps a single line, and {needs} need several", sensor.name);
            let also = [("sweep.sensor.pattern", "one line")];
            self.fault("slam", rule, "choose dead_reckoning or surrogate, or a sensor of several lines", &also);
        }
    }
}
