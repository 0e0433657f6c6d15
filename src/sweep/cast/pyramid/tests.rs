//! Bounds of blocks beside a plain loop over their nodes.

use std::sync::Arc;

use super::*;
use crate::geometry::DVec2;
use crate::wide::every_form;

/// Extremes by one loop over all nodes.
fn by_all_nodes(raster: &Raster, side: usize, row: usize, col: usize, block: &Block) -> [f64; 3] {
    let above = |r: usize, c: usize| {
        let along = block.height + block.north * (r as f64 - row as f64) + block.east * (c as f64 - col as f64);
        raster.heights_m[r * raster.cols + c] - along
    };
    let bounds = |margin: usize| {
        let rows = row.saturating_sub(margin)..(row + side + margin + 1).min(raster.rows);
        let cols = col.saturating_sub(margin)..(col + side + margin + 1).min(raster.cols);
        let nodes = rows.flat_map(|r| cols.clone().map(move |c| above(r, c)));
        nodes.fold([0.0, 0.0], |[low, high]: [f64; 2], x| [low.min(x), high.max(x)])
    };
    let [low, high] = bounds(0);
    [low, high, if side <= 1 << AROUND_LEVELS { bounds(side / 2)[1] } else { f64::INFINITY }]
}

#[test]
fn exact_bounds_are_those_of_all_nodes_in_all_forms() {
    for (rows, cols) in [(2, 2), (2, 41), (7, 5), (9, 9), (33, 34), (150, 131)] {
        let heights_m: Vec<f64> = (0..rows * cols).map(|k| ((k * k * 31 + k * 7) % 1013) as f64 / 97.0 - 5.0).collect();
        let raster = Raster { rows, cols, heights_m: Arc::new(heights_m), spacing_m: 0.1, origin_m: DVec2::ZERO };
        for (k, level) in levels(&raster).iter().enumerate() {
            let side = 2 << k;
            let (rows, cols) = (level.rows, level.cols);
            let bits = |block: &Block| {
                let Block { height, east, north, low, high, high_around } = *block;
                [height, east, north, low, high, high_around].map(f64::to_bits)
            };
            let bits = |blocks: &[Block]| blocks.iter().map(bits).collect::<Vec<_>>();
            for form in every_form(|| Blocks { raster: &raster, rows, cols, side }) {
                assert_eq!(bits(&form), bits(&level.blocks), "{rows} x {cols}, blocks of {side}");
            }
            for (place, block) in level.blocks.iter().enumerate() {
                let expected = by_all_nodes(&raster, side, place / cols * side, place % cols * side, block);
                for (bound, expected) in [-block.low, block.high, block.high_around].into_iter().zip(expected) {
                    let over = bound - expected.abs();
                    assert!(bound == expected || (over > 0.0 && over < 1e-10), "{bound} {expected}, blocks of {side}");
                }
            }
        }
    }
}
