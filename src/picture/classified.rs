//! Cells with a shade each -> a map in the shading of the paper: light traversable, dark untraversable (figures 10 to 14).
//!
//! Frame `map`, north (y) up. Shades run between the two ends in sRGB, as the eye steps them. Places without a cell keep the
//! background; cells that were not judged are blue.

use embedded_graphics::text::Alignment;

use super::canvas::{Canvas, NORMAL, TITLE};
use super::colour::{Colour, Palette, palette, srgb, srgb_byte};
use super::map::Map;
use super::top::{LEFT, SIDE, TOP};
use crate::geometry::{CellIndex, DVec2, GridSpec};

/// A cell and how dark it is: 0 light, 1 dark, `None` not judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShadedCell {
    pub index: CellIndex,
    pub shade: Option<f64>,
}

/// What the shades mean, for the legend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shades<'a> {
    /// Classes of these names, from light to dark.
    Classes(&'a [String]),
    /// The direct output between the two targets.
    Output([f64; 2]),
    /// Points a cell, from 1 to so many, by their logarithm.
    Density(i32),
}

const BELOW: usize = 96;
const EMPTY: u32 = 0xb9c4d0;
const UNKNOWN: u32 = 0x6f86b5;

/// PNG: the cells from above. `sensor_m`: where the scan was taken.
pub(crate) fn cell_map(title: &str, grid: GridSpec, cells: &[ShadedCell], sensor_m: DVec2, shades: Shades) -> Vec<u8> {
    let palette = palette();
    let mut canvas = Canvas::new(LEFT + SIDE + 28, TOP + SIDE + BELOW, palette.paper);
    canvas.text(title, (LEFT as f64, 16.0), TITLE, Alignment::Left, palette.ink);
    let map = framed(grid, cells, sensor_m);
    let clip = map.clip();
    let corners = [(clip.left, clip.top), (clip.right, clip.bottom)].map(|(x, y)| (x as f64, y as f64));
    canvas.rectangle(clip, corners[0], corners[1], srgb(EMPTY), 1.0);
    let half = grid.size_m / 2.0 / map.metres_a_pixel;
    for cell in cells {
        let (x, y) = map.spot(DVec2::from(grid.centre_m(cell.index)));
        let colour = cell.shade.map_or(srgb(UNKNOWN), |shade| shaded(shade, &palette));
        canvas.rectangle(clip, (x - half, y - half), (x + half, y + half), colour, 1.0);
    }
    let at = map.spot(sensor_m);
    canvas.disc(clip, at, 6.0, palette.halo, 1.0);
    canvas.disc(clip, at, 4.0, palette.estimated_path, 1.0);
    map.axes(&mut canvas, &palette);
    let judged = cells.iter().filter(|cell| cell.shade.is_some()).count();
    let what = match shades {
        Shades::Classes(_) => "class",
        Shades::Output(_) => "direct output",
        Shades::Density(_) => "points a cell",
    };
    let heading = format!("{} cells of {} m, {judged} judged. Shade: {what}", cells.len(), grid.size_m);
    canvas.text(&heading, (LEFT as f64, TOP as f64 - 32.0), NORMAL, Alignment::Left, palette.ink);
    legend(&mut canvas, shades, judged < cells.len(), &palette);
    canvas.png()
}

/// The least square that holds all cells and the sensor, with a border.
fn framed(grid: GridSpec, cells: &[ShadedCell], sensor_m: DVec2) -> Map {
    let centres = cells.iter().map(|cell| DVec2::from(grid.centre_m(cell.index)));
    let (low, high) = centres.fold((sensor_m, sensor_m), |(a, b), p| (a.min(p), b.max(p)));
    let side_m = (high - low).max_element() * 1.06 + 4.0 * grid.size_m;
    Map::new((LEFT, TOP), SIDE, (low + high) / 2.0 - DVec2::splat(side_m / 2.0), side_m)
}

/// From the palette's light to its dark, in sRGB.
fn shaded(shade: f64, palette: &Palette) -> Colour {
    let ends = [palette.traversable, palette.untraversable].map(|colour| colour.map(srgb_byte));
    let byte = |i: usize| {
        let (light, dark) = (f64::from(ends[0][i]), f64::from(ends[1][i]));
        (light + (dark - light) * shade.clamp(0.0, 1.0)).round() as u32
    };
    srgb(byte(0) << 16 | byte(1) << 8 | byte(2))
}

fn legend(canvas: &mut Canvas, shades: Shades, unknown: bool, palette: &Palette) {
    let top = (TOP + SIDE) as f64 + 50.0;
    let entries: Vec<(f64, String)> = match shades {
        Shades::Classes(names) => {
            let last = names.len().max(2) - 1;
            names.iter().enumerate().map(|(k, name)| (k as f64 / last as f64, name.clone())).collect()
        }
        Shades::Output([light, dark]) => {
            (0..5).map(|k| 0.25 * f64::from(k)).map(|s| (s, format!("{:.1}", light + (dark - light) * s))).collect()
        }
        Shades::Density(most) => vec![(0.0, "1 point".into()), (1.0, format!("{most} points"))],
    };
    let step = (600.0 / entries.len() as f64).min(160.0);
    let next = entries.len() as f64;
    for (k, (shade, text)) in entries.iter().enumerate() {
        canvas.square_entry((LEFT as f64 + step * k as f64, top), shaded(*shade, palette), text, palette);
    }
    if unknown {
        canvas.square_entry((LEFT as f64 + step * next, top), srgb(UNKNOWN), "not judged", palette);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_dark_cell_in_the_north_east_is_dark_in_the_upper_right() {
        let cell = |row, col, shade| ShadedCell { index: CellIndex { row, col }, shade: Some(shade) };
        let cells = [cell(0, 0, 0.0), cell(9, 9, 1.0), cell(0, 9, 0.0), cell(9, 0, 0.0)];
        let names = ["light", "dark"].map(String::from);
        let png = cell_map("t", GridSpec { size_m: 0.1 }, &cells, DVec2::new(0.5, 0.5), Shades::Classes(&names));
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let map = framed(GridSpec { size_m: 0.1 }, &cells, DVec2::new(0.5, 0.5));
        let at = |x_m: f64, y_m: f64| {
            let (x, y) = map.spot(DVec2::new(x_m, y_m));
            pixels[3 * (y as usize * info.width as usize + x as usize)]
        };
        assert_eq!([at(0.05, 0.05), at(0.95, 0.05), at(0.05, 0.95), at(0.95, 0.95)], [0xe9, 0xe9, 0xe9, 0x33]);
    }
}
