//! Rules of a family's drive: the path, the stops along it, and what the rover's file must say.

use super::Rules;
use crate::drive::params::{Keep, PathParams};
use crate::drive::rover::Chassis;
use crate::random::Dist;

impl Rules<'_, '_, '_> {
    pub(super) fn path(&mut self) {
        let (drive, extent_m) = (&self.family.drive, self.family.scene.extent_m);
        let across_m = extent_m * std::f64::consts::SQRT_2;
        let (path, by_default) =
            if self.place.holds("drive.path") { ("drive.path", "") } else { ("scene", " (the default)") };
        if !self.has_obstacles() {
            let cure = "add rocks, boxes or trees, or take another path";
            if drive.start.near_obstacle_m.is_some() {
                let rule = "near_obstacle_m needs an obstacle to be near to, and the scene has none".to_owned();
                self.fault(
                    "drive.start.near_obstacle_m",
                    rule,
                    "add rocks, boxes or trees, or take it out",
                    &[("scene", "the scene")],
                );
            }
            let name = match drive.path {
                PathParams::TowardObstacle(_) => Some("toward_obstacle"),
                PathParams::Planned(_) => Some("planned"),
                _ => None,
            };
            if let Some(name) = name {
                let rule = format!("the path '{name}'{by_default} needs obstacles, and the scene has none");
                self.fault(path, rule, cure, &[("scene", "the scene")]);
            }
        }
        let too_long = |key: &str, what: &str, length: &Dist| {
            let longest_m = length.bounds().1;
            let rule = format!("{what} of {longest_m} m is longer than the yard ({across_m:.1} m corner to corner)");
            (longest_m > across_m).then(|| (key.to_owned(), rule))
        };
        let long = match &drive.path {
            PathParams::Straight(p) => too_long("drive.path.straight.length_m", "a straight path", &p.length_m),
            PathParams::TowardObstacle(p) => too_long("drive.path.toward_obstacle.length_m", "a path", &p.length_m),
            PathParams::RandomWalk(p) => too_long("drive.path.random_walk.leg_m", "a leg", &p.leg_m),
            PathParams::Planned(p) => too_long("drive.path.planned.goal_m", "a goal at a distance", &p.goal_m),
            PathParams::Arc(p) => {
                // The chord of an arc that is bent least.
                let (low, high) = p.radius_m.bounds();
                let radius_m = low.abs().max(high.abs()).max(0.1);
                let half_turn = (p.length_m.bounds().1 / (2.0 * radius_m)).min(std::f64::consts::FRAC_PI_2);
                let chord_m = 2.0 * radius_m * crate::math::sin(half_turn);
                let rule =
                    format!("an arc that ends {chord_m:.1} m away leaves the yard ({across_m:.1} m corner to corner)");
                (chord_m > across_m).then(|| ("drive.path.arc.length_m".to_owned(), rule))
            }
            PathParams::Waypoints(p) => {
                for (i, &[x_m, y_m]) in p.points_m.iter().enumerate() {
                    if ![x_m, y_m].iter().all(|c| (0.0..=extent_m).contains(c)) {
                        let rule =
                            format!("the point [{x_m}, {y_m}] lies outside the yard [0, {extent_m}] x [0, {extent_m}]");
                        let key = format!("drive.path.waypoints.points_m[{i}]");
                        self.fault(
                            &key,
                            rule,
                            "points are metres from the yard's corner",
                            &[("scene.extent_m", "the yard")],
                        );
                    }
                }
                None
            }
        };
        if let Some((key, rule)) = long {
            self.fault(&key, rule, "shorten it, or make the yard larger", &[("scene.extent_m", "the yard")]);
        }
        if let Some(near) = &drive.start.near_obstacle_m
            && near.bounds().0 > across_m
        {
            let rule = format!("no place in the yard is {} m from an obstacle", near.bounds().0);
            let also = [("scene.extent_m", "the yard")];
            self.fault("drive.start.near_obstacle_m", rule, "shorten it, or make the yard larger", &also);
        }
        if let Some(speed) = &drive.speed_mps
            && speed.bounds().1 > drive.rover.max_speed_mps
        {
            let rule = format!("{} m/s is faster than the rover's {} m/s", speed.bounds().1, drive.rover.max_speed_mps);
            let also = [("drive.rover.max_speed_mps", "its greatest speed")];
            self.fault("drive.speed_mps", rule, "slow down, or take the key out for the greatest speed", &also);
        }
    }

    pub(super) fn stops(&mut self) {
        let (drive, cells) = (&self.family.drive, &self.family.cells);
        let also = [("drive.stops", "the stops")];
        match drive.keep {
            Keep::Every(0) => {
                self.fault("drive.keep", "keep: {every: 0} keeps nothing".into(), "write last, all or {every: n}", &[]);
            }
            Keep::Every(n) if n > drive.stops => {
                let rule = format!("keep: {{every: {n}}} of {} stops keeps the last alone", drive.stops);
                self.fault("drive.keep", rule, "write keep: last, or make more stops", &also);
            }
            _ => (),
        }
        if cells.window_scans > drive.stops {
            let rule =
                format!("a window of {} sweeps never fills: the rover makes {} stops", cells.window_scans, drive.stops);
            self.fault("cells.window_scans", rule, "make more stops or a shorter window", &also);
        }
    }

    pub(super) fn rover(&mut self) {
        let drive = &self.family.drive;
        if drive.over_bodies && drive.rover.limits.is_none() {
            let rule = format!(
                "the file of the rover '{}' has no section limits, which says what it drives over",
                drive.rover.name
            );
            let cure = "write `limits:` into the rover's file, or take over_bodies out";
            self.fault("drive.over_bodies", rule, cure, &[("drive.rover", "the rover")]);
        }
        let Chassis::RockerBogie(p) = &self.family.drive.rover.chassis else { return };
        let bogie = p.bogie_rear_x_m..p.bogie_front_x_m;
        let key = "drive.rover.chassis.rocker_bogie.bogie_pivot_x_m";
        if !bogie.contains(&p.bogie_pivot_x_m) {
            let rule = format!(
                "the bogie's pivot ({} m) must lie between its wheels ({} m and {} m)",
                p.bogie_pivot_x_m, p.bogie_rear_x_m, p.bogie_front_x_m
            );
            self.fault(key, rule, "bogie_rear_x_m < bogie_pivot_x_m < bogie_front_x_m", &[]);
        }
    }
}
