//! Which obstacles are within reach of a point, without a look at all the others.
//!
//! In: a scene's obstacles, of which only the discs that hold them, seen from above, are asked for. Out: those near a point, and of
//! each a sphere that holds it. The yard is cut into squares, each with the obstacles whose middle is in it; a query visits the
//! squares within reach and the widest obstacle's half width. Spheres, and the bodies they are of, are worked out when a sensor
//! first comes near.

use std::sync::OnceLock;

use super::convex;
use crate::geometry::{DVec2, DVec3};
use crate::scene::Obstacle;

/// Obstacles a square holds in the mean: few enough to look at all, enough that squares cost less than they save.
const IN_A_SQUARE: usize = 8;

/// Centre and radius of a sphere that holds an obstacle.
pub type Sphere = (DVec3, f64);

/// The obstacles of a yard by the squares they stand in.
pub struct Places {
    /// Squares a side of the yard.
    side: usize,
    squares_per_m: f64,
    /// Row by row.
    squares: Vec<Square>,
    /// Places in the obstacles' row, square by square, ascending within each.
    order: Vec<u32>,
    /// Half width of the widest obstacle.
    within_m: f64,
}

/// A square's part of `order`; it ends where the next one's begins.
struct Square {
    first: u32,
    /// As many as there are obstacles, once a sensor has come near one of them.
    spheres: OnceLock<Box<[OnceLock<Sphere>]>>,
}

impl Places {
    /// Obstacles that stand off the yard count to the squares at its border.
    pub fn new(obstacles: &[Obstacle], extent_m: f64) -> Places {
        let side = obstacles.len().div_ceil(IN_A_SQUARE).isqrt().max(1);
        let mut places = Places {
            side,
            squares_per_m: side as f64 / extent_m,
            squares: Vec::new(),
            order: Vec::new(),
            within_m: 0.0,
        };
        let mut firsts = vec![0u32; side * side + 1];
        let mut squares = Vec::with_capacity(obstacles.len());
        for obstacle in obstacles {
            let [col, row] = obstacle.middle_m.to_array().map(|m| places.square(m));
            squares.push(row * side + col);
            firsts[row * side + col] += 1;
            places.within_m = places.within_m.max(obstacle.within_m);
        }
        // Where each square ends; then, filled from the back, where it begins.
        for square in 1..firsts.len() {
            firsts[square] += firsts[square - 1];
        }
        places.order.resize(obstacles.len(), 0);
        for (index, &square) in squares.iter().enumerate().rev() {
            firsts[square] -= 1;
            places.order[firsts[square] as usize] = index as u32;
        }
        places.squares = firsts.into_iter().map(|first| Square { first, spheres: OnceLock::new() }).collect();
        places
    }

    /// The row or column of a coordinate.
    fn square(&self, m: f64) -> usize {
        ((m * self.squares_per_m) as usize).min(self.side - 1)
    }

    /// Calls `take` for every obstacle within reach (and maybe some that are not), in no order that means anything, with its place
    /// in the row and its sphere.
    pub fn near(&self, obstacles: &[Obstacle], point_m: DVec2, reach_m: f64, mut take: impl FnMut(usize, Sphere)) {
        // As much slack as an obstacle's own test has.
        let far_m = (reach_m + self.within_m) * (1.0 + 1e-9) + 1e-12 * point_m.abs().max_element();
        let [cols, rows] = point_m.to_array().map(|m| self.square(m - far_m)..=self.square(m + far_m));
        for square in rows.flat_map(|row| cols.clone().map(move |col| row * self.side + col)) {
            let (square, end) = (&self.squares[square], self.squares[square + 1].first as usize);
            let members = &self.order[square.first as usize..end];
            for (k, &index) in members.iter().enumerate() {
                let known = square.spheres.get().and_then(|spheres| spheres[k].get());
                // What is out of reach is not even made.
                let sphere = known.copied().or_else(|| {
                    let obstacle = &obstacles[index as usize];
                    let spheres = || members.iter().map(|_| OnceLock::new()).collect();
                    let made = || convex::bounding_sphere(&obstacle.shape, obstacle.centre_m, obstacle.radius_m);
                    (!obstacle.is_beyond(point_m, reach_m))
                        .then(|| *square.spheres.get_or_init(spheres)[k].get_or_init(made))
                });
                if let Some(sphere) = sphere {
                    take(index as usize, sphere);
                }
            }
        }
    }
}
