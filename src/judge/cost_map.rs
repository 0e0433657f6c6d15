//! Judged cells -> a cost map that ROS map servers load (nav2_map_server, map_server): PGM and YAML.
//!
//! One pixel a cell; the first row of the picture is the northernmost; `origin` is the lower left corner of the lower left pixel,
//! frame map. Two maps:
//! - by the direct output, `mode: raw`: a pixel is the occupancy itself, 0 to 100 as the output goes from its target for traversable to
//!   that for untraversable, and 255 is unknown: cells without a judgement. `mode: scale` tells unknown by the picture's alpha alone,
//!   which a PGM has not: such cells would load as 50, which a trinary costmap takes for free.
//! - by the class, `mode: trinary`: the first class free, the last occupied, all others and cells without a judgement unknown.
//!
//! Source: nav2_map_server, map_io.cpp, `loadMapFromFile`; map_server (ROS 1), image_loader.cpp. In both a raw pixel above 100 is
//! unknown.

use super::{JudgeError, JudgedCells};

/// What a map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    Output,
    Class,
}

/// A map as its two files.
#[derive(Clone, Debug, PartialEq)]
pub struct CostMap {
    pub pgm: Vec<u8>,
    pub yaml: String,
}

/// Pixels that a map may have: 8192 by 8192.
const MOST_PIXELS: u64 = 1 << 26;
/// No occupancy, in `mode: raw`.
const RAW_UNKNOWN: u8 = 255;
/// Half way between free and occupied, in `mode: trinary`.
const TRINARY_UNKNOWN: u8 = 128;

/// `image`: the name that the picture will have beside the YAML.
pub(crate) fn cost_map(judged: &JudgedCells, image: &str, shown: Shown) -> Result<CostMap, JudgeError> {
    let rows = &judged.cells.rows;
    let extent = |of: fn(&crate::cells::CellRow) -> i32| {
        let (least, most) = rows.iter().map(of).fold((i32::MAX, i32::MIN), |(a, b), v| (a.min(v), b.max(v)));
        // Of no cells the map is one unknown pixel, which map servers load, unlike a picture without pixels.
        if rows.is_empty() { (0, 1) } else { (least, (i64::from(most) - i64::from(least) + 1) as u64) }
    };
    let ((south, height), (west, width)) = (extent(|row| row.index.row), extent(|row| row.index.col));
    if height.checked_mul(width).is_none_or(|pixels| pixels > MOST_PIXELS) {
        let scan = judged.scan.clone();
        return Err(JudgeError::MapTooLarge { scan, columns: width, rows: height, limit: MOST_PIXELS });
    }
    let unknown = if shown == Shown::Output { RAW_UNKNOWN } else { TRINARY_UNKNOWN };
    let mut pixels = vec![unknown; (height * width) as usize];
    for (i, row) in rows.iter().enumerate() {
        let up = (i64::from(row.index.row) - i64::from(south)) as u64;
        let right = (i64::from(row.index.col) - i64::from(west)) as u64;
        let pixel = &mut pixels[((height - 1 - up) * width + right) as usize];
        match shown {
            Shown::Output => judged.shade(i).into_iter().for_each(|shade| *pixel = (100.0 * shade).round() as u8),
            // Map servers take dark for occupied.
            Shown::Class => {
                let shade = judged.class_shade(i).filter(|&shade| shade == 0.0 || shade == 1.0);
                shade.into_iter().for_each(|shade| *pixel = if shade == 1.0 { 0 } else { 255 });
            }
        }
    }
    let mut pgm = format!("P5\n{width} {height}\n255\n").into_bytes();
    pgm.append(&mut pixels);
    // Raw pixels meet no threshold, but the file must name two that differ; 0.25 and 0.65 leave the middle unknown.
    let mode = if shown == Shown::Output { "raw" } else { "trinary" };
    let size_m = judged.grid.size_m;
    let (x_m, y_m) = (f64::from(west) * size_m, f64::from(south) * size_m);
    let yaml = format!(
        "image: {image}\nmode: {mode}\nresolution: {size_m:?}\norigin: [{x_m:?}, {y_m:?}, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    );
    Ok(CostMap { pgm, yaml })
}
