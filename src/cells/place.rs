//! A place in the yard -> what is true of it, whether a beam met it or not: what stands there, how steep it is, how far the ground falls.
//!
//! In: the scene, and a place (x, y) in `world`. Out: [`Place`], and the truth of rows: what labels of cells without points follow from,
//! and those by `cells.labels.max_drop_m`, for which `fall` says how the ground falls. Own construction.
//! Not modelled: the rover's size and wheels; stones count by `obstacle` alone.

use super::fall::Falls;
use super::params::LabelParams;
use super::rule::TallerThan;
use super::{CellRow, CellTruth, Cells};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::scene::{Class, Scene, Shape};

/// What is true of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub class: Class,
    /// Id of what stands there, -1 for ground.
    pub object: i32,
    pub protrusion_m: f64,
    /// It is an obstacle by the label's rule.
    pub obstacle: bool,
    pub slope_rad: f64,
}

/// Asks a scene.
#[derive(Clone, Debug)]
pub(super) struct PlaceTruth<'s> {
    scene: &'s Scene,
    taller_than: TallerThan,
}

impl<'s> PlaceTruth<'s> {
    pub(super) fn new(scene: &'s Scene, taller_than: TallerThan) -> PlaceTruth<'s> {
        PlaceTruth { scene, taller_than }
    }

    /// What is at a place; `None` outside the yard, where there is no ground.
    pub(super) fn of(&self, x_m: f64, y_m: f64) -> Option<Place> {
        if !self.scene.contains(x_m, y_m) {
            return None;
        }
        let (ground_m, gradient) = self.scene.ground.height_and_gradient(x_m, y_m);
        let slope_rad = math::atan(gradient.length());
        let mut place = Place { class: Class::Ground, object: -1, protrusion_m: 0.0, obstacle: false, slope_rad };
        // As `labels` names a cell's object: what makes the label before what does not, then the taller, then the first.
        let mut named = (false, f64::NEG_INFINITY);
        let mut add = |class, object, protrusion_m: f64, obstacle| {
            place.obstacle |= obstacle;
            if (obstacle, protrusion_m) > named {
                named = (obstacle, protrusion_m);
                (place.class, place.object, place.protrusion_m) = (class, object, protrusion_m);
            }
        };
        let here = DVec2::new(x_m, y_m);
        for obstacle in self.scene.obstacles.iter().filter(|obstacle| !obstacle.is_beyond(here, 0.0)) {
            let body = obstacle.body();
            if top_m(&body.shape, here).is_some_and(|top_m| top_m > ground_m) {
                add(obstacle.class, obstacle.id, body.protrusion_m, self.taller_than.is_obstacle(body.protrusion_m));
            }
        }
        // A crown hangs above the ground; a bush stands on it.
        for volume in self.scene.volumes.iter().filter(|volume| volume.class == Class::Bush) {
            let away = (here - volume.centre_m.truncate()) / volume.semi_axes_m.truncate();
            if away.length_squared() <= 1.0 {
                add(volume.class, volume.id, volume.protrusion_m, volume.untraversable);
            }
        }
        for patch in &self.scene.patches {
            if patch.centre_m.distance_squared(here) <= patch.radius_m * patch.radius_m {
                add(patch.class, patch.id, 0.0, patch.untraversable);
            }
        }
        Some(place)
    }

    /// The truth of rows without points, the drop of all rows where the labels ask for it, and the labels that follow. `place_m`: where a
    /// row's cell is, by its index and mean height. Rows without points outside the yard stay unknown.
    pub(super) fn complete(&self, labels: &LabelParams, place_m: impl Fn(&CellRow, f32) -> DVec3, cells: &mut Cells) {
        let rule = labels.of_counted();
        let falls = labels.max_drop_m.map(|_| Falls::new(self.scene));
        let width = cells.features.len().checked_div(cells.rows.len()).unwrap_or(0);
        for (row, features) in cells.rows.iter_mut().zip(cells.features.chunks_exact(width.max(1))) {
            let here_m = place_m(row, features[0]);
            if row.points == 0 {
                let Some(place) = self.of(here_m.x, here_m.y) else { continue };
                row.truth = CellTruth {
                    pose: None,
                    obstacle_points: if place.obstacle { labels.min_obstacle_points as i32 } else { 0 },
                    top_points: 0,
                    class: Some(place.class),
                    object: place.object,
                    protrusion_m: place.protrusion_m as f32,
                    slope_rad: place.slope_rad as f32,
                    crossing: None,
                    drop_m: 0.0,
                    pit_m: 0.0,
                };
            }
            if let Some(falls) = &falls {
                let fall = falls.at(here_m.x, here_m.y);
                (row.truth.drop_m, row.truth.pit_m) = (fall.drop_m() as f32, fall.pit_m as f32);
            }
            row.label = Some(rule.label(&row.truth));
        }
    }
}

/// The top of a body on the upright line through a place; `None` where the line passes it by.
fn top_m(shape: &Shape, here: DVec2) -> Option<f64> {
    match shape {
        Shape::Cylinder(cylinder) => {
            let inside = cylinder.base_m.truncate().distance(here) <= cylinder.radius_m;
            inside.then_some(cylinder.base_m.z + cylinder.height_m)
        }
        Shape::Convex(body) => body.top_m(here),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::params::ObstacleRule;
    use crate::scene::params::HeightLaw;
    use crate::scene::{Convex, Cylinder, Ground, Patch, Polynomial};

    fn truth(scene: &Scene) -> PlaceTruth<'_> {
        PlaceTruth::new(scene, ObstacleRule::TallerThanM(0.3).taller_than(0.0))
    }

    #[test]
    fn exact_what_stands_at_a_place_is_found_from_above() {
        let ground = Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::new(0.0, 0.1)));
        let crate_m = Convex::cuboid(DVec3::new(3.0, 3.0, 0.3), DVec3::new(0.5, 0.2, 0.45), 0.0);
        let trunk = Cylinder { base_m: DVec3::new(7.0, 7.0, 0.0), radius_m: 0.1, height_m: 2.0 };
        let scene = Scene::bare(10.0, ground)
            .with_obstacle(Class::Box, Shape::Convex(crate_m))
            .with_obstacle(Class::Trunk, Shape::Cylinder(trunk));
        let truth = truth(&scene);
        let found = |x_m, y_m| truth.of(x_m, y_m).map(|place| (place.class, place.object, place.obstacle));
        assert_eq!(found(3.49, 3.19), Some((Class::Box, 0, true)));
        assert_eq!(found(3.51, 3.0), Some((Class::Ground, -1, false)));
        assert_eq!(found(7.0, 7.09), Some((Class::Trunk, 1, true)));
        assert_eq!(found(7.0, 7.11), Some((Class::Ground, -1, false)));
        assert_eq!(truth.of(-0.01, 5.0), None);
        assert!((truth.of(1.0, 1.0).unwrap().slope_rad - math::atan(0.1)).abs() < 1e-12);
    }

    #[test]
    fn exact_where_grass_and_brush_overlap_the_brush_is_named_and_a_low_step_in_it_is_not() {
        let ground = Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::ZERO));
        let step = Convex::cuboid(DVec3::new(5.0, 5.0, 0.05), DVec3::new(0.2, 0.2, 0.05), 0.0);
        let mut scene = Scene::bare(10.0, ground).with_obstacle(Class::Box, Shape::Convex(step));
        let patch = |id, class, x_m| Patch {
            id,
            class,
            centre_m: DVec2::new(x_m, 5.0),
            radius_m: 1.0,
            sigma_m: 0.1,
            height_law: HeightLaw::HalfNormal,
            untraversable: class == Class::Bush,
        };
        scene.patches = vec![patch(1, Class::Grass, 5.0), patch(2, Class::Bush, 5.9)];
        let truth = truth(&scene);
        let found = |x_m| truth.of(x_m, 5.0).map(|place| (place.class, place.object, place.obstacle));
        assert_eq!(found(5.5), Some((Class::Bush, 2, true)), "grass lies here too");
        assert_eq!(found(5.1), Some((Class::Bush, 2, true)), "and a step that the rover climbs");
        assert_eq!(found(4.9 - 0.05), Some((Class::Box, 0, false)), "outside the brush");
    }
}
