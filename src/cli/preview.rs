//! Pictures, a cloud and trajectories of one scene.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::explain::{check_scene, plan_of};
use super::output::outln;
use super::place::{self, corpus_failure, inputs, must_be_local};
use crate::corpus::Outputs;
use crate::episode::{Prepared, Scratch, Unobserved, replay_scene};
use crate::geometry::Pose;
use crate::picture::{self, Overlay, View};
use crate::slam;
use crate::sweep::Caster;
use crate::sweep::params::Cast;

#[derive(Debug, Args)]
pub(super) struct PreviewArgs {
    /// A config, a plan.yaml, or the folder or URL of a corpus.
    place: PathBuf,
    /// Number of the scene.
    #[arg(long)]
    scene: u64,
    /// Number of the scan (the stop); default: the last kept one.
    #[arg(long)]
    scan: Option<u32>,
    /// Folder for the files.
    #[arg(long, default_value = "preview")]
    out: PathBuf,
    /// Override a key of a config.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

pub(super) fn run(args: &PreviewArgs) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let (plan, corpus) = plan_of(&args.place, &args.sets)?;
    corpus.map_or(Ok(()), place::check_if_finished)?;
    check_scene(&plan, args.scene)?;
    let names = FILES.map(|file| format!("scene-{}-{file}", args.scene));
    let mut outputs =
        Outputs::open(&args.out, names.iter().map(String::as_str), inputs(&args.place)).map_err(corpus_failure)?;
    let prepared = Prepared::new(plan).map_err(Failure::failed)?.keeping_points();
    let replay = replay_scene(&prepared, args.scene, &mut Scratch::default(), &mut Unobserved)
        .map_err(|e| Failure::failed(format!("scene {}: {e}", args.scene)))?;
    let scan = super::explain::pick_scan(&replay, args.scan)?;
    let family = &prepared.plan.families[replay.family];
    let until =
        replay.poses.iter().position(|row| row.scan_id == Some(scan.scan_id)).expect("kept scans have a pose row");
    let truth: Vec<Pose> = replay.poses[..=until].iter().map(|row| row.truth).collect();
    let estimates: Vec<Pose> = replay.poses[..=until].iter().map(|row| row.estimate.pose).collect();
    let view = View {
        title: &format!("{}, scene {}, scan {}", prepared.plan.name, args.scene, scan.scan_id),
        scene: &replay.scene,
        rover: &family.drive.rover,
        truth: &truth,
        estimates: &estimates,
        rover_from_sensor: replay.rover_from_sensor,
        sweep: &scan.points.as_ref().expect("preview keeps the sweeps").sweep,
        cells: &scan.cells,
        cell_size_m: family.cells.size_m,
    };
    let caster = Caster::new(&replay.scene, &Cast::Exact);
    let trajectory = |pose: fn(&crate::episode::PoseRow) -> &Pose| {
        slam::tum(replay.poses.iter().map(|row| (row.time_s, pose(row)))).into_bytes()
    };
    let bytes = [
        picture::top_view(&view),
        picture::perspective(&view, &caster, Overlay::Points),
        picture::perspective(&view, &caster, Overlay::Cells),
        picture::scan_view(&view),
        picture::labelled_cloud(&view),
        trajectory(|row| &row.truth),
        trajectory(|row| &row.estimate.pose),
    ];
    let files: Vec<(String, Vec<u8>)> = names.into_iter().zip(bytes).collect();
    outputs.write(&files).map_err(corpus_failure)?;
    outputs.finish().map_err(corpus_failure)?;
    files.iter().for_each(|(name, _)| outln!("{}", args.out.join(name).display()));
    Ok(())
}

/// What is written of a scene, each behind `scene-K-`.
const FILES: [&str; 7] =
    ["top.png", "perspective.png", "cells.png", "scan.png", "cloud.ply", "truth.tum", "estimate.tum"];
