//! CSV, XYZ and the like: one point a line.
//!
//! Values of a line are separated by semicolons, else by commas, else by tabs and blanks; decimals have points. Between two semicolons or
//! commas may be nothing: a coordinate that is not there is not finite. The first line may name the columns (`x y z ...`, in any order and
//! case, also behind `#` or `//`). Without names the first three are x, y, z; a fourth, if there are exactly four, is the
//! intensity; others are left out. All lines have as many values as the first. Empty lines and lines that start with `#` or `//` are skipped; a
//! line with a single whole number before the first point (the count of .pts files) too.

use super::fields::{FieldOffsets, no_number};
use super::{Cloud, CloudError, Gathered};
use crate::geometry::DVec3;

/// Where the columns in use stand, and how many there are.
struct Columns {
    offsets: FieldOffsets,
    count: usize,
}

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let malformed = |line: usize, reason: String| CloudError::Malformed {
        file: file.into(),
        place: format!("line {}", line + 1),
        reason,
    };
    let text = String::from_utf8_lossy(bytes);
    let mut columns: Option<Columns> = None;
    let mut gathered = Gathered::new(false, false);
    let mut values = Vec::new();
    let mut first = true;
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let trimmed = line.trim();
        let bare = trimmed.trim_start_matches(['#', '/']);
        let comment = bare.len() < trimmed.len();
        if bare.is_empty() || comment && columns.is_some() {
            continue;
        }
        split(bare, &mut values);
        if columns.is_none() {
            drop_end(&mut values, None);
            let names: Vec<String> = values.iter().map(|name| name.trim_matches('"').to_string()).collect();
            let named = names.iter().any(|name| !name.is_empty() && name.parse::<f64>().is_err());
            if named && (!comment || is_header(&names)) {
                let place = format!("line {} (column names)", number + 1);
                let offsets = FieldOffsets::of(file, &place, &names, label_field)?;
                columns = Some(Columns { offsets, count: names.len() });
            } else if !(comment || first && names.len() == 1) {
                if names.len() < 3 {
                    return Err(malformed(number, format!("{} values, a point has three", names.len())));
                }
                let intensity = (names.len() == 4).then_some(3);
                let offsets = FieldOffsets { xyz: [0, 1, 2], intensity, label: unnamed(file, label_field)? };
                columns = Some(Columns { offsets, count: names.len() });
            }
            if let Some(Columns { offsets, .. }) = &columns {
                gathered = Gathered::new(offsets.intensity.is_some(), offsets.label.is_some());
            }
            if named || comment || columns.is_none() {
                first &= comment;
                continue;
            }
        }
        let Some(Columns { offsets, count }) = &columns else { continue };
        drop_end(&mut values, Some(*count));
        if values.len() != *count {
            return Err(malformed(
                number,
                format!(
                    "{} values where the lines before have {count}; decimals are written with points",
                    values.len()
                ),
            ));
        }
        let value = |column: usize| match values[column] {
            "" => Ok(f64::NAN),
            value => value.parse().map_err(|_| malformed(number, no_number(value))),
        };
        let or_none = |column: Option<usize>| column.map_or(Ok(f64::NAN), value);
        let [x, y, z] = offsets.xyz.map(value);
        gathered.push(DVec3::new(x?, y?, z?), or_none(offsets.intensity)?, or_none(offsets.label)?);
    }
    gathered.finish(file)
}

/// The values of a line; between blanks alone none is empty.
fn split<'t>(line: &'t str, values: &mut Vec<&'t str>) {
    values.clear();
    match [';', ','].into_iter().find(|separator| line.contains(*separator)) {
        Some(separator) => values.extend(line.split(separator).map(str::trim)),
        None => values.extend(line.split_ascii_whitespace()),
    }
}

/// A separator at the end of a line is followed by no value of its own, unless one is wanted there.
fn drop_end(values: &mut Vec<&str>, wanted: Option<usize>) {
    if values.last() == Some(&"") && wanted.is_none_or(|wanted| values.len() > wanted) {
        values.pop();
    }
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
