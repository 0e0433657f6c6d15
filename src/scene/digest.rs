//! A scene -> the bits that its stage hash covers, in a fixed order.

use super::params::HeightLaw;
use super::{Convex, Ground, Obstacle, Patch, Scene, Shape, Volume};
use crate::geometry::DVec3;

impl Scene {
    /// Feeds every number of the scene to a hasher, in order.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        numbers(hasher, &[self.extent_m]);
        match &self.ground {
            Ground::Polynomial(ground) => {
                whole(hasher, &[0, ground.degree as i64]);
                numbers(hasher, &[ground.centre_m.x, ground.centre_m.y, ground.half_m]);
                numbers(hasher, &ground.coefficients);
            }
            Ground::Raster(ground) => {
                whole(hasher, &[1, ground.rows as i64, ground.cols as i64]);
                numbers(hasher, &[ground.origin_m.x, ground.origin_m.y, ground.spacing_m]);
                numbers(hasher, &ground.heights_m);
            }
        }
        whole(hasher, &[self.obstacles.len() as i64, self.volumes.len() as i64, self.patches.len() as i64]);
        self.obstacles.iter().for_each(|obstacle| obstacle.hash_into(hasher));
        self.volumes.iter().for_each(|volume| volume.hash_into(hasher));
        self.patches.iter().for_each(|patch| patch.hash_into(hasher));
    }
}

impl Obstacle {
    fn hash_into(&self, hasher: &mut blake3::Hasher) {
        whole(hasher, &[self.id.into(), self.class as i64]);
        let body = self.body();
        match &body.shape {
            Shape::Convex(convex) => convex.hash_into(hasher),
            Shape::Cylinder(cylinder) => {
                points(hasher, &[cylinder.base_m]);
                numbers(hasher, &[cylinder.radius_m, cylinder.height_m]);
            }
        }
        points(hasher, &[body.centre_m]);
        numbers(hasher, &[body.radius_m, body.protrusion_m]);
    }
}

impl Convex {
    fn hash_into(&self, hasher: &mut blake3::Hasher) {
        whole(hasher, &[self.vertices_m.len() as i64, self.planes.len() as i64]);
        points(hasher, &self.vertices_m);
        for (plane, face) in self.planes.iter().zip(&self.faces) {
            points(hasher, &[plane.normal]);
            numbers(hasher, &[plane.offset_m]);
            whole(hasher, &[face.len() as i64]);
            face.iter().for_each(|&vertex| whole(hasher, &[vertex.into()]));
        }
    }
}

impl Volume {
    fn hash_into(&self, hasher: &mut blake3::Hasher) {
        whole(hasher, &[self.id.into(), self.class as i64, self.untraversable.into()]);
        points(hasher, &[self.centre_m, self.semi_axes_m]);
        numbers(hasher, &[self.extinction_per_m, self.protrusion_m]);
    }
}

impl Patch {
    fn hash_into(&self, hasher: &mut blake3::Hasher) {
        whole(hasher, &[self.id.into(), self.class as i64, self.untraversable.into()]);
        numbers(hasher, &[self.centre_m.x, self.centre_m.y, self.radius_m, self.sigma_m]);
        // Hashed where it is not the law that patches had before there was another.
        if self.height_law != HeightLaw::HalfNormal {
            whole(hasher, &[self.height_law as i64]);
        }
    }
}

fn whole(hasher: &mut blake3::Hasher, values: &[i64]) {
    values.iter().for_each(|value| _ = hasher.update(&value.to_le_bytes()));
}

fn numbers(hasher: &mut blake3::Hasher, values: &[f64]) {
    // In pieces: a raster has millions, and one update costs more than eight bytes' hashing.
    for piece in values.chunks(512) {
        let mut bytes = [0; 8 * 512];
        bytes.chunks_exact_mut(8).zip(piece).for_each(|(place, value)| place.copy_from_slice(&value.to_le_bytes()));
        hasher.update(&bytes[..8 * piece.len()]);
    }
}

fn points(hasher: &mut blake3::Hasher, points: &[DVec3]) {
    points.iter().for_each(|point| numbers(hasher, &point.to_array()));
}
