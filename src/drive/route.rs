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

#[cfg(test)]
mod tests {
    use super::super::fixtures::{kapvik, plane, posts};
    use super::*;
    use crate::geometry::DVec3;
    use crate::math;
    use crate::scene::{Class, Convex, Scene, Shape};

    fn length_m(points: &[DVec2]) -> f64 {
        points.windows(2).map(|leg| (leg[1] - leg[0]).length()).sum()
    }

    fn walled(scene: Scene, walls: &[(f64, f64, f64, f64)]) -> Scene {
        walls.iter().fold(scene, |scene, &(x, y, half_x, half_y)| {
            let wall = Convex::cuboid(DVec3::new(x, y, 0.5), DVec3::new(half_x, half_y, 0.5), 0.0);
            scene.with_obstacle(Class::Box, Shape::Convex(wall))
        })
    }

    #[test]
    fn exact_nothing_in_the_way_is_a_straight_line() {
        let scene = plane(10.0, 0.0, DVec2::ZERO);
        let yard = Yard::new(&scene, &kapvik(), None);
        let (start, goal) = (DVec2::new(1.0, 1.0), DVec2::new(8.0, 6.0));
        assert_eq!(around(&yard, start, goal, 0.5), Some(vec![start, goal]));
    }

    #[test]
    fn order_the_way_around_a_post_is_close_to_the_shortest() {
        // Shortest: two tangents and an arc around the grown disc.
        let scene = posts(plane(10.0, 0.0, DVec2::ZERO), &[(5.0, 5.0, 0.5)]);
        let yard = Yard::new(&scene, &kapvik(), None);
        let points = around(&yard, DVec2::new(2.0, 5.0), DVec2::new(8.0, 5.0), 0.5).unwrap();
        let (half, radius) = (3.0_f64, 1.0_f64);
        let shortest = 2.0 * (half * half - radius * radius).sqrt() + radius * 2.0 * math::asin(radius / half);
        assert!(length_m(&points) >= shortest && length_m(&points) < 1.04 * shortest, "{points:?} {shortest}");
        assert!(points.windows(2).all(|leg| yard.clear(leg, 0.5)));
    }

    #[test]
    fn law_a_way_goes_through_a_gap_that_is_wide_enough_and_else_around() {
        let walls = [(5.0, 2.0, 0.1, 2.0), (5.0, 7.0, 0.1, 1.7)];
        let scene = walled(plane(10.0, 0.0, DVec2::ZERO), &walls);
        let yard = Yard::new(&scene, &kapvik(), None);
        let (start, goal) = (DVec2::new(3.0, 4.0), DVec2::new(7.0, 4.0));
        let narrow = around(&yard, start, goal, 0.6).unwrap();
        assert!(narrow.iter().any(|p| p.y > 8.7), "the gap of 1.3 m is between 4 and 5.3 m: {narrow:?}");
        let wide = around(&yard, start, goal, 0.6 - 0.05).unwrap();
        assert!(wide.iter().all(|p| p.y < 5.3), "{wide:?}");
        for (points, distance_m) in [(narrow, 0.6), (wide, 0.55)] {
            assert!(points.windows(2).all(|leg| yard.clear(leg, distance_m)));
        }
    }

    #[test]
    fn extreme_a_goal_walled_in_has_no_way() {
        let walls = [(5.0, 4.0, 1.2, 0.1), (5.0, 6.0, 1.2, 0.1), (4.0, 5.0, 0.1, 1.2), (6.0, 5.0, 0.1, 1.2)];
        let scene = walled(plane(10.0, 0.0, DVec2::ZERO), &walls);
        let yard = Yard::new(&scene, &kapvik(), None);
        assert_eq!(around(&yard, DVec2::new(1.0, 1.0), DVec2::new(5.0, 5.0), 0.3), None);
    }
}
