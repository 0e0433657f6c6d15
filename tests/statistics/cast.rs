//! Casting against a second solver (`reference`), in random yards, pattern by pattern.
//!
//! What must hold: ranges within 1e-9 m, plus 1e-12 m over the slope at which the ray meets the surface; no hit missed or
//! invented, except where the ray's clearance there is below 1e-11 m. CI casts 10^4 rays a pattern and marches 10^2 of them; the
//! ignored test casts a hundred times as many:
//! `cargo test --release --test statistics cast -- --ignored --nocapture`.

mod reference;

use std::f64::consts::{PI, TAU};

use marsyard::geometry::{DVec2, DVec3};
use marsyard::math;
use marsyard::scene::{Body, Class, Convex, Cylinder, Ground, Obstacle, Polynomial, Raster, Scene, Shape};
use marsyard::sweep::params::Cast;
use marsyard::sweep::{Caster, Hit};
use reference::Ray;

use crate::extremes::{Family, row};

/// Clearance below which a hit may be missed or invented.
const CLEARANCE_M: f64 = 1e-11;

/// SplitMix64: the tests' own randomness.
struct Random(u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.word() >> 11) as f64 / (1u64 << 53) as f64)
    }

    fn log_within(&mut self, low: f64, high: f64) -> f64 {
        math::exp(self.within(math::ln(low), math::ln(high)))
    }

    /// A direction, uniform on the sphere.
    fn direction(&mut self) -> DVec3 {
        let (z, turn) = (self.within(-1.0, 1.0), self.within(0.0, TAU));
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * math::cos(turn), level * math::sin(turn), z)
    }
}

/// A rough polynomial: coefficients that fall off with the degree, scaled to a root mean square height.
fn polynomial(random: &mut Random, extent_m: f64, degree: usize) -> Polynomial {
    let mut coefficients = Vec::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            coefficients.push(random.within(-1.0, 1.0) / (1.0 + 0.15 * (i * i + j * j) as f64));
        }
    }
    let size = coefficients.iter().map(|c| c * c).sum::<f64>().sqrt();
    let rms_m = extent_m * random.log_within(0.001, 0.03);
    Polynomial::new(extent_m, degree, coefficients.iter().map(|c| c * rms_m / size).collect())
}

fn rock(random: &mut Random, centre: DVec3, size_m: f64) -> Option<Shape> {
    let squash = DVec3::new(1.0, random.within(0.4, 1.0), random.within(0.3, 1.0));
    let points: Vec<DVec3> = (0..6 + random.word() as usize % 20)
        .map(|_| centre + 0.5 * size_m * random.within(0.9, 1.0) * random.direction() * squash)
        .collect();
    Convex::hull(&points).map(Shape::Convex)
}

/// A yard of its own for each seed: polynomial grounds of degree 2 to 12, every fourth a raster.
fn yard(seed: u64) -> Scene {
    let mut random = Random(seed);
    let extent_m = random.log_within(8.0, 80.0);
    let degree = 2 + random.word() as usize % 11;
    let smooth = polynomial(&mut random, extent_m, degree);
    let ground = if seed % 4 == 3 {
        let spacing = extent_m / random.within(20.0, 400.0);
        let roughness = random.log_within(1e-4, 0.1) * spacing;
        let mut raster = Raster::sampled(extent_m, spacing, |x, y| smooth.height_m(x, y));
        std::sync::Arc::make_mut(&mut raster.heights_m)
            .iter_mut()
            .for_each(|h| *h += random.within(-roughness, roughness));
        Ground::Raster(raster)
    } else {
        Ground::Polynomial(smooth)
    };
    let mut obstacles = Vec::new();
    for _ in 0..random.word() % 80 {
        let (x, y) = (random.within(0.0, extent_m), random.within(0.0, extent_m));
        let size = random.log_within(1e-3 * extent_m, 0.1 * extent_m);
        let centre = DVec3::new(x, y, ground.height_m(x, y) + size * random.within(-0.2, 0.3));
        let shape = match random.word() % 5 {
            0 => Shape::Cylinder(Cylinder {
                base_m: centre - DVec3::Z * 0.1 * size,
                radius_m: 0.3 * size,
                height_m: size * random.log_within(0.5, 8.0),
            }),
            1 => Shape::Convex(Convex::cuboid(centre, DVec3::new(0.5, 0.2, 0.4) * size, random.within(0.0, PI))),
            _ => match rock(&mut random, centre, size) {
                Some(shape) => shape,
                None => continue,
            },
        };
        let (id, reach) = (obstacles.len() as i32, 10.0 * size);
        let body = Body { shape, centre_m: centre, radius_m: reach, protrusion_m: size };
        obstacles.push(Obstacle::new(id, Class::Rock, body));
    }
    Scene { extent_m, ground, obstacles, volumes: Vec::new(), patches: Vec::new() }
}

/// A place for a sensor, clear of everything.
fn sensor(random: &mut Random, scene: &Scene, caster: &Caster) -> DVec3 {
    loop {
        let (x, y) = (random.within(0.0, scene.extent_m), random.within(0.0, scene.extent_m));
        let place = DVec3::new(x, y, scene.ground.height_m(x, y) + random.log_within(0.05, 3.0));
        if caster.inside(place).is_none() {
            return place;
        }
    }
}

/// The direction of the k-th ray.
type Beam = fn(&mut Random, usize) -> DVec3;

/// Beam directions in the manner of the sensors: name, reach, rays.
fn patterns() -> Vec<(&'static str, f64, Beam)> {
    fn polar(azimuth: f64, elevation: f64) -> DVec3 {
        DVec3::new(
            math::cos(azimuth) * math::cos(elevation),
            math::sin(azimuth) * math::cos(elevation),
            math::sin(elevation),
        )
    }
    vec![
        ("tilted 2-D scanner, 4 m", 4.0, |random, k| {
            let tilt = (-60.0 + 70.0 * ((k / 683) % 60) as f64 / 59.0 + random.within(-0.01, 0.01)).to_radians();
            let bearing = (-120.0 + 240.0 * (k % 683) as f64 / 682.0).to_radians();
            let (c, s) = (math::cos(bearing), math::sin(bearing));
            DVec3::new(c * math::cos(tilt), s, c * math::sin(tilt))
        }),
        ("tilted 2-D scanner, 30 m", 30.0, |random, k| {
            let tilt = (-45.0 + 49.5 * ((k / 361) % 100) as f64 / 99.0 + random.within(-0.01, 0.01)).to_radians();
            let bearing = (-90.0 + 0.5 * (k % 361) as f64).to_radians();
            let (c, s) = (math::cos(bearing), math::sin(bearing));
            DVec3::new(c * math::cos(tilt), s, c * math::sin(tilt))
        }),
        ("spinning rings, 100 m", 100.0, |random, k| {
            polar(
                0.2f64.to_radians() * (k / 16) as f64 + random.within(0.0, 1e-3),
                ((k % 16) as f64 * 2.0 - 15.0).to_radians(),
            )
        }),
        ("picture, 10 m", 10.0, |random, k| {
            let (col, row) = (k % 200, (k / 200) % 150);
            polar(
                (col as f64 * 0.3 - 30.0 + random.within(0.0, 0.1)).to_radians(),
                (10.0 - row as f64 * 0.4).to_radians(),
            )
        }),
        ("rosette, 200 m", 200.0, |random, k| {
            let t = k as f64 * 1e-5;
            let (a, b) = (7294.0 / 60.0 * TAU * t, -4664.0 / 60.0 * TAU * t);
            let (y, z) = (0.34 * (math::cos(a) + math::cos(b)) / 2.0, 0.34 * (math::sin(a) + math::sin(b)) / 2.0);
            DVec3::new(1.0, y, z - 0.1 + random.within(0.0, 1e-4)).normalize()
        }),
        ("everywhere, 1 km", 1000.0, |random, _| random.direction()),
    ]
}

/// What was seen over many rays.
#[derive(Default, Debug)]
struct Tally {
    rays: usize,
    ground: usize,
    bodies: usize,
    /// Differences of hit or object, all with a clearance below the limit.
    excused: usize,
    worst_m: f64,
    /// Worst error over its own allowance.
    worst_share: f64,
}

impl Tally {
    /// Compares one answer with the reference's; panics where it is wrong.
    fn compare(&mut self, scene: &Scene, ray: &Ray, hit: Hit, truth: Hit, name: &str) {
        self.rays += 1;
        self.ground += usize::from(truth.object == Hit::GROUND);
        self.bodies += usize::from(truth.object >= 0);
        if hit.object == truth.object {
            if hit.object == Hit::NOTHING {
                return;
            }
            let error = (hit.range_m - truth.range_m).abs();
            let allowed = 1e-9 + 1e-12 / slope(scene, ray, truth);
            if error <= allowed {
                self.worst_m = self.worst_m.max(error);
                self.worst_share = self.worst_share.max(error / allowed);
                return;
            }
        }
        let clearance = doubt(scene, ray, hit, truth);
        assert!(
            clearance < CLEARANCE_M,
            "{name}: {ray:?}: cast {hit:?}, reference {truth:?}, clearance {clearance:.3e}, extent {}",
            scene.extent_m
        );
        self.excused += 1;
    }
}

/// Sine of the angle between ray and surface.
fn slope(scene: &Scene, ray: &Ray, hit: Hit) -> f64 {
    let point = ray.at(hit.range_m);
    match hit.object {
        Hit::GROUND => {
            let gradient: DVec2 = scene.ground.gradient(point.x, point.y);
            (ray.dir.z - gradient.x * ray.dir.x - gradient.y * ray.dir.y).abs().max(1e-300)
        }
        id => {
            let small = 1e-7;
            let shape = &scene.obstacles[id as usize].body().shape;
            let rate = reference::outside(shape, ray.at(hit.range_m + small))
                - reference::outside(shape, ray.at(hit.range_m - small));
            (0.5 * rate / small).abs().max(1e-300)
        }
    }
}

/// How much would have to be added to or taken from a surface for both answers to be right: the clearance of the earlier hit.
fn doubt(scene: &Scene, ray: &Ray, hit: Hit, truth: Hit) -> f64 {
    let (early, late) = if hit.range_m < truth.range_m { (hit, truth) } else { (truth, hit) };
    let border = reference::leaves_square(scene.extent_m, ray).min(ray.reach_m);
    if (early.range_m - border).abs() < 1e-9 {
        return 0.0;
    }
    // The deepest that the ray goes below the early surface before it comes up again, or how near it comes.
    let until = if late.range_m.is_finite() { late.range_m } else { border };
    let height = |t: f64| match early.object {
        Hit::GROUND => reference::clearance(scene, ray, t),
        id => reference::outside(&scene.obstacles[id as usize].body().shape, ray.at(t)),
    };
    let mut deepest = height(early.range_m);
    let mut step = 1e-9;
    let mut t = early.range_m;
    while t < until {
        let h = height(t);
        if h > 1e-9 {
            break;
        }
        deepest = deepest.min(h);
        t += step;
        step *= 1.2;
    }
    deepest.abs()
}

/// Marches along a ray in small steps and bisects the first change of sign: a later hit than this is a hit missed.
fn march(scene: &Scene, ray: &Ray, steps: usize) -> f64 {
    let end = ray.reach_m.min(200.0);
    let border = reference::leaves_square(scene.extent_m, ray);
    let height = |t: f64| {
        let bodies = scene.obstacles.iter().map(|o| reference::outside(&o.body().shape, ray.at(t)));
        let ground = if t <= border { reference::clearance(scene, ray, t) } else { f64::INFINITY };
        bodies.fold(ground, f64::min)
    };
    let mut before = 0.0;
    for k in 1..=steps {
        let t = end * k as f64 / steps as f64;
        if height(t) < 0.0 {
            return reference::bisect(&height, before, t);
        }
        before = t;
    }
    f64::INFINITY
}

/// `rays` rays of each pattern, in yards of a thousand rays each; `marched` of them are marched too.
fn check(rays: usize, marched: usize) {
    for (index, (name, reach_m, direction)) in patterns().into_iter().enumerate() {
        let mut tally = Tally::default();
        let mut missed = 0;
        let yards = rays / 1000;
        for number in 0..yards {
            let seed = (index * 1_000_003 + number) as u64;
            let scene = yard(seed);
            let caster = Caster::new(&scene, &Cast::Exact);
            let mut random = Random(seed ^ 0xabcdef);
            let origin = sensor(&mut random, &scene, &caster);
            let turn = random.within(0.0, TAU);
            let first = random.word() as usize % 40_000;
            let dirs: Vec<DVec3> = (0..1000)
                .map(|k| {
                    let d = direction(&mut random, first + k);
                    DVec3::new(
                        math::cos(turn) * d.x - math::sin(turn) * d.y,
                        math::sin(turn) * d.x + math::cos(turn) * d.y,
                        d.z,
                    )
                    .normalize()
                })
                .collect();
            let mut hits = Vec::new();
            caster.from(origin, reach_m).cast(&dirs, &mut hits);
            for (k, (&dir, &hit)) in dirs.iter().zip(&hits).enumerate() {
                let ray = Ray { origin, dir, reach_m };
                let truth = reference::first_hit(&scene, &ray);
                tally.compare(&scene, &ray, hit, truth, name);
                // The path for single rays, at a tenth of them.
                if k % 10 == 0 {
                    tally.compare(&scene, &ray, caster.first_hit(origin, dir, reach_m), truth, name);
                }
                if k < marched / yards.max(1) {
                    let by_foot = march(&scene, &ray, 20_000);
                    missed += usize::from(by_foot + 1e-9 < hit.range_m && by_foot < hit.range_m.min(reach_m));
                }
            }
        }
        println!(
            "{name}: {} rays, {} on ground, {} on bodies, {} within {CLEARANCE_M:e} m of either, worst {:.2e} m ({:.3} of allowed)",
            tally.rays, tally.ground, tally.bodies, tally.excused, tally.worst_m, tally.worst_share
        );
        assert_eq!(missed, 0, "{name}: marching met something first");
        assert!(tally.ground + tally.bodies > tally.rays / 50, "{name}: hardly anything was met");
    }
}

#[test]
fn equal_first_hits_of_a_second_solver_and_of_marching() {
    check(10_000, 100);
}

#[test]
#[ignore = "10^6 rays a pattern take minutes: cargo test --release --test statistics cast -- --ignored --nocapture"]
fn equal_first_hits_of_a_second_solver_and_of_marching_at_length() {
    check(1_000_000, 10_000);
}

#[test]
fn extreme_a_hundred_thousand_rocks() {
    let mut random = Random(7);
    let extent_m = 300.0;
    let ground = Ground::Polynomial(polynomial(&mut random, extent_m, 6));
    let mut obstacles = Vec::new();
    while obstacles.len() < 100_000 {
        let (x, y) = (random.within(0.0, extent_m), random.within(0.0, extent_m));
        let size = random.log_within(0.02, 1.0);
        let centre = DVec3::new(x, y, ground.height_m(x, y));
        if let Some(shape) = rock(&mut random, centre, size) {
            let id = obstacles.len() as i32;
            let radius_m = size;
            let body = Body { shape, centre_m: centre, radius_m, protrusion_m: size };
            obstacles.push(Obstacle::new(id, Class::Rock, body));
        }
    }
    let scene = Scene { extent_m, ground, obstacles, volumes: Vec::new(), patches: Vec::new() };
    let caster = Caster::new(&scene, &Cast::Exact);
    let origin = sensor(&mut random, &scene, &caster);
    let dirs: Vec<DVec3> = (0..20_000).map(|_| (random.direction() * DVec3::new(1.0, 1.0, 0.2)).normalize()).collect();
    let mut hits = Vec::new();
    caster.from(origin, 100.0).cast(&dirs, &mut hits);
    for (dir, hit) in dirs.iter().zip(&hits) {
        let single = caster.first_hit(origin, *dir, 100.0);
        let same = single.object == hit.object && (single == *hit || (single.range_m - hit.range_m).abs() < 1e-9);
        let ray = Ray { origin, dir: *dir, reach_m: 100.0 };
        assert!(same || doubt(&scene, &ray, *hit, single) < CLEARANCE_M, "{ray:?}: {hit:?} {single:?}");
    }
    assert!(hits.iter().filter(|h| h.object >= 0).count() > 200);
    // A hundred rays that meet a rock against all rocks, one by one; and triangles in f32 in world coordinates.
    let (mut tally, mut textbook_worst, mut other) = (Tally::default(), 0.0_f64, 0);
    for (&dir, &hit) in dirs.iter().zip(&hits).filter(|(_, h)| h.object >= 0).take(100) {
        let ray = Ray { origin, dir, reach_m: 100.0 };
        let truth = reference::first_hit(&scene, &ray);
        tally.compare(&scene, &ray, hit, truth, "100,000 rocks");
        let Shape::Convex(body) = &scene.obstacles[truth.object as usize].body().shape else { panic!("a rock") };
        match in_f32(body, &ray) {
            Some(range_m) => textbook_worst = textbook_worst.max((range_m - truth.range_m).abs()),
            None => other += 1,
        }
    }
    row(
        Family::Casting,
        "a hundred thousand rocks on 300 m",
        &format!(
            "triangles in f32, world coordinates: {other} of 100 hits lost, others off by up to {textbook_worst:.1e} m"
        ),
        &format!(
            "{} rays as all rocks one by one say, off by {:.1e} m at most; 20,000 rays alike by two paths",
            tally.rays, tally.worst_m
        ),
    );
}

/// First hit of a body's faces as triangles in f32 (Moller & Trumbore 1997).
fn in_f32(body: &Convex, ray: &Ray) -> Option<f64> {
    let corner = |k: u32| body.vertices_m[k as usize].as_vec3();
    let (origin, dir) = (ray.origin.as_vec3(), ray.dir.as_vec3());
    let mut nearest: Option<f32> = None;
    for face in &body.faces {
        for pair in face[1..].windows(2) {
            let a = corner(face[0]);
            let (edge1, edge2) = (corner(pair[0]) - a, corner(pair[1]) - a);
            let p = dir.cross(edge2);
            let det = edge1.dot(p);
            let from = origin - a;
            let q = from.cross(edge1);
            let (u, v, t) = (from.dot(p) / det, dir.dot(q) / det, edge2.dot(q) / det);
            if det.abs() > 1e-6 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 {
                nearest = Some(nearest.map_or(t, |before| before.min(t)));
            }
        }
    }
    nearest.map(f64::from)
}
