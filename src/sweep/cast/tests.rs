//! Casting at shapes whose ranges are known on paper, at the extremes, and by every code path alike.

mod extremes;
mod rocks;

use super::origin::CastBlocks;
use super::*;
use crate::cpu::Isa;
use crate::geometry::DVec2;
use crate::scene::{Body, Class, Convex, Cylinder, Obstacle, Polynomial, Shape};
use crate::sweep::params::SpacingParams;
use crate::wide;

fn yard(extent_m: f64, ground: Polynomial, shapes: Vec<Shape>) -> Scene {
    let obstacles = shapes
        .into_iter()
        .enumerate()
        .map(|(id, shape)| {
            let (centre_m, radius_m) = match &shape {
                Shape::Convex(hull) => hull.bounding_sphere(),
                Shape::Cylinder(c) => (c.base_m + 0.5 * c.height_m * DVec3::Z, c.radius_m + c.height_m),
            };
            Obstacle::new(id as i32, Class::Rock, Body { shape, centre_m, radius_m, protrusion_m: 0.0 })
        })
        .collect();
    Scene { extent_m, ground: Ground::Polynomial(ground), obstacles, volumes: vec![], patches: vec![] }
}

fn cube(centre_m: DVec3, half_m: f64) -> Shape {
    Shape::Convex(Convex::cuboid(centre_m, DVec3::splat(half_m), 0.0))
}

/// A bumpy ground of some degree.
fn bumps(extent_m: f64, degree: usize) -> Polynomial {
    let count = (degree + 1) * (degree + 2) / 2;
    Polynomial::new(
        extent_m,
        degree,
        (0..count).map(|k| 0.3 * crate::math::sin(2.7 * k as f64) / (1 + k) as f64).collect(),
    )
}

/// Directions all over the sphere.
fn fan(count: usize) -> Vec<DVec3> {
    (0..count)
        .map(|k| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
            let (sin, cos) = crate::math::sin_cos(2.399_963 * k as f64);
            let level = (1.0 - z * z).sqrt();
            DVec3::new(level * cos, level * sin, z).normalize()
        })
        .collect()
}

/// One ray by both paths: from a prepared origin and alone.
fn both(caster: &Caster, origin: DVec3, dir: DVec3, reach_m: f64) -> [Hit; 2] {
    let mut hits = Vec::new();
    caster.from(origin, reach_m).cast(&[dir], &mut hits);
    [hits[0], caster.first_hit(origin, dir, reach_m)]
}

fn expect(caster: &Caster, origin: DVec3, dir: DVec3, reach_m: f64, range_m: f64, object: i32, tolerance_m: f64) {
    for hit in both(caster, origin, dir, reach_m) {
        assert_eq!(hit.object, object, "{origin} {dir}: {hit:?}, expected {range_m}");
        assert!(hit.range_m == range_m || (hit.range_m - range_m).abs() <= tolerance_m, "{hit:?}, expected {range_m}");
    }
}

#[test]
fn exact_ranges_on_a_plane_a_cube_and_a_cylinder() {
    let trunk = Cylinder { base_m: DVec3::new(10.0, 14.0, -1.0), radius_m: 0.5, height_m: 3.0 };
    let shapes = vec![cube(DVec3::new(13.0, 10.0, 0.0), 0.5), Shape::Cylinder(trunk)];
    let scene = yard(20.0, Polynomial::flat(20.0), shapes);
    let caster = Caster::new(&scene, &Cast::Exact);
    let origin = DVec3::new(10.0, 10.0, 0.4);
    let nothing = (f64::INFINITY, Hit::NOTHING);
    for (dir, (range, object)) in [
        (DVec3::X, (2.5, 0)),
        (DVec3::Y, (3.5, 1)),
        (-DVec3::Y, nothing),
        (DVec3::new(0.0, -0.8, -0.6), (0.4 / 0.6, Hit::GROUND)),
        (DVec3::Z, nothing),
        (-DVec3::Z, (0.4, Hit::GROUND)),
    ] {
        expect(&caster, origin, dir, 30.0, range, object, 1e-12);
    }
    // From above: on the cylinder's cap, and down its side.
    expect(&caster, DVec3::new(10.1, 14.2, 5.0), -DVec3::Z, 30.0, 3.0, 1, 1e-12);
    expect(&caster, DVec3::new(10.6, 14.0, 5.0), -DVec3::Z, 30.0, 5.0, Hit::GROUND, 1e-12);
    assert_eq!(caster.inside(DVec3::new(13.0, 10.0, 0.2)), Some(Inside::Obstacle(0)));
    assert_eq!(caster.inside(DVec3::new(1.0, 1.0, -0.25)), Some(Inside::Ground { depth_m: 0.25 }));
    assert_eq!(caster.inside(origin), None);
    assert_eq!(caster.normal_at(0, DVec3::new(12.5, 10.1, 0.2)), -DVec3::X);
    assert_eq!(caster.normal_at(1, DVec3::new(10.0, 13.5, 1.0)), -DVec3::Y);
    assert_eq!(caster.normal_at(1, DVec3::new(10.1, 14.1, 2.0)), DVec3::Z);
}

#[test]
fn equal_bits_with_every_instruction_set_and_in_every_company() {
    let shapes = (0..40)
        .map(|k| {
            let (sin, cos) = crate::math::sin_cos(f64::from(k));
            let centre = DVec3::new(10.0 + 0.2 * f64::from(k + 6) * cos, 10.0 + 0.2 * f64::from(k + 6) * sin, 0.1);
            Shape::Convex(Convex::cuboid(centre, DVec3::new(0.2, 0.1, 0.3), f64::from(k)))
        })
        .collect();
    for degree in [2, 5, 8, 12] {
        let scene = yard(20.0, bumps(20.0, degree), Vec::clone(&shapes));
        let caster = Caster::new(&scene, &Cast::Exact);
        let from = caster.from(DVec3::new(10.0, 10.0, 1.0), 30.0);
        let dirs = fan(777);
        let mut best = Vec::new();
        from.cast(&dirs, &mut best);
        let bits = |hits: &[Hit]| hits.iter().map(|h| (h.range_m.to_bits(), h.object)).collect::<Vec<_>>();
        for isa in Isa::available() {
            let mut hits = Vec::new();
            wide::run(isa, CastBlocks { origin: &from, dirs: &dirs, hits: &mut hits });
            assert_eq!(bits(&hits), bits(&best), "{isa:?}");
        }
        // Alone, and in another block: the same bits.
        let mut shifted = Vec::new();
        from.cast(&dirs[5..], &mut shifted);
        assert_eq!(bits(&shifted), bits(&best[5..]));
        for (dir, hit) in dirs.iter().zip(&best).step_by(50) {
            from.cast(&[*dir], &mut shifted);
            assert_eq!(bits(&shifted), bits(&[*hit]));
        }
    }
}

#[test]
fn equal_prepared_origins_and_single_rays() {
    let shapes = (0..200)
        .map(|k| {
            let (a, b) = (f64::from(k), 1.7 * f64::from(k));
            let centre = DVec3::new(10.0 + 9.0 * crate::math::sin(a), 10.0 + 9.0 * crate::math::cos(b), 0.2);
            if k % 3 == 0 {
                Shape::Cylinder(Cylinder { base_m: centre - DVec3::Z, radius_m: 0.1, height_m: 2.0 })
            } else {
                Shape::Convex(Convex::cuboid(centre, DVec3::new(0.15, 0.1, 0.2), a))
            }
        })
        .collect();
    let scene = yard(20.0, bumps(20.0, 7), shapes);
    let caster = Caster::new(&scene, &Cast::Exact);
    let mut hits = Vec::new();
    // In the yard, at its corner, off it and below it.
    for origin in [(10.0, 10.0, 1.0), (0.0, 0.0, 2.0), (-3.0, 25.0, 4.0), (4.0, 5.0, -3.0)] {
        let origin = DVec3::new(origin.0, origin.1, origin.2);
        let dirs = fan(3000);
        caster.from(origin, 60.0).cast(&dirs, &mut hits);
        let mut met = 0;
        for (dir, hit) in dirs.iter().zip(&hits) {
            let single = caster.first_hit(origin, *dir, 60.0);
            assert_eq!(single.object, hit.object, "{origin} {dir}");
            met += usize::from(hit.object != Hit::NOTHING);
            assert!(single.range_m == hit.range_m || (single.range_m - hit.range_m).abs() < 1e-9);
        }
        assert!(met > 20, "{origin}: {met}");
    }
}

#[test]
fn law_certified_heights_hold_every_height() {
    for degree in [0, 1, 3, 8, 12] {
        let ground = bumps(20.0, degree);
        let caster = PolynomialCaster::new(&ground, 20.0);
        for k in 0..4000 {
            let (x, y) = (20.0 * f64::from(k % 63) / 62.0, 20.0 * f64::from(k / 63) / 63.0);
            let (low, high) = caster.height_bounds(x, y, 0.01);
            let height = ground.height_m(x, y);
            assert!(low <= height && height <= high, "degree {degree} at {x}, {y}: {low} {height} {high}");
            assert!(high - low < 1.0, "bounds this wide are of no use");
        }
    }
}

#[test]
fn extreme_sensors_in_and_on_a_body_meet_its_surface_on_the_way_out_or_not_at_all() {
    let scene = yard(20.0, Polynomial::flat(20.0), vec![cube(DVec3::new(10.0, 10.0, 5.0), 1.0)]);
    let caster = Caster::new(&scene, &Cast::Exact);
    expect(&caster, DVec3::new(10.0, 10.0, 5.5), DVec3::X, 30.0, 1.0, 0, 1e-15);
    expect(&caster, DVec3::new(10.0, 10.0, 5.5), DVec3::Z, 30.0, 0.5, 0, 1e-15);
    // On a face: outwards nothing, inwards at once.
    expect(&caster, DVec3::new(11.0, 10.0, 5.0), DVec3::X, 30.0, f64::INFINITY, Hit::NOTHING, 0.0);
    expect(&caster, DVec3::new(11.0, 10.0, 5.0), -DVec3::X, 30.0, 0.0, 0, 1e-15);
    // On the ground, upwards; a hair above it, downwards.
    expect(&caster, DVec3::new(3.0, 3.0, 0.0), DVec3::Z, 30.0, f64::INFINITY, Hit::NOTHING, 0.0);
    expect(&caster, DVec3::new(3.0, 3.0, 0.01), -DVec3::Z, 0.02, 0.01, Hit::GROUND, 1e-15);
    // From below the ground it is met from below.
    expect(&caster, DVec3::new(3.0, 3.0, -2.0), DVec3::Z, 30.0, 2.0, Hit::GROUND, 1e-12);
}

#[test]
fn extreme_rays_through_vertices_and_along_edges_end_on_the_body_or_pass_it() {
    let scene = yard(20.0, Polynomial::flat(20.0), vec![cube(DVec3::new(10.0, 10.0, 5.0), 1.0)]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let origin = DVec3::new(4.0, 7.0, 8.0);
    for corner in [(9.0, 9.0, 6.0), (11.0, 9.0, 6.0), (9.0, 11.0, 4.0), (9.0, 9.0, 5.0), (10.0, 9.0, 6.0)] {
        let way = DVec3::new(corner.0, corner.1, corner.2) - origin;
        for hit in both(&caster, origin, way.normalize(), 30.0) {
            // A silhouette may be passed; whatever is met is met at the corner or behind it.
            assert!(hit.object != 0 || hit.range_m >= way.length() - 1e-12, "{hit:?}");
        }
        // A nanometre inside the corner it is met for certain.
        let inside = DVec3::new(corner.0, corner.1, corner.2) * (1.0 - 1e-9) + DVec3::new(10.0, 10.0, 5.0) * 1e-9;
        let way = inside - origin;
        for hit in both(&caster, origin, way.normalize(), 30.0) {
            assert!(hit.object == 0 && (hit.range_m - way.length()).abs() < 1e-7, "{hit:?}");
        }
    }
    // In the plane of the top, along its edge.
    for hit in both(&caster, DVec3::new(4.0, 9.0, 6.0), DVec3::X, 30.0) {
        assert!(hit == Hit::NONE || (hit.range_m - 5.0).abs() < 1e-12);
    }
}

#[test]
fn extreme_no_rays_one_ray_and_senseless_rays() {
    let scene = yard(20.0, bumps(20.0, 8), vec![cube(DVec3::new(12.0, 10.0, 0.0), 0.5)]);
    let nan = f64::NAN;
    for cast in
        [Cast::Exact, Cast::Raster(SpacingParams { spacing_m: 0.5 }), Cast::Mesh(SpacingParams { spacing_m: 0.5 })]
    {
        let caster = Caster::new(&scene, &cast);
        let mut hits = vec![Hit::NONE; 3];
        let origin = DVec3::new(10.0, 10.0, 2.0);
        caster.from(origin, 30.0).cast(&[], &mut hits);
        assert!(hits.is_empty());
        caster.from(origin, 30.0).cast(&[-DVec3::Z], &mut hits);
        assert_eq!((hits.len(), hits[0].object), (1, Hit::GROUND));
        let odd = [DVec3::splat(nan), DVec3::ZERO, DVec3::new(nan, 0.0, -1.0)];
        for from in [origin, DVec3::splat(nan), DVec3::splat(f64::INFINITY), DVec3::splat(1e200)] {
            caster.from(from, 30.0).cast(&odd, &mut hits);
            assert!(hits.iter().all(|h| *h == Hit::NONE), "{from}: {hits:?}");
            caster.from(from, f64::INFINITY).cast(&[DVec3::X, DVec3::Z], &mut hits);
        }
        // A senseless ray does not disturb its neighbours.
        let mut dirs = fan(40);
        caster.from(origin, 30.0).cast(&dirs, &mut hits);
        let before = hits.clone();
        dirs[7] = DVec3::splat(nan);
        caster.from(origin, 30.0).cast(&dirs, &mut hits);
        assert!(before.iter().zip(&hits).enumerate().all(|(k, (a, b))| k == 7 || a == b));
    }
}

#[test]
fn exact_no_ground_beyond_the_yard() {
    let scene = yard(20.0, Polynomial::plane(20.0, 0.0, DVec2::new(0.1, 0.0)), vec![]);
    for cast in [Cast::Exact, Cast::Raster(SpacingParams { spacing_m: 0.25 })] {
        let caster = Caster::new(&scene, &cast);
        let origin = DVec3::new(15.0, 10.0, 3.0);
        let to = |x: f64| (DVec3::new(x, 10.0, 0.1 * x) - origin).normalize();
        let range = |x: f64| (DVec3::new(x, 10.0, 0.1 * x) - origin).length();
        expect(&caster, origin, to(19.999), 30.0, range(19.999), Hit::GROUND, 1e-11);
        expect(&caster, origin, to(20.001), 30.0, f64::INFINITY, Hit::NOTHING, 0.0);
        // From off the yard, in over the border.
        let outside = DVec3::new(25.0, 10.0, 3.0);
        let way = DVec3::new(18.0, 10.0, 1.8) - outside;
        expect(&caster, outside, way.normalize(), 30.0, way.length(), Hit::GROUND, 1e-11);
        let past = DVec3::new(20.5, 10.0, 2.05) - outside;
        expect(&caster, outside, past.normalize(), 5.0, f64::INFINITY, Hit::NOTHING, 0.0);
    }
}

#[test]
fn order_raster_and_mesh_approach_the_surface_with_the_square_of_their_spacing() {
    let scene = yard(20.0, bumps(20.0, 6), vec![cube(DVec3::new(12.0, 10.0, 0.0), 0.5)]);
    let (origin, dirs) = (DVec3::new(10.0, 10.0, 1.5), fan(2000));
    let cast = |method: &Cast| {
        let caster = Caster::new(&scene, method);
        let mut hits = Vec::new();
        caster.from(origin, 8.0).cast(&dirs, &mut hits);
        hits
    };
    let exact = cast(&Cast::Exact);
    let error = |method: &Cast| -> f64 {
        let pairs =
            cast(method).into_iter().zip(&exact).filter(|(a, b)| a.object == Hit::GROUND && b.object == Hit::GROUND);
        let errors: Vec<f64> = pairs.map(|(a, b)| (a.range_m - b.range_m).abs()).collect();
        assert!(errors.len() > 500);
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    for method in
        [|spacing_m| Cast::Raster(SpacingParams { spacing_m }), |spacing_m| Cast::Mesh(SpacingParams { spacing_m })]
    {
        let (coarse, fine) = (error(&method(0.8)), error(&method(0.2)));
        // Four times finer, sixteen times nearer: within a third, for a mean over one scene.
        assert!((10.0..24.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}

/// A rough raster: bumps at every scale down to the cell.
fn rough(extent_m: f64, spacing_m: f64) -> Raster {
    let (sin, cos) = (crate::math::sin, crate::math::cos);
    Raster::sampled(extent_m, spacing_m, |x, y| {
        0.4 * sin(0.5 * x) * cos(0.4 * y) + 0.05 * sin(7.0 * x + y) + 0.02 * sin(29.0 * x) * cos(31.0 * y)
    })
}

#[test]
fn equal_bits_by_slope_bounds_and_by_the_pyramid() {
    let bits = |hits: &[Hit]| hits.iter().map(|h| (h.range_m.to_bits(), h.object)).collect::<Vec<_>>();
    for (spacing_m, scale) in [(0.05, 1.0), (0.31, 1.0), (0.05, 20.0), (2.0, 0.1), (10.0, 0.1), (20.0, 0.1)] {
        let mut raster = rough(20.0, spacing_m);
        std::sync::Arc::make_mut(&mut raster.heights_m).iter_mut().for_each(|h| *h *= scale);
        let scene = Scene { ground: Ground::Raster(raster), ..yard(20.0, bumps(20.0, 2), Vec::new()) };
        let caster = Caster::new(&scene, &Cast::Exact);
        // In the middle, at the border, in a corner, on a node; far above and hardly above the ground.
        for (x, y, above_m) in [
            (10.1, 9.7, 0.4),
            (0.0, 7.0, 0.5),
            (20.0, 20.0, 1.0),
            (5.0, 5.0, 1e-9),
            (3.0, 11.0, 30.0),
            (13.3, 4.4, 0.0),
        ] {
            let origin = DVec3::new(x, y, scene.ground.height_m(x, y) + above_m);
            let dirs: Vec<DVec3> = fan(20_000)
                .into_iter()
                .chain([DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z])
                .chain((0..4000).map(|k| {
                    // Level sights, which graze every crest.
                    let (sin, cos) = crate::math::sin_cos(f64::from(k) * 0.001_571);
                    DVec3::new(cos, sin, 1e-3 * f64::from(k % 9 - 4)).normalize()
                }))
                .collect();
            let (mut sweep, mut single) = (Vec::new(), Vec::new());
            for reach_m in [0.7, 60.0] {
                caster.from(origin, reach_m).cast(&dirs, &mut sweep);
                let from = caster.from(origin, reach_m);
                for (k, (dir, hit)) in dirs.iter().zip(&sweep).enumerate() {
                    from.cast(&[*dir], &mut single);
                    assert_eq!(bits(&single), bits(&[*hit]), "spacing {spacing_m}, from {origin}, ray {k} {dir}");
                }
                // Looked around by now: the plain form of the march itself.
                let mut plain = Vec::new();
                from.cast(&dirs, &mut single);
                wide::run(Isa::PORTABLE, CastBlocks { origin: &from, dirs: &dirs, hits: &mut plain });
                assert_eq!(bits(&plain), bits(&sweep));
            }
        }
    }
}

/// Rays at a flat-topped post of radius 1 m and height 2 m that just miss it, just meet it, or run along its edge.
#[test]
fn exact_rays_at_the_edges_of_a_cylinder() {
    let post = Cylinder { base_m: DVec3::ZERO, radius_m: 1.0, height_m: 2.0 };
    let met = |origin: [f64; 3], dir: DVec3| convex::cylinder_first_hit(&post, DVec3::from(origin), dir, 100.0);
    assert_eq!(met([-5.0, 0.0, 1.0], DVec3::X), Some(4.0));
    assert_eq!(met([-5.0, 0.0, 3.0], DVec3::X), None);
    assert_eq!(met([-5.0, 0.0, -0.5], DVec3::X), None);
    assert_eq!(met([0.5, 0.0, 5.0], -DVec3::Z), Some(3.0));
    assert_eq!(met([1.5, 0.0, 5.0], -DVec3::Z), None);
    // The edge belongs to the post, as a plane's border belongs to a polyhedron.
    assert_eq!(met([1.0, 0.0, 5.0], -DVec3::Z), Some(3.0));
}

/// A shape of planes alone has its obstacle's sphere for a box.
#[test]
fn exact_the_box_of_a_shape_without_vertices() {
    let Shape::Convex(mut convex) = cube(DVec3::new(1.0, 2.0, 3.0), 0.5) else { panic!("a polyhedron") };
    let low_high =
        |convex: &Convex| convex::bounding_box(&Shape::Convex(convex.clone()), DVec3::new(1.0, 2.0, 3.0), 2.0);
    assert_eq!(low_high(&convex), (DVec3::new(0.5, 1.5, 2.5), DVec3::new(1.5, 2.5, 3.5)));
    convex.vertices_m.clear();
    assert_eq!(low_high(&convex), (DVec3::new(-1.0, 0.0, 1.0), DVec3::new(3.0, 4.0, 5.0)));
}

/// Flat faces are their triangles; a cylinder is a prism within it, whose flats lie at the cosine of half a side.
#[test]
fn exact_ranges_on_the_mesh_of_a_cube_and_a_post() {
    let centre = DVec3::new(3.0, 5.0, 5.0);
    let post = Cylinder { base_m: DVec3::new(7.0, 5.0, 4.0), radius_m: 0.5, height_m: 2.0 };
    let scene = yard(10.0, Polynomial::flat(10.0), vec![cube(centre, 0.4), Shape::Cylinder(post)]);
    let mesh = mesh::MeshCaster::new(&scene, 1.0);
    for dir in fan(400) {
        let origin = centre - 1.5 * dir;
        let exact = convex::first_hit(&scene.obstacles[0].body().shape, origin, dir, 10.0).expect("through the centre");
        let hit = mesh.first_hit(origin, dir, 10.0);
        assert!((hit.range_m - exact).abs() < 1e-5 && hit.object == 0, "{dir}: {hit:?} {exact}");
        let level = DVec3::new(dir.x, dir.y, 0.0).normalize();
        let hit = mesh.first_hit(DVec3::new(7.0, 5.0, 5.0) - 1.5 * level, level, 10.0);
        let flat_m = 0.5 * crate::math::cos(std::f64::consts::PI / 48.0);
        assert!((1.0 - 1e-5..1.5 - flat_m + 1e-5).contains(&hit.range_m) && hit.object == 1, "{level}: {hit:?}");
    }
    let above = mesh.first_hit(DVec3::new(7.1, 5.1, 8.0), -DVec3::Z, 10.0);
    assert!((above.range_m - 2.0).abs() < 1e-5 && above.object == 1, "{above:?}");
}

#[test]
fn equal_rays_into_a_trench_and_a_fine_march_meet_its_walls_and_floor() {
    use crate::random::{Drawn, Stage, Streams};
    use crate::scene::params::{ExcavationParams, FeatureParams, GroundParams, GroundShape, GroundSource, RawShape};
    let trench = ExcavationParams {
        count: 1.0.into(),
        depth_m: 0.5.into(),
        width_m: 1.0.into(),
        length_m: None,
        rounding_m: 0.06.into(),
        lip_m: 0.05.into(),
    };
    let ground = GroundParams {
        source: GroundSource::Flat,
        shape: GroundShape::Raw(RawShape { spacing_m: 0.02 }),
        features: vec![FeatureParams::Trench(trench)],
        ..GroundParams::default()
    };
    let params =
        crate::scene::SceneParams { extent_m: 10.0, ground, rocks: None, boxes: None, trees: None, vegetation: None };
    let streams = Streams { seed: 5, scene: 2, attempt: 0, stage: Stage::Scene, step: 0 };
    let scene = crate::scene::build(&params, &Drawn::draw(&streams, params.dists()), &streams).unwrap();
    let caster = Caster::new(&scene, &Cast::Exact);
    let (mut floor, mut wall) = (0, 0);
    for k in 0..60_u32 {
        let (x, y) = (1.0 + 8.0 * f64::from(k % 8) / 7.0, 1.0 + 8.0 * f64::from(k / 8) / 7.0);
        let origin = DVec3::new(x, y, scene.ground.height_m(x, y) + 0.8);
        for (dir, reach_m) in fan(200).into_iter().filter(|dir| dir.z < -0.1).map(|dir| (dir, 8.0)) {
            let below = |range_m: f64| {
                let point = origin + range_m * dir;
                scene.contains(point.x, point.y) && point.z <= scene.ground.height_m(point.x, point.y)
            };
            let marched = (0..16_000).map(|k| 5e-4 * f64::from(k)).find(|&range_m| below(range_m));
            let hit = caster.first_hit(origin, dir, reach_m);
            let Some(marched_m) = marched else {
                assert_eq!(hit.object, Hit::NOTHING, "{origin} {dir} {hit:?}");
                continue;
            };
            assert!((hit.range_m - marched_m).abs() <= 6e-4, "{origin} {dir}: {hit:?} {marched_m}");
            let point = origin + hit.range_m * dir;
            floor += u32::from((point.z + 0.5).abs() < 1e-6);
            wall += u32::from((-0.4..-0.1).contains(&point.z));
        }
    }
    assert!(floor > 50 && wall > 20, "{floor} {wall}");
}
