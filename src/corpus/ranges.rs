//! Shard numbers <-> text: `0..3,7` (half-open ranges, single numbers alone), and `3/16` (a part of all).
//!
//! A part is a stride: part 3 of 16 is the shards 3, 19, 35 ... Machines that each take a part need not know how many shards
//! there are, and a corpus that grows gives each of them some of the new ones.

use std::ops::Range;
use std::str::FromStr;

/// Ascending numbers as text; "none" where there are none.
pub(crate) fn to_text(numbers: &[u64]) -> String {
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

/// Which of a plan's shards are meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Never empty.
    Ranges(Vec<Range<u64>>),
    /// Every `of`th shard from `part` on; `part < of`.
    Part { part: u64, of: u64 },
}

impl FromStr for Selection {
    type Err = String;

    fn from_str(text: &str) -> Result<Selection, String> {
        let number = |digits: &str| {
            digits.trim().parse::<u64>().map_err(|_| format!("'{digits}' is not a shard number, in '{text}'"))
        };
        if let Some((part, of)) = text.split_once('/') {
            let (part, of) = (number(part)?, number(of)?);
            if part < of {
                return Ok(Selection::Part { part, of });
            }
            return Err(match of {
                0 => format!("'{text}': there is no part of 0 parts"),
                _ => format!("'{text}': {of} parts are numbered 0 to {}", of - 1),
            });
        }
        let range = |part: &str| match part.split_once("..") {
            None => number(part)?.checked_add(1).map(|after| after - 1..after).ok_or(format!("'{part}' is too large")),
            Some((first, after)) => {
                let range = number(first)?..number(after)?;
                if range.is_empty() {
                    Err(format!("'{part}' is empty: ranges are half open, as 7..8"))
                } else {
                    Ok(range)
                }
            }
        };
        text.split(',').map(range).collect::<Result<_, _>>().map(Selection::Ranges)
    }
}

impl Selection {
    /// The shards that are meant, of so many, ascending and each once; a part may have none. A range beyond the last shard is
    /// refused: it was meant for another plan.
    pub(crate) fn of(&self, shards: u64) -> Result<Vec<u64>, String> {
        match self {
            &Selection::Part { part, of } => {
                // A step too wide for memory is one step as well.
                Ok((part..shards).step_by(usize::try_from(of).unwrap_or(usize::MAX)).collect())
            }
            Selection::Ranges(ranges) => {
                if let Some(beyond) = ranges.iter().find(|range| range.end > shards) {
                    return Err(format!(
                        "{}..{} goes beyond the plan: its shards are 0..{shards}",
                        beyond.start, beyond.end
                    ));
                }
                let mut sorted = ranges.clone();
                sorted.sort_unstable_by_key(|range| (range.start, range.end));
                let mut next = 0;
                let mut numbers = Vec::new();
                for range in sorted {
                    numbers.extend(range.start.max(next)..range.end);
                    next = range.end.max(next);
                }
                Ok(numbers)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn selected(text: &str, shards: u64) -> Vec<u64> {
        text.parse::<Selection>().unwrap().of(shards).unwrap()
    }

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
            assert_eq!(to_text(&selected(text, 9)), text);
        }
        assert_eq!(selected("7..8", 8), [7]);
        assert_eq!(selected("5..9, 2,6..7,2", 9), [2, 5, 6, 7, 8], "any order, each once");
    }

    #[test]
    fn law_the_parts_of_a_corpus_are_all_of_it_each_shard_once() {
        for (shards, of) in [(20, 1), (20, 3), (20, 20), (7, 16)] {
            let mut all: Vec<u64> = (0..of).flat_map(|part| selected(&format!("{part}/{of}"), shards)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..shards).collect::<Vec<_>>(), "{shards} shards in {of} parts");
        }
        assert_eq!(selected("3/16", 40), [3, 19, 35]);
    }

    #[test]
    fn extreme_bad_selections_are_named() {
        for bad in [
            "",
            "x",
            "3..3",
            "4..2",
            "1..",
            "-1",
            "1,,2",
            "16/16",
            "0/0",
            "1/2/3",
            "18446744073709551615",
            "99999999999999999999",
        ] {
            assert!(bad.parse::<Selection>().is_err(), "{bad}");
        }
        let beyond = "2..99999999999".parse::<Selection>().unwrap();
        assert!(beyond.of(8).unwrap_err().contains("shards are 0..8"));
        assert_eq!(selected("0/18446744073709551615", 8), [0]);
    }
}
