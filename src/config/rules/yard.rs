//! Rules of a family's yard: its size, its ground and raster, and the rocks on it.

use super::Rules;
use crate::random::Dist;
use crate::scene::params::{GroundShape, RocksParams};
use crate::sweep::params::Cast;

/// Nodes along one side of a raster: 4096 x 4096 heights are 134 MB.
const MAX_NODES_A_SIDE: f64 = 4096.0;

impl Rules<'_, '_, '_> {
    pub(super) fn yard(&mut self) {
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

    pub(super) fn rocks(&mut self) {
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
    pub(super) fn has_obstacles(&self) -> bool {
        let some = |count: &Dist| count.bounds().1 >= 0.5;
        let scene = &self.family.scene;
        let rocks =
            scene.rocks.as_ref().is_some_and(|rocks| rocks.count.as_ref().is_none_or(some) || rocks.golombek.is_some());
        rocks
            || scene.boxes.as_ref().is_some_and(|boxes| some(&boxes.count))
            || scene.trees.as_ref().is_some_and(|trees| some(&trees.count))
    }
}
