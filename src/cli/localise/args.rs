//! What is typed behind `marsyard localise`.

use std::path::PathBuf;

use clap::Args;

use crate::cli::options::{parse_six, parse_three};
use crate::slam;

#[derive(Debug, Args)]
pub(in crate::cli) struct LocaliseArgs {
    /// Odometry and angles (CSV).
    pub(super) odometry: PathBuf,
    /// Features seen (CSV); without them and without sweeps the drive is dead-reckoned.
    #[arg(long, value_name = "CSV", conflicts_with = "sweeps")]
    pub(super) features: Option<PathBuf>,
    /// Sweeps of a LiDAR: a list (CSV) of times and files, each file the points of one sweep in the sensor's frame. Rocks in them are the
    /// features, and each is laid on the one before, by what stands up and by the ground; or see --registration.
    #[arg(long, value_name = "CSV", requires = "sensor")]
    pub(super) sweeps: Option<PathBuf>,
    /// Where the rover truly was (CSV): the drive starts where it says that it began, and errors are told.
    #[arg(long, value_name = "CSV")]
    pub(super) truth: Option<PathBuf>,
    /// Folder for the results.
    #[arg(long, default_value = "located")]
    pub(super) out: PathBuf,
    /// Start x, y (metres) and heading (degrees); default: the truth at the odometry's first time (or its first row), or 0,0,0.
    #[arg(long, value_name = "X,Y,DEG", allow_hyphen_values = true, value_parser = parse_three)]
    pub(super) start: Option<[f64; 3]>,
    /// The sensor on the rover, metres: forward, left, up; and how it is turned, degrees. Features: at the rover's origin unless told.
    #[arg(long, value_name = "X,Y,Z[,YAW,PITCH,ROLL]", allow_hyphen_values = true, value_parser = three_or_six)]
    pub(super) sensor: Option<[f64; 6]>,
    /// In sweeps rocks are looked for up to this far from the sensor, and what stands up (and the ground) is laid on the sweep before, metres, 0.5 to 20;
    /// at most nine tenths of the sensor's reach.
    #[arg(long, value_name = "M", requires = "sweeps", default_value_t = 10.0, value_parser = feature_range)]
    pub(super) feature_range_m: f64,
    /// A sweep is read when the wheels have rolled so far since the one read before, metres; 0 reads all. Sweeps that follow closely add up what
    /// laying one on the other errs.
    #[arg(long, value_name = "M", requires = "sweeps", default_value_t = 0.4, value_parser = at_least_0)]
    pub(super) sweep_spacing_m: f64,
    /// Returns of the rover itself are left out of sweeps: points in its outline and 0.1 m around, from the wheels' contact plane up. Length,
    /// width and height, metres.
    #[arg(long, value_name = "L,W,H", requires = "sweeps", value_parser = sizes)]
    pub(super) self_filter: Option<[f64; 3]>,
    /// Without rocks and particles: one Kalman filter lays each sweep on the one read before, by what stands up and by the ground.
    #[arg(long, requires = "sweeps", conflicts_with_all = ["particles", "measurement_inflation", "motion_inflation", "range_m", "bearing_deg"])]
    pub(super) registration: bool,
    /// Particles: recordings are long, and with few of them all descend from one ancestor, and sigmas are too small.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(super) particles: u32,
    /// Leave the ids out: the filter finds out which landmark each feature is.
    #[arg(long, conflicts_with = "sweeps")]
    pub(super) unknown_ids: bool,
    /// Noise of the driven distance, metres per square root of a metre.
    #[arg(long, value_name = "M", default_value_t = 0.05, value_parser = at_least_0)]
    pub(super) odometry_m_per_sqrt_m: f64,
    /// Sideways slip, which no reading tells of, metres per square root of a metre; 0 where wheels do not slip aside (then 1 mm a step).
    #[arg(long, value_name = "M", default_value_t = 0.02, value_parser = at_least_0)]
    pub(super) sideways_m_per_sqrt_m: f64,
    /// Of the counted way a share that is not driven, the same all the way (negative: more is driven): its standard deviation, 0 to 0.9. The filter
    /// learns the share from features and sweeps; without them its sigmas alone widen
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = |text: &str| of_0_to(slam::MOST_SLIP, text))]
    pub(super) slip: f64,
    /// Noise of the heading by odometry, degrees per square root of a metre.
    #[arg(long, value_name = "DEG", default_value_t = 2.0, value_parser = at_least_0)]
    pub(super) odometry_deg_per_sqrt_m: f64,
    /// Noise of roll_rad and pitch_rad, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.5, value_parser = at_least_0)]
    pub(super) imu_deg: f64,
    /// Constant bias of roll_rad and of pitch_rad, degrees, up to 45: its standard deviation. It widens z by the way driven, as on a straight
    /// way; on one that comes back to where it was, by too much
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = |text: &str| of_0_to(MOST_BIAS_DEG, text))]
    pub(super) imu_bias_deg: f64,
    /// Noise of yaw_rad, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 2.0, value_parser = at_least_0)]
    pub(super) sun_deg: f64,
    /// Noise of a feature's range where its row tells none, metres; with the inflation 0.01 at least.
    #[arg(long, value_name = "M", default_value_t = 0.03, value_parser = at_least_0)]
    pub(super) range_m: f64,
    /// Noise of a feature's bearing and elevation where its row tells none, degrees; with the inflation 0.25 at least.
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = at_least_0)]
    pub(super) bearing_deg: f64,
    /// Factor on the variances of features, those of rows among them, against optimism; 1 takes the noise above as it is.
    #[arg(long, value_name = "F", default_value_t = 4.0, value_parser = inflation)]
    pub(super) measurement_inflation: f64,
    /// Factor on the variances of what wheels tell, of the filter that reads features or sweeps; dead reckoning takes them as they are.
    #[arg(long, value_name = "F", default_value_t = 1.0, value_parser = inflation)]
    pub(super) motion_inflation: f64,
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// One JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

fn three_or_six(text: &str) -> Result<[f64; 6], String> {
    match text.split(',').count() {
        3 => parse_three(text).map(|[x_m, y_m, z_m]| [x_m, y_m, z_m, 0.0, 0.0, 0.0]),
        6 => parse_six(text),
        others => Err(format!("{others} numbers; three are needed, or six where the sensor is turned")),
    }
}

fn sizes(text: &str) -> Result<[f64; 3], String> {
    let sizes = parse_three(text)?;
    if sizes.iter().all(|&size_m| size_m > 0.0) { Ok(sizes) } else { Err("metres above 0 are needed".into()) }
}

/// The range of the config's key of this name.
fn feature_range(text: &str) -> Result<f64, String> {
    let range_m = of_0_to(20.0, text).ok().filter(|&range_m| range_m >= 0.5);
    range_m.ok_or_else(|| "a number of 0.5 to 20 is needed".into())
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
