//! Series of numbers -> a chart as SVG: panels one below the other, each with two axes, marks, and a legend; and a table of shaded fields.
//!
//! The only user of plotters. A legend stands between the title and the axes, in a strip of its own, so that it hides no mark; ticks are
//! placed by [`Axis`], linear or logarithmic. Marks beyond an axis are drawn beyond it: whoever fills a series keeps it inside. The width
//! of text is estimated, since the viewer chooses the font. Equal input gives equal bytes.

mod axis;
mod legend;
mod table;

use plotters::coord::Shift;
use plotters::prelude::*;

pub(crate) use axis::Axis;
pub(crate) use plotters::style::RGBColor as Colour;
pub(crate) use table::{Field, ShadedTable};

const MARGIN: i32 = 14;
/// Between the legend and the axes.
const TOP_MARGIN: i32 = 6;
const TITLE_SIZE: i32 = 18;
const TEXT_SIZE: i32 = 12;
const X_LABELS_HEIGHT: u32 = 44;
const Y_LABELS_WIDTH: u32 = 68;
const GREY: Colour = RGBColor(120, 120, 120);

/// x and y in the units of the axes.
pub(crate) type Point = (f64, f64);

/// Two axes and what is drawn between them, in this order.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
}

/// Marks of one colour.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// In the legend; a series without a name has no entry there.
    pub name: Option<String>,
    pub colour: Colour,
    /// 1 covers what lies below.
    pub opacity: f64,
    pub marks: Marks,
}

#[derive(Clone, Debug)]
pub(crate) enum Marks {
    /// A line through the points; width in pixels.
    Line(Vec<Point>, u32),
    /// Discs; radius in pixels.
    Dots(Vec<Point>, i32),
    /// Circles; radius in pixels.
    Rings(Vec<Point>, i32),
    /// Bars from zero: left end, right end, height.
    Bars(Vec<(f64, f64, f64)>),
    /// Rectangles between a lower left and an upper right corner, beside each other without gaps.
    Tiles(Vec<[Point; 2]>),
    /// Vertical lines: x, lower end, upper end.
    Intervals(Vec<(f64, f64, f64)>),
    /// Words to the right of a point, so many pixels above it (below where negative).
    Words(Vec<(Point, i32, String)>),
}

impl Series {
    pub(crate) fn named(name: impl Into<String>, colour: Colour, marks: Marks) -> Series {
        Series { name: Some(name.into()), colour, opacity: 1.0, marks }
    }

    pub(crate) fn unnamed(colour: Colour, marks: Marks) -> Series {
        Series { name: None, colour, opacity: 1.0, marks }
    }

    pub(crate) fn with_opacity(self, opacity: f64) -> Series {
        Series { opacity, ..self }
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Draws panels of one size, in pixels.
pub(crate) fn svg((width, height): (u32, u32), panels: &[Panel]) -> String {
    draw((width, height * panels.len() as u32), |area| {
        area.split_evenly((panels.len(), 1)).iter().zip(panels).try_for_each(|(area, panel)| panel.draw(area))
    })
}

/// Draws panels of one width, in pixels, each so high that a unit is as long on both axes.
pub(crate) fn maps_svg(width: u32, panels: &[Panel]) -> String {
    let heights: Vec<u32> = panels.iter().map(|panel| panel.height_as_map(width)).collect();
    draw((width, heights.iter().sum()), |area| {
        let mut rest = area.clone();
        for (panel, &height) in panels.iter().zip(&heights) {
            let (own, below) = rest.split_vertically(height);
            panel.draw(&own)?;
            rest = below;
        }
        Ok(())
    })
}

fn draw(size: (u32, u32), drawing: impl FnOnce(&Area) -> Drawn) -> String {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = area.fill(&WHITE).map_err(Into::into).and_then(|()| drawing(&area));
    drawn.and_then(|()| Ok(area.present()?)).expect("text in memory takes all that is drawn");
    drop(area);
    svg
}

fn text(area: &Area, words: &str, at: (i32, i32), size: i32, colour: &Colour) -> Drawn {
    Ok(area.draw(&Text::new(words.to_owned(), at, ("sans-serif", size).into_font().color(colour)))?)
}

impl Panel {
    fn legend(&self, width: u32) -> Vec<legend::Entry> {
        legend::arranged(&self.series, width as i32 - Y_LABELS_WIDTH as i32 - 2 * MARGIN)
    }

    fn title_height(&self) -> i32 {
        if self.title.is_empty() { MARGIN } else { MARGIN + TITLE_SIZE + 6 }
    }

    /// Of so much width: the height with which a unit is as long on both axes.
    fn height_as_map(&self, width: u32) -> u32 {
        let x_pixels = f64::from(width - Y_LABELS_WIDTH) - 2.0 * f64::from(MARGIN);
        let y_pixels = (x_pixels * self.y.span() / self.x.span()).round() as i32;
        let above = self.title_height() + legend::height(&self.legend(width)) + TOP_MARGIN;
        (above + y_pixels + X_LABELS_HEIGHT as i32 + MARGIN) as u32
    }

    fn draw(&self, area: &Area) -> Drawn {
        let entries = self.legend(area.dim_in_pixel().0);
        let title_height = self.title_height();
        let (head, body) = area.split_vertically(title_height + legend::height(&entries));
        text(&head, &self.title, (MARGIN + Y_LABELS_WIDTH as i32, MARGIN), TITLE_SIZE, &BLACK)?;
        legend::draw(&head, &self.series, &entries, (MARGIN + Y_LABELS_WIDTH as i32, title_height))?;
        let mut chart = ChartBuilder::on(&body)
            .margin(MARGIN)
            .margin_top(TOP_MARGIN)
            .x_label_area_size(X_LABELS_HEIGHT)
            .y_label_area_size(Y_LABELS_WIDTH)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x.label()).y_desc(self.y.label()).bold_line_style(GREY.mix(0.25));
        if !self.x.has_grid() {
            mesh.disable_x_mesh();
        }
        mesh.draw()?;
        for Series { colour, opacity, marks, .. } in &self.series {
            let colour = colour.mix(*opacity);
            match marks {
                Marks::Line(points, width) => {
                    chart.draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(*width)))?
                }
                Marks::Dots(points, radius) => {
                    chart.draw_series(points.iter().map(|&at| Circle::new(at, *radius, colour.filled())))?
                }
                Marks::Rings(points, radius) => {
                    chart.draw_series(points.iter().map(|&at| Circle::new(at, *radius, colour.stroke_width(2))))?
                }
                Marks::Bars(bars) => chart.draw_series(
                    bars.iter().map(|&(from, to, top)| Rectangle::new([(from, 0.0), (to, top)], colour.filled())),
                )?,
                Marks::Tiles(tiles) => {
                    chart.draw_series(tiles.iter().map(|&corners| Rectangle::new(corners, colour.filled())))?
                }
                Marks::Intervals(lines) => chart
                    .draw_series(lines.iter().map(|&(x, low, high)| PathElement::new([(x, low), (x, high)], colour)))?,
                Marks::Words(words) => chart.draw_series(words.iter().map(|(at, up, words)| {
                    let style = ("sans-serif", TEXT_SIZE + 1).into_font().color(&BLACK);
                    EmptyElement::at(*at) + Text::new(words.clone(), (9, -up - TEXT_SIZE / 2), style)
                }))?,
            };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of an attribute of an element, as a number.
    fn number(element: &str, name: &str) -> f64 {
        let rest = element.split(&format!(" {name}=\"")).nth(1).expect("the attribute");
        rest.split('"').next().unwrap().parse().unwrap()
    }

    fn panel() -> Panel {
        let dots = vec![(0.0, 0.0), (10.0, 5.0), (5.0, 10.0)];
        let series = vec![
            Series::named("alpha", BLUE, Marks::Dots(dots, 3)),
            Series::named("beta", RED, Marks::Bars(vec![(9.0, 10.0, 10.0)])),
            Series::unnamed(RED, Marks::Words(vec![((5.0, 10.0), 8, "summit".into())])),
        ];
        Panel { title: "Title".into(), x: Axis::linear("x", 0.0..10.0), y: Axis::linear("y", 0.0..10.0), series }
    }

    #[test]
    fn law_the_legend_lies_above_every_mark() {
        let svg = svg((600, 400), &[panel()]);
        let bar = svg
            .split('<')
            .filter(|e| e.starts_with("rect"))
            .find(|e| e.contains("FF0000") && number(e, "height") > 99.0);
        let top = number(bar.expect("the bar up to the upper edge"), "y");
        let legend: Vec<&str> = svg.split("<text").filter(|e| e.contains("alpha") || e.contains("beta")).collect();
        assert_eq!(legend.len(), 2);
        assert!(legend.iter().all(|entry| number(entry, "y") < top), "{svg}");
    }

    #[test]
    fn exact_marks_stand_where_their_axes_say() {
        let svg = svg((600, 400), &[panel()]);
        let discs = svg.split('<').filter(|e| e.starts_with("circle") && e.contains("r=\"3\""));
        // The first is the legend's.
        let marks: Vec<&str> = discs.skip(1).collect();
        // Between its margin, its labels and the other margin; from the foot upwards.
        let left = f64::from(MARGIN) + f64::from(Y_LABELS_WIDTH);
        let right = 600.0 - f64::from(MARGIN);
        let xs: Vec<f64> = marks.iter().map(|e| number(e, "cx")).collect();
        let ys: Vec<f64> = marks.iter().map(|e| number(e, "cy")).collect();
        for (x, expected) in xs.iter().zip([left, right, 0.5 * (left + right)]) {
            assert!((x - expected).abs() <= 1.5, "{x} {expected}");
        }
        assert!((ys[1] - 0.5 * (ys[0] + ys[2])).abs() <= 1.0 && ys[2] < ys[0], "{ys:?}");
        assert!(svg.contains("summit") && svg.contains("Title"));
    }

    #[test]
    fn exact_a_unit_of_a_map_is_as_long_on_both_axes_whatever_the_legend() {
        let corners = [(0.0, 0.0), (8.0, 6.0)];
        for names in 0..12 {
            let mut series = vec![Series::unnamed(RED, Marks::Tiles(vec![corners]))];
            let name =
                |k| Series::named(format!("shade number {k}"), BLUE, Marks::Tiles(vec![[(0.0, 0.0), (1.0, 2.0)]]));
            series.extend((0..names).map(name));
            let (x, y) = (Axis::linear("x", 0.0..8.0), Axis::linear("y", 0.0..6.0));
            let svg = maps_svg(500, &[Panel { title: "T".into(), x, y, series }]);
            let tile = |colour: &str| {
                let tiles = svg.split('<').filter(|e| e.starts_with("rect") && e.contains(colour));
                tiles.map(|e| [number(e, "width"), number(e, "height")]).max_by(|a, b| a[1].total_cmp(&b[1])).unwrap()
            };
            let [width, height] = tile("#FF0000");
            assert!((width / 8.0 - height / 6.0).abs() < 0.4 && width > 380.0, "{width} {height}");
            assert!(names == 0 || tile("#0000FF")[1] > 80.0);
        }
    }

    #[test]
    fn exact_panels_stand_one_below_the_other() {
        let (one, two) = (svg((600, 400), &[panel()]), svg((600, 400), &[panel(), panel()]));
        assert!(one.contains("height=\"400\"") && two.contains("height=\"800\""));
        assert_eq!(two.matches("summit").count(), 2);
    }
}
