//! CSV, XYZ and the like: one point a line.
//!
//! Values stand between semicolons, else commas, else tabs, else blanks, as the first point has them; decimals have points. Between two
//! separators may be nothing: a coordinate that is not there is not finite. The first line may name the columns (`x y z ...`, in any order and
//! case, with metres behind them or nothing, also behind `#` or `//`). Without names the first three are x, y, z; a fourth, if there are exactly
//! four, is the intensity; others are left out. All lines have as many values as there are names, or as the first. Empty lines and lines
//! that start with `#` or `//` are skipped; a line with a single whole number before the first point (a count) too.

use super::fields::{FieldOffsets, is_meant_for_number, is_number, no_number};
use super::{Cloud, CloudError, Gathered};
use crate::geometry::DVec3;

/// What stands between two values of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Sign(char),
    Blanks,
}

/// The columns of a file.
struct Columns {
    offsets: FieldOffsets,
    /// How many a line has.
    count: usize,
    /// Known from the first point on.
    separator: Option<Separator>,
}

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let malformed = |line: usize, reason: String| CloudError::Malformed {
        file: file.into(),
        place: format!("line {}", line + 1),
        reason,
    };
    let named = |line: usize, names: &[String]| {
        let offsets = FieldOffsets::of(file, &format!("line {} (column names)", line + 1), names, label_field)?;
        Ok(Columns { offsets, count: names.len(), separator: None })
    };
    let text = String::from_utf8_lossy(bytes);
    let mut columns: Option<Columns> = None;
    // The last comment before the first point, where it looks like names of columns, and its line.
    let mut maybe_names: Option<(usize, Vec<String>)> = None;
    let mut gathered: Option<Gathered> = None;
    let mut values = Vec::new();
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        // A tab at the beginning has nothing before it, which is a value that is not there.
        let trimmed = line.trim_matches(' ');
        let bare = trimmed.trim_start_matches(['#', '/']).trim_matches(' ');
        let is_comment = trimmed.starts_with(['#', '/']);
        let is_first = columns.as_ref().is_none_or(|columns| columns.separator.is_none());
        if bare.trim().is_empty() || is_comment && columns.is_some() || !is_comment && is_first && is_count(bare) {
            continue;
        }
        if columns.is_none() {
            Separator::of_numbers(bare).split(bare, &mut values);
            let is_point = values.iter().all(|value| value.is_empty() || is_number(value));
            let separator = Separator::of(bare);
            let names = names_of(bare, separator);
            match (is_comment, is_point) {
                (true, _) if is_header(&names) => columns = Some(named(number, &names)?),
                (true, _) => {
                    let is_list =
                        separator != Separator::Blanks && names.len() >= 3 && !names.iter().any(|name| is_number(name));
                    maybe_names = is_list.then_some((number, names));
                }
                (false, false) if names.iter().all(|name| is_meant_for_number(&name.replace(' ', ""))) => {
                    return Err(malformed(
                        number,
                        "numbers that cannot be told apart; decimals are written with points".into(),
                    ));
                }
                (false, false) => columns = Some(named(number, &names)?),
                (false, true) => {}
            }
            if is_comment || !is_point {
                continue;
            }
        }
        let separator = match &columns {
            Some(Columns { separator: Some(separator), .. }) => *separator,
            Some(Columns { count, .. }) => Separator::of_point(bare, *count),
            None => Separator::of_numbers(bare),
        };
        separator.split(bare, &mut values);
        if columns.is_none() {
            drop_empty_end(&mut values, 0);
            if values.len() < 3 {
                return Err(malformed(number, format!("{} values, a point has three", values.len())));
            }
            columns = Some(match maybe_names.take().filter(|(_, names)| names.len() == values.len()) {
                Some((line, names)) => named(line, &names)?,
                None => {
                    let intensity = (values.len() == 4).then_some(3);
                    let label = unnamed(file, label_field)?;
                    let offsets = FieldOffsets { xyz: [0, 1, 2], intensity, label, is_label_named: false };
                    Columns { offsets, count: values.len(), separator: None }
                }
            });
        }
        let Some(Columns { offsets, count, separator: known }) = &mut columns else { unreachable!("set above") };
        *known = Some(separator);
        drop_empty_end(&mut values, *count);
        if values.len() != *count {
            let cure = match separator {
                Separator::Sign(',') if values.len() > *count => {
                    "; decimals are written with points, and texts that hold commas in quotes"
                }
                _ => "; all lines need as many",
            };
            return Err(malformed(
                number,
                format!("{} values where the lines before have {count}{cure}", values.len()),
            ));
        }
        let value = |column: usize| match values[column] {
            "" => Ok(f64::NAN),
            value => value.parse().map_err(|_| malformed(number, no_number(value))),
        };
        let or_none = |column: Option<usize>| column.map_or(Ok(f64::NAN), value);
        let [x, y, z] = offsets.xyz.map(value);
        let gathered = gathered.get_or_insert_with(|| Gathered::of(offsets));
        gathered.push(DVec3::new(x?, y?, z?), or_none(offsets.intensity)?, or_none(offsets.label)?);
    }
    gathered.unwrap_or_default().finish(file)
}

impl Separator {
    const SIGNS: [char; 3] = [';', ',', '\t'];

    /// Of names.
    fn of(line: &str) -> Separator {
        Separator::SIGNS.into_iter().find(|sign| line.contains(*sign)).map_or(Separator::Blanks, Separator::Sign)
    }

    /// Of numbers without names, whose tabs may be as many as align them.
    fn of_numbers(line: &str) -> Separator {
        match Separator::of(line) {
            Separator::Sign('\t') => Separator::Blanks,
            separator => separator,
        }
    }

    /// Of a point of so many values: a text among them may hold what separates nothing.
    fn of_point(line: &str, count: usize) -> Separator {
        let signs = Separator::SIGNS.into_iter().filter(|sign| line.contains(*sign)).map(Separator::Sign);
        let fits = |separator: &Separator| {
            let mut values = Vec::new();
            separator.split(line, &mut values);
            drop_empty_end(&mut values, count);
            values.len() == count
        };
        signs.chain([Separator::Blanks]).find(fits).unwrap_or(Separator::of(line))
    }

    /// The values of a line, trimmed; between blanks none is empty. What stands in double quotes is one value.
    fn split<'t>(self, line: &'t str, values: &mut Vec<&'t str>) {
        values.clear();
        let mut is_quoted = false;
        let ends = |c: char| match self {
            Separator::Sign(sign) => c == sign,
            Separator::Blanks => c.is_ascii_whitespace(),
        };
        let parts = line.split(|c: char| {
            is_quoted ^= c == '"';
            !is_quoted && ends(c)
        });
        let parts = parts.map(str::trim);
        match self {
            Separator::Sign(_) => values.extend(parts),
            Separator::Blanks => values.extend(parts.filter(|part| !part.is_empty())),
        }
    }
}

/// Nothing is missing behind the last separators of a line, unless so many values are wanted.
fn drop_empty_end(values: &mut Vec<&str>, wanted: usize) {
    while values.len() > wanted && values.last() == Some(&"") {
        values.pop();
    }
}

/// Names of columns, without quotes; a unit in brackets belongs to the name before it.
fn names_of(line: &str, separator: Separator) -> Vec<String> {
    let mut values = Vec::new();
    separator.split(line, &mut values);
    drop_empty_end(&mut values, 0);
    let mut names: Vec<String> = Vec::new();
    for value in values.iter().map(|name| name.trim_matches('"')) {
        match names.last_mut().filter(|_| separator == Separator::Blanks && value.starts_with(['[', '('])) {
            Some(name) => *name = format!("{name} {value}"),
            None => names.push(value.into()),
        }
    }
    names.iter().map(|name| without_metres(name)).collect()
}

/// `x [m]` is x; with another unit it is another name, of which no coordinate is made.
fn without_metres(name: &str) -> String {
    let metres = ["[m]", "(m)"].into_iter().find_map(|unit| name.strip_suffix(unit));
    metres.unwrap_or(name).trim_end().into()
}

/// A line that says how many points follow.
fn is_count(line: &str) -> bool {
    line.bytes().all(|byte| byte.is_ascii_digit())
}

fn is_header(names: &[String]) -> bool {
    let is_axis = |name: &str, axis: &str| name.strip_suffix("_m").unwrap_or(name).eq_ignore_ascii_case(axis);
    ["x", "y", "z"].iter().all(|axis| names.iter().any(|name| is_axis(name, axis)))
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
