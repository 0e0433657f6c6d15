//! A recorded drive as CSV -> its trajectory (TUM), map and covariances; with a truth, how good they are.

mod args;
mod report;
mod sweeps;

use std::path::Path;

pub(super) use args::LocaliseArgs;
use sweeps::SweepReader;

use super::output::errln;
use super::place::{corpus_failure, fault_words, must_be_local};
use super::progress::LocaliseProgress;
use super::{Failure, LogFormat};
use crate::corpus::limits::FileKind;
use crate::corpus::outputs::Outputs;
use crate::drive::rover::Mount;
use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{DVec3, Pose, Transform};
use crate::recording::{
    self, LocateParams, Located, Observation, Recording, RecordingError, Score, SightLog, Step, read,
};
use crate::slam::{self, FastslamParams, RegistrationParams, SlamError, SlamParams};

/// What the files are, and a first try.
pub(super) const FILES: &str = "\
Files are CSV with a header, columns in any order, seconds of one clock, metres, radians; a line
that begins with # is a comment.
Odometry:  time_s, speed_mps, yaw_rate_radps, each over the step that ends at its time; where there
           are such instruments roll_rad, pitch_rad, yaw_rad (empty: no reading). Without roll and
           pitch the drive is level.
Features:  time_s, range_m, bearing_rad from the sensor (x forward, y left); where known
           elevation_rad, id, and the row's own noise: range_sigma_m, bearing_sigma_rad,
           elevation_sigma_rad (empty: that of the options).
Sweeps:    time_s, file (PLY, PCD, LAS, CSV / XYZ or KITTI .bin, points in the sensor's frame, one
           pose a sweep; names relative to the list).
Truth:     time_s, x_m, y_m, yaw_rad; z_m, roll_rad, pitch_rad.

Try it:  marsyard localise examples/logs/odometry.csv --features examples/logs/features.csv --truth examples/logs/truth.csv --out located
Sweeps:  marsyard localise odometry.csv --sweeps sweeps.csv --sensor 0.2,0,0.9 --out located
         marsyard classify runs/mixed scans/*.bin --trajectory located/sweeps.tum --mount 0.2,0,0.9,0,0,0
         (clouds in the order of the list, or named by their times)
Writes:  trajectory.tum, covariance.csv (a row a step), landmarks.csv; with --sweeps also sweeps.tum (a row a sweep)

marsyard writes into a place that is empty, not there yet, or its own; it never replaces a file that it did not write, nor its own input";

const TRAJECTORY: &str = "trajectory.tum";
const COVARIANCE: &str = "covariance.csv";
const LANDMARKS: &str = "landmarks.csv";
const SWEEPS: &str = "sweeps.tum";

pub(super) fn run(args: &LocaliseArgs, log: LogFormat) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let mut recording = recorded(args)?;
    if args.unknown_ids {
        recording.observations.iter_mut().for_each(|(_, observation)| forget_ids(observation));
    }
    let truth = match &args.truth {
        Some(path) => Some(read::truth(&path.display().to_string(), &text(path)?).map_err(bad)?),
        None => None,
    };
    let start = start(args, truth.as_deref(), &recording)?;
    let inputs = [Some(&args.odometry), args.features.as_ref(), args.sweeps.as_ref(), args.truth.as_ref()];
    let inputs = inputs.into_iter().flatten().cloned().chain(sweeps::files(args, &recording)?).collect();
    let names = [TRAJECTORY, COVARIANCE, LANDMARKS].into_iter().chain(args.sweeps.as_ref().map(|_| SWEEPS));
    let mut outputs = Outputs::open(&args.out, names, inputs).map_err(corpus_failure)?;
    let reckoning = dead_reckoning_params(args, start);
    let mut reader = SweepReader::new(args, reckoning.rover_from_sensor);
    let reckoned = recording::locate(&recording, &reckoning, |name| reader.returns(name), |_, _| {})?;
    let located = match args.features.as_ref().or(args.sweeps.as_ref()) {
        None => reckoned.clone(),
        Some(_) => {
            let params = LocateParams { slam: corrected(args, &recording), ..reckoning };
            let mut progress = LocaliseProgress::new(log);
            let each_step = |done, of| progress.take(done, of);
            let located = recording::locate(&recording, &params, |name| reader.returns(name), each_step);
            progress.finish();
            located?
        }
    };
    let at_sweeps = located.sweep_steps.iter().map(|&step| &located.steps[step]);
    let files: Vec<(String, Vec<u8>)> = [
        (TRAJECTORY, slam::tum(located.steps.iter().map(stamped))),
        (COVARIANCE, report::covariances(&located.steps)),
        (LANDMARKS, report::landmarks(&located)),
    ]
    .into_iter()
    .chain(args.sweeps.as_ref().map(|_| (SWEEPS, slam::tum(at_sweeps.map(stamped)))))
    .map(|(name, text)| (name.to_string(), text.into_bytes()))
    .collect();
    let scores = match &truth {
        None => None,
        Some(truth) => Some(scored(&located, truth).zip(scored(&reckoned, truth)).ok_or_else(|| {
            let help = "bring the truth and the odometry to one clock";
            Failure::usage(miette::miette!(help = help, "--truth: it covers no step of the odometry"))
        })?),
    };
    outputs.write(&files).map_err(corpus_failure)?;
    outputs.finish().map_err(corpus_failure)?;
    files.iter().for_each(|(name, _)| errln!("{}", args.out.join(name).display()));
    if args.slip > 0.0 && args.motion_inflation > 1.0 {
        errln!(
            "warning: the filter learns the slip of --slip, and --motion-inflation {} allows for it again: leave the one or the other out",
            args.motion_inflation
        );
    }
    let of_sweeps = args.out.join(SWEEPS);
    if args.sweeps.is_none() && of_sweeps.exists() {
        errln!("warning: {} was there before, and is of another run: this one read no sweeps", of_sweeps.display());
    }
    if args.sweeps.is_some() && located.sweeps_found_again == 0 {
        errln!(
            "warning: no sweep showed again what an earlier one had shown, so that the poses are dead reckoning's: look at --sensor and \
             --self-filter, and give a larger --feature-range-m or sweeps that are closer"
        );
    }
    report::report(args, &located, scores, &reader.read);
    Ok(())
}

fn forget_ids(observation: &mut Observation) {
    if let Observation::Features(features) = observation {
        features.iter_mut().for_each(|feature| feature.known = None);
    }
}

fn stamped(step: &Step) -> (f64, &Pose) {
    (step.time_s, &step.estimate.pose)
}

fn rover_from_sensor(args: &LocaliseArgs) -> Transform {
    let [x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg] = args.sensor.unwrap_or_default();
    Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg }.rover_from_sensor()
}

fn recorded(args: &LocaliseArgs) -> Result<Recording, Failure> {
    let odometry = (args.odometry.display().to_string(), text(&args.odometry)?);
    let log = |path: &Path| Ok::<_, Failure>((path.display().to_string(), text(path)?));
    let features = args.features.as_deref().map(log).transpose()?;
    let sweeps = args.sweeps.as_deref().map(log).transpose()?;
    let sights = features
        .as_ref()
        .map(|(file, text)| SightLog::Features { file, text })
        .or(sweeps.as_ref().map(|(file, text)| SightLog::Sweeps { file, text }));
    Recording::read((&odometry.0, &odometry.1), sights).map_err(bad)
}

fn text(path: &Path) -> Result<String, Failure> {
    let read = FileKind::Trajectory.read_path(path).and_then(|bytes| {
        String::from_utf8(bytes)
            .map_err(|fault| std::io::Error::new(std::io::ErrorKind::InvalidData, fault.utf8_error()))
    });
    read.map_err(|fault| Failure::usage(miette::miette!("{} cannot be read: {}", path.display(), fault_words(&fault))))
}

impl From<SlamError> for Failure {
    fn from(error: SlamError) -> Failure {
        Failure::failed(error)
    }
}

fn bad(error: RecordingError) -> Failure {
    Failure::usage(miette::Report::msg(error.to_string()))
}

fn start(args: &LocaliseArgs, truth: Option<&[read::TruePose]>, recording: &Recording) -> Result<Pose, Failure> {
    let begun = recording.readings.first();
    let begun_at = |truth| begun.and_then(|&(time_s, _)| recording::truth_at(truth, time_s));
    let of_truth = truth.and_then(|truth| begun_at(truth).or_else(|| truth.first().map(|row| row.pose)));
    let Some(pose) = of_truth else { return start_without_truth(args, recording) };
    Ok(told_start(args, pose).unwrap_or(pose))
}

/// Where `--start` stands; its height, roll and pitch are those of `otherwise`.
fn told_start(args: &LocaliseArgs, otherwise: Pose) -> Option<Pose> {
    let [x_m, y_m, yaw_deg] = args.start?;
    let position_m = DVec3::new(x_m, y_m, otherwise.position_m.z);
    Some(Pose { position_m, yaw_rad: yaw_deg.to_radians(), ..otherwise })
}

/// Angles that nobody tells are believed to be 0, and readings that say otherwise would be gated.
fn start_without_truth(args: &LocaliseArgs, recording: &Recording) -> Result<Pose, Failure> {
    let told = told_start(args, Pose::default());
    let is_told =
        |reading: &Reading, angle: usize| [reading.roll_rad, reading.pitch_rad, reading.yaw_rad][angle].is_some();
    for (angle, name) in ["roll_rad", "pitch_rad", "yaw_rad"].into_iter().enumerate() {
        let begins = recording.readings.first().is_some_and(|(_, reading)| is_told(reading, angle));
        let is_told_later = recording.readings.iter().any(|(_, reading)| is_told(reading, angle));
        if is_told_later && !begins && !(name == "yaw_rad" && told.is_some()) {
            let file = args.odometry.display();
            let start = if name == "yaw_rad" { ", or --start X,Y,DEG" } else { "" };
            let help = format!("begin the log at a row that has {name}, or give --truth{start}");
            return Err(Failure::usage(miette::miette!(
                help = help,
                "{file}: {name} is empty in the first row and told later, so that the start's is unknown"
            )));
        }
    }
    Ok(told.unwrap_or_default())
}

/// How features or sweeps correct what the odometry says.
fn corrected(args: &LocaliseArgs, recording: &Recording) -> SlamParams {
    if args.registration {
        SlamParams::Registration(RegistrationParams { range_m: args.feature_range_m, ..RegistrationParams::default() })
    } else {
        SlamParams::Fastslam(fastslam(args, recording))
    }
}

/// Of a log as many features of a time are taken as there are, but of those without ids one within 0.3 m; of sweeps as many as in corpora.
fn fastslam(args: &LocaliseArgs, recording: &Recording) -> FastslamParams {
    let of_log = recording.observations.iter().map(|(_, observation)| match observation {
        Observation::Features(features) => features.len() as u32,
        Observation::Sweep { .. } => FastslamParams::default().max_features,
    });
    FastslamParams {
        particles: args.particles,
        max_features: of_log.max().map_or(1, |most| most.max(1)),
        feature_range_m: args.feature_range_m,
        measurement_inflation: args.measurement_inflation,
        motion_inflation: args.motion_inflation,
        ..FastslamParams::default()
    }
}

/// The filter's differ in `slam` alone.
fn dead_reckoning_params(args: &LocaliseArgs, start: Pose) -> LocateParams {
    let bearing_rad = args.bearing_deg.to_radians();
    let noise = InstrumentNoise {
        imu_rad: args.imu_deg.to_radians(),
        imu_bias_rad: args.imu_bias_deg.to_radians(),
        sun_rad: args.sun_deg.to_radians(),
        odometry_m_per_sqrt_m: args.odometry_m_per_sqrt_m,
        sideways_m_per_sqrt_m: args.sideways_m_per_sqrt_m,
        slip: args.slip,
        heading_rad_per_sqrt_m: args.odometry_deg_per_sqrt_m.to_radians(),
    };
    LocateParams {
        slam: SlamParams::DeadReckoning,
        noise,
        feature_sigmas: [args.range_m, bearing_rad, bearing_rad],
        start,
        rover_from_sensor: rover_from_sensor(args),
        sweep_spacing_m: args.sweep_spacing_m,
        seed: args.seed,
    }
}

fn scored(located: &Located, truth: &[read::TruePose]) -> Option<Score> {
    recording::score(&located.steps, truth)
}
