//! The casting side of `scripts/peers/open3d_cast.py`: scene S2 as files for a peer, and timed sweeps on request.
//!
//! `cast_peer DIR` writes the scene into DIR (`vertices.f64`, `triangles.i32`, and per sweep `NAME.rays.f64` with origin and
//! direction a ray, `NAME.exact.f64`), prints one JSON line a fact, then reads commands from stdin: `NAME METHOD` casts one
//! sweep and answers with its CPU seconds, set-up of the sensor position included.
//!
//! S2: a degree-8 polynomial fitted to Gaussian-filtered noise (sigma 2 m, standard deviation 0.25 m) on 20 x 20 m, 60 convex
//! rocks. Sweeps from 0.4 m above the ground: `urg` 683 bearings x 60 tilts (-60 to +10 degrees), 4 m; `sick` 361 x 100, 30 m.

use std::fs;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

use marsyard::geometry::{DVec2, DVec3};
use marsyard::math;
use marsyard::scene::polynomial::{FIT_MARGIN, terms};
use marsyard::scene::{Class, Convex, Ground, Obstacle, Polynomial, Scene, Shape};
use marsyard::sweep::params::{Cast, SpacingParams};
use marsyard::sweep::{Caster, Hit};

const EXTENT_M: f64 = 20.0;
/// Spacing of the peer's ground mesh.
const MESH_M: f64 = 0.05;

/// A small generator of its own: the scene must not change with the product's draws.
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

/// Random Gaussian bumps (filtered noise), projected on the basis by a mean over a grid, scaled to 0.25 m.
fn ground(random: &mut Lcg) -> Polynomial {
    let half = 0.5 * FIT_MARGIN * EXTENT_M;
    let sigma = 2.0;
    let bumps: Vec<[f64; 3]> =
        (0..1500).map(|_| [random.within(-18.0, 18.0), random.within(-18.0, 18.0), random.within(-1.0, 1.0)]).collect();
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
        Polynomial::new(EXTENT_M, degree, coefficients).height_m(place(k) + 0.5 * EXTENT_M, 0.5 * EXTENT_M)
    };
    let basis: Vec<Vec<f64>> = (0..=degree).map(|n| (0..side).map(|k| unit(k, n)).collect()).collect();
    let coefficients = terms(degree)
        .map(|(i, j)| {
            let sum: f64 =
                (0..side * side).map(|k| (field[k] - mean) / sd * basis[i][k % side] * basis[j][k / side]).sum();
            0.25 * sum / count
        })
        .collect();
    Polynomial::new(EXTENT_M, degree, coefficients)
}

fn scene() -> Scene {
    let mut random = Lcg(42);
    let ground = ground(&mut random);
    let sensor = DVec2::splat(0.5 * EXTENT_M);
    let mut obstacles = Vec::new();
    while obstacles.len() < 60 {
        let (x, y) = (random.within(0.5, EXTENT_M - 0.5), random.within(0.5, EXTENT_M - 0.5));
        let radius = 0.05 * math::exp(random.unit() * math::ln(8.0));
        if (DVec2::new(x, y) - sensor).length() < 1.0 + radius {
            continue;
        }
        let centre = DVec3::new(x, y, ground.height_m(x, y));
        let points: Vec<DVec3> = (0..22)
            .map(|_| {
                let (up, turn) = (random.within(-1.0, 1.0), random.within(0.0, std::f64::consts::TAU));
                let level = (1.0 - up * up).sqrt() * random.within(0.85, 1.0);
                let (sin, cos) = math::sin_cos(turn);
                centre + radius * DVec3::new(level * cos, level * sin, 0.8 * up)
            })
            .collect();
        let Some(hull) = Convex::hull(&points) else { continue };
        let (centre_m, radius_m) = hull.bounding_sphere();
        let id = obstacles.len() as i32;
        let shape = Shape::Convex(hull);
        obstacles.push(Obstacle { id, class: Class::Rock, shape, centre_m, radius_m, protrusion_m: 0.8 * radius });
    }
    Scene {
        extent_m: EXTENT_M,
        ground: Ground::Polynomial(ground),
        obstacles,
        volumes: Vec::new(),
        patches: Vec::new(),
    }
}

/// One tilted 2-D scanner: rays and reach.
struct Sweep {
    name: &'static str,
    dirs: Vec<DVec3>,
    reach_m: f64,
}

fn sweeps() -> [Sweep; 2] {
    let tilted = |name, beams: usize, field_deg: f64, tilts: usize, reach_m| {
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
    };
    [tilted("urg", 683, 240.0, 60, 4.0), tilted("sick", 361, 180.0, 100, 30.0)]
}

/// Ground and rocks as the peer sees them.
fn write_mesh(dir: &Path, scene: &Scene) -> std::io::Result<()> {
    let cells = (EXTENT_M / MESH_M).round() as usize;
    let nodes = cells + 1;
    let mut vertices: Vec<f64> = Vec::new();
    let mut triangles: Vec<i32> = Vec::new();
    for row in 0..nodes {
        for col in 0..nodes {
            let (x, y) = (col as f64 * MESH_M, row as f64 * MESH_M);
            vertices.extend([x, y, scene.ground.height_m(x, y)]);
        }
    }
    for row in 0..cells {
        for col in 0..cells {
            let [sw, nw] = [(row * nodes + col) as i32, ((row + 1) * nodes + col) as i32];
            triangles.extend([sw, sw + 1, nw + 1, sw, nw + 1, nw]);
        }
    }
    for obstacle in &scene.obstacles {
        let Shape::Convex(hull) = &obstacle.shape else { continue };
        let base = (vertices.len() / 3) as i32;
        vertices.extend(hull.vertices_m.iter().flat_map(|v| v.to_array()));
        for face in &hull.faces {
            for k in 1..face.len() - 1 {
                triangles.extend([face[0], face[k], face[k + 1]].map(|v| base + v as i32));
            }
        }
    }
    println!("{{\"ground_triangles\": {}, \"triangles\": {}}}", 2 * cells * cells, triangles.len() / 3);
    fs::write(dir.join("vertices.f64"), vertices.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    fs::write(dir.join("triangles.i32"), triangles.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
}

unsafe extern "C" {
    fn clock_gettime(clock: i32, time: *mut [i64; 2]) -> i32;
}

/// Nanoseconds this thread has spent on a CPU (64-bit Linux).
fn cpu_ns() -> i64 {
    const CLOCK_THREAD_CPUTIME_ID: i32 = 3;
    let mut time = [0i64; 2];
    // SAFETY: the C function writes one timespec, two 64-bit words here, into the array.
    unsafe { clock_gettime(CLOCK_THREAD_CPUTIME_ID, &mut time) };
    time[0] * 1_000_000_000 + time[1]
}

fn main() -> std::io::Result<()> {
    let dir = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "target/cast_peer".into()));
    fs::create_dir_all(&dir)?;
    let scene = scene();
    let before = cpu_ns();
    let exact = Caster::new(&scene, &Cast::Exact);
    println!("{{\"exact_setup_ms\": {:.3}}}", (cpu_ns() - before) as f64 / 1e6);
    let before = cpu_ns();
    let raster = Caster::new(&scene, &Cast::Raster(SpacingParams { spacing_m: MESH_M }));
    println!("{{\"raster_setup_ms\": {:.3}}}", (cpu_ns() - before) as f64 / 1e6);
    let before = cpu_ns();
    let mesh = Caster::new(&scene, &Cast::Mesh(SpacingParams { spacing_m: MESH_M }));
    println!("{{\"mesh_setup_ms\": {:.3}}}", (cpu_ns() - before) as f64 / 1e6);
    write_mesh(&dir, &scene)?;
    let middle = 0.5 * EXTENT_M;
    let origin = DVec3::new(middle, middle, scene.ground.height_m(middle, middle) + 0.4);
    let sweeps = sweeps();
    let mut hits = Vec::new();
    for sweep in &sweeps {
        exact.from(origin, sweep.reach_m).cast(&sweep.dirs, &mut hits);
        let rays: Vec<u8> = sweep
            .dirs
            .iter()
            .flat_map(|d| origin.to_array().into_iter().chain(d.to_array()).flat_map(f64::to_le_bytes))
            .collect();
        fs::write(dir.join(format!("{}.rays.f64", sweep.name)), rays)?;
        let ranges: Vec<u8> = hits.iter().flat_map(|h| h.range_m.to_le_bytes()).collect();
        fs::write(dir.join(format!("{}.exact.f64", sweep.name)), ranges)?;
        let count = |object: fn(i32) -> bool| hits.iter().filter(|h: &&Hit| object(h.object)).count();
        println!(
            "{{\"sweep\": \"{}\", \"rays\": {}, \"ground\": {}, \"rocks\": {}, \"reach_m\": {}}}",
            sweep.name,
            sweep.dirs.len(),
            count(|o| o == Hit::GROUND),
            count(|o| o >= 0),
            sweep.reach_m
        );
    }
    println!("ready");
    std::io::stdout().flush()?;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let (Some(name), Some(method)) = (words.next(), words.next()) else { break };
        let Some(sweep) = sweeps.iter().find(|s| s.name == name) else { break };
        let caster = match method {
            "raster" => &raster,
            "mesh" => &mesh,
            _ => &exact,
        };
        let before = cpu_ns();
        caster.from(origin, sweep.reach_m).cast(&sweep.dirs, &mut hits);
        println!("{:.9}", (cpu_ns() - before) as f64 / 1e9);
        std::io::stdout().flush()?;
    }
    Ok(())
}
