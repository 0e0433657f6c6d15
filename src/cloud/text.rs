//! CSV, XYZ and the like: one point a line.
//!
//! Values are separated by commas, semicolons, tabs or blanks. The first line may name the columns (`x y z ...`, in any order and
//! case, also behind `#` or `//`). Without names the first three are x, y, z; a fourth, if there are exactly four, is the
//! intensity; others are left out. Empty lines and lines that start with `#` or `//` are skipped; a line with a single whole number
//! before the first point (the count of .pts files) too.

use super::fields::{FieldOffsets, label_of, no_number};
use super::{Cloud, CloudError, Gathered};
use crate::geometry::DVec3;

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let malformed = |line: usize, reason: String| CloudError::Malformed {
        file: file.into(),
        place: format!("line {}", line + 1),
        reason,
    };
    let text = String::from_utf8_lossy(bytes);
    let mut places: Option<FieldOffsets> = None;
    let mut gathered = Gathered::new(false, false);
    let mut first = true;
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let trimmed = line.trim();
        let bare = trimmed.trim_start_matches(['#', '/']);
        let comment = bare.len() < trimmed.len();
        let values = || bare.split([',', ';', ' ', '\t']).map(str::trim).filter(|value| !value.is_empty());
        if bare.is_empty() {
            continue;
        }
        if places.is_none() {
            let names: Vec<String> = values().map(|name| name.trim_matches('"').to_string()).collect();
            let named = names.iter().any(|name| name.parse::<f64>().is_err());
            if named && (!comment || is_header(&names)) {
                places =
                    Some(FieldOffsets::of(file, &format!("line {} (column names)", number + 1), &names, label_field)?);
            } else if !(comment || first && names.len() == 1) {
                if names.len() < 3 {
                    return Err(malformed(number, format!("{} values, a point has three", names.len())));
                }
                let intensity = (names.len() == 4).then_some(3);
                places = Some(FieldOffsets { xyz: [0, 1, 2], intensity, label: unnamed(file, label_field)? });
            }
            if let Some(places) = &places {
                gathered = Gathered::new(places.intensity.is_some(), places.label.is_some());
            }
            if named || comment || places.is_none() {
                first &= comment;
                continue;
            }
        }
        if comment {
            continue;
        }
        let Some(places) = &places else { continue };
        let mut row = [f64::NAN; 5];
        let wanted = [Some(places.xyz[0]), Some(places.xyz[1]), Some(places.xyz[2]), places.intensity, places.label];
        let mut columns = 0;
        for (column, value) in values().enumerate() {
            columns = column + 1;
            // One column may be asked for twice, as intensity and as label.
            for (place, _) in row.iter_mut().zip(wanted).filter(|(_, wanted)| *wanted == Some(column)) {
                *place = value.parse().map_err(|_| malformed(number, no_number(value)))?;
            }
        }
        if columns <= places.last() {
            return Err(malformed(number, format!("{columns} values, {} are needed", places.last() + 1)));
        }
        gathered.push(DVec3::new(row[0], row[1], row[2]), row[3], label_of(row[4]));
    }
    gathered.finish(file)
}

fn is_header(names: &[String]) -> bool {
    ["x", "y", "z"].iter().all(|axis| names.iter().any(|name| name.eq_ignore_ascii_case(axis)))
}

/// A file without names has no label column.
fn unnamed(file: &str, label_field: Option<&str>) -> Result<Option<usize>, CloudError> {
    label_field.map_or(Ok(None), |name| {
        Err(CloudError::Malformed {
            file: file.into(),
            place: "line 1".into(),
            reason: format!("the columns have no names, so there is no label column '{name}'; add a first line such as `x y z {name}`"),
        })
    })
}
