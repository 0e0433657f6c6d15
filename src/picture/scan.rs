//! A sweep -> its range image: lines by beams, coloured by range and by what the beams truly met (figure 8b of the paper).
//!
//! Slots are laid out as the sensor fires them where it has lines; a pattern of a single line (a rosette) is laid out by its
//! angles instead. Seen as the rover sees: left is left, up is up.

use embedded_graphics::text::Alignment;

use super::View;
use super::canvas::{Canvas, NORMAL, SMALL, Spot, TITLE};
use super::colour::{Colour, Palette, of_class, palette, scale};
use crate::math;
use crate::scene::Class;
use crate::sweep::{Pattern, Status, Sweep};

const WIDTH: usize = 1364;
const LEFT: usize = 40;
const TOP: usize = 76;
const BETWEEN: usize = 74;
const BELOW: usize = 64;

/// Which slot each pixel of the range image shows.
struct Layout {
    columns: usize,
    rows: usize,
    slot: Vec<Option<u32>>,
}

/// PNG: the range image twice, by range (above) and by true class.
pub(crate) fn scan_view(view: &View) -> Vec<u8> {
    let palette = palette();
    let sweep = view.sweep;
    let layout = Layout::of(&sweep.returns.pattern);
    // Whole pixels a beam where they fit; lines as tall as keeps the image between a quarter and half as high as wide.
    let height = (layout.rows * WIDTH / layout.columns.max(1)).clamp(WIDTH / 5, WIDTH / 2);
    let mut canvas = Canvas::new(WIDTH + 2 * LEFT, TOP + 2 * height + BETWEEN + BELOW, palette.paper);
    canvas.text(view.title, (LEFT as f64, 16.0), TITLE, Alignment::Left, palette.ink);
    let hits = sweep.returns.status.iter().filter(|&&s| s == Status::Hit).count();
    let heading = format!(
        "Sweep: {} x {} beams, {hits} returns. Colour: range, by its square root",
        sweep.returns.pattern.lines, sweep.returns.pattern.beams
    );
    canvas.text(&heading, (LEFT as f64, TOP as f64 - 26.0), NORMAL, Alignment::Left, palette.ink);
    let far_m = far_end(sweep);
    // The square root gives near ranges, where the rover is about to drive, half of the scale.
    let by_range = |slot: usize| scale((sweep.returns.range_m[slot] / far_m).clamp(0.0, 1.0).sqrt());
    layout.draw(&mut canvas, TOP, height, sweep, &palette, by_range);
    let lower = TOP + height + BETWEEN;
    range_legend(&mut canvas, (LEFT as f64, (TOP + height) as f64 + 12.0), far_m, &palette);
    canvas.text(
        "Colour: what the beam truly met",
        (LEFT as f64, lower as f64 - 22.0),
        NORMAL,
        Alignment::Left,
        palette.ink,
    );
    let by_class = |slot: usize| sweep.truth[slot].class.map_or(palette.paper, of_class);
    layout.draw(&mut canvas, lower, height, sweep, &palette, by_class);
    class_legend(&mut canvas, (LEFT as f64, (lower + height) as f64 + 18.0), sweep, &palette);
    canvas.png()
}

/// The range below which 99 % of the returns lie: one far stray does not darken the rest.
fn far_end(sweep: &Sweep) -> f64 {
    let mut ranges_m: Vec<f64> = sweep.returns.range_m.iter().copied().filter(|r| r.is_finite()).collect();
    ranges_m.sort_by(f64::total_cmp);
    ranges_m.get(ranges_m.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-3)
}

impl Layout {
    fn of(pattern: &Pattern) -> Layout {
        let (lines, beams) = (pattern.lines as usize, pattern.beams as usize);
        if lines > 1 { Layout::by_lines(pattern, lines, beams) } else { Layout::by_angles(pattern) }
    }

    fn by_lines(pattern: &Pattern, lines: usize, beams: usize) -> Layout {
        let mean = |of: &dyn Fn(usize) -> f64, count: usize| (0..count).map(of).sum::<f64>();
        // Left is where y is greater, up where z is.
        let half = beams / 2;
        let side = |line: usize| {
            let y = |from: usize| mean(&|k| pattern.directions[line * beams + from + k].y, half);
            y(beams - half) - y(0)
        };
        let flip_columns = mean(&side, lines) > 0.0;
        let height = |line: usize| mean(&|k| pattern.directions[line * beams + k].z, beams);
        let flip_rows = mean(&|l| height(lines - lines / 2 + l) - height(l), lines / 2) > 0.0;
        let slot = (0..lines * beams).map(|pixel| {
            let (row, column) = (pixel / beams, pixel % beams);
            let line = if flip_rows { lines - 1 - row } else { row };
            let beam = if flip_columns { beams - 1 - column } else { column };
            Some((line * beams + beam) as u32)
        });
        Layout { columns: beams, rows: lines, slot: slot.collect() }
    }

    fn by_angles(pattern: &Pattern) -> Layout {
        let angles: Vec<(f64, f64)> =
            pattern.directions.iter().map(|d| (-math::atan2(d.y, d.x), -math::asin(d.z.clamp(-1.0, 1.0)))).collect();
        let extent = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) =
                angles.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            (low, (high - low).max(1e-9))
        };
        let ((left, width), (top, height)) = (extent(|a| a.0), extent(|a| a.1));
        // About one beam a pixel.
        let columns = ((angles.len() as f64 * width / height).sqrt().ceil() as usize).clamp(1, WIDTH);
        let rows = (angles.len().div_ceil(columns)).clamp(1, WIDTH);
        let mut slot = vec![None; columns * rows];
        for (k, (x, y)) in angles.iter().enumerate() {
            let column = (((x - left) / width * columns as f64) as usize).min(columns - 1);
            let row = (((y - top) / height * rows as f64) as usize).min(rows - 1);
            slot[row * columns + column] = Some(k as u32);
        }
        Layout { columns, rows, slot }
    }

    /// Paints each pixel with its slot's colour; slots without a return stay pale.
    fn draw(
        &self,
        canvas: &mut Canvas,
        top: usize,
        height: usize,
        sweep: &Sweep,
        palette: &Palette,
        colour: impl Fn(usize) -> Colour,
    ) {
        for y in 0..height {
            for x in 0..WIDTH {
                let pixel = (y * self.rows / height) * self.columns + x * self.columns / WIDTH;
                let slot = self.slot[pixel].map(|s| s as usize).filter(|&s| sweep.returns.status[s] == Status::Hit);
                let colour = slot.map_or(palette.traversable, &colour);
                canvas.blend(LEFT + x, top + y, colour, 1.0);
            }
        }
        let (left, right) = (LEFT as f64, (LEFT + WIDTH) as f64);
        let (above, below) = (top as f64, (top + height) as f64);
        canvas.outline(
            canvas.whole(),
            &[(left, above), (right, above), (right, below), (left, below)],
            1.2,
            palette.ink,
        );
    }
}

fn range_legend(canvas: &mut Canvas, at: Spot, far_m: f64, palette: &Palette) {
    const LENGTH: usize = 360;
    for x in 0..LENGTH {
        let colour = scale(x as f64 / LENGTH as f64);
        let left = at.0 + x as f64;
        canvas.rectangle(canvas.whole(), (left, at.1), (left + 1.0, at.1 + 10.0), colour, 1.0);
    }
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let unit = if share == 1.0 { " m" } else { "" };
        let label = format!("{:.1}{unit}", far_m * share * share);
        canvas.text(&label, (at.0 + share * LENGTH as f64, at.1 + 14.0), SMALL, Alignment::Center, palette.ink);
    }
    let empty = (at.0 + LENGTH as f64 + 70.0, at.1 - 1.0);
    canvas.square_entry(empty, palette.traversable, "no return", palette);
}

fn class_legend(canvas: &mut Canvas, at: Spot, sweep: &Sweep, palette: &Palette) {
    let met = |class: Class| {
        let slots = sweep.truth.iter().zip(&sweep.returns.status);
        slots.filter(|(t, s)| t.class == Some(class) && **s == Status::Hit).count()
    };
    let classes = Class::ALL.into_iter().map(|class| (class, met(class))).filter(|(_, count)| *count > 0);
    for (k, (class, count)) in classes.enumerate() {
        let text = format!("{} ({count})", class.name());
        canvas.square_entry((at.0 + 180.0 * k as f64, at.1), of_class(class), &text, palette);
    }
}
