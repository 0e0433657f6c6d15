//! A yard and a sensor pose -> one sweep: a range, a status and the truth of every beam slot.
//!
//! In: [`SweepParams`], a [`Scene`](crate::scene::Scene), `world_from_sensor`, streams, scratch. Out: a [`Sweep`] in the `sensor` frame.
//! Source: Hewitt et al. 2017, "LiDAR model"; the sources of beam effects stand in their modules. Not modelled: motion during
//! a sweep (the rover stands), the tilt head's lever arm (all beams leave one point), dust, crosstalk, several echoes a beam.
//!
//! A pattern of one's own, cast without noise: the range to flat ground is the height over the sine of the beam's angle.
//!
//! ```
//! use std::sync::Arc;
//!
//! use marsyard::geometry::{DVec3, Transform};
//! use marsyard::preset::Preset;
//! use marsyard::random::{Drawn, Stage, Streams};
//! use marsyard::scene::{Ground, Polynomial, Scene};
//! use marsyard::sweep::params::Cast;
//! use marsyard::sweep::sensor::{PatternFile, PatternParams, PhaseRanging, Ranging};
//! use marsyard::sweep::{Caster, Pattern, Scratch, Sensor, Status, SweepParams, sweep};
//!
//! // Time, azimuth and elevation of each beam: ten that look down, one that looks up.
//! let down_deg = (1..=10).map(|k| 4.0 * f64::from(k));
//! let beams = down_deg.clone().map(|down_deg| [0.0, 0.0, -down_deg]).chain([[0.0, 0.0, 5.0]]).collect();
//! let sensor = Sensor {
//!     name: "own".into(),
//!     source: String::new(),
//!     pattern: PatternParams::File(PatternFile { path: "own.csv".into(), beams }),
//!     min_range_m: 0.1,
//!     max_range_m: 30.0,
//!     range_sigma_m: 0.0,
//!     range_sigma_per_m: 0.0,
//!     range_bias_m: 0.0,
//!     range_step_m: 0.001,
//!     divergence_mrad: 3.0,
//!     exit_diameter_m: 0.0,
//!     range_at_10_percent_m: 30.0,
//!     ranging: Ranging::Phase(PhaseRanging { modulation_mhz: 46.55 }),
//! };
//! let pattern = Arc::new(Pattern::build(&sensor)?);
//! let params = SweepParams { sensor: Preset::Inline(Box::new(sensor)), ..SweepParams::default() };
//!
//! let yard = Scene::bare(40.0, Ground::Polynomial(Polynomial::flat(40.0)));
//! let caster = Caster::new(&yard, &Cast::Exact);
//! let world_from_sensor = Transform { translation_m: DVec3::new(10.0, 20.0, 1.5), ..Transform::IDENTITY };
//! let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
//! let drawn = Drawn::default();
//! let scan = sweep(&params, &pattern, &caster, &world_from_sensor, &drawn, &streams, &mut Scratch::default())?;
//! for (slot, down_deg) in down_deg.enumerate() {
//!     assert!((scan.returns.range_m[slot] - 1.5 / down_deg.to_radians().sin()).abs() < 1e-9);
//! }
//! assert_eq!(scan.returns.status[10], Status::None);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cast;
#[cfg(test)]
mod fixtures;
mod footprint;
mod light;
mod measure;
pub mod params;
mod pattern;
mod range_error;
mod ranging;
mod returns;
pub mod sensor;
mod vegetation;

pub use cast::{Caster, Hit, Inside, Origin};
pub use measure::{Scratch, sweep};
pub use params::SweepParams;
pub use pattern::{MAX_SLOTS, PatternError};
pub use sensor::Sensor;

use std::sync::Arc;

use crate::geometry::DVec3;
use crate::scene::Class;

/// The beam directions of a sensor: `lines` rows of `beams` slots each; neighbours on a line are neighbours in angle. A line
/// is a fan (tilted), a ring (spinning), a row (raster) or the whole (rosette, file).
#[derive(Clone, Debug)]
pub struct Pattern {
    pub lines: u32,
    pub beams: u32,
    /// Unit directions in the sensor frame (x forward, y left, z up); slot = line * beams + beam.
    pub directions: Vec<DVec3>,
    /// Time of each slot from the sweep's start, seconds (one pose a sweep all the same).
    pub times_s: Vec<f64>,
}

/// What became of a beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Status {
    /// A range was measured.
    Hit = 0,
    /// Nothing within the sensor's reach.
    None = 1,
    /// Something was there, but too little light came back (or a random drop).
    Dropped = 2,
    /// A range was measured outside the sensor's gates.
    OutOfRange = 3,
}

/// One sweep: what the sensor reports, and what is known of it besides. Localisation takes the [`Returns`] alone, so that it cannot see
/// the truth.
#[derive(Clone, Debug)]
pub struct Sweep {
    pub returns: Returns,
    /// Share of the return's energy that came off other surfaces than the labelled one, where sub-rays are cast; NaN where
    /// no light came back. One entry a slot.
    pub mixed: Option<Vec<f32>>,
    /// What each beam truly met, for labels and scoring; one entry a slot.
    pub truth: Vec<TrueReturn>,
}

/// What a sensor reports, slot by slot; every vector has one entry a slot, misses included.
#[derive(Clone, Debug)]
pub struct Returns {
    pub pattern: Arc<Pattern>,
    /// Measured range, metres; NaN unless the status is `Hit`.
    pub range_m: Vec<f64>,
    pub status: Vec<Status>,
    /// Received intensity, where the effect is on; NaN unless the status is `Hit`.
    pub intensity: Option<Vec<f32>>,
}

/// What a beam truly met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueReturn {
    /// True range of the surface (or leaf) that the return is labelled with, along the beam, metres; infinite where nothing
    /// was met.
    pub range_m: f64,
    /// Id of the obstacle, volume or patch; -1 ground, -2 nothing.
    pub object: i32,
    /// `None` where nothing was met.
    pub class: Option<Class>,
    /// The hit lies on an upward face (normal within 30 degrees of up) of a solid body, at least 2 cm from its other faces: a
    /// rock's top.
    pub top: bool,
}

impl Returns {
    /// The measured point of a slot, sensor frame: the reported range along the reported direction.
    #[inline]
    pub fn point_sensor(&self, slot: usize) -> Option<DVec3> {
        (self.status[slot] == Status::Hit).then(|| self.pattern.directions[slot] * self.range_m[slot])
    }
}

impl Sweep {
    /// Feeds all bits in order: what two builds of one sweep must share.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        let mut feed = |bytes: &[u8]| {
            hasher.update(bytes);
        };
        feed(&self.returns.pattern.lines.to_le_bytes());
        feed(&self.returns.pattern.beams.to_le_bytes());
        for (range_m, status) in self.returns.range_m.iter().zip(&self.returns.status) {
            feed(&range_m.to_bits().to_le_bytes());
            feed(&(*status as i8).to_le_bytes());
        }
        for column in [&self.returns.intensity, &self.mixed] {
            feed(&[u8::from(column.is_some())]);
            for value in column.iter().flatten() {
                feed(&value.to_bits().to_le_bytes());
            }
        }
        for truth in &self.truth {
            feed(&truth.range_m.to_bits().to_le_bytes());
            feed(&truth.object.to_le_bytes());
            feed(&[Class::number_or_none(truth.class) as u8, u8::from(truth.top)]);
        }
    }
}

/// Why a sweep could not be made.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum SweepError {
    #[error("the sensor's pose at ({x_m}, {y_m}, {z_m}) is not finite")]
    NoPose { x_m: f64, y_m: f64, z_m: f64 },
    #[error("the sensor is below the ground at ({x_m:.2}, {y_m:.2}): by {depth_m:.3} m")]
    Buried { x_m: f64, y_m: f64, depth_m: f64 },
    #[error("the sensor is inside obstacle {object}")]
    Inside { object: i32 },
}
