//! What a budget is asked for with: hours, cores, disk and rows, the study it is planned by, and the config to write.

use std::path::PathBuf;

use clap::Args;

use crate::cli::Failure;
use crate::cli::options::{parse_positive, parse_threads};

#[derive(Debug, Args)]
pub(super) struct BudgetArgs {
    /// Say what to build in so many hours, generating and training together: a setting, how many scenes of it, and what to expect of it.
    #[arg(long, value_parser = parse_hours)]
    pub hours: Option<f64>,
    /// Cores that the build will have; default: those of this machine.
    #[arg(long, value_parser = parse_threads)]
    pub cores: Option<usize>,
    /// Disk that the corpus may take, such as 200GB or 1.5TiB; default: what is free where it goes.
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub disk: Option<f64>,
    /// Rows that the corpus may have, all splits together, such as 5e6; default: as many as there is time and room for.
    #[arg(long, value_parser = parse_rows)]
    pub rows: Option<f64>,
    /// The study.json that `marsyard tradeoff` wrote; default: tradeoffs/<name>/study.json, else studies/<name>.json beside the config.
    #[arg(long, value_name = "FILE")]
    pub study: Option<PathBuf>,
    /// Where there is no study of the config as it stands, make one first, in about so many minutes on all cores: --study-minutes 10. The least,
    /// of 12 scenes, is made whole. It lies in tradeoffs/<name>, and replaces one of another state there.
    #[arg(long, value_name = "MINUTES", conflicts_with = "study", value_parser = parse_positive)]
    pub study_minutes: Option<f64>,
    /// Write the choice as a config; its name is the file's.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
}

impl BudgetArgs {
    /// Without hours no option of a budget does anything.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        let given = [
            ("--cores", self.cores.is_some()),
            ("--disk", self.disk.is_some()),
            ("--rows", self.rows.is_some()),
            ("--study", self.study.is_some()),
            ("--study-minutes", self.study_minutes.is_some()),
            ("--write", self.write.is_some()),
        ];
        let help = "give --hours: how long generating and training may take together";
        refuse(given.map(|(option, is_given)| (option, is_given, help)), "is of a budget, and none is given")
    }
}

/// Refuses the first option that is given, with its cure.
pub(super) fn refuse<const N: usize>(options: [(&str, bool, &'static str); N], why: &str) -> Result<(), Failure> {
    match options.into_iter().find(|(_, is_given, _)| *is_given) {
        None => Ok(()),
        Some((option, _, help)) => Err(Failure::usage(miette::miette!(help = help, "{option} {why}"))),
    }
}

fn parse_hours(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(hours) if hours > 0.0 && hours <= 1e5 => Ok(hours),
        _ => Err(format!("'{text}' is not a number of hours above 0 and up to 100000")),
    }
}

fn parse_rows(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rows) if (1.0..=1e15).contains(&rows) => Ok(rows.floor()),
        _ => Err(format!("'{text}' is not a number of rows from 1 to 1e15, such as 5e6")),
    }
}

fn parse_bytes(text: &str) -> Result<f64, String> {
    let unit_at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    let scale = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "pb" => 1e15,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "pib" => 1024.0 * 1024.0 * 1024.0 * 1024.0 * 1024.0,
        _ => return Err(format!("'{unit}' is no unit of bytes: MB, GB, TB, PB, MiB, GiB, TiB or PiB")),
    };
    match number.trim().parse::<f64>() {
        Ok(count) if count > 0.0 && (count * scale).is_finite() => Ok(count * scale),
        _ => Err(format!("'{text}' is not a number of bytes above 0, such as 200GB")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_bytes_are_read_with_their_units() {
        for (text, expected) in [("200GB", 2e11), ("1.5TiB", 1_649_267_441_664.0), ("512", 512.0), ("3 mb", 3e6)] {
            assert_eq!(parse_bytes(text), Ok(expected), "{text}");
        }
        for wrong in ["GB", "-1GB", "0", "1XB", "nan", "1e999GB"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
        assert_eq!((parse_rows("5e6"), parse_rows("0").is_err(), parse_rows("inf").is_err()), (Ok(5e6), true, true));
        assert_eq!((parse_hours("0.5"), parse_hours("0").is_err(), parse_hours("x").is_err()), (Ok(0.5), true, true));
    }
}
