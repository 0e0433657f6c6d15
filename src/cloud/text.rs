//! CSV, XYZ and the like: one point a line.
//!
//! Values stand between semicolons, else commas, else tabs, else blanks, as the first point has them; decimals have points. Between two
//! separators may be nothing: a coordinate that is not there is not finite. The first line may name the columns (`x y z ...`, in any order and
//! case, with metres behind them or nothing, also behind `#` or `//`). Without names the first three are x, y, z; a fourth, if there are exactly
//! four, is the intensity; others are left out. All lines have as many values as there are names, or as the first. Empty lines and lines
//! that start with `#` or `//` are skipped; a line with a single whole number before the first point (a count) too.

use std::iter::Peekable;

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
    separator: Separator,
}

/// A line that holds more than blanks and the sign of a comment.
struct Line<'t> {
    /// From 1 on.
    number: usize,
    is_comment: bool,
    /// Without the sign of a comment and the spaces around it. A tab at the beginning stays: before it is a value that is not there.
    text: &'t str,
}

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = lines(&text).peekable();
    let Some(columns) = columns(file, &mut lines, label_field)? else {
        return Gathered::default().finish(file);
    };
    let mut gathered = Gathered::of(&columns.offsets);
    let mut values = Vec::new();
    for line in lines.filter(|line| !line.is_comment) {
        let (point_m, intensity, label) =
            columns.point(&line, &mut values).map_err(|reason| malformed(file, &line, reason))?;
        gathered.push(point_m, intensity, label);
    }
    gathered.finish(file)
}

fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate().map(|(k, line)| {
        let line = line.trim_matches(' ');
        let text = line.trim_start_matches(['#', '/']).trim_matches(' ');
        Line { number: k + 1, is_comment: line.starts_with(['#', '/']), text }
    });
    lines.filter(|line| !line.text.trim().is_empty())
}

fn malformed(file: &str, line: &Line, reason: String) -> CloudError {
    CloudError::Malformed { file: file.into(), place: format!("line {}", line.number), reason }
}

/// Takes the lines before the first point; the columns follow from these and from that point, which is left in `lines`. `None` where there is no
/// point.
fn columns<'t>(
    file: &str,
    lines: &mut Peekable<impl Iterator<Item = Line<'t>>>,
    label_field: Option<&str>,
) -> Result<Option<Columns>, CloudError> {
    let offsets_of = |line: usize, names: &[String]| {
        FieldOffsets::of(file, &format!("line {line} (column names)"), names, label_field)
    };
    let mut named: Option<(FieldOffsets, usize)> = None;
    // The last comment, where it looks like names of columns, and its line.
    let mut maybe_names: Option<(usize, Vec<String>)> = None;
    let is_head =
        |line: &Line, is_named: bool| line.is_comment || is_count(line.text) || !is_named && !is_point(line.text);
    while let Some(line) = lines.next_if(|line| is_head(line, named.is_some())) {
        if named.is_some() || !line.is_comment && is_count(line.text) {
            continue;
        }
        let separator = Separator::of(line.text);
        let names = names_of(line.text, separator);
        if !line.is_comment && names.iter().all(|name| is_meant_for_number(&name.replace(' ', ""))) {
            let reason = "numbers that cannot be told apart; decimals are written with points";
            return Err(malformed(file, &line, reason.into()));
        }
        if !line.is_comment || is_header(&names) {
            named = Some((offsets_of(line.number, &names)?, names.len()));
        } else {
            let is_list =
                separator != Separator::Blanks && names.len() >= 3 && !names.iter().any(|name| is_number(name));
            maybe_names = is_list.then_some((line.number, names));
        }
    }
    let Some(first) = lines.peek() else { return Ok(None) };
    if let Some((offsets, count)) = named {
        return Ok(Some(Columns { offsets, count, separator: Separator::of_point(first.text, count) }));
    }
    let separator = Separator::of_numbers(first.text);
    let mut values = Vec::new();
    separator.split(first.text, &mut values);
    drop_empty_end(&mut values, 0);
    let count = values.len();
    if count < 3 {
        return Err(malformed(file, first, format!("{count} values, a point has three")));
    }
    let offsets = match maybe_names.filter(|(_, names)| names.len() == count) {
        Some((line, names)) => offsets_of(line, &names)?,
        None => FieldOffsets {
            xyz: [0, 1, 2],
            intensity: (count == 4).then_some(3),
            label: unnamed(file, label_field)?,
            is_label_named: false,
        },
    };
    Ok(Some(Columns { offsets, count, separator }))
}

impl Columns {
    /// Coordinates, intensity and label of a line, NaN where there is none; or what is wrong with it. `values` is scratch.
    fn point<'t>(&self, line: &Line<'t>, values: &mut Vec<&'t str>) -> Result<(DVec3, f64, f64), String> {
        self.separator.split(line.text, values);
        drop_empty_end(values, self.count);
        if values.len() != self.count {
            let cure = match self.separator {
                Separator::Sign(',') if values.len() > self.count => {
                    "; decimals are written with points, and texts that hold commas in quotes"
                }
                _ => "; all lines need as many",
            };
            return Err(format!("{} values where the lines before have {}{cure}", values.len(), self.count));
        }
        let value = |column: usize| match values[column] {
            "" => Ok(f64::NAN),
            value => value.parse().map_err(|_| no_number(value)),
        };
        let or_none = |column: Option<usize>| column.map_or(Ok(f64::NAN), value);
        let [x, y, z] = self.offsets.xyz.map(value);
        Ok((DVec3::new(x?, y?, z?), or_none(self.offsets.intensity)?, or_none(self.offsets.label)?))
    }
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

/// Numbers and values that are not there, and nothing else.
fn is_point(line: &str) -> bool {
    let mut values = Vec::new();
    Separator::of_numbers(line).split(line, &mut values);
    values.iter().all(|value| value.is_empty() || is_number(value))
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
