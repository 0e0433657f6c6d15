use super::super::GroundGrid;
use super::*;
use crate::wide::{Work, every_form};

/// Enters bumps and rocks with holes in them.
fn enter(grid: &mut GroundGrid, half_m: f64, turn: f64) {
    for k in 0..60_000u32 {
        let along = |step: f64| half_m * (2.0 * (step * f64::from(k)).fract() - 1.0);
        let (x, y) = (along(0.618_033_988), turn * along(0.414_213_562));
        if math::hypot(x - 1.0, y) < 0.6 || y < -0.7 * half_m {
            continue;
        }
        let rock = if math::hypot(x + 1.0, y - 0.5) < 0.3 { 0.4 } else { 0.0 };
        let mut cells = [grid.nowhere()];
        grid.place(&[x], &[y], &[true], &mut cells);
        grid.enter(cells[0], 0.3 * math::sin(x) + 0.1 * math::cos(3.0 * y) + rock);
    }
}

/// The plane at a node, cell by cell: the definition, in the order of the sums that the grid takes.
fn plane_by_cells_m(grid: &GroundGrid, node_row: usize, node_col: usize) -> f64 {
    let reach = grid.planes.reach();
    let near = |node: usize| {
        let centre = node * CELLS_A_NODE;
        (centre.saturating_sub(reach)..(centre + reach + 1).min(grid.side)).map(move |at| {
            let k = at as f64 - centre as f64;
            (at, k, grid.planes.taps[at + reach - centre].g)
        })
    };
    let mut sums = [0.0; 9];
    for (col, kx, gx) in near(node_col) {
        let mut along_y = [0.0; 5];
        for (row, ky, gy) in near(node_row) {
            let at = row * grid.cells.width + col;
            let (weight, height) = (grid.cells.weight[at], grid.cells.weighted_m[at]);
            let terms = [gy * weight, gy * ky * weight, gy * ky * ky * weight, gy * height, gy * ky * height];
            along_y.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [w, wy, wyy, z, zy] = along_y.map(|sum| gx * sum);
        let terms = [w, kx * w, wy, kx * kx * w, kx * wy, wyy, z, kx * z, zy];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
    let [s, sx, sy, sxx, sxy, syy, t, tx, ty] = sums;
    if s < LEAST_WEIGHT {
        return f64::NAN;
    }
    let (mx, my, mz) = (sx / s, sy / s, t / s);
    let (xx, yy) = (sxx / s - mx * mx + LEVEL_SHARE, syy / s - my * my + LEVEL_SHARE);
    let (xy, xz, yz) = (sxy / s - mx * my, tx / s - mx * mz, ty / s - my * mz);
    let determinant = xx * yy - xy * xy;
    mz - (xz * yy - yz * xy) / determinant * mx - (yz * xx - xz * xy) / determinant * my
}

/// A grid that has seen other points before.
struct SecondMoments(f64, f64);

impl Work for SecondMoments {
    type Out = GroundGrid;
    #[inline(always)]
    fn run(self) -> GroundGrid {
        let SecondMoments(half_m, cell_m) = self;
        let mut grid = GroundGrid::new(half_m, cell_m);
        for turn in [-1.0, 1.0] {
            grid.clear();
            enter(&mut grid, half_m, turn);
            grid.fit_plainly();
        }
        grid
    }
}

#[test]
fn equal_planes_by_lanes_and_cell_by_cell_in_every_form() {
    // Sides of 85, 86, 88, 80 and 7 cells: at and off a whole number of lanes and of nodes.
    for (half_m, cell_m) in [(4.25, 0.1), (4.3, 0.1), (4.4, 0.1), (4.0, 0.1), (1.0, 0.3)] {
        for grid in every_form(|| SecondMoments(half_m, cell_m)) {
            let bits = |x: f64| if x.is_nan() { 0 } else { x.to_bits() };
            for node in 0..grid.nodes * grid.nodes {
                let plain = plane_by_cells_m(&grid, node / grid.nodes, node % grid.nodes);
                assert_eq!(bits(grid.node_m[node]), bits(plain), "{half_m} {cell_m}: node {node}");
            }
            let width = grid.cells.width;
            for cell in (0..width * grid.side).filter(|cell| cell % width < grid.side) {
                let centre_m = |k: usize| (k as f64 + 0.5) * grid.cell_m - grid.half_m;
                let ground_m = grid.ground_m(centre_m(cell % width), centre_m(cell / width));
                let standing_m = grid.highest_m[cell] - ground_m;
                let near = (grid.standing_m(cell) - standing_m).abs() < 1e-12;
                assert!(near || !standing_m.is_finite() && grid.standing_m(cell).is_nan(), "cell {cell}");
            }
        }
    }
}

#[test]
fn equal_weights_are_those_of_a_whole_fit_at_every_weighing() {
    let mut grid = GroundGrid::new(4.25, 0.1);
    enter(&mut grid, 4.25, 1.0);
    grid.fit();
    // Rocks are weighed down, and what has been weighed last has been fitted.
    assert!(grid.cells.weight.iter().any(|&weight| weight > 0.0 && weight < 1.0));
    let kept = grid.node_m.clone();
    grid.changed.fill(0..grid.side);
    grid.planes.fit(&grid.cells, &grid.held, &grid.changed, &mut grid.node_m);
    assert!(kept.iter().zip(&grid.node_m).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()));
}

#[test]
fn exact_points_off_the_grid_are_nowhere() {
    let grid = GroundGrid::new(4.25, 0.1);
    let (inside, edge) = (4.249, 4.25);
    let x_m = [inside, edge, -edge, 0.0, f64::NAN, f64::INFINITY, 1e300, -4.251];
    let mut cells = [grid.nowhere(); LANES];
    grid.place(&x_m, &[-edge; LANES], &[true, true, true, false, true, true, true, true], &mut cells);
    let nowhere = grid.nowhere();
    assert_eq!(cells, [84, nowhere, 0, nowhere, nowhere, nowhere, nowhere, nowhere]);
    assert_eq!(nowhere, 88 * 85);
}
