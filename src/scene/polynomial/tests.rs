//! These tests hold the fitted ground against planes, central differences, its own lanes and grids, and its Taylor series. Others of the scene take
//! their polynomials from `sample`.

use super::*;
use crate::math;
use crate::wide::{Work, every_form};

/// A polynomial of any degree with coefficients that fall off like those of a smooth surface.
pub(in crate::scene) fn sample(degree: usize) -> Polynomial {
    let coefficients =
        terms(degree).enumerate().map(|(n, (i, j))| math::sin(3.0 * n as f64 + 1.0) / (1 + i + j) as f64).collect();
    Polynomial::new(20.0, degree, coefficients)
}

#[test]
fn exact_plane_has_its_height_and_slope_everywhere() {
    let plane = Polynomial::plane(20.0, 0.3, DVec2::new(0.1, -0.2));
    for (x, y) in [(0.0, 0.0), (20.0, 20.0), (3.0, 17.5)] {
        assert!((plane.height_m(x, y) - (0.3 + 0.1 * x - 0.2 * y)).abs() < 1e-14);
        assert!((plane.gradient(x, y) - DVec2::new(0.1, -0.2)).length() < 1e-15);
    }
}

#[test]
fn equal_derivatives_and_central_differences() {
    for degree in [2, 5, 8, 12] {
        let poly = sample(degree);
        for (x, y) in [(0.0, 0.0), (20.0, 3.0), (9.0, 11.0)] {
            let h = 1e-4;
            let slope = |dx: f64, dy: f64| (poly.height_m(x + dx, y + dy) - poly.height_m(x - dx, y - dy)) / (2.0 * h);
            let (height, gradient) = poly.height_and_gradient(x, y);
            assert_eq!(height, poly.height_and_gradient(x, y).0);
            assert!((height - poly.height_m(x, y)).abs() < 1e-13);
            // Truncation h^2 f''' / 6 dominates: f''' stays below 100 here.
            assert!((gradient - DVec2::new(slope(h, 0.0), slope(0.0, h))).length() < 1e-6);
            let bend = (poly.gradient(x + h, y) - poly.gradient(x - h, y)) / (2.0 * h);
            let [xx, xy, yy] = poly.hessian(x, y);
            let across = (poly.gradient(x, y + h) - poly.gradient(x, y - h)) / (2.0 * h);
            assert!((xx - bend.x).abs() < 1e-5 && (xy - bend.y).abs() < 1e-5 && (yy - across.y).abs() < 1e-5);
        }
    }
}

struct Points<'a> {
    ground: &'a Polynomial,
    x_m: &'a [f64; LANES],
    y_m: &'a [f64; LANES],
}

impl Work for Points<'_> {
    type Out = ([[f64; LANES]; 3], [f64; LANES]);
    #[inline(always)]
    fn run(self) -> ([[f64; LANES]; 3], [f64; LANES]) {
        (self.ground.heights_and_gradients(self.x_m, self.y_m), self.ground.heights_m(self.x_m, self.y_m))
    }
}

#[test]
fn equal_points_one_by_one_and_by_lanes_in_every_form() {
    for degree in 0..=MAX_DEGREE {
        let poly = sample(degree);
        for k in 0..50 {
            let at = |i: usize, step: f64| 20.0 * (step * (k * LANES + i) as f64).fract();
            let x_m: [f64; LANES] = std::array::from_fn(|i| at(i, 0.618_034));
            let y_m: [f64; LANES] = std::array::from_fn(|i| at(i, 0.414_214));
            for ([height, along_x, along_y], alone) in every_form(|| Points { ground: &poly, x_m: &x_m, y_m: &y_m }) {
                for l in 0..LANES {
                    let (h, g) = poly.height_and_gradient(x_m[l], y_m[l]);
                    let single = [h, g.x, g.y].map(f64::to_bits);
                    assert_eq!([height[l], along_x[l], along_y[l]].map(f64::to_bits), single, "degree {degree}");
                    let plain = poly.height_m(x_m[l], y_m[l]);
                    assert_eq!(alone[l].to_bits(), plain.to_bits(), "degree {degree}");
                }
            }
        }
    }
}

#[test]
fn equal_nodes_of_a_grid_and_points_one_by_one() {
    let nodes_m = [0.0, 0.05, 3.7, 11.1, 20.0];
    for degree in 0..=MAX_DEGREE {
        let poly = sample(degree);
        let heights_m = poly.heights_on_grid(&nodes_m);
        assert_eq!(heights_m.len(), 25);
        for (k, height) in heights_m.iter().enumerate() {
            let alone = poly.height_m(nodes_m[k % 5], nodes_m[k / 5]);
            assert_eq!(height.to_bits(), alone.to_bits(), "degree {degree}");
        }
    }
}

#[test]
fn equal_taylor_series_and_surface() {
    for degree in [0, 1, 5, 12] {
        let poly = sample(degree);
        let taylor = poly.taylor_at(7.0, 12.0);
        for (dx, dy) in [(0.0, 0.0), (0.3, -0.4), (-5.0, 6.0), (13.0, 8.0), (-7.0, -12.0)] {
            let mut sum = 0.0;
            for ((k, l), t) in terms(degree).zip(&taylor) {
                sum += t * (0..k).fold(1.0, |p, _| p * dx) * (0..l).fold(1.0, |p, _| p * dy);
            }
            let height = poly.height_m(7.0 + dx, 12.0 + dy);
            assert!((sum - height).abs() < 1e-9, "degree {degree} at {dx}, {dy}: {sum} {height}");
        }
    }
}

#[test]
fn law_the_yard_ends_at_its_border() {
    let flat = Polynomial::flat(20.0);
    assert!(flat.contains(0.0, 20.0) && flat.contains(20.0, 0.0) && flat.contains(10.0, 10.0));
    assert!(!flat.contains(-1e-9, 5.0) && !flat.contains(5.0, 20.0 + 1e-9) && !flat.contains(f64::NAN, 5.0));
}
