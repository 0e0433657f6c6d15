//! Ground at a point -> height, derivatives and the slope that a wheel feels.
//!
//! All that a contact solver needs of one wheel. Polynomial: value, gradient and Hessian. Raster: the height is the
//! bilinear patch's, whose gradient jumps at grid lines; a wheel's residual would jump with it, so that no stand might
//! exist. Deviation: on a raster the slope under a wheel is interpolated between the central differences at the nodes,
//! which is continuous (and exact on planes). Frame: world, metres. Outside the yard there is no ground.

use super::rolled::Rolling;
use crate::geometry::DVec2;
use crate::scene::{Ground, Raster, Scene};
use crate::wide::LANES;

/// The ground of one scene, as wheels feel it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface<'a> {
    scene: &'a Scene,
    /// Wheels that roll over bodies too; `None`: over the ground alone.
    rolling: Option<Rolling<'a>>,
}

/// The ground at one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct WheelContact {
    pub height_m: f64,
    /// Derivative of the height.
    pub gradient: DVec2,
    /// The slope that enters the wheel's residual; for a polynomial, the gradient.
    pub slope: DVec2,
    /// Derivatives of the slope by x and by y.
    pub slope_by_x: DVec2,
    pub slope_by_y: DVec2,
}

impl<'a> Surface<'a> {
    pub(super) fn new(scene: &'a Scene) -> Surface<'a> {
        Surface { scene, rolling: None }
    }

    /// The same ground with bodies on it, as the wheels of one stand meet both.
    pub(super) fn with<'b>(&self, rolling: Rolling<'b>) -> Surface<'b>
    where
        'a: 'b,
    {
        Surface { scene: self.scene, rolling: Some(rolling) }
    }

    pub(super) fn scene(&self) -> &'a Scene {
        self.scene
    }

    pub(super) fn ground(&self) -> &'a Ground {
        &self.scene.ground
    }

    /// The height that a wheel feels at (x, y): of the ground, or of what it rolls over.
    pub(super) fn felt_height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        match &self.rolling {
            None => self.height_m(x_m, y_m),
            Some(rolling) => match &self.scene.ground {
                Ground::Polynomial(polynomial) => {
                    let (height_m, slope) = polynomial.height_and_gradient(x_m, y_m);
                    let is_ground = self.scene.contains(x_m, y_m) && height_m.is_finite() && slope.is_finite();
                    is_ground.then(|| {
                        rolling.held(DVec2::new(x_m, y_m), height_m, slope).map_or(height_m, |held| held.height_m)
                    })
                }
                Ground::Raster(_) => rolling.touch(self, x_m, y_m).map(|touch| touch.height_m),
            },
        }
    }

    /// The height of the ground at (x, y) alone; `None` outside the yard, or where the ground is not finite.
    pub(super) fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        if !self.scene.contains(x_m, y_m) {
            return None;
        }
        Some(self.scene.ground.height_m(x_m, y_m)).filter(|height| height.is_finite())
    }

    /// Heights and slopes at the first `count` points, without derivatives of the slopes; `None` where one has no ground.
    #[inline(always)]
    pub(super) fn heights_and_slopes(&self, points: &[DVec2; LANES], count: usize) -> Option<[(f64, DVec2); LANES]> {
        let mut felt = [(0.0, DVec2::ZERO); LANES];
        let Ground::Polynomial(polynomial) = &self.scene.ground else {
            for (felt, at) in felt.iter_mut().zip(points).take(count) {
                let touch = self.touch(at.x, at.y)?;
                *felt = (touch.height_m, touch.slope);
            }
            return Some(felt);
        };
        if !points[..count].iter().all(|at| self.scene.contains(at.x, at.y)) {
            return None;
        }
        let [height_m, along_x, along_y] =
            polynomial.heights_and_gradients(&points.map(|at| at.x), &points.map(|at| at.y));
        for (l, felt) in felt.iter_mut().enumerate().take(count) {
            *felt = (height_m[l], DVec2::new(along_x[l], along_y[l]));
            if !(felt.0.is_finite() && felt.1.is_finite()) {
                return None;
            }
            if let Some(rolling) = &self.rolling
                && let Some(held) = rolling.held(points[l], felt.0, felt.1)
            {
                *felt = (held.height_m, held.slope);
            }
        }
        Some(felt)
    }

    /// What a wheel over (x, y) touches; `None` outside the yard, or where the ground is not finite.
    pub(super) fn touch(&self, x_m: f64, y_m: f64) -> Option<WheelContact> {
        match &self.rolling {
            None => self.touch_ground(x_m, y_m),
            Some(rolling) => rolling.touch(self, x_m, y_m),
        }
    }

    /// The ground at (x, y), whatever lies on it.
    pub(super) fn touch_ground(&self, x_m: f64, y_m: f64) -> Option<WheelContact> {
        if !self.scene.contains(x_m, y_m) {
            return None;
        }
        let touch = match &self.scene.ground {
            Ground::Polynomial(polynomial) => {
                let (height_m, gradient) = polynomial.height_and_gradient(x_m, y_m);
                let [xx, xy, yy] = polynomial.hessian(x_m, y_m);
                let (slope_by_x, slope_by_y) = (DVec2::new(xx, xy), DVec2::new(xy, yy));
                WheelContact { height_m, gradient, slope: gradient, slope_by_x, slope_by_y }
            }
            Ground::Raster(raster) => on_raster(raster, x_m, y_m),
        };
        let finite = touch.height_m.is_finite()
            && touch.gradient.is_finite()
            && touch.slope.is_finite()
            && touch.slope_by_x.is_finite()
            && touch.slope_by_y.is_finite();
        finite.then_some(touch)
    }
}

fn on_raster(raster: &Raster, x_m: f64, y_m: f64) -> WheelContact {
    let step = raster.spacing_m;
    let (col, u) = cell((x_m - raster.origin_m.x) / step, raster.cols);
    let (row, v) = cell((y_m - raster.origin_m.y) / step, raster.rows);
    let (gsw, gse) = (node_slope(raster, row, col), node_slope(raster, row, col + 1));
    let (gnw, gne) = (node_slope(raster, row + 1, col), node_slope(raster, row + 1, col + 1));
    let (height_m, gradient) = raster.height_and_gradient(x_m, y_m);
    WheelContact {
        height_m,
        gradient,
        slope: (gsw * (1.0 - u) + gse * u) * (1.0 - v) + (gnw * (1.0 - u) + gne * u) * v,
        slope_by_x: ((gse - gsw) * (1.0 - v) + (gne - gnw) * v) / step,
        slope_by_y: ((gnw - gsw) * (1.0 - u) + (gne - gse) * u) / step,
    }
}

/// The slope at a node: central differences, one-sided at the border.
fn node_slope(raster: &Raster, row: usize, col: usize) -> DVec2 {
    let height = |row: usize, col: usize| raster.heights_m[row * raster.cols + col];
    let (west, east) = (col.saturating_sub(1), (col + 1).min(raster.cols - 1));
    let (south, north) = (row.saturating_sub(1), (row + 1).min(raster.rows - 1));
    DVec2::new(
        (height(row, east) - height(row, west)) / ((east - west) as f64 * raster.spacing_m),
        (height(north, col) - height(south, col)) / ((north - south) as f64 * raster.spacing_m),
    )
}

/// The cell of a grid coordinate, and the place in it.
fn cell(at: f64, nodes: usize) -> (usize, f64) {
    // Float-to-integer casts saturate, so that rounding below zero lands in cell 0.
    let index = (at as usize).min(nodes - 2);
    (index, at - index as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_plane_is_felt_as_one_up_to_every_border() {
        let height_m = |x: f64, y: f64| 0.3 + 0.2 * x - 0.1 * y;
        let ground = Ground::Raster(Raster::sampled(4.0, 0.5, height_m));
        let scene = Scene { extent_m: 4.0, ground, obstacles: vec![], volumes: vec![], patches: vec![] };
        let surface = Surface::new(&scene);
        for x_m in [0.0, 0.2, 0.5, 1.9, 3.4, 3.5, 3.8, 4.0] {
            for y_m in [0.0, 0.3, 0.5, 2.1, 3.4, 3.5, 3.8, 4.0] {
                let felt = surface.touch(x_m, y_m).expect("ground in the yard");
                assert!((felt.height_m - height_m(x_m, y_m)).abs() < 1e-14);
                assert!((felt.slope - DVec2::new(0.2, -0.1)).length() < 1e-13, "{x_m} {y_m}: {}", felt.slope);
                assert!(felt.slope_by_x.length() < 1e-12 && felt.slope_by_y.length() < 1e-12, "{x_m} {y_m}");
            }
        }
    }
}
