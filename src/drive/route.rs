//! Start, goal and outlines -> a way around them.
//!
//! A* (the `pathfinding` crate) over a square lattice through the start, eight neighbours, costs in whole thousandths of a
//! lattice step so that ties do not hang on rounding; then corners that can be cut are cut. Every leg keeps its distance
//! exactly (line against outline). The search stays within a circle around the start, so that a goal walled in costs a
//! bounded number of nodes. Not modelled: slopes.

use pathfinding::directed::astar::astar;

use super::yard::Yard;
use crate::geometry::DVec2;

/// Steps of the lattice: (columns, rows, thousandths of a step).
const NEIGHBOURS: [(i32, i32, u32); 8] = [
    (1, 0, 1000),
    (0, 1, 1000),
    (-1, 0, 1000),
    (0, -1, 1000),
    (1, 1, 1414),
    (-1, 1, 1414),
    (-1, -1, 1414),
    (1, -1, 1414),
];

/// Points from `start` to `goal`, both included, whose joining lines keep `distance_m` from every outline and the edge.
pub(super) fn around(yard: &Yard, start: DVec2, goal: DVec2, distance_m: f64) -> Option<Vec<DVec2>> {
    let free = |from: DVec2, to: DVec2| yard.clear(&[from, to], distance_m) && yard.inside(to, distance_m);
    if free(start, goal) {
        return Some(vec![start, goal]);
    }
    let way_m = (goal - start).length();
    // At most some 3e5 nodes.
    let step_m = (0.25 * distance_m).clamp(0.05, 0.5).max(way_m / 150.0);
    let reach_m = 1.5 * way_m + 4.0 * distance_m;
    let at = |node: (i32, i32)| start + DVec2::new(f64::from(node.0), f64::from(node.1)) * step_m;
    let near_goal = |node: (i32, i32)| (at(node) - goal).length() <= step_m && free(at(node), goal);
    let (nodes, _) = astar(
        &(0, 0),
        |&node| {
            NEIGHBOURS.iter().filter_map(move |&(cols, rows, cost)| {
                let next = (node.0 + cols, node.1 + rows);
                ((at(next) - start).length() <= reach_m && free(at(node), at(next))).then_some((next, cost))
            })
        },
        |&node| {
            let d = (goal - at(node)).abs() / step_m;
            // Octile distance, rounded down, less the last leg: never more than the way that is left.
            let octile = 1000.0 * (d.max_element() - d.min_element()) + 1414.0 * d.min_element();
            (octile - 1415.0).max(0.0) as u32
        },
        |&node| near_goal(node),
    )?;
    let mut points: Vec<DVec2> = nodes.into_iter().map(at).collect();
    points.push(goal);
    Some(cut_corners(&points, free))
}

/// Leaves out every point that a straight line can pass by.
fn cut_corners(points: &[DVec2], free: impl Fn(DVec2, DVec2) -> bool) -> Vec<DVec2> {
    let mut kept = vec![points[0]];
    let mut from = 0;
    while from + 1 < points.len() {
        let next = (from + 2..points.len()).rev().find(|&to| free(points[from], points[to])).unwrap_or(from + 1);
        kept.push(points[next]);
        from = next;
    }
    kept
}
