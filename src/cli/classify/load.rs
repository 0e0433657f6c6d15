//! Arguments -> how to judge, and where each scan was taken; a cloud's path -> its points.

use std::path::{Path, PathBuf};

use super::args::{self, ClassifyArgs};
use crate::cli::{Failure, place};
use crate::cloud::{self, Cloud, CloudError, LabelMap, trajectory};
use crate::corpus::address;
use crate::corpus::limits::FileKind;
use crate::drive::rover::Mount;
use crate::geometry::{DVec3, Pose};
use crate::judge::{Frame, Options, OwnBody, PoseSource};
use crate::train::Model;

fn usage(error: impl std::fmt::Display) -> Failure {
    Failure::usage(miette::Report::msg(error.to_string()))
}

fn read_file(path: &Path, kind: FileKind) -> Result<Vec<u8>, Failure> {
    if address::is_url(path) {
        return place::read(path, kind);
    }
    kind.read_path(path).map_err(|source| unreadable(path, source))
}

/// Says what is wrong with a cloud's name before anything is judged.
pub(super) fn check_clouds(args: &ClassifyArgs) -> Result<(), Failure> {
    let mut local = args.clouds.iter().filter(|path| !address::is_url(path));
    local.try_for_each(|path| std::fs::metadata(path).map(|_| ()).map_err(|source| unreadable(path, source)))
}

fn unreadable(path: &Path, source: std::io::Error) -> Failure {
    let wrong = |source| usage(CloudError::Io { file: path.display().to_string(), source });
    place::named_failure(path, source, wrong)
}

fn read_text(path: &Path, kind: FileKind) -> Result<String, Failure> {
    Ok(String::from_utf8_lossy(&read_file(path, kind)?).into_owned())
}

/// What was chosen; the mapping of labels is read.
pub(super) fn options(args: &ClassifyArgs, model: &Model) -> Result<Options, Failure> {
    let labels = match &args.labels {
        Some(path) => {
            let text = read_text(path, FileKind::LabelMap)?;
            Some(LabelMap::parse(&path.display().to_string(), &text).map_err(usage)?)
        }
        None => None,
    };
    let mount =
        |[x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg]: [f64; 6]| Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg };
    let own_body = |[length_m, width_m, height_m]: [f64; 3]| OwnBody { length_m, width_m, height_m };
    Ok(Options {
        frame: match args.frame {
            args::Frame::Sensor => Frame::Sensor,
            args::Frame::Map => Frame::Map,
        },
        pose_source: match (args.sensor_height, args.pose_of) {
            (Some(sensor_height_m), _) => PoseSource::Ground { sensor_height_m },
            (None, args::PoseOf::Rover) => PoseSource::Rover,
            (None, args::PoseOf::Sensor) => PoseSource::Sensor,
        },
        mount: args.mount.map(mount),
        sigma_xy_m: args.sigma_xy,
        sigma_z_m: args.sigma_z,
        sigma_tilt_rad: args.sigma_tilt.map(f64::to_radians),
        sigma_yaw_rad: args.sigma_yaw.map(f64::to_radians),
        max_range_m: args.max_range,
        window: args.window,
        overhang_m: args.overhang,
        own_body: args.self_filter.map(|given| given.map_or_else(|| OwnBody::of_model(&model.about), own_body)),
        min_points: args.min_points,
        point: args.point.chosen(),
        labels,
    })
}

/// One pose a cloud; none where clouds are levelled.
pub(super) fn poses(args: &ClassifyArgs) -> Result<Vec<Pose>, Failure> {
    let tolerance_s = args.time_tolerance;
    if !(tolerance_s > 0.0 && tolerance_s.is_finite()) {
        return Err(usage(format!("--time-tolerance {tolerance_s}: must be a number above 0")));
    }
    if let Some(path) = &args.trajectory {
        let file = path.display().to_string();
        let stamped = trajectory::parse(&file, &read_text(path, FileKind::Trajectory)?).map_err(usage)?;
        let names: Vec<String> = args.clouds.iter().map(|path| bare_name(path)).collect();
        return trajectory::match_clouds(&file, &stamped, &names, tolerance_s).map_err(usage);
    }
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

/// Reads one cloud, with the labels beside it where they are asked for.
pub(super) fn cloud(args: &ClassifyArgs, path: &Path) -> Result<Cloud, Failure> {
    let bytes = read_file(path, FileKind::Cloud)?;
    let beside = if args.labels.is_some() { labels_beside(path)? } else { None };
    let label_bytes = beside.as_deref().map(|path| read_file(path, FileKind::Cloud)).transpose()?;
    let options = cloud::Options { label_field: args.label_field.clone() };
    cloud::read(&path.display().to_string(), &bytes, label_bytes.as_deref(), &options).map_err(usage)
}

/// All clouds by name, as a report calls them.
pub(super) fn names(clouds: &[PathBuf]) -> String {
    clouds.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

pub(super) fn label_file(args: &ClassifyArgs) -> String {
    args.labels.as_ref().map_or(String::new(), |path| path.display().to_string())
}

fn bare_name(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// The clouds' names in what is written: without their endings, fit for files and YAML, each once.
pub(super) fn stems(clouds: &[PathBuf]) -> Vec<String> {
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
fn labels_beside(path: &Path) -> Result<Option<PathBuf>, Failure> {
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
