//! The marsyard side of `scripts/peers/whole_pipeline.py`: yards of `configs/paper.yaml` as files, with the cells that belong to them.
//!
//! `pipeline_peer DIR SCENES` writes `directions.f64` (the sensor's beams) and per scene that can be made `K.json`: extent, the ground's
//! Legendre coefficients, the rocks' vertices, where the kept sweep's sensor and rover stood, and the cells of that sweep without
//! noise at the true pose. Prints the numbers of the scenes written, one a line.

use std::fs;
use std::path::PathBuf;

use marsyard::cells::{Label, feature_columns};
use marsyard::config;
use marsyard::episode::{Prepared, Replay, Scratch, Unobserved, replay_scene};
use marsyard::scene::{Ground, Shape};
use serde_json::{Value, json};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().collect();
    let [_, dir, scenes] = &words[..] else { return Err("usage: pipeline_peer DIR SCENES".into()) };
    let dir = PathBuf::from(dir);
    fs::create_dir_all(&dir)?;
    let sets = ["slam=truth", "sweep.effects={}", "drive.contact=gauss_newton"].map(String::from);
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
    let plan = config::load(&path, &sets)?;
    // What the peer has to add, of the config as it is.
    let noise = json!(config::load(&path, &[])?.family_of(0).sweep.effects.range_noise);
    let prepared = Prepared::new(plan)?;
    let directions = prepared.pattern(0).directions.iter().flat_map(|d| d.to_array());
    fs::write(dir.join("directions.f64"), directions.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())?;
    let mut scratch = Scratch::default();
    for scene in 0..scenes.parse()? {
        let Ok(replay) = replay_scene(&prepared, scene, &mut scratch, &mut Unobserved) else { continue };
        fs::write(dir.join(format!("{scene}.json")), described(&prepared, &replay, &noise).to_string())?;
        println!("{scene}");
    }
    Ok(())
}

fn described(prepared: &Prepared, replay: &Replay, noise: &Value) -> Value {
    let family = prepared.plan.family_of(0);
    let Ground::Polynomial(ground) = &replay.scene.ground else { unreachable!("the paper's grounds are polynomials") };
    let rocks = replay.scene.obstacles.iter().filter_map(|obstacle| match &obstacle.body().shape {
        Shape::Convex(body) => Some(body.vertices_m.iter().map(|v| v.to_array()).collect::<Vec<_>>()),
        Shape::Cylinder(_) => None,
    });
    let rover = replay.drive.truth[*replay.drive.stops.last().expect("a drive has a stop")];
    let sensor = rover.transform() * replay.rover_from_sensor;
    let cells = &replay.scans.last().expect("the last sweep is kept").cells;
    let width = feature_columns(&family.cells, false).len();
    json!({
        "extent_m": replay.scene.extent_m,
        "degree": ground.degree,
        "half_m": ground.half_m,
        "coefficients": ground.coefficients,
        "rocks": rocks.collect::<Vec<_>>(),
        // Rows of the matrix that takes sensor directions to the world.
        "world_from_sensor": sensor.rotation.transpose().to_cols_array_2d(),
        "sensor_m": sensor.translation_m.to_array(),
        "rover_z_m": rover.position_m.z,
        "pitch_rad": rover.pitch_rad,
        "roll_rad": rover.roll_rad,
        "cell_m": family.cells.size_m,
        "max_range_m": family.cells.max_range_m,
        "sensor_range_m": [family.sweep.sensor.min_range_m, family.sweep.sensor.max_range_m],
        "range_noise": noise,
        "cells": cells.rows.iter().map(|row| (row.index.row, row.index.col, row.label.map(Label::number), row.points)).collect::<Vec<_>>(),
        "features": cells.features.chunks(width).map(|row| &row[..14]).collect::<Vec<_>>(),
    })
}
