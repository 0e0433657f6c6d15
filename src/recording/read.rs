//! CSV -> readings, observations, a truth.
//!
//! In: text with a header that names its columns, in any order; lines that begin with `#` are skipped. Out: [`Recording`], [`TruePose`]s.
//! Odometry: `time_s`, `speed_mps`, `yaw_rate_radps`, and where there are such instruments `roll_rad`, `pitch_rad`, `yaw_rad` (empty where
//! nothing was read). Without the columns of roll and pitch the drive is taken as level. Features: `time_s`, `range_m`, `bearing_rad`,
//! and where known `elevation_rad` (0 otherwise), `id`, and the row's own noise, `range_sigma_m`, `bearing_sigma_rad`, `elevation_sigma_rad`. Sweeps: `time_s`, `file`. Truth: `time_s`, `x_m`, `y_m`, `yaw_rad`, and `z_m`, `roll_rad`, `pitch_rad`.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use super::{Observation, Recording, RecordingError, SightLog};
use crate::drive::Reading;
use crate::geometry::{DVec3, Pose};
use crate::slam::Feature;

/// Ranges above it are no metres.
const FARTHEST_M: f64 = 1e6;
/// Columns of a feature's own noise, in the order of what is measured, and the most that each may be.
/// A bearing that is vaguer places no landmark: the filter takes a place for normal in the map.
const SIGMAS: [(&str, f64); 3] = [("range_sigma_m", 10.0), ("bearing_sigma_rad", 0.5), ("elevation_sigma_rad", 0.5)];

/// Where the rover truly was at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruePose {
    pub time_s: f64,
    pub pose: Pose,
}

/// A table by its header.
struct Table {
    file: String,
    header: Vec<String>,
    rows: Vec<(u64, Vec<String>)>,
}

impl Table {
    fn read(file: &str, text: &str) -> Result<Table, RecordingError> {
        let mut reader =
            csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes());
        let fault = |error: csv::Error| RecordingError {
            file: file.into(),
            line: error.position().map(csv::Position::line),
            what: "it is no table of comma-separated values".into(),
            cure: format!("every line needs as many values as the header ({error})"),
        };
        let header: Vec<String> = reader.headers().map_err(fault)?.iter().map(str::to_owned).collect();
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(fault)?;
            let line = record.position().map_or(0, csv::Position::line);
            rows.push((line, record.iter().map(str::to_owned).collect()));
        }
        let table = Table { file: file.into(), header, rows };
        let twice = |&(k, name): &(usize, &String)| table.header[..k].contains(name);
        if let Some((_, name)) = table.header.iter().enumerate().find(twice) {
            return Err(table.fault(Some(1), format!("it names '{name}' twice"), "name each column once"));
        }
        if table.rows.is_empty() {
            return Err(table.fault(None, "it holds no row", "write a header and at least one row"));
        }
        Ok(table)
    }

    fn fault(&self, line: Option<u64>, what: impl Into<String>, cure: impl Into<String>) -> RecordingError {
        RecordingError { file: self.file.clone(), line, what: what.into(), cure: cure.into() }
    }

    /// Of a number that makes no sense.
    fn senseless(&self, (line, row): &(u64, Vec<String>), column: usize, cure: impl Into<String>) -> RecordingError {
        self.fault(Some(*line), format!("{} is {}", self.header[column], row[column]), cure)
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column == name)
    }

    fn needed(&self, name: &str) -> Result<usize, RecordingError> {
        let there = self.header.join(", ");
        let fault = || self.fault(Some(1), format!("it has no column '{name}'"), format!("the header names: {there}"));
        self.column(name).ok_or_else(fault)
    }

    /// A finite number.
    fn number(&self, (line, row): &(u64, Vec<String>), column: usize) -> Result<f64, RecordingError> {
        let text = &row[column];
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        let name = &self.header[column];
        let fault = || self.fault(Some(*line), format!("{name} is '{text}'"), "write a finite number");
        number.ok_or_else(fault)
    }

    /// A number, unless the column is absent or the value empty.
    fn number_if_any(&self, row: &(u64, Vec<String>), column: Option<usize>) -> Result<Option<f64>, RecordingError> {
        column.filter(|&column| !row.1[column].is_empty()).map(|column| self.number(row, column)).transpose()
    }

    /// The times of all rows, which must not go back.
    fn times_s(&self, strictly: bool) -> Result<Vec<f64>, RecordingError> {
        let column = self.needed("time_s")?;
        let mut times_s: Vec<f64> = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let time_s = self.number(row, column)?;
            if let Some(&before_s) = times_s.last()
                && (time_s < before_s || (strictly && time_s == before_s))
            {
                let what = format!("time_s goes from {before_s} to {time_s}");
                let cure = if strictly { "sort the rows by time, one a time" } else { "sort the rows by time" };
                return Err(self.fault(Some(row.0), what, cure));
            }
            times_s.push(time_s);
        }
        Ok(times_s)
    }
}

impl Recording {
    /// A recording of the texts of its files, each with the name that errors call it by.
    pub fn read(odometry: (&str, &str), sights: Option<SightLog>) -> Result<Recording, RecordingError> {
        let readings = readings(&Table::read(odometry.0, odometry.1)?)?;
        let (first_s, last_s) = (readings[0].0, readings[readings.len() - 1].0);
        let (table, observations): (Table, Vec<(f64, Observation)>) = match sights {
            None => return Ok(Recording { readings, observations: Vec::new() }),
            Some(SightLog::Features { file, text }) => {
                let table = Table::read(file, text)?;
                let seen = features(&table)?;
                (table, seen.into_iter().map(|(time_s, seen)| (time_s, Observation::Features(seen))).collect())
            }
            Some(SightLog::Sweeps { file, text }) => {
                let table = Table::read(file, text)?;
                let seen = sweeps(&table)?;
                (table, seen)
            }
        };
        if let Some((time_s, _)) = observations.iter().find(|(time_s, _)| !(first_s..=last_s).contains(time_s)) {
            let what = format!("time_s {time_s} lies outside the odometry, which goes from {first_s} to {last_s}");
            return Err(table.fault(None, what, "bring both logs to one clock, and cut them to the same stretch"));
        }
        Ok(Recording { readings, observations })
    }
}

fn readings(table: &Table) -> Result<Vec<(f64, Reading)>, RecordingError> {
    let times_s = table.times_s(true)?;
    let (speed, rate) = (table.needed("speed_mps")?, table.needed("yaw_rate_radps")?);
    let [roll, pitch, yaw] = ["roll_rad", "pitch_rad", "yaw_rad"].map(|name| table.column(name));
    let is_level = roll.is_none() && pitch.is_none();
    let mut before_s = times_s[0];
    let mut readings = Vec::with_capacity(times_s.len());
    for (row, &time_s) in table.rows.iter().zip(&times_s) {
        let level = is_level.then_some(0.0);
        let reading = Reading {
            dt_s: time_s - before_s,
            speed_mps: table.number(row, speed)?,
            yaw_rate_radps: table.number(row, rate)?,
            roll_rad: table.number_if_any(row, roll)?.or(level),
            pitch_rad: table.number_if_any(row, pitch)?.or(level),
            yaw_rad: table.number_if_any(row, yaw)?,
        };
        readings.push((time_s, reading));
        before_s = time_s;
    }
    Ok(readings)
}

fn features(table: &Table) -> Result<Vec<(f64, Vec<Feature>)>, RecordingError> {
    let times_s = table.times_s(false)?;
    let (range, bearing) = (table.needed("range_m")?, table.needed("bearing_rad")?);
    let (elevation, id) = (table.column("elevation_rad"), table.column("id"));
    let noise = SIGMAS.map(|(name, _)| table.column(name));
    let mut observations: Vec<(f64, Vec<Feature>)> = Vec::new();
    for (row, &time_s) in table.rows.iter().zip(&times_s) {
        let range_m = table.number(row, range)?;
        let bearing_rad = table.number(row, bearing)?;
        let elevation_rad = table.number_if_any(row, elevation)?.unwrap_or(0.0);
        for (column, is_sane, cure) in [
            (Some(range), range_m > 0.0, "a range is above 0: leave misses out"),
            (
                Some(range),
                range_m <= FARTHEST_M,
                "a range is in metres, and no sensor of a rover sees a thousand kilometres",
            ),
            (Some(bearing), bearing_rad.abs() <= TAU, "a bearing is in radians, a whole turn at most"),
            (elevation, elevation_rad.abs() < FRAC_PI_2, "an elevation is in radians, below a quarter of a turn"),
        ] {
            if let Some(column) = column.filter(|_| !is_sane) {
                return Err(table.senseless(row, column, cure));
            }
        }
        let sigmas = stated_sigmas(table, row, noise)?;
        let known = match id.map(|id| row.1[id].as_str()).filter(|text| !text.is_empty()) {
            None => None,
            Some(text) => Some(text.parse::<u32>().map_err(|_| {
                table.fault(
                    Some(row.0),
                    format!("id is '{text}'"),
                    "an id is a whole number, or empty where it is not known",
                )
            })?),
        };
        let feature =
            Feature { polar: [range_m, bearing_rad, elevation_rad], points: 1, half_width_m: 0.0, known, sigmas };
        match observations.last_mut() {
            Some((last_s, features)) if *last_s == time_s => features.push(feature),
            _ => observations.push((time_s, vec![feature])),
        }
    }
    Ok(observations)
}

/// The noise that a row states of its own feature, by the columns of [`SIGMAS`].
fn stated_sigmas(
    table: &Table,
    row: &(u64, Vec<String>),
    columns: [Option<usize>; 3],
) -> Result<[Option<f64>; 3], RecordingError> {
    let mut sigmas = [None; 3];
    for ((sigma, column), (_, most)) in sigmas.iter_mut().zip(columns).zip(SIGMAS) {
        *sigma = table.number_if_any(row, column)?;
        let senseless = sigma.filter(|sigma| !(*sigma > 0.0 && *sigma <= most));
        if let (Some(_), Some(column)) = (senseless, column) {
            let cure = format!(
                "a standard deviation is above 0 and {most} at most, in the unit of the name; empty: the options'"
            );
            return Err(table.senseless(row, column, cure));
        }
    }
    Ok(sigmas)
}

fn sweeps(table: &Table) -> Result<Vec<(f64, Observation)>, RecordingError> {
    let times_s = table.times_s(true)?;
    let file = table.needed("file")?;
    let mut line_of = BTreeMap::new();
    let mut sweeps = Vec::with_capacity(times_s.len());
    for ((line, row), time_s) in table.rows.iter().zip(times_s) {
        let (name, line) = (row[file].clone(), *line);
        if name.is_empty() {
            return Err(table.fault(Some(line), "file is empty", "name the file of the sweep's points"));
        }
        if let Some(first) = line_of.insert(name.clone(), line) {
            let what = format!("file {name} stands in line {first} already");
            return Err(table.fault(Some(line), what, "name each sweep's own file"));
        }
        sweeps.push((time_s, Observation::Sweep { file: name, line }));
    }
    Ok(sweeps)
}

/// The truth of a drive.
pub fn truth(file: &str, text: &str) -> Result<Vec<TruePose>, RecordingError> {
    let table = Table::read(file, text)?;
    let times_s = table.times_s(true)?;
    let [x, y, yaw] = [table.needed("x_m")?, table.needed("y_m")?, table.needed("yaw_rad")?];
    let [z, roll, pitch] = ["z_m", "roll_rad", "pitch_rad"].map(|name| table.column(name));
    let pose = |(row, &time_s): (&(u64, Vec<String>), &f64)| {
        let or_zero = |column| Ok::<f64, RecordingError>(table.number_if_any(row, column)?.unwrap_or(0.0));
        let position_m = DVec3::new(table.number(row, x)?, table.number(row, y)?, or_zero(z)?);
        let (roll_rad, pitch_rad, yaw_rad) = (or_zero(roll)?, or_zero(pitch)?, table.number(row, yaw)?);
        Ok(TruePose { time_s, pose: Pose { position_m, roll_rad, pitch_rad, yaw_rad } })
    };
    table.rows.iter().zip(&times_s).map(pose).collect()
}

#[cfg(test)]
mod tests;
