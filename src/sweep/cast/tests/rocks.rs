//! Casting among few and many bodies, against a plain loop over all of them.

use super::*;
use crate::math;

/// A generator for the yards alone.
struct Draws(u64);

impl Draws {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

/// Boxes and trunks all over a yard; every seventh stands where another does.
fn strewn(extent_m: f64, count: usize, draws: &mut Draws) -> Vec<Shape> {
    let mut shapes: Vec<Shape> = Vec::new();
    for k in 0..count {
        let place = [extent_m, extent_m, 1.0].map(|most| draws.within(0.0, most));
        let centre_m = DVec3::from_array(place);
        shapes.push(match k % 7 {
            6 => shapes[k / 2].clone(),
            3 => Shape::Cylinder(Cylinder { base_m: centre_m - DVec3::Z, radius_m: 0.1, height_m: 2.0 }),
            // Long ones, in whose spheres there is room to stand.
            kind => {
                let long = if kind == 5 { 1.5 } else { 0.3 };
                let half_m = DVec3::new(draws.within(0.02, long), draws.within(0.02, 0.3), draws.within(0.02, 0.4));
                Shape::Convex(Convex::cuboid(centre_m, half_m, draws.within(0.0, 3.0)))
            }
        });
    }
    shapes
}

/// Every body at every ray, in the order of their nearest points: the definition of what is met. `hit` is the ground's.
fn plainly(bodies: &[(f64, DVec3, f64, &Obstacle)], origin: DVec3, dir: DVec3, hit: Hit, reach_m: f64) -> Hit {
    if !is_ray(origin, dir) {
        return hit;
    }
    let mut inverse = 1.0 / hit.range_m.min(reach_m);
    let mut object = hit.object;
    for &(_, centre, radius, obstacle) in bodies {
        // For the test's own speed: far clear of the sphere.
        let along = dir.dot(centre);
        if centre.length_squared() - along * along > radius * radius * 1.01 + 1e-3 {
            continue;
        }
        let met = match &obstacle.body().shape {
            Shape::Cylinder(upright) => {
                let upright = Cylinder { base_m: upright.base_m - origin, ..*upright };
                let range_m = convex::cylinder_first_hit(&upright, DVec3::ZERO, dir, 1.0 / inverse);
                range_m.filter(|range_m| *range_m < 1.0 / inverse).map(|range_m| 1.0 / range_m.max(1e-300))
            }
            Shape::Convex(body) => {
                let (mut enter, mut exit) = (f64::INFINITY, f64::NEG_INFINITY);
                for plane in &body.planes {
                    let height = plane.normal.dot(origin) + plane.offset_m;
                    let w = -plane.normal / if height == 0.0 { 1e-300 } else { height };
                    let q = dir.x.mul_add(w.x, dir.y.mul_add(w.y, dir.z * w.z));
                    if height >= 0.0 {
                        enter = enter.min(q);
                    } else {
                        exit = exit.max(q);
                    }
                }
                let enter = if enter == f64::INFINITY { exit } else { enter };
                (enter > inverse && enter >= exit && enter > 0.0).then_some(enter)
            }
        };
        if let Some(met) = met {
            (inverse, object) = (met, obstacle.id);
        }
    }
    if object >= 0 { Hit { range_m: 1.0 / inverse, object } } else { hit }
}

/// A scanner's lines, whose ends lie anywhere in a block; rays all round; vertical and senseless ones among them.
fn rays() -> Vec<DVec3> {
    let lines = (0..12).flat_map(|line| {
        let (tilt_sin, tilt_cos) = math::sin_cos(f64::from(line) * 0.07 - 0.6);
        (0..91).map(move |beam| {
            let (sin, cos) = math::sin_cos((f64::from(beam) - 45.0) * 0.035);
            DVec3::new(cos * tilt_cos, sin, cos * tilt_sin).normalize()
        })
    });
    let upright = (0..64).map(|k| {
        let (sin, cos) = math::sin_cos(f64::from(k) * 0.1);
        DVec3::new(0.6 * cos, 0.8 * cos, sin)
    });
    let mut rays: Vec<DVec3> = lines.chain(upright).chain(fan(300)).collect();
    for (k, odd) in [DVec3::Z, -DVec3::Z, DVec3::splat(f64::NAN), DVec3::ZERO].into_iter().enumerate() {
        for place in [3, 16, 31, 400, 1100] {
            rays.insert(place + 67 * k, odd);
        }
    }
    rays
}

#[test]
fn equal_bits_to_a_plain_loop_over_all_bodies() {
    let mut draws = Draws(1);
    let rays = rays();
    for (count, extent_m, reach_m) in
        [(1, 5.0, 30.0), (9, 5.0, 30.0), (60, 20.0, 4.0), (300, 20.0, 30.0), (2000, 60.0, 12.0), (10_000, 80.0, 30.0)]
    {
        let scene = yard(extent_m, bumps(extent_m, 3), strewn(extent_m, count, &mut draws));
        let bare = Scene { obstacles: vec![], ..scene.clone() };
        let (caster, ground) = (Caster::new(&scene, &Cast::Exact), Caster::new(&bare, &Cast::Exact));
        // Beside and in the first body, in the yard, at its corner, above it, off it.
        let middle = 0.5 * extent_m;
        let origins = [
            scene.obstacles[0].body().centre_m + 0.9 * scene.obstacles[0].body().radius_m * DVec3::Z,
            scene.obstacles[0].body().centre_m,
            DVec3::new(middle, middle, 1.2),
            DVec3::new(0.0, 0.0, 1.5),
            DVec3::new(middle, 0.3 * extent_m, 9.0),
            DVec3::new(-2.0, middle, 1.3),
        ];
        let mut met = 0;
        for origin in origins {
            let mut bodies: Vec<_> = scene
                .obstacles
                .iter()
                .map(|o| {
                    let (centre, radius) =
                        convex::bounding_sphere(&o.body().shape, o.body().centre_m, o.body().radius_m);
                    let radius = radius + 1e-14 * (centre.abs().max_element() + origin.abs().max_element());
                    let centre = centre - origin;
                    ((centre.length() - radius).max(0.0), centre, radius, o)
                })
                .collect();
            bodies.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (mut hits, mut bare_hits) = (Vec::new(), Vec::new());
            caster.from(origin, reach_m).cast(&rays, &mut hits);
            ground.from(origin, reach_m).cast(&rays, &mut bare_hits);
            for ((dir, hit), bare_hit) in rays.iter().zip(&hits).zip(bare_hits) {
                let plain = plainly(&bodies, origin, *dir, bare_hit, reach_m);
                let bits = |hit: &Hit| (hit.range_m.to_bits(), hit.object);
                assert_eq!(bits(hit), bits(&plain), "{count} bodies from {origin}: {dir}, {hit:?}, {plain:?}");
                met += usize::from(hit.object >= 0);
            }
            let inside = scene.obstacles.iter().find(|o| convex::contains(&o.body().shape, origin));
            let ground = &scene.ground;
            let deep = ground.contains(origin.x, origin.y) && ground.height_m(origin.x, origin.y) > origin.z;
            match caster.inside(origin) {
                Some(Inside::Ground { depth_m }) => assert!(deep && depth_m > 0.0, "{origin}"),
                Some(Inside::Obstacle(id)) => assert_eq!((deep, Some(id)), (false, inside.map(|o| o.id))),
                None => assert!(!deep && inside.is_none(), "{origin}"),
            }
        }
        assert!(met > 100, "{count} bodies: {met}");
    }
}

#[test]
fn exact_nearness_by_squares() {
    let mut draws = Draws(2);
    for (count, extent_m) in [(0, 10.0), (1, 10.0), (40, 10.0), (3000, 300.0)] {
        let scene = yard(extent_m, Polynomial::flat(extent_m), strewn(extent_m, count, &mut draws));
        let reaches_m = [0.0, 0.5, 20.0, f64::INFINITY];
        let points_m = [(5.0, 5.0), (0.0, 10.0), (-7.0, 3.0), (1e9, 0.0), (200.0, 100.0), (212.0, 90.0)];
        let points_m = points_m.map(|(x, y)| DVec2::new(x, y));
        let queries = || points_m.iter().flat_map(|&point_m| reaches_m.map(|reach_m| (point_m, reach_m)));
        // Each as the first, which the window is drawn about.
        for first in queries() {
            let places = obstacle_grid::ObstacleGrid::new(extent_m);
            for (point_m, reach_m) in std::iter::once(first).chain(queries()) {
                let mut near = Vec::new();
                places.near(&scene.obstacles, point_m, reach_m, |index, _| near.push(index));
                near.sort_unstable();
                // What an earlier query has worked out may be told of too.
                assert!(near.windows(2).all(|pair| pair[0] < pair[1]));
                let mut wanted = (0..count).filter(|&k| !scene.obstacles[k].is_beyond(point_m, reach_m));
                assert!(wanted.all(|k| near.binary_search(&k).is_ok()), "{count} {reach_m} {point_m} {first:?}");
            }
        }
    }
}
