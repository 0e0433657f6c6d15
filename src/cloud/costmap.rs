//! Judged cells -> a cost map that ROS map servers load (nav2_map_server, map_server): PGM and YAML.
//!
//! One pixel a cell; the first row of the picture is the northernmost; `origin` is the lower left corner of the lower left pixel,
//! frame map. Two maps:
//! - by the direct output, `mode: scale`: occupancy 0 to 100 as the output goes from its target for traversable to that for
//!   untraversable. A PGM has no alpha, so this mode cannot say unknown: cells without a judgement hold 50.
//! - by the class, `mode: trinary`: the first class free, the last occupied, all others and cells without a judgement unknown.

use super::CloudError;
use super::export::Judged;

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
/// Half way between free and occupied.
const UNKNOWN: u8 = 128;

/// `image`: the name that the picture will have beside the YAML.
pub fn cost_map(judged: &Judged, image: &str, shown: Shown) -> Result<CostMap, CloudError> {
    let rows = &judged.cells.rows;
    let extent = |of: fn(&crate::cells::CellRow) -> i32| {
        let (least, most) = rows.iter().map(of).fold((i32::MAX, i32::MIN), |(a, b), v| (a.min(v), b.max(v)));
        (least, (i64::from(most) - i64::from(least) + 1).max(0) as u64)
    };
    let ((south, height), (west, width)) = (extent(|row| row.index.row), extent(|row| row.index.col));
    if height.checked_mul(width).is_none_or(|pixels| pixels > MOST_PIXELS) {
        return Err(CloudError::MapTooLarge { columns: width, rows: height, limit: MOST_PIXELS });
    }
    let mut pixels = vec![UNKNOWN; (height * width) as usize];
    for (i, row) in rows.iter().enumerate() {
        let up = (i64::from(row.index.row) - i64::from(south)) as u64;
        let right = (i64::from(row.index.col) - i64::from(west)) as u64;
        let pixel = &mut pixels[((height - 1 - up) * width + right) as usize];
        match shown {
            Shown::Output => judged.shade(i).into_iter().for_each(|shade| *pixel = byte(shade)),
            Shown::Class => {
                let shade = judged.class_shade(i).filter(|&shade| shade == 0.0 || shade == 1.0);
                shade.into_iter().for_each(|shade| *pixel = byte(shade));
            }
        }
    }
    let mut pgm = format!("P5\n{width} {height}\n255\n").into_bytes();
    pgm.append(&mut pixels);
    // With thresholds 0 and 1 the scale is linear; 0.25 and 0.65 leave the middle unknown.
    let (mode, occupied, free) = match shown {
        Shown::Output => ("scale", "1.0", "0.0"),
        Shown::Class => ("trinary", "0.65", "0.25"),
    };
    let size_m = judged.grid.size_m;
    let (x_m, y_m) = (f64::from(west) * size_m, f64::from(south) * size_m);
    let yaml = format!(
        "image: {image}\nmode: {mode}\nresolution: {size_m:?}\norigin: [{x_m:?}, {y_m:?}, 0.0]\nnegate: 0\n\
         occupied_thresh: {occupied}\nfree_thresh: {free}\n"
    );
    Ok(CostMap { pgm, yaml })
}

/// Map servers take dark for occupied.
fn byte(shade: f64) -> u8 {
    (255.0 * (1.0 - shade)).round() as u8
}
