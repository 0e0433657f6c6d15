//! Names and types of a file's columns -> which of them are x, y, z, intensity and label. Shared by PLY, PCD and text.

use super::CloudError;

/// Types of numbers in binary clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    pub(super) fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }

    /// The number that starts at `at`; the caller has checked that the bytes are there.
    pub(super) fn take(self, bytes: &[u8], at: usize, big_endian: bool) -> f64 {
        let mut raw = [0; 8];
        let size = self.size();
        raw[..size].copy_from_slice(&bytes[at..at + size]);
        if big_endian {
            raw[..size].reverse();
        }
        let low = u64::from_le_bytes(raw);
        match self {
            Number::I8 => f64::from(low as i8),
            Number::U8 => f64::from(low as u8),
            Number::I16 => f64::from(low as i16),
            Number::U16 => f64::from(low as u16),
            Number::I32 => f64::from(low as i32),
            Number::U32 => f64::from(low as u32),
            Number::I64 => low as i64 as f64,
            Number::U64 => low as f64,
            Number::F32 => f64::from(f32::from_bits(low as u32)),
            Number::F64 => f64::from_bits(low),
        }
    }
}

/// Where the values of a point stand among the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FieldOffsets {
    pub xyz: [usize; 3],
    pub intensity: Option<usize>,
    pub label: Option<usize>,
    /// Whether the user named the column of labels.
    pub is_label_named: bool,
}

/// A text of a file as messages show it: no longer than this many characters.
pub(super) fn shown(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.into(),
    }
}

/// What should be a number and is none, as messages show it: a file may be anything, so only what was meant for a number.
pub(super) fn no_number(word: &str) -> String {
    let meant = is_meant_for_number(word);
    let cure = if meant && word.contains(',') { "; decimals are written with points" } else { "" };
    format!("'{}' is not a number{cure}", if meant { word } else { "..." })
}

pub(super) fn is_number(word: &str) -> bool {
    word.parse::<f64>().is_ok()
}

/// Whether a word has no letter but those of numbers.
pub(super) fn is_meant_for_number(word: &str) -> bool {
    word.len() <= 24 && word.chars().all(|c| c.is_ascii_digit() || "+-.,eE".contains(c))
}

/// The columns' names as messages show them, where they look like such.
fn shown_names(names: &[String]) -> String {
    let plain = |name: &String| {
        name.len() <= 32
            && name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || "_.:".contains(c))
    };
    let is_header = names.len() >= 2 && names.iter().all(plain);
    if is_header { format!("'{}'", shown(&names.join(" "), 300)) } else { format!("{} columns", names.len()) }
}

/// What files call them, likeliest first, in lower case.
const INTENSITIES: [&str; 6] =
    ["intensity", "scalar_intensity", "reflectance", "remission", "reflectivity", "scalar_reflectance"];
const LABELS: [&str; 6] = ["label", "class", "classification", "semantic", "scalar_label", "scalar_classification"];

impl FieldOffsets {
    /// `label_field`: the name that the user gave.
    pub(super) fn of(
        file: &str,
        place: &str,
        names: &[String],
        label_field: Option<&str>,
    ) -> Result<FieldOffsets, CloudError> {
        let malformed = |reason: String| CloudError::Malformed { file: file.into(), place: place.into(), reason };
        let there = shown_names(names);
        let find = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
        let coordinate = |axis: &str| {
            find(axis).or_else(|| find(&format!("{axis}_m"))).ok_or_else(|| {
                malformed(format!("there is no column {axis} among {there}; name the columns x, y and z"))
            })
        };
        let label = match label_field {
            Some(name) => {
                Some(find(name).ok_or_else(|| malformed(format!("there is no label column '{name}' among {there}")))?)
            }
            None => LABELS.iter().find_map(|name| find(name)),
        };
        Ok(FieldOffsets {
            xyz: [coordinate("x")?, coordinate("y")?, coordinate("z")?],
            intensity: INTENSITIES.iter().find_map(|name| find(name)),
            label,
            is_label_named: label_field.is_some(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_messages_show_numbers_and_names_and_nothing_else() {
        assert_eq!(no_number("1.2.3"), "'1.2.3' is not a number");
        assert_eq!(no_number("3,6"), "'3,6' is not a number; decimals are written with points");
        assert_eq!(no_number("AKIDEXAMPLE"), "'...' is not a number");
        let names = |all: &[&str]| shown_names(&all.iter().map(|name| (*name).to_string()).collect::<Vec<_>>());
        assert_eq!(names(&["east", "north_m", "up"]), "'east north_m up'");
        assert_eq!(names(&["aws_access_key_id", "=", "AKIDEXAMPLE"]), "3 columns");
        assert_eq!(names(&["hush"]), "1 columns");
    }
}
