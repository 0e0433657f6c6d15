//! What families say that is legal and hardly meant: told, not refused, since corpora of such configs exist.
//!
//! In: checked families and where their keys stand. Out: remarks with place, rule and cure. What cannot be meant is a rule (`rules`).

use super::error::Fault;
use super::key_path::KeyPath;
use crate::drive::rover::Chassis;
use crate::plan::{Family, unlike_labels};
use crate::slam::{FastslamParams, SlamParams};

/// What families say only together; `root`: the document.
pub(crate) fn of_families(families: &[Family], root: &KeyPath, remarks: &mut Vec<Fault>) {
    if let Some([rule, cure]) = unlike_labels(families.iter()) {
        remarks.push(Fault::new(root.span("families"), rule).cure(cure));
    }
}

pub(crate) fn of_family(family: &Family, place: &KeyPath, remarks: &mut Vec<Fault>) {
    range_beyond_the_sensor(family, place, remarks);
    wheels_outside_the_outline(family, place, remarks);
    free_height_below_the_rover(family, place, remarks);
    slip_counted_twice(family, place, remarks);
}

fn range_beyond_the_sensor(family: &Family, place: &KeyPath, remarks: &mut Vec<Fault>) {
    let sensor = &family.sweep.sensor;
    let gate_m = family.sweep.effects.gates.as_ref().and_then(|gates| gates.max_m);
    let reach_m = gate_m.unwrap_or(sensor.max_range_m);
    if let Some(max_m) = family.cells.max_range_m
        && max_m > reach_m
    {
        let rule = format!("cells reach to {max_m} m, but '{}' reports nothing beyond {reach_m} m", sensor.name);
        let cure = "take cells.max_range_m out for the sensor's own reach, or give a smaller one";
        remarks.push(Fault::new(place.span("cells.max_range_m"), rule).cure(cure));
    }
}

fn free_height_below_the_rover(family: &Family, place: &KeyPath, remarks: &mut Vec<Fault>) {
    let Some(above_m) = family.cells.above_m() else { return };
    let (rover, mast_m) = (&family.drive.rover, family.drive.rover.mount.z_m);
    if above_m < mast_m {
        let rule =
            format!("a rover fits beneath what hangs {above_m} m high, but the mast of '{}' is {mast_m} m", rover.name);
        let cure = "take cells.overhang.above_m out for a height by the rover's own, or give a larger one";
        remarks.push(Fault::new(place.span("cells.overhang.above_m"), rule).cure(cure));
    }
}

fn slip_counted_twice(family: &Family, place: &KeyPath, remarks: &mut Vec<Fault>) {
    let SlamParams::Fastslam(FastslamParams { motion_inflation, .. }) = family.slam else { return };
    let slips = family.drive.instruments.slip.as_ref().is_some_and(|slip| slip.bounds() != (0.0, 0.0));
    if motion_inflation > 1.0 && slips {
        let rule =
            format!("the filter learns the wheels' slip, and motion_inflation {motion_inflation} allows for it again");
        let cure = "take slam.fastslam.motion_inflation out, unless the wheels err by more than drive.instruments says";
        remarks.push(Fault::new(place.span("slam.fastslam.motion_inflation"), rule).cure(cure));
    }
}

fn wheels_outside_the_outline(family: &Family, place: &KeyPath, remarks: &mut Vec<Fault>) {
    let rover = &family.drive.rover;
    let (key, wheelbase_m) = match &rover.chassis {
        Chassis::Rigid(chassis) => ("rigid.wheelbase_m", chassis.wheelbase_m),
        Chassis::RockerBogie(chassis) => {
            let axles = [chassis.rocker_wheel_x_m, chassis.bogie_front_x_m, chassis.bogie_rear_x_m];
            let (rear, front) =
                axles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(r, f), &x| (r.min(x), f.max(x)));
            ("rocker_bogie.bogie_front_x_m", front - rear)
        }
    };
    let track = match &rover.chassis {
        Chassis::Rigid(_) => "rigid.track_m",
        Chassis::RockerBogie(_) => "rocker_bogie.track_m",
    };
    for (key, axles_m, side, outline_m) in
        [(key, wheelbase_m, "length_m", rover.length_m), (track, rover.track_m(), "width_m", rover.width_m)]
    {
        if axles_m > outline_m {
            let rule = format!(
                "the wheels of '{}' stand {axles_m} m apart, outside its outline ({side} {outline_m} m), which is all that collides",
                rover.name
            );
            let cure = format!("give {side} the whole rover, wheels included");
            remarks.push(Fault::new(place.span(&format!("drive.rover.chassis.{key}")), rule).cure(cure));
        }
    }
}
