//! The casting side of `scripts/peers/open3d_cast.py`: yards S2 and S3 as files for peers, and timed sweeps on request.
//!
//! `cast_peer DIR` writes each yard of `benches/shared/yards.rs` into DIR (`YARD.vertices.f64`, `YARD.triangles.i32`, and per sweep
//! `YARD.SWEEP.rays.f64` with origin and direction a ray, `YARD.SWEEP.exact.f64`), prints one JSON line a fact, then reads commands
//! from stdin and answers each with CPU seconds: `YARD SWEEP METHOD` casts one sweep, set-up of the sensor position included;
//! `YARD setup METHOD` makes ground and rocks ready to be cast at.
//! Methods: `exact`, `raster` (sampled at the mesh's spacing from the exact ground), `raw` (set-up of such a raster as the yard's own
//! ground), `mesh`.

use std::fs;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

use marsyard::geometry::DVec3;
use marsyard::measure::clock::thread_cpu_s;
use marsyard::scene::{Ground, Raster, Scene, Shape};
use marsyard::sweep::params::{Cast, SpacingParams};
use marsyard::sweep::{Caster, Hit};

#[path = "../shared/yards.rs"]
mod yards;

use yards::{Sweep, YARDS, Yard, sweeps};

/// A yard, its ground as a raster too, and what is prepared of it so far.
struct Peer {
    yard: &'static Yard,
    scene: Scene,
    raw: Scene,
    origin_m: DVec3,
}

impl Peer {
    fn new(yard: &'static Yard) -> Peer {
        let scene = yard.scene();
        let raster = Raster::sampled(yard.extent_m, yard.mesh_m, |x, y| scene.ground.height_m(x, y));
        let raw = Scene { ground: Ground::Raster(raster), ..scene.clone() };
        Peer { yard, origin_m: yard.origin_m(&scene), scene, raw }
    }

    fn caster(&self, method: &str) -> Option<Caster<'_>> {
        let spacing = SpacingParams { spacing_m: self.yard.mesh_m };
        Some(match method {
            "exact" => Caster::new(&self.scene, &Cast::Exact),
            "raster" => Caster::new(&self.scene, &Cast::Raster(spacing)),
            "raw" => Caster::new(&self.raw, &Cast::Exact),
            "mesh" => Caster::new(&self.scene, &Cast::Mesh(spacing)),
            _ => return None,
        })
    }

    /// Ground and rocks as a peer sees them.
    fn write_mesh(&self, dir: &Path) -> std::io::Result<()> {
        let Yard { name, extent_m, mesh_m, .. } = *self.yard;
        let cells = (extent_m / mesh_m).round() as usize;
        let nodes = cells + 1;
        let mut vertices: Vec<f64> = Vec::new();
        let mut triangles: Vec<i32> = Vec::new();
        for row in 0..nodes {
            for col in 0..nodes {
                let (x, y) = (col as f64 * mesh_m, row as f64 * mesh_m);
                vertices.extend([x, y, self.scene.ground.height_m(x, y)]);
            }
        }
        for row in 0..cells {
            for col in 0..cells {
                let [sw, nw] = [(row * nodes + col) as i32, ((row + 1) * nodes + col) as i32];
                triangles.extend([sw, sw + 1, nw + 1, sw, nw + 1, nw]);
            }
        }
        for obstacle in &self.scene.obstacles {
            let Shape::Convex(hull) = &obstacle.body().shape else { continue };
            let base = (vertices.len() / 3) as i32;
            vertices.extend(hull.vertices_m.iter().flat_map(|v| v.to_array()));
            for face in &hull.faces {
                for k in 1..face.len() - 1 {
                    triangles.extend([face[0], face[k], face[k + 1]].map(|v| base + v as i32));
                }
            }
        }
        println!("{{\"yard\": \"{name}\", \"mesh_m\": {mesh_m}, \"triangles\": {}}}", triangles.len() / 3);
        write_f64(&dir.join(format!("{name}.vertices.f64")), vertices.into_iter())?;
        let bytes: Vec<u8> = triangles.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(dir.join(format!("{name}.triangles.i32")), bytes)
    }

    /// Rays and exact ranges of a sweep.
    fn write_sweep(&self, dir: &Path, exact: &Caster, sweep: &Sweep) -> std::io::Result<()> {
        let name = format!("{}.{}", self.yard.name, sweep.name);
        let mut hits = Vec::new();
        exact.from(self.origin_m, sweep.reach_m).cast(&sweep.dirs, &mut hits);
        let rays = sweep.dirs.iter().flat_map(|d| self.origin_m.to_array().into_iter().chain(d.to_array()));
        write_f64(&dir.join(format!("{name}.rays.f64")), rays)?;
        write_f64(&dir.join(format!("{name}.exact.f64")), hits.iter().map(|h| h.range_m))?;
        let ground = hits.iter().filter(|h| h.object == Hit::GROUND).count();
        let rocks = hits.iter().filter(|h| h.object >= 0).count();
        println!(
            "{{\"sweep\": \"{name}\", \"rays\": {}, \"ground\": {ground}, \"rocks\": {rocks}, \"reach_m\": {}}}",
            sweep.dirs.len(),
            sweep.reach_m
        );
        Ok(())
    }
}

fn write_f64(path: &Path, values: impl Iterator<Item = f64>) -> std::io::Result<()> {
    fs::write(path, values.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
}

fn main() -> std::io::Result<()> {
    let dir = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "target/cast_peer".into()));
    fs::create_dir_all(&dir)?;
    let peers: Vec<Peer> = YARDS.iter().filter(|yard| yard.rocks > 0).map(Peer::new).collect();
    let sweeps = sweeps();
    for peer in &peers {
        peer.write_mesh(&dir)?;
        let exact = Caster::new(&peer.scene, &Cast::Exact);
        sweeps.iter().try_for_each(|sweep| peer.write_sweep(&dir, &exact, sweep))?;
    }
    println!("ready");
    std::io::stdout().flush()?;
    // Prepared when first asked for: a mesh of two million triangles takes seconds.
    let mut casters: Vec<(String, Caster)> = Vec::new();
    let mut hits = Vec::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let [yard, task, method] = line.split_whitespace().collect::<Vec<_>>()[..] else { break };
        let Some(peer) = peers.iter().find(|peer| peer.yard.name == yard) else { break };
        let seconds = if task == "setup" {
            let begun = thread_cpu_s();
            let caster = peer.caster(method);
            let seconds = thread_cpu_s() - begun;
            drop(caster);
            seconds
        } else {
            let Some(sweep) = sweeps.iter().find(|sweep| sweep.name == task) else { break };
            let key = format!("{yard} {method}");
            if !casters.iter().any(|(known, _)| *known == key) {
                let Some(caster) = peer.caster(method) else { break };
                casters.push((key.clone(), caster));
            }
            let Some((_, caster)) = casters.iter().find(|(known, _)| *known == key) else { break };
            let begun = thread_cpu_s();
            caster.from(peer.origin_m, sweep.reach_m).cast(&sweep.dirs, &mut hits);
            thread_cpu_s() - begun
        };
        println!("{seconds:.9}");
        std::io::stdout().flush()?;
    }
    Ok(())
}
