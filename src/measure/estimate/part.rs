//! The parts that a config may name and may leave out: whether a family of a plan has one, and the plan without it.
//!
//! A part is what a key of the config adds to the work (rocks, dropout, a table), not a choice between equals: how the ground is cast or
//! which way a pose is estimated always has some value, and is measured by [`tradeoff`](crate::measure::tradeoff).

use crate::cells::CellFrame;
use crate::corpus::Table;
use crate::plan::Plan;
use crate::scene::params::VegetationParams;
use crate::slam::SlamParams;

/// A part of the work, in the order of the flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Roughness,
    Landforms,
    Rocks,
    Boxes,
    Trees,
    Grass,
    Brush,
    Bushes,
    OverBodies,
    ControlNoise,
    Attempts,
    RangeNoise,
    RangeBias,
    Quantisation,
    Gates,
    Dropout,
    MixedPixels,
    TiltJitter,
    Intensity,
    Fastslam,
    Registration,
    DeadReckoning,
    WindowScans,
    FittedPlane,
    Overhang,
    LocalHeight,
    Curvature,
    Surroundings,
    Beams,
    RoverLabels,
    RoverPoses,
    Unseen,
    MaxDrop,
    PointsTable,
}

impl Part {
    pub(crate) const ALL: [Part; 34] = [
        Part::Roughness,
        Part::Landforms,
        Part::Rocks,
        Part::Boxes,
        Part::Trees,
        Part::Grass,
        Part::Brush,
        Part::Bushes,
        Part::OverBodies,
        Part::ControlNoise,
        Part::Attempts,
        Part::RangeNoise,
        Part::RangeBias,
        Part::Quantisation,
        Part::Gates,
        Part::Dropout,
        Part::MixedPixels,
        Part::TiltJitter,
        Part::Intensity,
        Part::Fastslam,
        Part::Registration,
        Part::DeadReckoning,
        Part::WindowScans,
        Part::FittedPlane,
        Part::Overhang,
        Part::LocalHeight,
        Part::Curvature,
        Part::Surroundings,
        Part::Beams,
        Part::RoverLabels,
        Part::RoverPoses,
        Part::Unseen,
        Part::MaxDrop,
        Part::PointsTable,
    ];

    /// As `marsyard plan` writes it: the key of the config where there is one.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Part::Roughness => "roughness",
            Part::Landforms => "landforms",
            Part::Rocks => "rocks",
            Part::Boxes => "boxes",
            Part::Trees => "trees",
            Part::Grass => "grass",
            Part::Brush => "brush",
            Part::Bushes => "bushes",
            Part::OverBodies => "over_bodies",
            Part::ControlNoise => "control_noise",
            Part::Attempts => "attempts",
            Part::RangeNoise => "range_noise",
            Part::RangeBias => "range_bias",
            Part::Quantisation => "quantisation",
            Part::Gates => "gates",
            Part::Dropout => "dropout",
            Part::MixedPixels => "mixed_pixels",
            Part::TiltJitter => "tilt_jitter",
            Part::Intensity => "intensity",
            Part::Fastslam => "fastslam",
            Part::Registration => "registration",
            Part::DeadReckoning => "dead_reckoning",
            Part::WindowScans => "window_scans",
            Part::FittedPlane => "fitted_plane",
            Part::Overhang => "overhang",
            Part::LocalHeight => "local_height",
            Part::Curvature => "curvature",
            Part::Surroundings => "surroundings",
            Part::Beams => "beams",
            Part::RoverLabels => "labels.rover",
            Part::RoverPoses => "labels.rover.pose",
            Part::Unseen => "unseen",
            Part::MaxDrop => "max_drop",
            Part::PointsTable => "points table",
        }
    }

    /// An effect of the sensor on its beams (`sweep.effects`).
    pub(crate) fn is_beam_effect(self) -> bool {
        matches!(
            self,
            Part::RangeNoise
                | Part::RangeBias
                | Part::Quantisation
                | Part::Gates
                | Part::Dropout
                | Part::MixedPixels
                | Part::TiltJitter
                | Part::Intensity
        )
    }

    /// Whether a family of the plan has it.
    pub(crate) fn is_on(self, plan: &Plan, family: usize) -> bool {
        let family = &plan.families[family];
        let (scene, effects) = (&family.scene, &family.sweep.effects);
        let grows = |kind: fn(&VegetationParams) -> bool| scene.vegetation.as_ref().is_some_and(kind);
        match self {
            Part::Roughness => scene.ground.roughness.is_some(),
            Part::Landforms => !scene.ground.features.is_empty(),
            Part::Rocks => scene.rocks.is_some(),
            Part::Boxes => scene.boxes.is_some(),
            Part::Trees => scene.trees.is_some(),
            Part::Grass => grows(|vegetation| vegetation.grass.is_some()),
            Part::Brush => grows(|vegetation| vegetation.brush.is_some()),
            Part::Bushes => grows(|vegetation| vegetation.bushes.is_some()),
            Part::OverBodies => family.drive.over_bodies,
            Part::ControlNoise => family.drive.control_noise.is_some(),
            Part::Attempts => family.drive.attempts > 1,
            Part::RangeNoise => effects.range_noise.is_some(),
            Part::RangeBias => effects.range_bias_m.is_some(),
            Part::Quantisation => effects.quantisation.is_some(),
            Part::Gates => effects.gates.is_some(),
            Part::Dropout => effects.dropout.is_some(),
            Part::MixedPixels => effects.mixed_pixels.is_some(),
            Part::TiltJitter => effects.tilt_jitter_deg.is_some(),
            Part::Intensity => effects.intensity.is_some(),
            Part::Fastslam => matches!(family.slam, SlamParams::Fastslam(_)),
            Part::Registration => matches!(family.slam, SlamParams::Registration(_)),
            Part::DeadReckoning => family.slam == SlamParams::DeadReckoning,
            Part::WindowScans => family.cells.window_scans > 1,
            Part::FittedPlane => family.cells.frame == CellFrame::FittedPlane,
            Part::Overhang => family.cells.overhang.is_some(),
            Part::LocalHeight => family.cells.local_height.is_some(),
            Part::Curvature => family.cells.curvature.is_some(),
            Part::Surroundings => family.cells.surroundings.is_some(),
            Part::Beams => family.cells.beams.is_some(),
            Part::RoverLabels => family.cells.labels.rover.is_some(),
            Part::RoverPoses => family.cells.labels.rover.as_ref().is_some_and(|rule| rule.pose),
            Part::Unseen => family.cells.unseen.is_some(),
            Part::MaxDrop => family.cells.labels.max_drop_m.is_some(),
            Part::PointsTable => plan.tables.contains(&Table::Points),
        }
    }

    /// The plan with the part left out of a family; the table of points is left out of all.
    pub(crate) fn leave_out(self, plan: &mut Plan, family: usize) {
        let family = &mut plan.families[family];
        let (scene, effects) = (&mut family.scene, &mut family.sweep.effects);
        let vegetation = scene.vegetation.as_mut();
        match self {
            Part::Roughness => scene.ground.roughness = None,
            Part::Landforms => scene.ground.features.clear(),
            Part::Rocks => scene.rocks = None,
            Part::Boxes => scene.boxes = None,
            Part::Trees => scene.trees = None,
            Part::Grass => vegetation.into_iter().for_each(|vegetation| vegetation.grass = None),
            Part::Brush => vegetation.into_iter().for_each(|vegetation| vegetation.brush = None),
            Part::Bushes => vegetation.into_iter().for_each(|vegetation| vegetation.bushes = None),
            Part::OverBodies => family.drive.over_bodies = false,
            Part::ControlNoise => family.drive.control_noise = None,
            Part::Attempts => family.drive.attempts = 1,
            Part::RangeNoise => effects.range_noise = None,
            Part::RangeBias => effects.range_bias_m = None,
            Part::Quantisation => effects.quantisation = None,
            Part::Gates => effects.gates = None,
            Part::Dropout => effects.dropout = None,
            Part::MixedPixels => effects.mixed_pixels = None,
            Part::TiltJitter => effects.tilt_jitter_deg = None,
            Part::Intensity => effects.intensity = None,
            Part::Fastslam | Part::Registration | Part::DeadReckoning => family.slam = SlamParams::Truth,
            Part::WindowScans => family.cells.window_scans = 1,
            Part::FittedPlane => family.cells.frame = CellFrame::EstimatedPose,
            Part::Overhang => family.cells.overhang = None,
            Part::LocalHeight => {
                (family.cells.local_height, family.cells.surroundings, family.cells.beams) = (None, None, None);
            }
            Part::Curvature => family.cells.curvature = None,
            Part::Surroundings => family.cells.surroundings = None,
            Part::Beams => family.cells.beams = None,
            Part::RoverLabels => family.cells.labels.rover = None,
            Part::RoverPoses => family.cells.labels.rover.iter_mut().for_each(|rule| rule.pose = false),
            Part::Unseen => family.cells.unseen = None,
            Part::MaxDrop => family.cells.labels.max_drop_m = None,
            Part::PointsTable => plan.tables.retain(|table| *table != Table::Points),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;

    #[test]
    fn law_a_part_left_out_is_off_and_every_other_part_is_as_it_was() {
        let sets = ["tables=[cells, scenes, poses, points]", "families.0.drive.attempts=3"].map(String::from);
        let whole = config::load("configs/mixed.yaml".as_ref(), &sets).unwrap();
        let on = |plan: &Plan, family| Part::ALL.map(|part| part.is_on(plan, family));
        let mut met = 0;
        for family in 0..whole.families.len() {
            for (k, part) in Part::ALL.into_iter().enumerate().filter(|(_, part)| part.is_on(&whole, family)) {
                let mut plan = whole.clone();
                part.leave_out(&mut plan, family);
                let mut expected = on(&whole, family);
                expected[k] = false;
                // The squares around a cell and the beams stand on the plane: without it they are off too.
                if part == Part::LocalHeight {
                    (expected[Part::Surroundings as usize], expected[Part::Beams as usize]) = (false, false);
                }
                assert_eq!(on(&plan, family), expected, "{}", part.name());
                assert!(plan.scene_plan_hash() != whole.scene_plan_hash() || part == Part::PointsTable);
                met += 1;
            }
        }
        assert!(met > 20, "{met}");
    }

    #[test]
    fn exact_every_part_is_listed_once_in_the_order_of_the_flow() {
        // The last variant counts them.
        assert_eq!(Part::ALL.map(|part| part as usize).to_vec(), (0..=Part::PointsTable as usize).collect::<Vec<_>>());
    }
}
