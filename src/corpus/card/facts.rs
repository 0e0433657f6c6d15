//! A family of a plan -> what the corpus's card says of it, in words: rover, sensor, cells, and when a cell is untraversable.
//!
//! Values stand as the plan has them, in SI units and degrees. What is drawn per scene is in the `scenes` table, and is only named here.

use crate::cells::params::ObstacleRule;
use crate::cells::{CellFrame, CellParams};
use crate::drive::Rover;
use crate::drive::rover::Chassis;
use crate::plan::Family;
use crate::sweep::SweepParams;
use crate::sweep::sensor::PatternParams;

/// What the card says of a family.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FamilyCard {
    pub name: String,
    /// What of each: (what, in words).
    pub rows: Vec<(&'static str, String)>,
}

impl FamilyCard {
    pub(crate) fn of(family: &Family) -> FamilyCard {
        let (rover, sweep, cells) = (&*family.drive.rover, &family.sweep, &family.cells);
        let mut rows = vec![
            ("yard", format!("{0} x {0} m", family.scene.extent_m)),
            ("rover", rover_words(rover)),
            ("sensor", sensor_words(sweep)),
            ("sensor's place", place_words(sweep, rover)),
            ("errors of the sensor", effect_words(sweep)),
            ("cells", cell_words(cells)),
            ("untraversable is a cell that", label_words(cells, rover.wheel_diameter_m)),
        ];
        if family.hold_out {
            rows.push(("scenes", "in the test split alone".into()));
        }
        FamilyCard { name: family.name.clone(), rows }
    }
}

fn rover_words(rover: &Rover) -> String {
    let chassis = match &rover.chassis {
        Chassis::Rigid(_) => "four wheels on a rigid frame",
        Chassis::RockerBogie(_) => "six wheels on rockers and bogies",
    };
    let Rover { name, length_m, width_m, wheel_diameter_m, .. } = rover;
    format!("{name}, {length_m} x {width_m} m, {chassis}, wheel diameter {wheel_diameter_m} m")
}

fn sensor_words(sweep: &SweepParams) -> String {
    let sensor = &*sweep.sensor;
    let pattern = match &sensor.pattern {
        PatternParams::Tilted(tilted) => {
            let fans = ((tilted.tilt_to_deg - tilted.tilt_from_deg) / tilted.tilt_step_deg).abs().round() + 1.0;
            format!("tilted fans, about {fans} of {} beams", tilted.beams)
        }
        PatternParams::Spinning(spinning) => {
            format!("{} spinning rings of {} beams", spinning.elevations_deg.len(), spinning.columns)
        }
        PatternParams::Raster(raster) => format!("a raster of {} x {} beams", raster.columns, raster.rows),
        PatternParams::Rosette(rosette) => format!("a rosette of {} beams", rosette.beams),
        PatternParams::File(file) => format!("{} beams of a file", file.beams.len()),
    };
    format!("{}, {} to {} m, {pattern}", sensor.name, sensor.min_range_m, sensor.max_range_m)
}

fn place_words(sweep: &SweepParams, rover: &Rover) -> String {
    match &sweep.mount {
        Some(_) => "drawn or set by `sweep.mount` in `plan.yaml`, the rest as the rover's mast".into(),
        None => format!("{} m above the wheels' contact, pitch {} degrees", rover.mount.z_m, rover.mount.pitch_deg),
    }
}

/// The effects that the plan names; each that is absent is not simulated.
fn effect_words(sweep: &SweepParams) -> String {
    let effects = &sweep.effects;
    let named = [
        ("range noise", effects.range_noise.is_some()),
        ("range bias", effects.range_bias_m.is_some()),
        ("quantisation", effects.quantisation.is_some()),
        ("gates", effects.gates.is_some()),
        ("dropout", effects.dropout.is_some()),
        ("mixed pixels", effects.mixed_pixels.is_some()),
        ("tilt jitter", effects.tilt_jitter_deg.is_some()),
        ("intensity", effects.intensity.is_some()),
    ];
    let on: Vec<&str> = named.iter().filter(|(_, is_on)| *is_on).map(|(name, _)| *name).collect();
    if on.is_empty() { "none: ranges are exact".into() } else { on.join(", ") + "; no others" }
}

fn cell_words(cells: &CellParams) -> String {
    let reach =
        cells.max_range_m.map_or("as far as the sensor reaches".into(), |range_m| format!("up to {range_m} m away"));
    let window = match cells.window_scans {
        1 => "points of one sweep".into(),
        most => format!("points of up to {most} sweeps"),
    };
    let unseen = cells.unseen.as_ref().map_or("", |_| "; also those without a point (`points` = 0) near gaps of beams");
    let frame = match cells.frame {
        CellFrame::EstimatedPose => "",
        CellFrame::FittedPlane => {
            "; of each scan in a frame of its own, levelled by a plane fitted to its points: origin below the sensor, x under the sensor's; \
             rows and columns count from there"
        }
    };
    let overhang = cells.overhang.as_ref().map_or(String::new(), |overhang| format!("; without {}", overhang.words()));
    format!("squares of {} m, {reach}, {window}{overhang}{unseen}{frame}", cells.size_m)
}

/// The label's rule; what the columns `truth_*` allow to be asked anew.
fn label_words(cells: &CellParams, wheel_diameter_m: f64) -> String {
    let labels = &cells.labels;
    if let Some(rover) = &labels.rover {
        return format!(
            "asks more of the rover, along one of eight headings, than {}; or that holds vegetation, above whatever else it holds, that \
             the plan marks untraversable",
            rover.words()
        );
    }
    let points = match labels.min_obstacle_points {
        1 => "a point".into(),
        least => format!("{least} points or more"),
    };
    let obstacle = match labels.obstacle {
        ObstacleRule::TallerThanWheel => {
            format!(
                "a rock, box or trunk that rises more than {wheel_diameter_m} m, the wheel diameter, above the ground"
            )
        }
        ObstacleRule::TallerThanM(height_m) => {
            format!("a rock, box or trunk that rises more than {height_m} m above the ground")
        }
        ObstacleRule::All => "a rock, box or trunk of whatever height".into(),
    };
    let slope = labels.max_ground_slope_deg.map_or("; slopes never make one so".into(), |slope_deg| {
        format!("; or that lies on ground steeper than {slope_deg} degrees")
    });
    let drop = labels.max_drop_m.map_or(String::new(), |drop_m| {
        format!("; or where the ground falls by more than {drop_m} m within 0.3 m, or lies so deep between two sides")
    });
    format!("holds {points} of {obstacle}, or of vegetation that the plan marks untraversable{slope}{drop}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::params::LabelParams;

    #[test]
    fn exact_the_label_rule_in_words() {
        let with = |labels| label_words(&CellParams { labels, ..CellParams::default() }, 0.15);
        let taller = with(LabelParams::default());
        assert!(
            taller.starts_with("holds a point of a rock") && taller.contains("0.15 m, the wheel diameter"),
            "{taller}"
        );
        assert!(taller.ends_with("slopes never make one so"), "{taller}");
        let strict = LabelParams {
            obstacle: ObstacleRule::TallerThanM(0.3),
            min_obstacle_points: 5,
            max_ground_slope_deg: Some(20.0),
            ..LabelParams::default()
        };
        let strict = with(strict);
        assert!(strict.starts_with("holds 5 points or more") && strict.contains("more than 0.3 m"), "{strict}");
        assert!(strict.ends_with("steeper than 20 degrees"), "{strict}");
        let all = with(LabelParams { obstacle: ObstacleRule::All, ..LabelParams::default() });
        assert!(all.contains("of whatever height"), "{all}");
    }
}
