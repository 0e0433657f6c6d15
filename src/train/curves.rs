//! The looks of a run -> both learning curves as SVG.
//!
//! Errors fall fast and then slowly: where they span more than a factor of four the axis is logarithmic.

use super::stopping::Look;
use crate::chart::{self, Axis, Colour, Marks, Panel, Point, Series};

const SIZE: (u32, u32) = (900, 520);
const TRAIN: Colour = Colour(150, 150, 150);
const VALIDATION: Colour = Colour(178, 80, 30);

/// Points of a curve that a picture can show; more are thinned out evenly.
const MOST_POINTS: usize = 2000;

/// Training and validation error over the rows learnt, the look whose weights are kept marked. `None` where there is nothing to draw.
pub(crate) fn svg(looks: &[Look], best: Option<&Look>) -> Option<String> {
    let step = looks.len().div_ceil(MOST_POINTS).max(1);
    let curve = |of: fn(&Look) -> Option<f64>| -> Vec<Point> {
        looks.iter().step_by(step).filter_map(|look| Some((look.rows as f64, of(look)?))).collect()
    };
    let (train, validation) = (curve(|look| look.train_error), curve(|look| look.validation_error));
    let best = best.and_then(|look| Some((look.rows as f64, look.validation_error?)));
    let errors: Vec<f64> = train.iter().chain(&validation).chain(&best).map(|point| point.1).collect();
    let last = looks.last()?.rows.max(1) as f64;
    if !errors.iter().any(|error| *error > 0.0) {
        return None;
    }
    let mut series = vec![
        Series::named("training, before each row is learnt", TRAIN, Marks::Line(train, 2)),
        Series::named("validation", VALIDATION, Marks::Line(validation, 2)),
    ];
    if let Some((rows, error)) = best {
        let name = format!("kept: {error:.5} after {rows:.0} rows");
        series.push(Series::named(name, VALIDATION, Marks::Dots(vec![(rows, error)], 5)));
    }
    let y = Axis::of_values("weighted mean squared error", errors.into_iter());
    let panel = Panel { title: String::new(), x: Axis::linear("rows learnt", 0.0..last), y, series };
    Some(chart::svg(SIZE, &[panel]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(rows: u64, train: Option<f64>, validation: Option<f64>) -> Look {
        Look { rows, epoch: 0, train_error: train, validation_error: validation }
    }

    #[test]
    fn law_the_picture_holds_both_curves_and_the_best() {
        let looks = [look(0, None, Some(0.2)), look(10, Some(0.15), Some(0.1)), look(20, Some(0.1), Some(0.12))];
        let text = svg(&looks, Some(&looks[1])).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        assert!(text.matches("<polyline").count() >= 2);
        assert!(text.contains("kept: 0.10000 after 10 rows"), "{text}");
    }

    #[test]
    fn extreme_nothing_to_draw_is_no_picture() {
        assert_eq!(svg(&[], None), None);
        assert_eq!(svg(&[look(0, None, None)], None), None);
        assert!(svg(&[look(0, None, Some(0.3))], None).is_some());
    }
}
