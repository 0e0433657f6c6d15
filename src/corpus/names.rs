//! The names that a corpus carries: one rule for what a user writes in a config and for what a manifest from anywhere says.
//!
//! A corpus's name is that of its folder and begins the names of run folders, so that a name is no path.

/// The rule in words.
pub(crate) const RULE: &str = "must be 1 to 64 letters, digits, '-', '_' or '.', not beginning with '.'";

/// Whether a text may name a corpus or a family.
pub(crate) fn is_folder_name(name: &str) -> bool {
    let legal = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    (1..=64).contains(&name.len()) && name.chars().all(legal) && !name.starts_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_names_are_one_part_of_a_path() {
        for name in ["a", "quickstart", "v1.2_b-c", &"x".repeat(64)] {
            assert!(is_folder_name(name), "{name}");
        }
        for name in ["", ".", "..", ".a", "../../evil", "/etc", "a/b", "a\\b", "a b", "a\n", "ä", &"x".repeat(65)] {
            assert!(!is_folder_name(name), "{name:?}");
        }
    }
}
