//! The looks of a run -> both learning curves as SVG.

use plotters::prelude::*;

use super::stopping::Look;

const SIZE: (u32, u32) = (900, 520);
const TRAIN: RGBColor = RGBColor(150, 150, 150);
const VALIDATION: RGBColor = RGBColor(178, 80, 30);

/// Points of a curve that a picture can show; more are thinned out evenly.
const MOST_POINTS: usize = 2000;

/// Training and validation error over the rows learnt, the best look marked. `None` where there is nothing to draw.
pub fn svg(looks: &[Look], best: Option<&Look>) -> Option<String> {
    let step = looks.len().div_ceil(MOST_POINTS).max(1);
    let thinned: Vec<&Look> = looks.iter().step_by(step).collect();
    let curve = |of: fn(&Look) -> Option<f64>| -> Vec<(f64, f64)> {
        thinned.iter().filter_map(|look| Some((look.rows as f64, of(look)?))).collect()
    };
    let (train, validation) = (curve(|look| look.train_error), curve(|look| look.validation_error));
    let top = train.iter().chain(&validation).map(|point| point.1).fold(0.0, f64::max);
    let last = looks.last()?.rows.max(1) as f64;
    if top <= 0.0 {
        return None;
    }
    let mut text = String::new();
    draw(&mut text, &train, &validation, best, last, 1.05 * top).ok()?;
    Some(text)
}

fn draw(
    text: &mut String,
    train: &[(f64, f64)],
    validation: &[(f64, f64)],
    best: Option<&Look>,
    last: f64,
    top: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..last, 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc("rows learnt")
        .y_desc("weighted mean squared error")
        .light_line_style(WHITE)
        .x_label_formatter(&|rows| format!("{rows:.0}"))
        .draw()?;
    let legend = |colour: RGBColor| move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2));
    chart
        .draw_series(LineSeries::new(train.iter().copied(), TRAIN.stroke_width(2)))?
        .label("training, before each row is learnt")
        .legend(legend(TRAIN));
    chart
        .draw_series(LineSeries::new(validation.iter().copied(), VALIDATION.stroke_width(2)))?
        .label("validation")
        .legend(legend(VALIDATION));
    if let Some((rows, error)) = best.and_then(|look| Some((look.rows as f64, look.validation_error?))) {
        chart
            .draw_series([Circle::new((rows, error), 5, VALIDATION.filled())])?
            .label(format!("best: {error:.5} after {rows:.0} rows"))
            .legend(|(x, y)| Circle::new((x + 9, y), 4, VALIDATION.filled()));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.85)).border_style(TRAIN).draw()?;
    area.present()?;
    Ok(())
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
        assert!(text.contains("best: 0.10000 after 10 rows"), "{text}");
    }

    #[test]
    fn extreme_nothing_to_draw_is_no_picture() {
        assert_eq!(svg(&[], None), None);
        assert_eq!(svg(&[look(0, None, None)], None), None);
        assert!(svg(&[look(0, None, Some(0.3))], None).is_some());
    }
}
