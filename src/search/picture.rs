//! Entries -> validation error over the number of weights as SVG.

use std::collections::BTreeSet;

use super::entry::Entry;
use super::networks::shown;
use super::rungs::{front, smallest_within};
use crate::chart::{self, Axis, Colour, Marks, Panel, Point, Series};

pub(crate) const NAME: &str = "search.svg";

const SIZE: (u32, u32) = (900, 560);
const BLACK: Colour = Colour(0, 0, 0);
const LEFT_BEHIND: Colour = Colour(190, 190, 190);
/// One, two, three and more hidden layers.
const BY_DEPTH: [Colour; 3] = [Colour(44, 110, 160), Colour(178, 80, 30), Colour(70, 130, 60)];
/// Dots that a picture can show; more are thinned out evenly.
const MOST_DOTS: usize = 4000;
/// The picture ends at so many times the lowest error; what is worse stands at its upper edge.
const TALLEST: f64 = 30.0;

/// Networks of the last rung by depth, those left behind in grey, what no smaller network beats as a line, the chosen network ringed.
/// `entries`: of each rung, best first. `None` where there is nothing to draw.
pub(crate) fn svg(entries: &[Vec<Entry>], margin: f64) -> Option<String> {
    let (last, earlier) = entries.split_last()?;
    let finalists: BTreeSet<_> = last.iter().map(|entry| &entry.hidden).collect();
    let first = earlier.first().map_or(&[][..], Vec::as_slice);
    let behind = thinned(first.iter().filter(|entry| !finalists.contains(&entry.hidden)));
    let finals: Vec<Point> = last.iter().filter_map(point).collect();
    let shown_points = || behind.iter().chain(&finals);
    let lowest = shown_points().map(|point| point.1).fold(f64::INFINITY, f64::min);
    if !(lowest > 0.0 && lowest.is_finite()) {
        return None;
    }
    let top = TALLEST * lowest;
    let clipped = |points: Vec<Point>| -> Vec<Point> {
        points.into_iter().map(|(weights, error)| (weights, error.min(top))).collect()
    };
    let least = shown_points().map(|point| point.0).fold(f64::INFINITY, f64::min);
    let most = shown_points().map(|point| point.0).fold(0.0, f64::max);
    let y =
        Axis::of_values("validation error (weighted mean squared error)", shown_points().map(|point| point.1.min(top)));
    let x = Axis::logarithmic("weights", 0.9 * least..1.1 * most);

    let mut series = Vec::new();
    if !behind.is_empty() {
        let dots = Marks::Dots(clipped(behind), 2);
        series.push(Series::named("left behind, after the first rung", LEFT_BEHIND, dots));
    }
    for (depth, colour) in (1..).zip(BY_DEPTH) {
        let dots = thinned(last.iter().filter(|entry| entry.hidden.len().min(BY_DEPTH.len()) == depth));
        if !dots.is_empty() {
            let name = if depth == 1 { "one hidden layer".into() } else { format!("{depth} hidden layers") };
            series.push(Series::named(name, colour, Marks::Dots(clipped(dots), 3)));
        }
    }
    let best_by_size = clipped(front(last).into_iter().filter_map(point).collect());
    let steps = Marks::Line(staircase(&best_by_size, x.high()), 1);
    series.push(Series::named("the best of that size or smaller", BLACK, steps).with_opacity(0.6));
    if let Some((entry, at)) = smallest_within(last, margin).and_then(|entry| Some((entry, point(entry)?))) {
        let name = format!("{}: the smallest within {:.1} % of the best", shown(&entry.hidden), 100.0 * margin);
        series.push(Series::named(name, BLACK, Marks::Rings(vec![at], 8)));
    }
    Some(chart::svg(SIZE, &[Panel { title: String::new(), x, y, series }]))
}

fn point(entry: &Entry) -> Option<Point> {
    Some((entry.weights as f64, entry.validation_error?))
}

fn thinned<'a>(entries: impl Iterator<Item = &'a Entry>) -> Vec<Point> {
    let points: Vec<Point> = entries.filter_map(point).collect();
    let step = points.len().div_ceil(MOST_DOTS).max(1);
    points.into_iter().step_by(step).collect()
}

/// Level from each point to below the next, and on to the right edge.
fn staircase(points: &[Point], right: f64) -> Vec<Point> {
    let ends = points.iter().skip(1).map(|next| next.0).chain([right]);
    points.iter().zip(ends).flat_map(|(&(x, y), end)| [(x, y), (end, y)]).collect()
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
        let text = svg(&[first, last], 1.1).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        assert!(text.contains("2-3: the smallest within 110.0 % of the best"), "{text}");
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
