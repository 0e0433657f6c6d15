//! Real scans -> cells with outputs and classes; labelled clouds, meshes, cost maps and tables for other tools.
//!
//! In: a [`Model`](crate::train::Model), [`Options`], and scans in the order they were taken: a [`Cloud`](crate::cloud::Cloud) and
//! the pose of each, or the sensor's height above the ground ([`level`](mod@crate::cells::level)). Out: a [`JudgedScan`] each, whose methods give the bytes of
//! the files that other tools read, in the frame `map`; a table of all cells; where the clouds carry labels, a
//! [`Report`](crate::evaluate::Report). Cells and features are made by the `cells` stage, by the code that makes a corpus. Units:
//! metres, radians. Source: Hewitt et al. 2017, "Neural network input types" and figures 12 and 14. Not modelled: motion during a scan
//! (undistort it first), several echoes a beam.
//!
//! ```
//! use marsyard::cloud::Cloud;
//! use marsyard::judge::{Options, PoseSource, ScanJudge, Shown};
//! # use std::path::Path;
//! # use marsyard::episode::{Prepared, Scratch, Unobserved, run_scene};
//! # use marsyard::geometry::Pose;
//! # use marsyard::train::{About, Activation, Layout, MODEL_FORMAT, Model, Network, Scaler};
//! # let plan = marsyard::config::load(Path::new("configs/quickstart.yaml"), &["cells.size_m=0.2".into()])?;
//! # let prepared = Prepared::new(plan)?.keeping_points();
//! # let model = {
//! #     // One neuron: untraversable from 0.1 m between a cell's lowest and highest point.
//! #     let (family, layout) = (&prepared.plan.families[0], Layout { inputs: 1, hidden: vec![1], bias: true, members: 1, activation: Activation::Logistic });
//! #     let about = About {
//! #         marsyard_model: MODEL_FORMAT,
//! #         inputs: 1,
//! #         hidden: vec![1],
//! #         bias: true,
//! #         members: 1,
//! #         activation: Activation::Logistic,
//! #         features: vec!["height_difference_m".into()],
//! #         scaler: Scaler { minus: vec![None], mean: vec![0.1], scale: vec![0.025], clip: 8.0, scores: Vec::new() },
//! #         quantiles: vec![[0.0, 0.0, 0.0, 0.02, 0.5, 1.0, 2.0]],
//! #         targets: [0.1, 0.9],
//! #         thresholds: vec![0.5],
//! #         cells: family.cells.clone(),
//! #         rover: (*family.drive.rover).clone(),
//! #         sensor: (*family.sweep.sensor).clone(),
//! #         mount: [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
//! #         corpus_ids: Vec::new(),
//! #         corpus_names: Vec::new(),
//! #         run: None,
//! #         learnt_from: Vec::new(),
//! #         calibration: None,
//! #         frames: Vec::new(),
//! #         overhangs_m: Vec::new(),
//! #         reach_m: None,
//! #         labels: None,
//! #     };
//! #     Model { network: Network { layout, weights: vec![1.0, 0.0, 4.0, -2.0] }, about, sha256: None }
//! # };
//! # let simulated = run_scene(&prepared, 3, &mut Scratch::default(), &mut Unobserved).scans.swap_remove(0);
//! # let sweep = simulated.points.expect("kept points");
//! # let returns = &sweep.sweep.returns;
//! # let points_m = (0..returns.status.len()).filter_map(|slot| returns.point_sensor(slot)).collect();
//! # let sensor = Pose::from_transform(&sweep.map_from_sensor);
//! // `model`: of your own, Model::read(Path::new("runs/quickstart-1/model.safetensors"))?
//! // `points_m`: of your own, cloud::read("scan.ply", &std::fs::read("scan.ply")?, None, &cloud::Options::default())?.points_m
//! let cloud = Cloud { points_m, ..Cloud::default() };
//! let options = Options { pose_source: PoseSource::Sensor, ..Options::default() };
//! let mut judge = ScanJudge::new(&model, options)?;
//! let judged = judge.scan("scan 0", cloud.clone(), Some(&sensor))?;
//! // The cells are those of the corpus that the scan was simulated for.
//! assert_eq!(judged.cells.cells.rows.len(), simulated.cells.rows.len());
//! let [traversable, untraversable] = [0, 1].map(|class| judged.cells.count(Some(class)));
//! assert!(untraversable > 0 && traversable > untraversable);
//! // Files for other tools, as bytes.
//! let cloud_file = judged.pcd(&judged.labelled_points());
//! let map = judged.cost_map("scan-cost.pgm", Shown::Output)?;
//! assert!(cloud_file.starts_with(b"# .PCD v0.7") && map.yaml.starts_with("image: scan-cost.pgm\nmode: raw\n"));
//! let table = judge.parquet("cells.parquet", std::slice::from_ref(&judged.cells))?;
//! assert!(table.starts_with(b"PAR1"));
//!
//! // No pose: the ground is found below the sensor.
//! let sensor_height_m = judged.scan.pose.map_from_sensor.translation_m.z - judged.cells.rover_z_m;
//! let options = Options { pose_source: PoseSource::Ground { sensor_height_m }, ..Options::default() };
//! let found = ScanJudge::new(&model, options)?.scan("scan 0", cloud, None)?.scan.levelled.expect("levelled");
//! assert!((found.height_m - sensor_height_m).abs() < 0.2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cells;
pub(crate) mod cost_map;
pub(crate) mod error;
pub(crate) mod export;
mod options;
mod own_body;
pub(crate) mod scale;
mod scan;
mod scan_judge;
#[cfg(test)]
mod tests;
pub(crate) mod training_range;

pub use crate::cells::ScanPose;
pub(crate) use crate::cells::frame::Sigmas;
pub use crate::cells::level::{Levelled, RivalGround};
pub use cells::JudgedCells;
pub(crate) use cells::class_names;
pub use cost_map::{CostMap, Shown};
pub use error::JudgeError;
pub use export::LabelledPoint;
pub(crate) use options::Setup;
pub use options::{Frame, Options, PoseSource};
pub use own_body::OwnBody;
pub use scan::{JudgedScan, PlacedScan};
pub use scan_judge::ScanJudge;
pub(crate) use training_range::Outside;
