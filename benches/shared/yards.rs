//! The yards S1, S2 and S3 that casting is measured on, and the sweeps that are cast there: shared by benches and peers.
//!
//! The ground is a degree-8 polynomial fitted to Gaussian-filtered noise: S2 is 20 x 20 m (sigma 2 m, standard deviation 0.25 m) with
//! 60 convex rocks, S1 the same without rocks, S3 is 100 x 100 m with all lengths of the ground five times as long and 2000 rocks.
//! Sweeps from 0.4 m above the ground in the middle: `urg` 683 bearings x 60 tilts (-60 to +10 degrees), 4 m; `sick` 361 x 100,
//! 30 m. Draws come from a small generator of its own: the yards must not change with the product's draws.

use marsyard::geometry::{DVec2, DVec3};
use marsyard::math;
use marsyard::scene::polynomial::{FIT_MARGIN, terms};
use marsyard::scene::{Class, Convex, Ground, Polynomial, Scene, Shape};

/// One of the yards.
pub struct Yard {
    pub name: &'static str,
    pub extent_m: f64,
    /// Spacing of a peer's ground mesh.
    pub mesh_m: f64,
    pub rocks: usize,
}

pub const YARDS: [Yard; 3] = [
    Yard { name: "s1", extent_m: 20.0, mesh_m: 0.05, rocks: 0 },
    Yard { name: "s2", extent_m: 20.0, mesh_m: 0.05, rocks: 60 },
    Yard { name: "s3", extent_m: 100.0, mesh_m: 0.1, rocks: 2000 },
];

/// A multiplicative generator, for the yards alone.
struct Lcg(u64);

impl Lcg {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

impl Yard {
    pub fn scene(&self) -> Scene {
        let mut random = Lcg(42);
        let ground = self.ground(&mut random);
        let middle = DVec2::splat(0.5 * self.extent_m);
        let mut scene = Scene::bare(self.extent_m, Ground::Polynomial(ground));
        while scene.obstacles.len() < self.rocks {
            let (x, y) = (random.within(0.5, self.extent_m - 0.5), random.within(0.5, self.extent_m - 0.5));
            let radius = 0.05 * math::exp(random.unit() * math::ln(8.0));
            if (DVec2::new(x, y) - middle).length() < 1.0 + radius {
                continue;
            }
            let centre = DVec3::new(x, y, scene.ground.height_m(x, y));
            let points: Vec<DVec3> = (0..22)
                .map(|_| {
                    let (up, turn) = (random.within(-1.0, 1.0), random.within(0.0, std::f64::consts::TAU));
                    let level = (1.0 - up * up).sqrt() * random.within(0.85, 1.0);
                    let (sin, cos) = math::sin_cos(turn);
                    centre + radius * DVec3::new(level * cos, level * sin, 0.8 * up)
                })
                .collect();
            if let Some(hull) = Convex::hull(&points) {
                scene = scene.with_obstacle(Class::Rock, Shape::Convex(hull));
            }
        }
        scene
    }

    /// Where the sensor stands.
    pub fn origin_m(&self, scene: &Scene) -> DVec3 {
        let middle = 0.5 * self.extent_m;
        DVec3::new(middle, middle, scene.ground.height_m(middle, middle) + 0.4)
    }

    /// Random Gaussian bumps (filtered noise), projected on the basis by a mean over a grid, scaled to a 80th of the extent.
    fn ground(&self, random: &mut Lcg) -> Polynomial {
        // In yards of 20 m.
        let half = 0.5 * FIT_MARGIN * 20.0;
        let sigma = 2.0;
        let bumps: Vec<[f64; 3]> = (0..1500)
            .map(|_| [random.within(-18.0, 18.0), random.within(-18.0, 18.0), random.within(-1.0, 1.0)])
            .collect();
        let side = 72;
        let place = |k: usize| half * ((2 * k + 1) as f64 / side as f64 - 1.0);
        let mut field = vec![0.0; side * side];
        for (k, value) in field.iter_mut().enumerate() {
            let (x, y) = (place(k % side), place(k / side));
            *value = bumps
                .iter()
                .map(|b| {
                    let r2 = (x - b[0]) * (x - b[0]) + (y - b[1]) * (y - b[1]);
                    if r2 < 100.0 { b[2] * math::exp(-0.5 * r2 / (sigma * sigma)) } else { 0.0 }
                })
                .sum();
        }
        let count = field.len() as f64;
        let mean = field.iter().sum::<f64>() / count;
        let sd = (field.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt();
        let degree = 8;
        let unit = |k: usize, n: usize| {
            let mut coefficients = vec![0.0; (degree + 1) * (degree + 2) / 2];
            let index = terms(degree).position(|t| t == (n, 0)).unwrap_or(0);
            coefficients[index] = 1.0;
            Polynomial::new(20.0, degree, coefficients).height_m(place(k) + 10.0, 10.0)
        };
        let basis: Vec<Vec<f64>> = (0..=degree).map(|n| (0..side).map(|k| unit(k, n)).collect()).collect();
        let coefficients = terms(degree)
            .map(|(i, j)| {
                let sum: f64 =
                    (0..side * side).map(|k| (field[k] - mean) / sd * basis[i][k % side] * basis[j][k / side]).sum();
                self.extent_m / 80.0 * sum / count
            })
            .collect();
        Polynomial::new(self.extent_m, degree, coefficients)
    }
}

/// One tilted 2-D scanner: rays and reach.
pub struct Sweep {
    pub name: &'static str,
    pub dirs: Vec<DVec3>,
    pub reach_m: f64,
}

pub fn sweeps() -> [Sweep; 2] {
    [tilted("urg", 683, 240.0, 60, 4.0), tilted("sick", 361, 180.0, 100, 30.0)]
}

/// Bearings over a field, tilts from -60 to +10 degrees.
pub fn tilted(name: &'static str, beams: usize, field_deg: f64, tilts: usize, reach_m: f64) -> Sweep {
    let mut dirs = Vec::new();
    for line in 0..tilts {
        let (tilt_sin, tilt_cos) = math::sin_cos((-60.0 + 70.0 * line as f64 / (tilts - 1) as f64).to_radians());
        for beam in 0..beams {
            let bearing = field_deg * (beam as f64 / (beams - 1) as f64 - 0.5);
            let (sin, cos) = math::sin_cos(bearing.to_radians());
            dirs.push(DVec3::new(cos * tilt_cos, sin, cos * tilt_sin).normalize());
        }
    }
    Sweep { name, dirs, reach_m }
}
