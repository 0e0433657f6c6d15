//! The files of a recording's sweeps -> returns, one at a time, and counts of what was left out of them.

use std::path::{Path, PathBuf};

use super::args::LocaliseArgs;
use crate::cli::Failure;
use crate::cloud::{self, Cloud, CloudError};
use crate::corpus::limits::FileKind;
use crate::geometry::{DVec3, Transform};
use crate::judge::OwnBody;
use crate::recording::{self, Observation, Recording, SweepPoints};
use crate::sweep::Returns;

/// Points of all sweeps that were read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SweepsRead {
    pub(super) points: u64,
    pub(super) not_finite: u64,
    pub(super) at_sensor: u64,
    pub(super) on_rover: u64,
    /// Sweeps in whose files there is no point.
    pub(super) empty: u64,
}

/// Reads sweeps where their list names them.
pub(super) struct SweepReader<'a> {
    args: &'a LocaliseArgs,
    rover_from_sensor: Transform,
    pub(super) read: SweepsRead,
}

impl<'a> SweepReader<'a> {
    pub(super) fn new(args: &'a LocaliseArgs, rover_from_sensor: Transform) -> SweepReader<'a> {
        SweepReader { args, rover_from_sensor, read: SweepsRead::default() }
    }

    /// The returns of one sweep; one in which nothing was met tells nothing, and is counted.
    pub(super) fn returns(&mut self, name: &str) -> Result<Returns, Failure> {
        let cloud = match cloud(&path(self.args, name)) {
            Err(CloudError::NoPoints { not_finite, .. }) => {
                self.read.empty += 1;
                Cloud { not_finite, ..Cloud::default() }
            }
            read => read.map_err(|fault| Failure::usage(miette::Report::msg(fault.to_string())))?,
        };
        let body = self.args.self_filter.map(|[length_m, width_m, height_m]| OwnBody { length_m, width_m, height_m });
        let is_own = |point_m: DVec3| body.is_some_and(|body| body.holds(self.rover_from_sensor.point(point_m)));
        let SweepPoints { returns, no_return, own } = recording::returns_of_points(&cloud.points_m, is_own);
        self.read.points += cloud.points_m.len() as u64 + cloud.not_finite;
        self.read.not_finite += cloud.not_finite;
        self.read.at_sensor += no_return;
        self.read.on_rover += own;
        Ok(returns)
    }
}

fn cloud(path: &Path) -> Result<Cloud, CloudError> {
    let file = path.display().to_string();
    let unreadable = |source| CloudError::Io { file: file.clone(), source };
    let bytes = FileKind::Cloud.read_path(path).map_err(unreadable)?;
    cloud::read(&file, &bytes, None, &cloud::Options::default())
}

/// Where a sweep lies: names are relative to the list that they stand in.
fn path(args: &LocaliseArgs, name: &str) -> PathBuf {
    let folder = args.sweeps.as_deref().and_then(Path::parent);
    folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name))
}

/// The files of all sweeps. What is missing, or of no format that is read, is told before anything is located.
pub(super) fn files(args: &LocaliseArgs, recording: &Recording) -> Result<Vec<PathBuf>, Failure> {
    let Some(list) = &args.sweeps else { return Ok(Vec::new()) };
    let mut files = Vec::new();
    for (name, line) in named(recording) {
        let path = path(args, name);
        let fault = |what: &str, cure: &str| {
            let place = format!("{}:{line}", list.display());
            Failure::usage(miette::miette!(help = cure, "{place}: {}: {what}", path.display()))
        };
        if !path.is_file() {
            let cure = "name a sweep's file, by its whole path or by that from the list's folder";
            return Err(fault("there is no such file", cure));
        }
        cloud::Format::of(name).map_err(|unknown| fault(&unknown.to_string(), "name clouds of these formats"))?;
        files.push(path);
    }
    Ok(files)
}

/// The sweeps' files and the lines that name them.
fn named(recording: &Recording) -> impl Iterator<Item = (&str, u64)> {
    recording.observations.iter().filter_map(|(_, observation)| match observation {
        Observation::Sweep { file, line } => Some((file.as_str(), *line)),
        Observation::Features(_) => None,
    })
}
