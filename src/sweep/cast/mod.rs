//! Stand-in until the casters arrive: a flat ground and brute force.
use super::params::Cast;
use crate::geometry::DVec3;
use crate::scene::{Scene, Shape};
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub range_m: f64,
    pub object: i32,
}
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    Ground { depth_m: f64 },
    Obstacle(i32),
}
pub struct Caster<'a> {
    scene: &'a Scene,
}
pub struct Origin<'a> {
    caster: &'a Caster<'a>,
    origin_m: DVec3,
    max_range_m: f64,
}
impl<'a> Caster<'a> {
    pub fn new(scene: &'a Scene, _cast: &Cast) -> Caster<'a> {
        Caster { scene }
    }
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }
    pub fn from(&self, origin_m: DVec3, max_range_m: f64) -> Origin<'_> {
        Origin { caster: self, origin_m, max_range_m }
    }
    pub fn normal_at(&self, object: i32, p: DVec3) -> DVec3 {
        if object < 0 {
            return DVec3::Z;
        }
        match &self.scene.obstacles[object as usize].shape {
            Shape::Convex(c) => {
                c.planes
                    .iter()
                    .max_by(|a, b| (a.normal.dot(p) + a.offset_m).total_cmp(&(b.normal.dot(p) + b.offset_m)))
                    .unwrap()
                    .normal
            }
            Shape::Cylinder(_) => DVec3::Z,
        }
    }
    pub fn inside(&self, p: DVec3) -> Option<Inside> {
        (p.z < 0.0).then_some(Inside::Ground { depth_m: -p.z })
    }
    fn first_hit(&self, o: DVec3, d: DVec3, max: f64) -> Hit {
        let t = if d.z < 0.0 { -o.z / d.z } else { f64::INFINITY };
        let p = o + d * t;
        let e = 0.0..=self.scene.extent_m;
        let mut hit = if t <= max && e.contains(&p.x) && e.contains(&p.y) {
            Hit { range_m: t, object: -1 }
        } else {
            Hit { range_m: f64::INFINITY, object: -2 }
        };
        for ob in &self.scene.obstacles {
            if let Shape::Convex(c) = &ob.shape {
                let (mut tn, mut tf) = (f64::NEG_INFINITY, max);
                for pl in &c.planes {
                    let (vd, vn) = (pl.normal.dot(d), pl.normal.dot(o) + pl.offset_m);
                    if vd == 0.0 {
                        if vn > 0.0 {
                            tf = f64::NEG_INFINITY;
                        }
                    } else if vd < 0.0 {
                        tn = tn.max(-vn / vd)
                    } else {
                        tf = tf.min(-vn / vd)
                    }
                }
                if tn <= tf && tn >= 0.0 && tn < hit.range_m {
                    hit = Hit { range_m: tn, object: ob.id }
                }
            }
        }
        hit
    }
}
impl Origin<'_> {
    pub fn cast(&self, dirs: &[DVec3], hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(dirs.iter().map(|&d| self.caster.first_hit(self.origin_m, d, self.max_range_m)));
    }
}
