//! Entries -> validation error over the number of weights as SVG.

use plotters::prelude::*;

use super::entry::Entry;
use super::networks::shown;
use super::rungs::{front, smallest_within};

pub const NAME: &str = "search.svg";

const SIZE: (u32, u32) = (900, 560);
const LEFT_BEHIND: RGBColor = RGBColor(205, 205, 205);
/// One, two, three and more hidden layers.
const BY_DEPTH: [RGBColor; 3] = [RGBColor(44, 110, 160), RGBColor(178, 80, 30), RGBColor(70, 130, 60)];
/// Dots that a picture can show; more are thinned out evenly.
const MOST_DOTS: usize = 4000;

/// The picture ends at so many times the lowest error; what is worse stands at its upper edge.
const TALLEST: f64 = 4.0;

/// Networks of the last rung by depth, those left behind in grey, what no smaller network beats as a line, the chosen network ringed.
/// `entries`: of each rung, best first. `None` where there is nothing to draw.
pub fn svg(entries: &[Vec<Entry>], margin: f64) -> Option<String> {
    let (last, earlier) = entries.split_last()?;
    let dots = |entries: &[Entry]| -> Vec<(f64, f64)> {
        let step = entries.len().div_ceil(MOST_DOTS).max(1);
        entries.iter().step_by(step).filter_map(dot).collect()
    };
    let finalists: std::collections::BTreeSet<_> = last.iter().map(|entry| &entry.hidden).collect();
    let first = earlier.first().map_or(&[][..], Vec::as_slice);
    let behind: Vec<Entry> = first.iter().filter(|entry| !finalists.contains(&entry.hidden)).cloned().collect();
    let (behind, all) = (dots(&behind), dots(last));
    let bounds = |of: fn(&(f64, f64)) -> f64| {
        let values = || behind.iter().chain(&all).map(of);
        (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max))
    };
    let ((least, most), (lowest, highest)) = (bounds(|dot| dot.0), bounds(|dot| dot.1));
    if !(lowest > 0.0 && lowest.is_finite()) {
        return None;
    }
    let mut text = String::new();
    let top = (1.05 * highest).min(TALLEST * lowest);
    draw(&mut text, last, &behind, [0.9 * least, 1.1 * most, 0.95 * lowest, top], margin).ok()?;
    Some(text)
}

fn dot(entry: &Entry) -> Option<(f64, f64)> {
    Some((entry.weights as f64, entry.validation_error?))
}

fn draw(
    text: &mut String,
    last: &[Entry],
    behind: &[(f64, f64)],
    [left, right, bottom, top]: [f64; 4],
    margin: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d((left..right).log_scale(), bottom..top)?;
    let inside = |(weights, error): (f64, f64)| (weights, error.min(top));
    chart
        .configure_mesh()
        .x_desc("weights")
        .y_desc("validation error (weighted mean squared error)")
        .light_line_style(WHITE)
        .x_label_formatter(&|weights| format!("{weights:.0}"))
        .y_label_formatter(&|error| format!("{error:.3}"))
        .draw()?;
    let legend = |colour: RGBColor| move |(x, y)| Circle::new((x + 9, y), 3, colour.filled());
    if !behind.is_empty() {
        chart
            .draw_series(behind.iter().map(|&at| Circle::new(inside(at), 2, LEFT_BEHIND.filled())))?
            .label("left behind, after the first rung")
            .legend(legend(LEFT_BEHIND));
    }
    for (depth, colour) in (1..).zip(BY_DEPTH) {
        let here = |entry: &&Entry| entry.hidden.len().min(BY_DEPTH.len()) == depth;
        let dots: Vec<_> = last.iter().filter(here).filter_map(dot).collect();
        if dots.is_empty() {
            continue;
        }
        let name = if depth == 1 { "one hidden layer".into() } else { format!("{depth} hidden layers") };
        chart
            .draw_series(dots.into_iter().take(MOST_DOTS).map(|at| Circle::new(inside(at), 3, colour.filled())))?
            .label(name)
            .legend(legend(colour));
    }
    let mut steps: Vec<(f64, f64)> = Vec::new();
    for at in front(last).into_iter().filter_map(dot) {
        let at = inside(at);
        steps.extend(steps.last().map(|before| (at.0, before.1)));
        steps.push(at);
    }
    steps.extend(steps.last().map(|before| (right, before.1)));
    chart
        .draw_series(LineSeries::new(steps, BLACK.mix(0.6).stroke_width(1)))?
        .label("the best of that size or smaller")
        .legend(|(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], BLACK.mix(0.6).stroke_width(1)));
    if let Some((entry, at)) = smallest_within(last, margin).and_then(|entry| Some((entry, dot(entry)?))) {
        chart
            .draw_series([Circle::new(at, 8, BLACK.stroke_width(2))])?
            .label(format!("{}: the smallest within {margin} of the best", shown(&entry.hidden)))
            .legend(|(x, y)| Circle::new((x + 9, y), 5, BLACK.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(LEFT_BEHIND)
        .draw()?;
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::rungs::tests::entry;
    use super::*;

    #[test]
    fn law_the_picture_holds_all_dots_the_front_and_the_chosen_network() {
        let first =
            vec![entry(&[1], 20, 0.3), entry(&[2, 3], 40, 0.2), entry(&[4], 60, 0.25), entry(&[2, 2, 2], 50, 0.1)];
        let last = vec![first[3].clone(), first[1].clone()];
        let text = svg(&[first, last], 0.11).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        assert!(text.contains("2-3: the smallest within 0.11 of the best"), "{text}");
        assert!(text.contains("3 hidden layers") && !text.contains("one hidden layer"));
        // Two left behind, two of the last rung, a ring; and as many legends: 1 + 2 + 1.
        assert_eq!(text.matches("<circle").count(), 5 + 4);
    }

    #[test]
    fn extreme_nothing_to_draw_is_no_picture() {
        assert_eq!(svg(&[], 0.1), None);
        assert_eq!(svg(&[vec![]], 0.1), None);
        assert_eq!(svg(&[vec![entry(&[1], 20, f64::NAN)]], 0.1), None);
        assert!(svg(&[vec![entry(&[1], 20, 0.2)]], 0.1).is_some());
    }
}
