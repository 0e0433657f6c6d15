//! Means of cells, held against a plain loop over the points.

use super::*;
use crate::math;
use std::collections::BTreeMap;

/// Points of waves a few millimetres high, with a stone of 20 cm on some cells and a stray point deep below one.
fn points() -> Vec<DVec3> {
    let ground = (0..6000).map(|k| {
        let (x, y) = (1.9 * math::sin(0.37 * f64::from(k)), 1.9 * math::sin(0.211 * f64::from(k) + 1.0));
        DVec3::new(x, y, -0.6 + 0.004 * math::sin(3.0 * x))
    });
    let stone = (0..200).map(|k| DVec3::new(1.0 + 0.001 * f64::from(k), 0.55, -0.4));
    ground.chain(stone).chain([DVec3::new(-1.04, -0.52, -0.9), DVec3::new(50.0, 0.0, -0.6)]).collect()
}

fn entered(grid: &mut GroundGrid, points: &[DVec3]) -> BTreeMap<u32, Vec<DVec3>> {
    let mut by_cell: BTreeMap<u32, Vec<DVec3>> = BTreeMap::new();
    grid.clear();
    for &point in points {
        let mut cell = [grid.nowhere()];
        grid.place(&[point.x], &[point.y], &[true], &mut cell);
        if cell[0] != grid.nowhere() {
            grid.enter(cell[0], point.z);
            grid.add(cell[0], point);
            by_cell.entry(cell[0]).or_default().push(point);
        }
    }
    grid.fit();
    by_cell
}

#[test]
fn equal_means_of_cells_and_those_of_a_plain_loop() {
    let mut grid = GroundGrid::new(2.0, 0.1).with_means();
    // Twice: of a former sweep nothing is left.
    for shift_m in [0.003, 0.0] {
        let points: Vec<DVec3> = points().into_iter().map(|p| p + shift_m * DVec3::X).collect();
        let by_cell = entered(&mut grid, &points);
        let is_ground = |cell: u32, points: &[DVec3]| {
            let standing_m = grid.standing_m(cell as usize);
            let highest_m = points.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            let lowest_m = points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
            standing_m <= 0.08 && standing_m - highest_m + lowest_m >= -LOW_M
        };
        let wanted: Vec<DVec3> = by_cell
            .iter()
            .filter(|(cell, points)| is_ground(**cell, points))
            .map(|(_, points)| points.iter().sum::<DVec3>() / points.len() as f64)
            .collect();
        let told: Vec<DVec3> = grid.means_m(0.08).collect();
        assert_eq!(told.len(), wanted.len());
        assert!(told.iter().zip(&wanted).all(|(a, b)| a.distance(*b) < 1e-12));
        // The stone's cells and the stray point's are out, and the rest is in.
        let left_out = by_cell.len() - told.len();
        assert!((3..=6).contains(&left_out), "{left_out}");
        assert!(told.iter().all(|mean_m| (mean_m.z + 0.6).abs() < 0.006), "{told:?}");
    }
}

#[test]
fn exact_a_grid_that_nobody_asked_keeps_nothing() {
    let mut grid = GroundGrid::new(2.0, 0.1);
    assert!(!grid.keeps_means());
    grid.clear();
    grid.fit();
    assert_eq!(grid.means_m(0.08).count(), 0);
    assert_eq!(GroundGrid::new(2.0, 0.1).with_means().means_m(0.08).count(), 0);
}
