//! Shard numbers <-> text such as `0..3,7`: half-open ranges, single numbers alone.

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

/// The numbers that a text names, ascending and each once, or what is wrong with it.
pub fn from_text(text: &str) -> Result<Vec<u64>, String> {
    let number =
        |part: &str| part.trim().parse::<u64>().map_err(|_| format!("'{part}' is not a shard number, in '{text}'"));
    let mut numbers = Vec::new();
    for part in text.split(',') {
        match part.split_once("..") {
            None => numbers.push(number(part)?),
            Some((first, after)) => {
                let (first, after) = (number(first)?, number(after)?);
                if first >= after {
                    return Err(format!("'{part}' is empty: ranges are half open, as 7..8"));
                }
                if after - first > 100_000_000 {
                    return Err(format!("'{part}' names more than 100,000,000 shards"));
                }
                numbers.extend(first..after);
            }
        }
    }
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
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
            assert_eq!(to_text(&from_text(text).unwrap()), text);
        }
        assert_eq!(from_text("7..8").unwrap(), [7]);
    }

    #[test]
    fn extreme_bad_ranges_are_named() {
        for bad in ["", "x", "3..3", "4..2", "1..", "0..99999999999", "-1"] {
            assert!(from_text(bad).is_err(), "{bad}");
        }
    }
}
