//! A second first-hit solver, written apart from the product: slow, and simple enough to be believed.
//!
//! Ground: the clearance z - h along the ray is evaluated directly from the surface. On short pieces it is interpolated in the
//! Bernstein basis, whose coefficients bound it; pieces are halved until they have no root or one, and the root is bisected on
//! the direct evaluation. Rasters: every grid line is crossed by hand, each cell's quadratic split at its vertex. Polyhedra: the
//! segment is clipped by one plane after another. Cylinders: half chord about the point nearest to the axis.

use marsyard::geometry::DVec3;
use marsyard::math;
use marsyard::scene::{Convex, Cylinder, Ground, Raster, Scene, Shape};
use marsyard::sweep::Hit;

/// A ray and its reach.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: DVec3,
    pub dir: DVec3,
    pub reach_m: f64,
}

impl Ray {
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.dir * t
    }
}

/// Height above the ground at a range.
pub fn clearance(scene: &Scene, ray: &Ray, t: f64) -> f64 {
    let p = ray.at(t);
    p.z - scene.ground.height_m(p.x, p.y)
}

/// How far outside a body a point is, by its own surfaces: negative inside.
pub fn outside(shape: &Shape, p: DVec3) -> f64 {
    match shape {
        Shape::Convex(hull) => {
            hull.planes.iter().map(|f| f.normal.dot(p) + f.offset_m).fold(f64::NEG_INFINITY, f64::max)
        }
        Shape::Cylinder(c) => {
            let q = p - c.base_m;
            ((q.x * q.x + q.y * q.y).sqrt() - c.radius_m).max(-q.z).max(q.z - c.height_m)
        }
    }
}

/// The first hit of all.
pub fn first_hit(scene: &Scene, ray: &Ray) -> Hit {
    let mut best = Hit::NONE;
    if let Some(range_m) = ground_hit(scene, ray) {
        best = Hit { range_m, object: Hit::GROUND };
    }
    for obstacle in &scene.obstacles {
        let span = body_span(&obstacle.body().shape, ray);
        if let Some((enter, _)) = span.filter(|s| s.0 < best.range_m && s.0 <= ray.reach_m) {
            best = Hit { range_m: enter, object: obstacle.id };
        }
    }
    best
}

/// Entry and exit of a body ahead of a ray that starts outside it.
pub fn body_span(shape: &Shape, ray: &Ray) -> Option<(f64, f64)> {
    match shape {
        Shape::Convex(hull) => clip_by_planes(hull, ray),
        Shape::Cylinder(cylinder) => cylinder_span(cylinder, ray),
    }
}

/// The segment of the ray inside all planes, by clipping its two ends.
fn clip_by_planes(hull: &Convex, ray: &Ray) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0, 2.0 * ray.reach_m);
    for plane in &hull.planes {
        let side = |t: f64| plane.normal.dot(ray.origin) + plane.offset_m + t * plane.normal.dot(ray.dir);
        let (a, b) = (side(from), side(to));
        if a > 0.0 && b > 0.0 {
            return None;
        }
        let crossing = from + (to - from) * (a / (a - b));
        if a > 0.0 {
            from = crossing;
        } else if b > 0.0 {
            to = crossing;
        }
    }
    (from < to).then_some((from, to))
}

fn cylinder_span(cylinder: &Cylinder, ray: &Ray) -> Option<(f64, f64)> {
    let o = ray.origin - cylinder.base_m;
    let speed = (ray.dir.x * ray.dir.x + ray.dir.y * ray.dir.y).sqrt();
    let (mut from, mut to) = (0.0f64, f64::INFINITY);
    if speed > 0.0 {
        let (ux, uy) = (ray.dir.x / speed, ray.dir.y / speed);
        let nearest = -(o.x * ux + o.y * uy);
        let miss = (o.x * uy - o.y * ux).abs();
        if miss > cylinder.radius_m {
            return None;
        }
        let half = ((cylinder.radius_m - miss) * (cylinder.radius_m + miss)).sqrt();
        from = from.max((nearest - half) / speed);
        to = to.min((nearest + half) / speed);
    } else if (o.x * o.x + o.y * o.y).sqrt() > cylinder.radius_m {
        return None;
    }
    if ray.dir.z != 0.0 {
        let times = [-o.z / ray.dir.z, (cylinder.height_m - o.z) / ray.dir.z];
        from = from.max(times[0].min(times[1]));
        to = to.min(times[0].max(times[1]));
    } else if o.z < 0.0 || o.z > cylinder.height_m {
        return None;
    }
    (from < to && to > 0.0).then_some((from, to))
}

fn ground_hit(scene: &Scene, ray: &Ray) -> Option<f64> {
    let end = leaves_square(scene.extent_m, ray).min(ray.reach_m);
    match &scene.ground {
        Ground::Polynomial(ground) => polynomial_hit(scene, ray, end, ground.degree, 0.1 * ground.half_m),
        Ground::Raster(raster) => raster_hit(scene, raster, ray, end),
    }
}

/// Range at which a ray from inside the yard leaves it.
pub fn leaves_square(extent_m: f64, ray: &Ray) -> f64 {
    let out = |o: f64, d: f64| match d {
        d if d > 0.0 => (extent_m - o) / d,
        d if d < 0.0 => -o / d,
        _ => f64::INFINITY,
    };
    out(ray.origin.x, ray.dir.x).min(out(ray.origin.y, ray.dir.y))
}

fn polynomial_hit(scene: &Scene, ray: &Ray, end: f64, degree: usize, piece_m: f64) -> Option<f64> {
    let g = |t: f64| clearance(scene, ray, t);
    let pieces = (end / piece_m).ceil().max(1.0);
    let inverse = bernstein_from_values(degree);
    for k in 0..pieces as usize {
        let (a, b) = (end * k as f64 / pieces, end * (k + 1) as f64 / pieces);
        let values: Vec<f64> = nodes(degree).iter().map(|u| g(a + (b - a) * u)).collect();
        let coefficients: Vec<f64> =
            inverse.iter().map(|row| row.iter().zip(&values).map(|(m, v)| m * v).sum()).collect();
        if let Some(root) = subdivide(&g, &coefficients, a, b) {
            return Some(root);
        }
    }
    None
}

/// Places of interpolation on [0, 1].
fn nodes(degree: usize) -> Vec<f64> {
    let n = degree.max(1) as f64;
    (0..=degree).map(|k| 0.5 - 0.5 * math::cos(std::f64::consts::PI * k as f64 / n)).collect()
}

/// The matrix from values at the nodes to Bernstein coefficients, by Gauss-Jordan elimination with pivoting.
fn bernstein_from_values(degree: usize) -> Vec<Vec<f64>> {
    let n = degree + 1;
    let power = |x: f64, n: usize| (0..n).fold(1.0, |p, _| p * x);
    let binomial = |k: usize| (0..k).fold(1.0, |c, i| c * (degree - i) as f64 / (i + 1) as f64);
    let mut rows: Vec<Vec<f64>> = nodes(degree)
        .iter()
        .enumerate()
        .map(|(r, u)| {
            let basis = (0..n).map(|k| binomial(k) * power(*u, k) * power(1.0 - u, degree - k));
            basis.chain((0..n).map(|c| f64::from(u8::from(c == r)))).collect()
        })
        .collect();
    for c in 0..n {
        let pivot = (c..n).max_by(|&a, &b| rows[a][c].abs().total_cmp(&rows[b][c].abs())).unwrap();
        rows.swap(c, pivot);
        let scale = 1.0 / rows[c][c];
        rows[c].iter_mut().for_each(|v| *v *= scale);
        let source = rows[c].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(r, _)| *r != c) {
            let factor = row[c];
            row.iter_mut().zip(&source).for_each(|(v, s)| *v -= factor * s);
        }
    }
    rows.into_iter().map(|row| row[n..].to_vec()).collect()
}

/// First root on [a, b] of a function that is not negative at a.
fn subdivide(g: &impl Fn(f64) -> f64, coefficients: &[f64], a: f64, b: f64) -> Option<f64> {
    // The interpolation's own rounding: coefficients this close to zero decide nothing.
    const NOISE_M: f64 = 2e-13;
    if coefficients.iter().all(|&c| c > NOISE_M) {
        return None;
    }
    let (ga, gb) = (g(a), g(b));
    if ga < 0.0 && a > 0.0 {
        return Some(a);
    }
    let falls = coefficients.windows(2).all(|w| w[1] < w[0]);
    if falls && ga >= 0.0 {
        return (gb <= 0.0).then(|| bisect(g, a, b));
    }
    let rises = coefficients.windows(2).all(|w| w[1] > w[0]);
    if rises && ga >= 0.0 {
        return None;
    }
    if b - a < 1e-9 {
        return (gb < 0.0).then(|| bisect(g, a, b));
    }
    let (left, right) = halves(coefficients);
    let middle = 0.5 * (a + b);
    subdivide(g, &left, a, middle).or_else(|| subdivide(g, &right, middle, b))
}

/// De Casteljau at one half.
fn halves(coefficients: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut work = coefficients.to_vec();
    let (mut left, mut right) = (vec![work[0]], vec![work[work.len() - 1]]);
    while work.len() > 1 {
        work = work.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
        left.push(work[0]);
        right.push(work[work.len() - 1]);
    }
    right.reverse();
    (left, right)
}

/// The sign change between a (not negative) and b (not positive), to the last bit.
pub fn bisect(g: &impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    loop {
        let middle = 0.5 * (a + b);
        if middle <= a || middle >= b {
            return b;
        }
        if g(middle) > 0.0 {
            a = middle;
        } else {
            b = middle;
        }
    }
}

fn raster_hit(scene: &Scene, raster: &Raster, ray: &Ray, end: f64) -> Option<f64> {
    let g = |t: f64| clearance(scene, ray, t);
    let mut times = vec![0.0, end];
    for (o, d) in [(ray.origin.x, ray.dir.x), (ray.origin.y, ray.dir.y)] {
        if d != 0.0 {
            times.extend(
                (0..raster.cols).map(|k| (k as f64 * raster.spacing_m - o) / d).filter(|t| *t > 0.0 && *t < end),
            );
        }
    }
    times.sort_by(f64::total_cmp);
    for pair in times.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (ga, gm, gb) = (g(a), g(0.5 * (a + b)), g(b));
        if ga < 0.0 && a > 0.0 {
            return Some(a);
        }
        // The quadratic through three values, on u in [0, 1]; its vertex splits it into monotone parts.
        let (square, linear) = (2.0 * (ga - 2.0 * gm + gb), -3.0 * ga + 4.0 * gm - gb);
        let vertex = a + (b - a) * (-linear / (2.0 * square)).clamp(0.0, 1.0);
        let vertex = if vertex.is_nan() { b } else { vertex };
        for (from, to) in [(a, vertex), (vertex, b)] {
            if g(from) > 0.0 && g(to) <= 0.0 {
                return Some(bisect(&g, from, to));
            }
        }
    }
    None
}
