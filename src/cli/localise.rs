//! A recorded drive as CSV -> its trajectory (TUM), map and covariances; with a truth, how good they are.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::Failure;
use super::output::{errln, outln};
use super::place::{corpus_failure, fault_words, must_be_local};
use crate::corpus::limits::FileKind;
use crate::corpus::outputs::Outputs;
use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{DVec3, Pose, Transform};
use crate::recording::{self, LocateParams, Located, Recording, RecordingError, Score, Step, read};
use crate::slam::{self, FastslamParams, SlamParams};

/// What the files are, and a first try.
pub(super) const FILES: &str = "\
Odometry (CSV with a header): time_s, speed_mps, yaw_rate_radps, each over the step that ends at its time; where there are such instruments
roll_rad, pitch_rad, yaw_rad (empty = no reading). Without roll and pitch the drive is level. Features: time_s, range_m, bearing_rad from
the sensor (x forward, y left); elevation_rad and id where known. Truth: time_s, x_m, y_m, yaw_rad; z_m, roll_rad, pitch_rad. A line that
begins with # is a comment.

Try it:  marsyard localise examples/logs/odometry.csv --features examples/logs/features.csv --truth examples/logs/truth.csv --out located
Writes:  trajectory.tum, covariance.csv (a row a step), landmarks.csv

marsyard writes into a place that is empty, not there yet, or its own; it never replaces a file that it did not write, nor its own input";

#[derive(Debug, Args)]
pub(super) struct LocaliseArgs {
    /// Odometry and angles (CSV).
    odometry: PathBuf,
    /// Features seen (CSV); without it the drive is dead-reckoned.
    #[arg(long, value_name = "CSV")]
    features: Option<PathBuf>,
    /// Where the rover truly was (CSV): the drive starts where it says that it began, and errors are told.
    #[arg(long, value_name = "CSV")]
    truth: Option<PathBuf>,
    /// Folder for the results.
    #[arg(long, default_value = "located")]
    out: PathBuf,
    /// Start x, y (metres) and heading (degrees); default: the truth at the odometry's first time (or its first row), or 0,0,0.
    #[arg(long, value_name = "X,Y,DEG", allow_hyphen_values = true, value_parser = three)]
    start: Option<[f64; 3]>,
    /// The sensor on the rover, metres: forward, left, up.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true, value_parser = three)]
    sensor: [f64; 3],
    /// Particles: recordings are long, and with few of them all descend from one ancestor, and sigmas are too small.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    particles: u32,
    /// Leave the ids out: the filter finds out which landmark each feature is.
    #[arg(long)]
    unknown_ids: bool,
    /// Noise of the driven distance, metres per square root of a metre.
    #[arg(long, value_name = "M", default_value_t = 0.05, value_parser = at_least_0)]
    odometry_m_per_sqrt_m: f64,
    /// Sideways slip, which no reading tells of, metres per square root of a metre; 0 where wheels do not slip aside (then 1 mm a step).
    #[arg(long, value_name = "M", default_value_t = 0.02, value_parser = at_least_0)]
    sideways_m_per_sqrt_m: f64,
    /// Of the counted way a share that is not driven, the same all the way (negative: more is driven): its standard deviation, 0 to 0.9. The filter
    /// learns the share from features; without them its sigmas alone widen
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = |text: &str| of_0_to(slam::MOST_SLIP, text))]
    slip: f64,
    /// Noise of the heading by odometry, degrees per square root of a metre.
    #[arg(long, value_name = "DEG", default_value_t = 2.0, value_parser = at_least_0)]
    odometry_deg_per_sqrt_m: f64,
    /// Noise of roll_rad and pitch_rad, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.5, value_parser = at_least_0)]
    imu_deg: f64,
    /// Constant bias of roll_rad and of pitch_rad, degrees, up to 45: its standard deviation. It widens z by the way driven, as on a straight
    /// way; on one that comes back to where it was, by too much
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = |text: &str| of_0_to(MOST_BIAS_DEG, text))]
    imu_bias_deg: f64,
    /// Noise of yaw_rad, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 2.0, value_parser = at_least_0)]
    sun_deg: f64,
    /// Noise of a feature's range, metres; 0.01 at least.
    #[arg(long, value_name = "M", default_value_t = 0.03, value_parser = at_least_0)]
    range_m: f64,
    /// Noise of a feature's bearing and elevation, degrees; 0.25 at least.
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = at_least_0)]
    bearing_deg: f64,
    /// Factor on the variances of features, against optimism; 1 takes the noise above as it is.
    #[arg(long, value_name = "F", default_value_t = 4.0, value_parser = inflation)]
    measurement_inflation: f64,
    /// Factor on the variances of what wheels tell, of the filter that reads features; dead reckoning takes them as they are.
    #[arg(long, value_name = "F", default_value_t = 1.0, value_parser = inflation)]
    motion_inflation: f64,
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
}

fn three(text: &str) -> Result<[f64; 3], String> {
    let finite = |part: &str| part.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let values: Option<Vec<f64>> = text.split(',').map(finite).collect();
    let three = values.and_then(|values| <[f64; 3]>::try_from(values).ok());
    three.ok_or_else(|| "three finite numbers with commas between are needed".into())
}

fn at_least_0(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a number of at least 0 is needed".into()),
    }
}

fn of_0_to(most: f64, text: &str) -> Result<f64, String> {
    at_least_0(text).ok().filter(|&value| value <= most).ok_or_else(|| format!("a number of 0 to {most} is needed"))
}

/// The range of the config's keys of these names.
fn inflation(text: &str) -> Result<f64, String> {
    let factor = of_0_to(1000.0, text).ok().filter(|&factor| factor >= 0.01);
    factor.ok_or_else(|| "a number of 0.01 to 1000 is needed".into())
}

/// A bias beyond it is no bias of an instrument that stands upright.
const MOST_BIAS_DEG: f64 = 45.0;

const TRAJECTORY: &str = "trajectory.tum";
const COVARIANCE: &str = "covariance.csv";
const LANDMARKS: &str = "landmarks.csv";

pub(super) fn run(args: &LocaliseArgs) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let mut recording = recorded(args)?;
    if args.unknown_ids {
        recording.observations.iter_mut().flat_map(|(_, features)| features).for_each(|feature| feature.known = None);
    }
    let truth = match &args.truth {
        Some(path) => Some(read::truth(&path.display().to_string(), &text(path)?).map_err(bad)?),
        None => None,
    };
    let start = start(args, truth.as_deref(), &recording)?;
    let inputs = [Some(&args.odometry), args.features.as_ref(), args.truth.as_ref()];
    let inputs = inputs.into_iter().flatten().cloned().collect();
    let mut outputs = Outputs::open(&args.out, [TRAJECTORY, COVARIANCE, LANDMARKS], inputs).map_err(corpus_failure)?;
    let reckoned = locate(&recording, args, start, SlamParams::DeadReckoning)?;
    let located = match args.features {
        None => reckoned.clone(),
        Some(_) => locate(&recording, args, start, SlamParams::Fastslam(fastslam(args, &recording)))?,
    };
    let files = [
        (TRAJECTORY, slam::tum(located.steps.iter().map(|step| (step.time_s, &step.estimate.pose)))),
        (COVARIANCE, covariances(&located.steps)),
        (LANDMARKS, landmarks(&located)),
    ]
    .map(|(name, text)| (name.to_string(), text.into_bytes()));
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
    report(args, &located, scores);
    Ok(())
}

fn recorded(args: &LocaliseArgs) -> Result<Recording, Failure> {
    let odometry = (args.odometry.display().to_string(), text(&args.odometry)?);
    let features = match &args.features {
        Some(path) => Some((path.display().to_string(), text(path)?)),
        None => None,
    };
    let features = features.as_ref().map(|(file, text)| (file.as_str(), text.as_str()));
    Recording::read((&odometry.0, &odometry.1), features).map_err(bad)
}

fn text(path: &Path) -> Result<String, Failure> {
    let read = FileKind::Trajectory.read_path(path).and_then(|bytes| {
        String::from_utf8(bytes)
            .map_err(|fault| std::io::Error::new(std::io::ErrorKind::InvalidData, fault.utf8_error()))
    });
    read.map_err(|fault| Failure::usage(miette::miette!("{} cannot be read: {}", path.display(), fault_words(&fault))))
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

/// Of a recording as many features of a time are taken as there are, but of those without ids one within 0.3 m.
fn fastslam(args: &LocaliseArgs, recording: &Recording) -> FastslamParams {
    let most_features = recording.observations.iter().map(|(_, features)| features.len()).max();
    FastslamParams {
        particles: args.particles,
        max_features: most_features.map_or(1, |most| most.max(1) as u32),
        measurement_inflation: args.measurement_inflation,
        motion_inflation: args.motion_inflation,
        ..FastslamParams::default()
    }
}

fn locate(recording: &Recording, args: &LocaliseArgs, start: Pose, slam: SlamParams) -> Result<Located, Failure> {
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
    let translation_m = DVec3::from(args.sensor);
    let params = LocateParams {
        slam,
        noise,
        feature_sigmas: [args.range_m, bearing_rad, bearing_rad],
        start,
        rover_from_sensor: Transform { translation_m, ..Transform::IDENTITY },
        seed: args.seed,
    };
    recording::locate(recording, &params).map_err(Failure::failed)
}

fn scored(located: &Located, truth: &[read::TruePose]) -> Option<Score> {
    recording::score(&located.steps, truth)
}

const STATE: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// A row a step: the upper triangle of the covariance, metres and radians.
fn covariances(steps: &[Step]) -> String {
    let pairs = || (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    let mut text = String::from("time_s");
    for (row, column) in pairs() {
        let _ = write!(text, ",{}_{}", STATE[row], STATE[column]);
    }
    for step in steps {
        let _ = write!(text, "\n{}", step.time_s);
        for (row, column) in pairs() {
            let _ = write!(text, ",{}", step.estimate.covariance[row][column]);
        }
    }
    text + "\n"
}

/// A row a landmark, in the order in which they were first seen; the covariance is that of the particle, whose pose is taken as exact.
fn landmarks(located: &Located) -> String {
    let mut text = String::from("id,x_m,y_m,z_m,x_x_m2,x_y_m2,x_z_m2,y_y_m2,y_z_m2,z_z_m2\n");
    for landmark in &located.landmarks {
        let id = landmark.known.map_or(String::new(), |id| id.to_string());
        let ([x, y, z], c) = (landmark.mean_m, &landmark.covariance_m2);
        let [xx, xy, xz, yy, yz, zz] = [c[0][0], c[0][1], c[0][2], c[1][1], c[1][2], c[2][2]];
        let _ = writeln!(text, "{id},{x},{y},{z},{xx},{xy},{xz},{yy},{yz},{zz}");
    }
    text
}

fn report(args: &LocaliseArgs, located: &Located, scores: Option<(Score, Score)>) {
    let last = &located.steps[located.steps.len() - 1].estimate;
    let (located_score, reckoned_score) = scores.unzip();
    let (scale, scale_sigma) = located.odometry_scale;
    let left_out = &located.left_out;
    if args.json {
        outln!(
            "{:#}",
            json!({
                "steps": located.steps.len(),
                "landmarks": located.landmarks.len(),
                "left_out": {
                    "not_finite": left_out.not_finite,
                    "gated": left_out.gated,
                    "ambiguous": left_out.ambiguous,
                    "passed_over": left_out.passed_over,
                },
                "sigma_optimistic": last.sigma_optimistic,
                "odometry_scale": { "mean": scale, "sigma": scale_sigma },
                "score": located_score,
                "dead_reckoning": reckoned_score,
            })
        );
        return;
    }
    outln!("{} steps, {} landmarks", located.steps.len(), located.landmarks.len());
    // Without features the drive is dead reckoning itself, and only readings can be left out.
    let has_features = args.features.is_some();
    let of_features = format!(
        ", {} too far from what was believed, {} features of two landmarks or of none, {} beside others",
        left_out.gated, left_out.ambiguous, left_out.passed_over
    );
    outln!(
        "left out: {} measurements that make no sense{}",
        left_out.not_finite,
        if has_features { of_features.as_str() } else { "" }
    );
    if args.slip > 0.0 && has_features {
        outln!("{:.1} ± {:.1} % of the counted way was driven", 100.0 * scale, 100.0 * scale_sigma);
    }
    for (name, score) in [("this drive", located_score.filter(|_| has_features)), ("dead reckoning", reckoned_score)] {
        let Some(score) = score else { continue };
        let nees =
            score.nees.map_or("none (a covariance has no inverse)".into(), |nees| format!("{nees:.2} (3 is honest)"));
        outln!(
            "{name}: ATE {:.3} m, at the end {:.3} m, heading {:.2} deg, NEES of x, y, yaw {nees}",
            score.ate_m,
            score.last_error_m,
            score.heading_rms_rad.to_degrees()
        );
    }
    if last.sigma_optimistic {
        outln!(
            "the position's covariance is too small: all particles descend from fewer than 3; more particles put that off"
        );
    }
}
