//! Pictures, a cloud and trajectories of one scene.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};

use super::Failure;
use super::options::{check_scene, plan_of};
use super::output::{errln, outln};
use super::place::{self, corpus_failure, inputs, must_be_local};
use crate::cells::CellFrame;
use crate::corpus::Outputs;
use crate::episode::{Prepared, Scratch, Unobserved, replay_scene};
use crate::geometry::Pose;
use crate::picture::{self, Overlay, Perspective, View};
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
    /// Make only these, separated by commas; default: all.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PRODUCTS")]
    only: Vec<Product>,
    /// Folder for the files.
    #[arg(long, default_value = "preview")]
    out: PathBuf,
    /// Override a key of a config.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

/// What is made of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Product {
    /// The yard from above, with the drive (PNG).
    Top,
    /// The rover in the yard, with the points of its sweep (PNG).
    Perspective,
    /// The same with the labelled cells (PNG).
    Cells,
    /// The sweep as the sensor sees it (PNG).
    Scan,
    /// The sweep's points with class and label (PLY).
    Cloud,
    /// The true trajectory (TUM).
    Truth,
    /// The estimated trajectory (TUM).
    Estimate,
}

impl Product {
    /// Behind `scene-K-`.
    fn file(self) -> &'static str {
        match self {
            Product::Top => "top.png",
            Product::Perspective => "perspective.png",
            Product::Cells => "cells.png",
            Product::Scan => "scan.png",
            Product::Cloud => "cloud.ply",
            Product::Truth => "truth.tum",
            Product::Estimate => "estimate.tum",
        }
    }
}

pub(super) fn run(args: &PreviewArgs) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let (plan, corpus) = plan_of(&args.place, &args.sets)?;
    corpus.map_or(Ok(()), place::check_if_finished)?;
    check_scene(&plan, args.scene)?;
    let is_asked = |product: &&Product| args.only.is_empty() || args.only.contains(product);
    let products: Vec<Product> = Product::value_variants().iter().filter(is_asked).copied().collect();
    let names: Vec<String> =
        products.iter().map(|product| format!("scene-{}-{}", args.scene, product.file())).collect();
    let mut outputs =
        Outputs::open(&args.out, names.iter().map(String::as_str), inputs(&args.place)).map_err(corpus_failure)?;
    let started = Instant::now();
    let prepared = Prepared::new(plan).map_err(Failure::failed)?.keeping_points();
    let replay = replay_scene(&prepared, args.scene, &mut Scratch::default(), &mut Unobserved)
        .map_err(|e| Failure::failed(format!("scene {}: {e}", args.scene)))?;
    let scan = super::explain::pick_scan(&replay, args.scan)?;
    let family = &prepared.plan.families[replay.family];
    let points = scan.points.as_ref().expect("preview keeps the sweeps");
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
        map_from_sensor: points.map_from_sensor,
        levelled: family.cells.frame == CellFrame::FittedPlane,
        sweep: &points.sweep,
        hanging: &points.hanging,
        cells: &scan.cells,
        cell_size_m: family.cells.size_m,
    };
    let caster = Caster::new(&replay.scene, &Cast::Exact);
    let trajectory = |pose: fn(&crate::episode::PoseRow) -> &Pose| {
        slam::tum(replay.poses.iter().map(|row| (row.time_s, pose(row)))).into_bytes()
    };
    // What the camera sees serves both of its pictures.
    let (mut perspective, seen) = (None, || Perspective::new(&view, &caster));
    errln!("scene {}: made in {:.1} s", args.scene, started.elapsed().as_secs_f64());
    for (product, name) in products.into_iter().zip(names) {
        let started = Instant::now();
        let bytes = match product {
            Product::Top => picture::top_view(&view),
            Product::Perspective => perspective.get_or_insert_with(seen).png(Overlay::Points),
            Product::Cells => perspective.get_or_insert_with(seen).png(Overlay::Cells),
            Product::Scan => picture::scan_view(&view),
            Product::Cloud => picture::labelled_cloud(&view),
            Product::Truth => trajectory(|row| &row.truth),
            Product::Estimate => trajectory(|row| &row.estimate.pose),
        };
        let path = args.out.join(&name);
        outputs.write(&[(name, bytes)]).map_err(corpus_failure)?;
        errln!("{}: {:.1} s", product.file(), started.elapsed().as_secs_f64());
        outln!("{}", path.display());
    }
    outputs.finish().map_err(corpus_failure)
}
