//! The named series of a panel -> the entries of its legend in lines, as many as fit beside each other.

use plotters::prelude::*;

use super::{Area, Drawn, Marks, Series, TEXT_SIZE, text};

const LINE_HEIGHT: i32 = TEXT_SIZE + 6;
/// From an entry's left end to its words, for the sign; and between entries.
const SIGN_WIDTH: i32 = 24;
const GAP: i32 = 18;
/// Mean width of a letter, a little more than that of common fonts.
const LETTER_WIDTH: f64 = 0.58;

/// An entry: which series, and where its upper left corner is.
pub(super) struct Entry {
    series: usize,
    x: i32,
    line: i32,
}

/// Puts the entries into lines of some width, in pixels.
pub(super) fn arranged(series: &[Series], width: i32) -> Vec<Entry> {
    let (mut x, mut line) = (0, 0);
    let mut entries = Vec::new();
    for (k, series) in series.iter().enumerate() {
        let Some(name) = &series.name else { continue };
        let words = (LETTER_WIDTH * f64::from(TEXT_SIZE) * name.chars().count() as f64).ceil() as i32;
        let entry = SIGN_WIDTH + words;
        if x > 0 && x + entry > width {
            (x, line) = (0, line + 1);
        }
        entries.push(Entry { series: k, x, line });
        x += entry + GAP;
    }
    entries
}

pub(super) fn height(entries: &[Entry]) -> i32 {
    entries.last().map_or(0, |entry| (entry.line + 1) * LINE_HEIGHT + 4)
}

pub(super) fn draw(area: &Area, series: &[Series], entries: &[Entry], (left, top): (i32, i32)) -> Drawn {
    for entry in entries {
        let Series { name, colour, opacity, marks } = &series[entry.series];
        let (x, y) = (left + entry.x, top + entry.line * LINE_HEIGHT + LINE_HEIGHT / 2);
        let colour = colour.mix(*opacity);
        match marks {
            Marks::Line(_, width) => {
                area.draw(&PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(*width)))?
            }
            Marks::Dots(_, radius) => area.draw(&Circle::new((x + 9, y), *radius, colour.filled()))?,
            Marks::Rings(..) => area.draw(&Circle::new((x + 9, y), 5, colour.stroke_width(2)))?,
            Marks::Bars(_) | Marks::Tiles(_) => {
                area.draw(&Rectangle::new([(x + 3, y - 5), (x + 15, y + 5)], colour.filled()))?
            }
            Marks::Intervals(_) => area.draw(&PathElement::new([(x + 9, y - 6), (x + 9, y + 6)], colour))?,
            Marks::Words(_) => (),
        }
        let name = name.as_deref().unwrap_or_default();
        text(area, name, (x + SIGN_WIDTH, y - TEXT_SIZE / 2), TEXT_SIZE, &BLACK)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_entries_that_do_not_fit_go_into_the_next_line() {
        let named = |name: &str| Series::named(name, BLACK, Marks::Line(Vec::new(), 1));
        let series =
            [named("ten letters"), Series::unnamed(BLACK, Marks::Bars(Vec::new())), named("more"), named("of them")];
        let lines = |width| arranged(&series, width).iter().map(|entry| (entry.series, entry.line)).collect::<Vec<_>>();
        assert_eq!(lines(1000), [(0, 0), (2, 0), (3, 0)]);
        assert_eq!(lines(190), [(0, 0), (2, 0), (3, 1)]);
        assert_eq!(lines(10), [(0, 0), (2, 1), (3, 2)]);
        assert_eq!(height(&arranged(&series, 10)), 3 * LINE_HEIGHT + 4);
        assert_eq!(height(&arranged(&series[1..2], 10)), 0);
    }
}
