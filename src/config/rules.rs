//! Rules that bind several keys: what contradicts itself is refused, with both places named.
//!
//! Rules of one key are the types' own (`garde`); here stand those between keys, sections and families.

use super::document::Document;
use super::error::Fault;
use super::key_path::KeyPath;
use crate::cells::{CellFrame, CellParams};
use crate::drive::params::{Keep, PathParams};
use crate::drive::rover::Chassis;
use crate::plan::Family;
use crate::random::Dist;
use crate::scene::params::{GroundShape, RocksParams};
use crate::slam::SlamParams;
use crate::sweep::MAX_SLOTS;
use crate::sweep::params::Cast;
use crate::sweep::sensor::{PatternParams, Sensor};

/// Nodes along one side of a raster: 4096 x 4096 heights are 134 MB.
const MAX_NODES_A_SIDE: f64 = 4096.0;
/// Cells from the centre to the rim of the ground around a cell: some 31,000 cells lie within.
const MAX_LOCAL_RADIUS_CELLS: f64 = 100.0;
/// A square around a cell reaches so many cells at most: the time grows with its area.
const MAX_SQUARE_CELLS: f64 = 10.0;

/// Rules of the document as a whole.
pub(crate) fn of_document(document: &Document, place: &KeyPath, faults: &mut Vec<Fault>) {
    let (scenes, per_shard) = (document.scenes, u64::from(document.scenes_per_shard));
    if per_shard > 0 && scenes % per_shard != 0 {
        let below = scenes / per_shard * per_shard;
        let near = if below == 0 { format!("{per_shard}") } else { format!("{below} or {}", below + per_shard) };
        faults.push(
            Fault::new(
                place.span("scenes"),
                format!("scenes ({scenes}) must be a multiple of scenes_per_shard ({per_shard})"),
            )
            .cure(format!("write scenes: {near}"))
            .also(place.span("scenes_per_shard"), "a shard is full"),
        );
    }
    for (i, table) in document.tables.iter().enumerate() {
        if let Some(first) = document.tables[..i].iter().position(|earlier| earlier == table) {
            faults.push(
                Fault::new(place.span(&format!("tables[{i}]")), "the same table twice")
                    .also(place.span(&format!("tables[{first}]")), "first here"),
            );
        }
    }
    let families = &document.families;
    for (i, family) in families.iter().enumerate() {
        if let Some(first) = families[..i].iter().position(|earlier| earlier.name == family.name) {
            faults.push(
                Fault::new(
                    place.span(&format!("families[{i}].name")),
                    format!("two families are named '{}'", family.name),
                )
                .cure("give each its own name")
                .also(place.span(&format!("families[{first}].name")), "first here"),
            );
        }
    }
    let training: f64 = families.iter().filter(|family| !family.hold_out).map(|family| family.weight).sum();
    if !families.is_empty() && families.iter().all(|family| family.hold_out) {
        faults.push(
            Fault::new(place.span("families"), "every family is held out: nothing is left to train on")
                .cure("take hold_out from at least one"),
        );
    } else if !families.is_empty() && training <= 0.0 {
        faults.push(
            Fault::new(place.span("families"), "the weights of the families that are not held out add up to 0")
                .cure("give one of them a positive weight"),
        );
    }
}

/// Columns are the same in all scenes, so families must agree on what makes them.
pub(crate) fn between_families(families: &[(Family, KeyPath)], faults: &mut Vec<Fault>) {
    let Some(((first, first_place), others)) = families.split_first() else { return };
    for (family, place) in others {
        let mut differ = |key: &str, ours: String, theirs: String, why: &str| {
            if ours != theirs {
                let rule = format!(
                    "{key} is {theirs} in family '{}' and {ours} in family '{}': {why}",
                    family.name, first.name
                );
                faults.push(
                    Fault::new(place.span(key), rule)
                        .cure("set it once, in the document's own section")
                        .also(first_place.span(key), format!("for '{}'", first.name)),
                );
            }
        };
        let (a, b) = (&first.cells, &family.cells);
        differ("cells.size_m", a.size_m.to_string(), b.size_m.to_string(), "one corpus has one grid");
        differ(
            "cells.neighbours",
            a.neighbours.to_string(),
            b.neighbours.to_string(),
            "one corpus has one set of columns",
        );
        let local = |cells: &CellParams| cells.local_height.as_ref().map_or("absent".to_owned(), |local| local.words());
        differ("cells.local_height", local(a), local(b), "one corpus has one set of columns");
        let curvature = |cells: &CellParams| cells.curvature.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.curvature", curvature(a), curvature(b), "one corpus has one set of columns");
        let around = |cells: &CellParams| cells.surroundings.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.surroundings", around(a), around(b), "one corpus has one set of columns");
        let beams = |cells: &CellParams| cells.beams.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.beams", beams(a), beams(b), "one corpus has one set of columns");
        let rover = |cells: &CellParams| if cells.labels.rover.is_some() { "on" } else { "off" }.to_owned();
        differ("cells.labels.rover", rover(a), rover(b), "one corpus has one set of columns");
        let pose = |cells: &CellParams| {
            let is_named = cells.labels.rover.as_ref().is_some_and(|rule| rule.pose);
            if is_named { "named" } else { "absent" }.to_owned()
        };
        differ("cells.labels.rover.pose", pose(a), pose(b), "one corpus has one set of columns");
        let unseen = |cells: &CellParams| cells.unseen.as_ref().map_or("absent".to_owned(), |unseen| unseen.words());
        differ("cells.unseen", unseen(a), unseen(b), "one corpus has one set of columns");
        let drop = |cells: &CellParams| if cells.labels.max_drop_m.is_some() { "named" } else { "absent" }.to_owned();
        differ("cells.labels.max_drop_m", drop(a), drop(b), "one corpus has one set of columns");
        let on = |family: &Family| if family.sweep.effects.intensity.is_some() { "on" } else { "off" }.to_owned();
        differ("sweep.effects.intensity", on(first), on(family), "one corpus has one set of columns");
    }
}

/// Rules of one family's sections.
pub(crate) fn of_family(family: &Family, place: &KeyPath, faults: &mut Vec<Fault>) {
    let mut rules = Rules { family, place, faults };
    rules.yard();
    rules.rocks();
    rules.path();
    rules.stops();
    rules.sensor();
    rules.ranges();
    rules.slam();
    rules.cells();
    rules.frame();
    rules.rover_labels();
    rules.rover();
}

struct Rules<'a, 'p, 'f> {
    family: &'a Family,
    place: &'a KeyPath<'p>,
    faults: &'f mut Vec<Fault>,
}

impl Rules<'_, '_, '_> {
    fn fault(&mut self, key: &str, rule: String, cure: &str, also: &[(&str, &str)]) {
        let mut fault = Fault::new(self.place.span(key), rule).cure(cure);
        // A default stands nowhere: there is nothing to point at.
        for (key, word) in also.iter().filter(|(key, _)| self.place.holds(key)) {
            fault = fault.also(self.place.span(key), *word);
        }
        self.faults.push(fault);
    }

    fn yard(&mut self) {
        let (scene, start) = (&self.family.scene, &self.family.drive.start);
        let rover_m = self.family.drive.rover.length_m.max(self.family.drive.rover.width_m);
        let extent_m = scene.extent_m;
        if 2.0 * start.margin_m + rover_m >= extent_m {
            let rule = format!(
                "no room to start: the yard is {extent_m} m wide, twice drive.start.margin_m ({}) and the rover ({rover_m} m) need as much",
                start.margin_m
            );
            let also = [("drive.start.margin_m", "the margin"), ("drive.rover", "the rover")];
            self.fault("scene.extent_m", rule, "make the yard larger or the margin smaller", &also);
        }
        let too_fine = |spacing_m: f64| extent_m / spacing_m > MAX_NODES_A_SIDE;
        let needed = |spacing_m: f64| {
            format!(
                "{:.0} x {:.0} nodes, at most {MAX_NODES_A_SIDE} a side are held",
                extent_m / spacing_m,
                extent_m / spacing_m
            )
        };
        let cure = "make the spacing wider or the yard smaller";
        if let GroundShape::Raw(raw) = &scene.ground.shape
            && too_fine(raw.spacing_m)
        {
            let key = "scene.ground.shape.raw.spacing_m";
            self.fault(
                key,
                format!("the ground would have {}", needed(raw.spacing_m)),
                cure,
                &[("scene.extent_m", "the yard")],
            );
        }
        if let Some(roughness) = &scene.ground.roughness {
            let key = "scene.ground.roughness.spacing_m";
            if too_fine(roughness.spacing_m) {
                let rule = format!("the ground would have {}", needed(roughness.spacing_m));
                self.fault(key, rule, cure, &[("scene.extent_m", "the yard")]);
            }
            let shortest_m = roughness.correlation_length_m.bounds().0;
            if shortest_m < 2.0 * roughness.spacing_m {
                let rule = format!(
                    "roughness of correlation length {shortest_m} m cannot be held by nodes {} m apart",
                    roughness.spacing_m
                );
                let also = [("scene.ground.roughness.correlation_length_m", "its length")];
                self.fault(key, rule, "at most half the correlation length", &also);
            }
        }
        if let Cast::Raster(grid) | Cast::Mesh(grid) = &self.family.sweep.cast
            && too_fine(grid.spacing_m)
        {
            let rule = format!("the cast ground would have {}", needed(grid.spacing_m));
            self.fault("sweep.cast", rule, cure, &[("scene.extent_m", "the yard")]);
        }
    }

    fn rocks(&mut self) {
        let Some(rocks) = &self.family.scene.rocks else { return };
        let extent_m = self.family.scene.extent_m;
        let (law, by_count) = ("scene.rocks.golombek", [("scene.rocks.count", "by count")]);
        match rocks {
            RocksParams { golombek: Some(_), count: Some(_), .. } => {
                self.fault(
                    law,
                    "rocks come by golombek or by count, not both".into(),
                    "take one of them out",
                    &by_count,
                );
            }
            RocksParams { golombek: Some(_), diameter_m: Some(_), .. } => {
                let also = [("scene.rocks.diameter_m", "sizes again")];
                self.fault(law, "golombek gives the sizes too".into(), "take diameter_m out", &also);
            }
            RocksParams { golombek: Some(golombek), .. } => {
                if golombek.min_diameter_m >= golombek.max_diameter_m {
                    let rule = format!(
                        "golombek's sizes end ({} m) before they begin ({} m)",
                        golombek.max_diameter_m, golombek.min_diameter_m
                    );
                    let also = [("scene.rocks.golombek.min_diameter_m", "the smallest")];
                    self.fault(
                        "scene.rocks.golombek.max_diameter_m",
                        rule,
                        "max_diameter_m must be above min_diameter_m",
                        &also,
                    );
                }
            }
            RocksParams { count: None, .. } => {
                let cure = "say how many: count and diameter_m, or golombek: {abundance: ...}";
                self.fault("scene.rocks", "'scene.rocks' needs count or golombek".into(), cure, &[]);
            }
            RocksParams { diameter_m: None, .. } => {
                self.fault(
                    "scene.rocks",
                    "'scene.rocks' with count needs diameter_m".into(),
                    "say how large they are",
                    &[],
                );
            }
            RocksParams { diameter_m: Some(diameter_m), .. } => {
                let largest_m = diameter_m.bounds().1;
                if largest_m > extent_m / 2.0 {
                    let rule = format!("a rock of {largest_m} m does not fit a yard of {extent_m} m");
                    let also = [("scene.extent_m", "the yard")];
                    self.fault("scene.rocks.diameter_m", rule, "at most half the yard", &also);
                }
            }
        }
    }

    /// Whether any solid thing can stand in the yard.
    fn has_obstacles(&self) -> bool {
        let some = |count: &Dist| count.bounds().1 >= 0.5;
        let scene = &self.family.scene;
        let rocks =
            scene.rocks.as_ref().is_some_and(|rocks| rocks.count.as_ref().is_none_or(some) || rocks.golombek.is_some());
        rocks
            || scene.boxes.as_ref().is_some_and(|boxes| some(&boxes.count))
            || scene.trees.as_ref().is_some_and(|trees| some(&trees.count))
    }

    fn path(&mut self) {
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

    fn stops(&mut self) {
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

    fn sensor(&mut self) {
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

    fn ranges(&mut self) {
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

    fn slam(&mut self) {
        let sensor: &Sensor = &self.family.sweep.sensor;
        if !matches!(self.family.slam, SlamParams::Fastslam(_)) {
            return;
        }
        let lines = match &sensor.pattern {
            PatternParams::Tilted(p) => ((p.tilt_to_deg - p.tilt_from_deg).abs() / p.tilt_step_deg).floor() + 1.0,
            PatternParams::Spinning(p) => p.elevations_deg.len() as f64,
            PatternParams::Raster(p) => f64::from(p.rows),
            PatternParams::Rosette(_) | PatternParams::File(_) => f64::INFINITY,
        };
        if lines < 2.0 {
            let rule = format!(
                "fastslam has nothing to read: '{}' sweeps a single line, and features need several",
                sensor.name
            );
            let also = [("sweep.sensor.pattern", "one line")];
            self.fault("slam", rule, "choose dead_reckoning or surrogate, or a sensor of several lines", &also);
        }
    }

    fn cells(&mut self) {
        let cells = &self.family.cells;
        if cells.size_m > self.family.scene.extent_m {
            let rule =
                format!("a cell of {} m is larger than the yard of {} m", cells.size_m, self.family.scene.extent_m);
            self.fault("cells.size_m", rule, "about one wheel diameter is usual", &[("scene.extent_m", "the yard")]);
        }
        if let Some(max_m) = cells.max_range_m
            && cells.size_m > max_m
        {
            let rule = format!("a cell of {} m is larger than max_range_m ({max_m} m)", cells.size_m);
            let also = [("cells.max_range_m", "the range")];
            self.fault("cells.size_m", rule, "about one wheel diameter is usual", &also);
        }
        if let Some(local) = &cells.local_height
            && local.radius_m > MAX_LOCAL_RADIUS_CELLS * cells.size_m * (1.0 + 1e-9)
        {
            let rule = format!(
                "a radius of {} m is more than {MAX_LOCAL_RADIUS_CELLS} cells of {} m",
                local.radius_m, cells.size_m
            );
            let cure = "1 m is usual; the time grows with the radius in cells";
            self.fault("cells.local_height.radius_m", rule, cure, &[("cells.size_m", "the cell")]);
        }
        if let Some(curvature) = &cells.curvature {
            self.radii("cells.curvature.radii_m", &curvature.radii_m, MAX_LOCAL_RADIUS_CELLS, "[0.2, 0.4, 0.8]");
        }
        if let Some(surroundings) = &cells.surroundings {
            self.radii("cells.surroundings.radii_m", &surroundings.radii_m, MAX_SQUARE_CELLS, "[0.2, 0.4]");
            self.needs_plane("cells.surroundings", "heights of the squares are above");
        }
        if let Some(beams) = &cells.beams {
            self.radii("cells.beams.radii_m", &beams.radii_m, MAX_SQUARE_CELLS, "[0.1, 0.2, 0.4]");
            self.needs_plane("cells.beams", "heights of the beams are above");
        }
    }

    /// What is above the plane around a cell needs that plane.
    fn needs_plane(&mut self, key: &str, what: &str) {
        if !self.family.cells.local_height.as_ref().is_some_and(|local| local.plane) {
            let rule = format!("{what} the plane around, which is not asked for");
            self.fault(key, rule, "add cells.local_height: {plane: true}", &[("cells.local_height", "here")]);
        }
    }

    /// Distances in cells, in rising order.
    fn radii(&mut self, key: &str, radii_m: &[f64], most_cells: f64, usual: &str) {
        let size_m = self.family.cells.size_m;
        let cure = format!("cells of 0.1 m go with {usual}");
        let mut before_m = 0.0;
        for (k, &radius_m) in radii_m.iter().enumerate() {
            let key = format!("{key}[{k}]");
            if !(1.0 - 1e-9..=most_cells * (1.0 + 1e-9)).contains(&(radius_m / size_m)) {
                let rule = format!("a distance of {radius_m} m is not between 1 and {most_cells} cells of {size_m} m");
                self.fault(&key, rule, &cure, &[("cells.size_m", "the cell")]);
            } else if radius_m <= before_m {
                let rule = format!("{radius_m} m does not lie beyond {before_m} m: distances rise");
                self.fault(&key, rule, &cure, &[]);
            }
            before_m = radius_m;
        }
    }

    fn frame(&mut self) {
        let cells = &self.family.cells;
        if cells.frame == CellFrame::FittedPlane && cells.window_scans > 1 {
            let rule = format!(
                "a window of {} sweeps has no one frame: with fitted_plane each sweep is levelled by its own points",
                cells.window_scans
            );
            let also = [("cells.window_scans", "the window")];
            self.fault("cells.frame", rule, "write window_scans: 1, or frame: estimated_pose", &also);
        }
        if cells.frame == CellFrame::FittedPlane && cells.labels.rover.as_ref().is_some_and(|rover| rover.pose) {
            let rule = "headings are those of the yard, which a frame fitted to one sweep does not know".to_string();
            let also = [("cells.labels.rover.pose", "the truth of poses")];
            self.fault("cells.frame", rule, "leave pose out, or write frame: estimated_pose", &also);
        }
    }

    fn rover_labels(&mut self) {
        let labels = &self.family.cells.labels;
        let Some(rule) = &labels.rover else { return };
        let missing = rule.missing();
        if !missing.is_empty() {
            let rover = &self.family.drive.rover.name;
            let rule =
                format!("neither 'cells.labels.rover' nor the file of the rover '{rover}' says {}", missing.join(", "));
            let cure = "write `limits:` into the rover's file, or the keys under cells.labels.rover";
            self.fault("cells.labels.rover", rule, cure, &[("drive.rover", "the rover")]);
        }
        let (points, slope_deg) = (labels.min_obstacle_points, labels.max_ground_slope_deg);
        let by_points = [
            ("cells.labels.min_obstacle_points", points > 1, "take it out: the rover counts no points"),
            ("cells.labels.max_ground_slope_deg", slope_deg.is_some(), "take it out: max_tilt_deg bounds slopes"),
        ];
        for (key, _, cure) in by_points.into_iter().filter(|(_, is_named, _)| *is_named) {
            let also = [("cells.labels.rover", "the rover's rule")];
            self.fault(key, "labels are the rover's, which is a whole rule".into(), cure, &also);
        }
    }

    fn rover(&mut self) {
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
