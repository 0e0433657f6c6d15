//! Rows and columns of numbers -> a table whose fields are shaded by a share: a confusion matrix.

use plotters::prelude::*;

use super::{Colour, Drawn, GREY, draw, text};

const ROWS_FROM: (i32, i32) = (190, 104);
const FIELD: (i32, i32) = (240, 140);
const GAP: i32 = 10;
const LEFT: i32 = 24;

#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub words: String,
    /// Below the words, smaller.
    pub detail: String,
    pub colour: Colour,
    /// How dark, from 0 to 1.
    pub share: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct ShadedTable {
    pub title: String,
    pub subtitle: String,
    pub columns: Vec<String>,
    /// Each with its name, which may have two lines.
    pub rows: Vec<(String, Vec<Field>)>,
}

impl ShadedTable {
    pub(crate) fn svg(&self) -> String {
        let width = ROWS_FROM.0 + self.columns.len() as i32 * (FIELD.0 + GAP) + LEFT;
        let height = ROWS_FROM.1 + self.rows.len() as i32 * (FIELD.1 + GAP) + LEFT / 2;
        draw((width as u32, height as u32), |area| {
            text(area, &self.title, (LEFT, 16), 20, &BLACK)?;
            text(area, &self.subtitle, (LEFT, 42), 15, &GREY)?;
            for (k, name) in (0..).zip(&self.columns) {
                text(area, name, (ROWS_FROM.0 + k * (FIELD.0 + GAP), 78), 16, &BLACK)?;
            }
            for (row, (name, fields)) in (0..).zip(&self.rows) {
                let top = ROWS_FROM.1 + row * (FIELD.1 + GAP);
                for (line, words) in (0..).zip(name.lines()) {
                    text(area, words, (LEFT, top + 50 + 20 * line), 16, &BLACK)?;
                }
                for (column, field) in (0..).zip(fields) {
                    field.draw(area, (ROWS_FROM.0 + column * (FIELD.0 + GAP), top))?;
                }
            }
            Ok(())
        })
    }
}

impl Field {
    fn draw(&self, area: &super::Area, (left, top): (i32, i32)) -> Drawn {
        let shade = self.colour.mix(0.12 + 0.75 * self.share).filled();
        area.draw(&Rectangle::new([(left, top), (left + FIELD.0, top + FIELD.1)], shade))?;
        let ink = if self.share > 0.55 { WHITE } else { BLACK };
        text(area, &self.words, (left + 24, top + 40), 26, &ink)?;
        text(area, &self.detail, (left + 24, top + 78), 16, &ink)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_every_field_is_drawn_and_the_picture_is_as_large_as_the_table() {
        let field = |words: &str| Field { words: words.into(), detail: "some".into(), colour: RED, share: 0.5 };
        let rows = vec![("truly\nfree".into(), vec![field("one"), field("two")])];
        let columns = ["left", "right"].map(String::from).to_vec();
        let svg = ShadedTable { title: "T".into(), subtitle: String::new(), columns, rows }.svg();
        assert!(svg.contains(&format!("width=\"{}\"", 190 + 2 * 250 + 24)), "{svg}");
        assert!(["left", "right", "truly", "free", "one", "two"].iter().all(|words| svg.contains(words)));
        assert_eq!(svg.matches("<rect").count(), 1 + 2);
    }
}
