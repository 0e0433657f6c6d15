//! A table of words -> lines with aligned columns, for a terminal.
//!
//! In: a title, headings and rows of cells that are words already. Out: lines behind those that are there. Not here: Markdown, whose
//! readers align for themselves.

use std::fmt::Write;

/// Headings, and rows that may be a heading of their own (one cell).
pub(super) struct Grid {
    pub title: String,
    pub head: Vec<&'static str>,
    pub rows: Vec<Vec<String>>,
}

impl Grid {
    /// Columns aligned; the first to the left, the others to the right. Headings stand at the foot of their lines.
    pub(super) fn align(&self, out: &mut String) {
        let words: Vec<Vec<&str>> = self.head.iter().map(|head| head.split('\n').collect()).collect();
        let lines = words.iter().map(Vec::len).max().unwrap_or(0);
        let head_line = |line: usize| -> Vec<String> {
            let word = |words: &Vec<&str>| match (line + words.len()).checked_sub(lines) {
                Some(k) => words[k].to_owned(),
                None => String::new(),
            };
            words.iter().map(word).collect()
        };
        let heads: Vec<Vec<String>> = (0..lines).map(head_line).collect();
        let all = || heads.iter().chain(&self.rows);
        let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        for row in all() {
            let cells = row.iter().zip(&widths).enumerate();
            let padded = cells.map(
                |(k, (cell, &width))| {
                    if k == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                },
            );
            let line = padded.collect::<Vec<_>>().join("  ");
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_columns_are_aligned() {
        let rows = vec![vec!["a".into(), "1".into()], vec!["long".into(), "22.5".into()]];
        let grid = Grid { title: String::new(), head: vec!["name", "of\ntwo"], rows };
        let mut out = String::new();
        grid.align(&mut out);
        assert_eq!(out, "        of\nname   two\na        1\nlong  22.5\n");
    }
}
