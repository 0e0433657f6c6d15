//! Arguments and a model -> how to classify; a cloud's path -> its points and its place.

use std::path::{Path, PathBuf};

use super::args::{ClassifyArgs, Frame, PoseOf};
use crate::cells::{FeatureColumn, WindowCloud, feature_columns};
use crate::cli::output::errln;
use crate::cli::{Failure, place};
use crate::cloud::scan_pose::{ScanPose, Sigmas};
use crate::cloud::{self, Cloud, CloudError, LabelMap, Levelled, level, trajectory};
use crate::corpus::address;
use crate::corpus::limits::FileKind;
use crate::drive::rover::Mount;
use crate::geometry::{DVec3, Pose, Transform};
use crate::train::Model;

/// Poses lie no farther from the map's origin: the Earth's own coordinates do not, and so far out doubles still tell 0.02 um.
const FARTHEST_M: f64 = 1e8;

/// What holds for all clouds.
pub(super) struct Setup {
    pub window: usize,
    pub max_range_m: f64,
    pub in_map: bool,
    /// The model takes intensities.
    pub intensity: bool,
    /// The columns that are computed, and where among them the model's inputs stand.
    pub features: Vec<FeatureColumn>,
    pub inputs: Vec<usize>,
    pub labels: Option<LabelMap>,
    pub label_file: String,
    pub sigmas: Sigmas,
    rover_from_sensor: Transform,
    /// One a cloud; empty where clouds are levelled.
    poses: Vec<Pose>,
    stems: Vec<String>,
}

/// One cloud, ready to be binned.
pub(super) struct Loaded {
    pub name: String,
    pub stem: String,
    pub cloud: Cloud,
    /// Points at the sensor's own place, which are no returns.
    pub at_sensor: u64,
    pub place: ScanPose,
    pub levelled: Option<Levelled>,
    pub verdicts: Option<Vec<Option<bool>>>,
}

impl Loaded {
    pub(super) fn as_cloud(&self, setup: &Setup) -> WindowCloud<'_> {
        WindowCloud {
            points_m: &self.cloud.points_m,
            in_map: setup.in_map,
            intensity: self.cloud.intensity.as_deref().filter(|_| setup.intensity),
            obstacle: self.verdicts.as_deref(),
            estimate: &self.place.estimate,
            map_from_sensor: self.place.map_from_sensor,
        }
    }
}

fn usage(error: impl std::fmt::Display) -> Failure {
    Failure::usage(miette::Report::msg(error.to_string()))
}

fn read_file(path: &Path, kind: FileKind) -> Result<Vec<u8>, Failure> {
    if address::is_url(path) {
        return place::read(path, kind);
    }
    let wrong = |source| usage(CloudError::Io { file: path.display().to_string(), source });
    kind.read_path(path).map_err(|source| place::named_failure(path, source, wrong))
}

fn read_text(path: &Path, kind: FileKind) -> Result<String, Failure> {
    Ok(String::from_utf8_lossy(&read_file(path, kind)?).into_owned())
}

impl Setup {
    pub(super) fn of(args: &ClassifyArgs, model: &Model) -> Result<Setup, Failure> {
        let about = &model.about;
        let intensity = about.features.iter().any(|name| name.starts_with("intensity"));
        let features = feature_columns(&about.cells, intensity);
        let names: Vec<&str> = features.iter().map(|column| column.name.as_str()).collect();
        let inputs = model.inputs_of(&names).map_err(usage)?;
        let max_range_m = args.max_range.or(about.cells.max_range_m).unwrap_or(about.sensor.max_range_m);
        let positive = [("--max-range", max_range_m), ("--time-tolerance", args.time_tolerance)];
        if let Some((flag, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(usage(format!("{flag} {value}: must be a number above 0")));
        }
        let [x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg] = args.mount.unwrap_or(about.mount);
        let mount = Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg };
        let stems = stems(&args.clouds);
        let poses = match &args.trajectory {
            Some(path) => {
                let file = path.display().to_string();
                let stamped = trajectory::parse(&file, &read_text(path, FileKind::Trajectory)?).map_err(usage)?;
                let names: Vec<String> = args.clouds.iter().map(|path| bare_name(path)).collect();
                trajectory::match_clouds(&file, &stamped, &names, args.time_tolerance).map_err(usage)?
            }
            None => poses_of(args)?,
        };
        let labels = match &args.labels {
            Some(path) => Some(
                LabelMap::parse(&path.display().to_string(), &read_text(path, FileKind::LabelMap)?).map_err(usage)?,
            ),
            None => None,
        };
        if let Some(pose) = poses.iter().find(|pose| pose.position_m.abs().max_element() > FARTHEST_M) {
            return Err(usage(format!(
                "a pose at {}: positions lie within {FARTHEST_M:e} m of the map's origin; subtract the origin, or mend the unit",
                pose.position_m
            )));
        }
        Ok(Setup {
            window: window(args, model)?,
            max_range_m,
            in_map: args.frame == Frame::Map,
            intensity,
            features,
            inputs,
            labels,
            label_file: args.labels.as_ref().map_or(String::new(), |path| path.display().to_string()),
            rover_from_sensor: mount.rover_from_sensor(),
            sigmas: sigmas(args, model)?,
            poses,
            stems,
        })
    }

    /// The clouds' names in what is written, one a cloud.
    pub(super) fn stems(&self) -> &[String] {
        &self.stems
    }

    /// Reads one cloud and finds its place.
    pub(super) fn load(
        &self,
        args: &ClassifyArgs,
        model: &Model,
        number: usize,
        path: &Path,
    ) -> Result<Loaded, Failure> {
        let name = path.display().to_string();
        let bytes = read_file(path, FileKind::Cloud)?;
        let beside = if self.labels.is_some() { label_file(path)? } else { None };
        let label_bytes = beside.as_deref().map(|path| read_file(path, FileKind::Cloud)).transpose()?;
        let options = cloud::Options { label_field: args.label_field.clone() };
        let mut cloud = cloud::read(&name, &bytes, label_bytes.as_deref(), &options).map_err(usage)?;
        let at_sensor = if self.in_map { 0 } else { cloud.drop_at(DVec3::ZERO) };
        if cloud.points_m.is_empty() {
            return Err(usage(CloudError::NoPoints { file: name, not_finite: cloud.not_finite }));
        }
        if self.intensity && cloud.intensity.is_none() {
            return Err(usage(format!(
                "{name}: the model takes {}, and the cloud has no intensities; export them with the cloud, or use a model \
                 without them",
                model
                    .about
                    .features
                    .iter()
                    .filter(|f| f.starts_with("intensity"))
                    .cloned()
                    .collect::<Vec<_>>()
                    .join(", ")
            )));
        }
        let verdicts = match (&self.labels, &cloud.labels) {
            (Some(map), Some(labels)) => Some(map.verdicts(&name, labels).map_err(usage)?),
            (Some(_), None) => {
                return Err(usage(format!(
                    "{name}: there are no labels in it to judge the model by; name their column with --label-field, put a \
                     .label file beside a KITTI scan, or leave out --labels"
                )));
            }
            (None, _) => None,
        };
        let mut levelled = None;
        let place = match (args.sensor_height, self.poses.get(number)) {
            (Some(height_m), _) => {
                let found = level::level(&name, &cloud.points_m, height_m).map_err(usage)?;
                levelled = Some(found);
                let rover = ScanPose::of_rover(&found.rover(), &self.rover_from_sensor, &self.sigmas);
                ScanPose { map_from_sensor: found.map_from_sensor, ..rover }
            }
            (None, Some(pose)) if args.pose_of == PoseOf::Sensor => {
                ScanPose::of_sensor(pose, &self.rover_from_sensor, &self.sigmas)
            }
            (None, Some(pose)) => ScanPose::of_rover(pose, &self.rover_from_sensor, &self.sigmas),
            (None, None) => return Err(usage(format!("{name}: there is no pose for it"))),
        };
        Ok(Loaded { name, stem: self.stems[number].clone(), cloud, at_sensor, place, levelled, verdicts })
    }
}

/// One pose for all, or one a cloud; none where clouds are levelled.
fn poses_of(args: &ClassifyArgs) -> Result<Vec<Pose>, Failure> {
    let pose = |[x, y, z, roll, pitch, yaw]: &[f64; 6]| Pose {
        position_m: DVec3::new(*x, *y, *z),
        roll_rad: roll.to_radians(),
        pitch_rad: pitch.to_radians(),
        yaw_rad: crate::math::wrap_angle(yaw.to_radians()),
    };
    match (args.pose.len(), args.clouds.len()) {
        (1, clouds) => Ok(vec![pose(&args.pose[0]); clouds]),
        (poses, clouds) if poses == clouds || poses == 0 => Ok(args.pose.iter().map(pose).collect()),
        (poses, clouds) => {
            Err(usage(format!("{poses} times --pose for {clouds} clouds: give one for all, or one a cloud")))
        }
    }
}

fn window(args: &ClassifyArgs, model: &Model) -> Result<usize, Failure> {
    let trained = model.about.cells.window_scans;
    if args.sensor_height.is_some() {
        if args.window.is_some_and(|window| window > 1) {
            return Err(usage(
                "--window needs poses: with --sensor-height each scan has a frame of its own; give --trajectory or --pose",
            ));
        }
        if trained > 1 {
            errln!(
                "warning: the model was trained on windows of {trained} scans; without poses each scan is judged alone"
            );
        }
        return Ok(1);
    }
    match args.window.unwrap_or(trained) {
        0 => Err(usage("--window 0: at least 1")),
        window => Ok(window as usize),
    }
}

/// What is given; else the median of the model's training; else 0.
fn sigmas(args: &ClassifyArgs, model: &Model) -> Result<Sigmas, Failure> {
    let about = &model.about;
    let median = |name: &str| {
        let place = about.features.iter().position(|feature| feature == name);
        place.map_or(0.0, |place| about.quantiles[place][3])
    };
    let or_median =
        |given: Option<f64>, scale: f64, name: &str| given.map_or_else(|| median(name), |value| value * scale);
    let to_rad = 1f64.to_radians();
    let sigmas = Sigmas {
        xy_m: or_median(args.sigma_xy, 1.0, "sigma_x_m"),
        z_m: or_median(args.sigma_z, 1.0, "sigma_z_m"),
        tilt_rad: or_median(args.sigma_tilt, to_rad, "sigma_pitch_rad"),
        yaw_rad: or_median(args.sigma_yaw, to_rad, "sigma_yaw_rad"),
    };
    let all = [sigmas.xy_m, sigmas.z_m, sigmas.tilt_rad, sigmas.yaw_rad];
    if all.iter().all(|sigma| (0.0..1e6).contains(sigma)) {
        return Ok(sigmas);
    }
    Err(usage("a --sigma is negative or not finite: standard deviations are 0 or more"))
}

fn bare_name(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Names fit for files and YAML, each once.
fn stems(clouds: &[PathBuf]) -> Vec<String> {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' };
    let mut stems: Vec<String> = Vec::new();
    for path in clouds {
        let stem: String = bare_name(path).chars().map(plain).collect();
        let free = |name: &String| !stems.contains(name);
        let numbered = (2..).map(|k| format!("{stem}-{k}"));
        let name = std::iter::once(stem.clone()).chain(numbered).find(free);
        stems.extend(name);
    }
    stems
}

/// A KITTI scan's labels: beside it, or in `labels/` beside its folder (SemanticKITTI).
fn label_file(path: &Path) -> Result<Option<PathBuf>, Failure> {
    if cloud::Format::of(&path.to_string_lossy()).ok() != Some(cloud::Format::Kitti) {
        return Ok(None);
    }
    let beside = path.with_extension("label");
    let above = path.parent().and_then(Path::parent).zip(beside.file_name());
    let apart = above.map(|(above, name)| above.join("labels").join(name));
    for file in [Some(beside), apart].into_iter().flatten() {
        if place::is_file(&file)? {
            return Ok(Some(file));
        }
    }
    Ok(None)
}
