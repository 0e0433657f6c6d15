//! Shard numbers <-> text such as `0..3,7`: half-open ranges, single numbers alone.

use std::ops::Range;
use std::str::FromStr;

/// Ascending numbers as text; "none" where there are none.
pub fn to_text(numbers: &[u64]) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut rest = numbers;
    while let Some(&first) = rest.first() {
        let run = rest.iter().zip(first..).take_while(|&(&number, expected)| number == expected).count();
        let after = first + run as u64;
        parts.push(if run == 1 { first.to_string() } else { format!("{first}..{after}") });
        rest = &rest[run..];
    }
    if parts.is_empty() { "none".into() } else { parts.join(",") }
}

/// Half-open ranges of shards, as typed: `3..5,9`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranges(Vec<Range<u64>>);

impl Ranges {
    pub fn contains(&self, number: u64) -> bool {
        self.0.iter().any(|range| range.contains(&number))
    }

    /// One more than the greatest number.
    pub fn end(&self) -> u64 {
        self.0.iter().map(|range| range.end).max().unwrap_or(0)
    }
}

impl FromStr for Ranges {
    type Err = String;

    fn from_str(text: &str) -> Result<Ranges, String> {
        let number =
            |part: &str| part.trim().parse::<u64>().map_err(|_| format!("'{part}' is not a shard number, in '{text}'"));
        let range = |part: &str| {
            let range = match part.split_once("..") {
                Some((first, after)) => number(first)?..number(after)?,
                None => {
                    let first = number(part)?;
                    first..first.checked_add(1).ok_or(format!("'{part}' is too great"))?
                }
            };
            if range.is_empty() { Err(format!("'{part}' is empty: ranges are half open, as 7..8")) } else { Ok(range) }
        };
        text.split(',').map(range).collect::<Result<_, _>>().map(Ranges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_runs_become_half_open_ranges() {
        assert_eq!(to_text(&[0, 1, 2, 7]), "0..3,7");
        assert_eq!(to_text(&[]), "none");
        assert_eq!(to_text(&[5, 9, 10]), "5,9..11");
        assert_eq!(to_text(&[u64::MAX - 2]), format!("{}", u64::MAX - 2));
    }

    #[test]
    fn equal_text_and_numbers_round_trip() {
        for text in ["0..3,7", "4", "1,3,5..9"] {
            let ranges: Ranges = text.parse().unwrap();
            let numbers: Vec<u64> = (0..ranges.end()).filter(|&n| ranges.contains(n)).collect();
            assert_eq!(to_text(&numbers), text);
        }
        let overlapping: Ranges = "5..9,0..6, 2".parse().unwrap();
        assert_eq!(to_text(&(0..20).filter(|&n| overlapping.contains(n)).collect::<Vec<_>>()), "0..9");
    }

    #[test]
    fn extreme_bad_ranges_are_named() {
        for bad in ["", "x", "3..3", "4..2", "1..", "-1", "1,,2", "18446744073709551615", "99999999999999999999"] {
            assert!(bad.parse::<Ranges>().is_err(), "{bad}");
        }
    }
}
