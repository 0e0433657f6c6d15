//! Which obstacles are within reach of a point, without a look at all the others.
//!
//! In: a scene's obstacles, of which only the discs that hold them, seen from above, are asked for. Out: those near a point, and of
//! each a sphere that holds it. A window of the yard is cut into squares, each with the obstacles whose middle is in it; a query
//! visits the squares within reach and the widest obstacle's half width. The first query draws a window about its own point, wide
//! enough for the next stops of a drive; the first that leaves it draws one that holds all. So what is far from every sensor costs a
//! comparison. Spheres, and the bodies they are of, are worked out when a sensor first comes near.

use std::sync::OnceLock;

use super::convex;
use crate::geometry::{DVec2, DVec3};
use crate::scene::Obstacle;

/// Obstacles a square holds in the mean: few enough to look at all, enough that squares cost less than they save.
const IN_A_SQUARE: usize = 8;

/// Share of the yard's side that a sensor may move by before all obstacles are sorted.
const ROAMING: f64 = 0.125;

/// Centre and radius of a sphere that holds an obstacle.
pub(super) type Sphere = (DVec3, f64);

/// The obstacles of a yard by where they stand.
pub(super) struct ObstacleGrid {
    extent_m: f64,
    /// About the point of the first query.
    near: OnceLock<Window>,
    /// Of all obstacles; for queries that leave the other.
    all: OnceLock<Window>,
}

/// The obstacles that reach into a part of the yard, by the squares they stand in.
struct Window {
    middle_m: DVec2,
    /// Half a side.
    half_m: f64,
    /// Where the squares begin.
    low_m: DVec2,
    squares_per_m: DVec2,
    /// Squares a side.
    side: usize,
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

impl ObstacleGrid {
    pub(super) fn new(extent_m: f64) -> ObstacleGrid {
        ObstacleGrid { extent_m, near: OnceLock::new(), all: OnceLock::new() }
    }

    /// Calls `take` for every obstacle within reach (and maybe some that are not), in no order that means anything, with its place
    /// in the row and its sphere.
    pub(super) fn near(
        &self,
        obstacles: &[Obstacle],
        point_m: DVec2,
        reach_m: f64,
        mut take: impl FnMut(usize, Sphere),
    ) {
        let window = self.window(obstacles, point_m, reach_m);
        for square in window.squares(point_m, reach_m) {
            let (square, end) = (&window.squares[square], window.squares[square + 1].first as usize);
            let members = &window.order[square.first as usize..end];
            for (k, &index) in members.iter().enumerate() {
                let known = square.spheres.get().and_then(|spheres| spheres[k].get());
                // What is out of reach is not even made.
                let sphere = known.copied().or_else(|| {
                    let obstacle = &obstacles[index as usize];
                    let spheres = || members.iter().map(|_| OnceLock::new()).collect();
                    let made = || {
                        convex::bounding_sphere(
                            &obstacle.body().shape,
                            obstacle.body().centre_m,
                            obstacle.body().radius_m,
                        )
                    };
                    (!obstacle.is_beyond(point_m, reach_m))
                        .then(|| *square.spheres.get_or_init(spheres)[k].get_or_init(made))
                });
                if let Some(sphere) = sphere {
                    take(index as usize, sphere);
                }
            }
        }
    }

    /// A window with all that is within reach of a point.
    fn window(&self, obstacles: &[Obstacle], point_m: DVec2, reach_m: f64) -> &Window {
        // More slack than an obstacle's own test has.
        let far_m = reach_m * (1.0 + 1e-8) + 1e-11 * point_m.abs().max_element();
        let about = |middle_m, half_m| Window::new(obstacles, self.extent_m, middle_m, half_m);
        let near = self.near.get_or_init(|| about(point_m, far_m + ROAMING * self.extent_m));
        if (point_m - near.middle_m).abs().max_element() + far_m <= near.half_m {
            near
        } else {
            self.all.get_or_init(|| about(DVec2::ZERO, f64::INFINITY))
        }
    }
}

impl Window {
    fn new(obstacles: &[Obstacle], extent_m: f64, middle_m: DVec2, half_m: f64) -> Window {
        let reaches_in = |obstacle: &Obstacle| {
            (obstacle.middle_m - middle_m).abs().max_element() <= half_m + obstacle.within_m * (1.0 + 1e-8)
        };
        let inside = (0..).zip(obstacles).filter(|(_, obstacle)| reaches_in(obstacle));
        let inside: Vec<(u32, &Obstacle)> = inside.collect();
        let side = inside.len().div_ceil(IN_A_SQUARE).isqrt().max(1);
        let corner = |half_m: f64| (middle_m + half_m).clamp(DVec2::ZERO, DVec2::splat(extent_m));
        let low_m = corner(-half_m);
        let squares_per_m = side as f64 / (corner(half_m) - low_m);
        let within_m = inside.iter().fold(0.0_f64, |most, (_, obstacle)| most.max(obstacle.within_m));
        let (squares, order) = (Vec::new(), vec![0; inside.len()]);
        let mut window = Window { middle_m, half_m, low_m, squares_per_m, side, squares, order, within_m };
        let mut firsts = vec![0u32; side * side + 1];
        let places: Vec<usize> = inside.iter().map(|(_, obstacle)| window.place(obstacle.middle_m)).collect();
        places.iter().for_each(|&place| firsts[place] += 1);
        // Where each square ends; then, filled from the back, where it begins.
        for square in 1..firsts.len() {
            firsts[square] += firsts[square - 1];
        }
        for ((index, _), place) in inside.into_iter().zip(places).rev() {
            firsts[place] -= 1;
            window.order[firsts[place] as usize] = index;
        }
        window.squares = firsts.into_iter().map(|first| Square { first, spheres: OnceLock::new() }).collect();
        window
    }

    /// Column and row of a point; what lies off the squares counts to those at their border.
    fn col_row(&self, point_m: DVec2) -> [usize; 2] {
        ((point_m - self.low_m) * self.squares_per_m).to_array().map(|at| (at as usize).min(self.side - 1))
    }

    fn place(&self, point_m: DVec2) -> usize {
        let [col, row] = self.col_row(point_m);
        row * self.side + col
    }

    /// The squares in which what is within reach of a point stands.
    fn squares(&self, point_m: DVec2, reach_m: f64) -> impl Iterator<Item = usize> + use<> {
        // As much slack as an obstacle's own test has.
        let far_m = (reach_m + self.within_m) * (1.0 + 1e-9) + 1e-12 * point_m.abs().max_element();
        let ([west, south], [east, north]) = (self.col_row(point_m - far_m), self.col_row(point_m + far_m));
        let side = self.side;
        (south..=north).flat_map(move |row| (west..=east).map(move |col| row * side + col))
    }
}
