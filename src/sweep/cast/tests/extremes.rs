//! Casting at its extremes, beside what a textbook gives there: triangles in f32 world coordinates (Moller & Trumbore 1997), the
//! slab test of Kay & Kajiya 1986, marching by fixed steps, the quadratic formula.
//!
//! Expected ranges: closed forms, and the same yard elsewhere, moved by a power of two so that no coordinate rounds.

use glam::Vec3;

use super::*;
use crate::extremes::{Family, row};
use crate::math;

/// 1997's test as it is printed, with its own epsilon.
fn triangle_f32(origin: Vec3, dir: Vec3, [a, b, c]: [Vec3; 3]) -> Option<f32> {
    let (edge1, edge2) = (b - a, c - a);
    let p = dir.cross(edge2);
    let det = edge1.dot(p);
    if det.abs() < 1e-6 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(p) / det;
    let q = from.cross(edge1);
    let v = dir.dot(q) / det;
    let t = edge2.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
}

/// A body's faces as fans of triangles, f32.
fn triangles(shape: &Shape) -> Vec<[Vec3; 3]> {
    let Shape::Convex(body) = shape else { panic!("a polyhedron") };
    let corner = |k: u32| body.vertices_m[k as usize].as_vec3();
    body.faces
        .iter()
        .flat_map(|face| face.windows(2).skip(1).map(|pair| [corner(face[0]), corner(pair[0]), corner(pair[1])]))
        .collect()
}

/// Height of the floors, metres: no number of f32.
const FLOOR_M: f64 = 100.1;

/// A level yard at `FLOOR_M`.
fn level(extent_m: f64) -> Scene {
    yard(extent_m, Polynomial::plane(extent_m, FLOOR_M, DVec2::ZERO), vec![])
}

/// The same as two triangles.
fn floor(extent_m: f32) -> [[Vec3; 3]; 2] {
    let corner = |x: f32, y: f32| Vec3::new(x * extent_m, y * extent_m, FLOOR_M as f32);
    let [sw, se, nw, ne] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0)];
    [[sw, se, ne], [sw, ne, nw]]
}

fn textbook(triangles: &[[Vec3; 3]], origin: DVec3, dir: DVec3) -> Option<f64> {
    triangles.iter().filter_map(|t| triangle_f32(origin.as_vec3(), dir.as_vec3(), *t)).reduce(f32::min).map(f64::from)
}

/// What a textbook's answer is worth: "off by ..." or "missed".
fn judged(found: Option<f64>, range_m: f64) -> String {
    found.map_or("missed".to_string(), |found| format!("off by {:.1e} m", (found - range_m).abs()))
}

/// A boulder of many faces, its points on an ellipsoid.
fn boulder(centre_m: DVec3, size_m: f64) -> Shape {
    let points: Vec<DVec3> = fan(24).into_iter().map(|p| centre_m + p * DVec3::new(0.5, 0.4, 0.3) * size_m).collect();
    Shape::Convex(Convex::hull(&points).expect("a body"))
}

#[test]
fn extreme_rays_that_graze_to_a_nanoradian() {
    let scene = level(10_000.0);
    let caster = Caster::new(&scene, &Cast::Exact);
    for angle in [1e-3, 1e-6, 1e-9f64] {
        let origin = DVec3::new(4000.0, 5000.0, FLOOR_M + 1000.0 * angle);
        let dir = DVec3::new((1.0 - angle * angle).sqrt(), 0.0, -angle);
        // From the height as it was rounded.
        let range_m = (origin.z - FLOOR_M) / angle;
        let own_m =
            both(&caster, origin, dir, 5000.0).iter().fold(0.0_f64, |off, hit| off.max((hit.range_m - range_m).abs()));
        assert!(own_m <= 1e-9 + 1e-12 / angle, "{angle}: {own_m:e}");
        for hit in both(&caster, origin, DVec3::new(dir.x, 0.0, angle), 5000.0) {
            assert_eq!(hit, Hit::NONE);
        }
        row(
            Family::Casting,
            &format!("a ray that grazes at {angle:.0e} rad, 1 km"),
            &format!("triangles in f32: {}", judged(textbook(&floor(10_000.0), origin, dir), range_m)),
            &format!("off by {own_m:.1e} m; as far above the horizon: no hit"),
        );
    }
}

/// The slab test in the form of Williams et al. 2005: whether a box is met.
fn slabs(low: DVec3, high: DVec3, origin: DVec3, dir: DVec3) -> bool {
    let spans = [0, 1, 2].map(|axis| {
        let inverse = 1.0 / dir[axis];
        let (a, b) = ((low[axis] - origin[axis]) * inverse, (high[axis] - origin[axis]) * inverse);
        if inverse < 0.0 { (b, a) } else { (a, b) }
    });
    let (mut enter, mut exit) = spans[0];
    for (near, far) in &spans[1..] {
        if enter > *far || *near > exit {
            return false;
        }
        enter = if *near > enter { *near } else { enter };
        exit = if *far < exit { *far } else { exit };
    }
    enter < f64::INFINITY && exit > 0.0
}

#[test]
fn extreme_rays_straight_up_and_straight_down() {
    let ground = bumps(20.0, 8);
    let cube = cube(DVec3::new(10.0, 10.0, 5.0), 1.0);
    let scene = yard(20.0, ground.clone(), vec![cube]);
    let raster = Raster::sampled(20.0, 0.25, |x, y| ground.height_m(x, y));
    let over_raster = Scene { ground: Ground::Raster(raster), ..scene.clone() };
    let (mut worst, mut rays) = (0.0_f64, 0);
    for scene in [&scene, &over_raster] {
        let caster = Caster::new(scene, &Cast::Exact);
        // Nodes, cell borders and the middles of cells, the yard's own border among them.
        for k in 0..81 * 81 {
            let (x, y) = (0.25 * f64::from(k % 81), 0.25 * f64::from(k / 81));
            let height = scene.ground.height_m(x, y);
            let (above, below) = (DVec3::new(x, y, 8.0), DVec3::new(x, y, height - 2.0));
            let over_cube = (9.0..=11.0).contains(&x) && (9.0..=11.0).contains(&y);
            let edge = over_cube && ([9.0, 11.0].contains(&x) || [9.0, 11.0].contains(&y));
            for hit in both(&caster, above, -DVec3::Z, 30.0) {
                // On the cube's very edge either answer is right.
                let on_cube = over_cube && (!edge || hit.object == 0);
                let (range, object) = if on_cube { (2.0, 0) } else { (8.0 - height, Hit::GROUND) };
                assert_eq!(hit.object, object, "{x} {y}");
                worst = worst.max((hit.range_m - range).abs());
            }
            for hit in both(&caster, below, DVec3::Z, 30.0) {
                assert_eq!(hit.object, Hit::GROUND, "{x} {y}");
                worst = worst.max((hit.range_m - 2.0).abs());
            }
            rays += 2;
        }
    }
    assert!(worst < 1e-12, "{worst:e}");
    // Down the east face of the cube, 999 rays: all meet its top by right.
    let (low, high) = (DVec3::new(9.0, 9.0, 4.0), DVec3::new(11.0, 11.0, 6.0));
    let along = (1..1000).map(|k| DVec3::new(11.0, 9.0 + 0.002 * f64::from(k), 8.0));
    let missed = along.filter(|origin| !slabs(low, high, *origin, -DVec3::Z)).count();
    assert!(missed > 0);
    row(
        Family::Casting,
        "straight up and straight down, on nodes and borders",
        &format!("slab test, rays down the face of a box: {missed} of 999 lost (0 times infinity)"),
        &format!("{rays} rays, all answers right, off by {worst:.1e} m at most"),
    );
}

#[test]
fn extreme_rays_at_vertices_and_edges_that_face_the_sensor() {
    let centre = DVec3::new(10.3, 9.7, 3.1);
    let shape = boulder(centre, 0.6);
    let Shape::Convex(body) = shape.clone() else { panic!("a polyhedron") };
    let scene = yard(20.0, Polynomial::flat(20.0), vec![shape.clone()]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let faces = triangles(&shape);
    let (mut rays, mut lost, mut worst) = (0, 0, 0.0_f64);
    for place in fan(400) {
        let sensor = centre + 2.5 * place;
        let facing = |k: &u32| {
            let around = body.faces.iter().zip(&body.planes).filter(|(face, _)| face.contains(k));
            around.into_iter().all(|(_, plane)| plane.normal.dot(sensor) + plane.offset_m > 0.05)
        };
        for face in &body.faces {
            for (n, &k) in face.iter().enumerate() {
                let next = face[(n + 1) % face.len()];
                if !facing(&k) || !facing(&next) {
                    continue;
                }
                let (a, b) = (body.vertices_m[k as usize], body.vertices_m[next as usize]);
                for share in [0.0, 0.5, 0.37] {
                    let way = a + (b - a) * share - sensor;
                    for hit in both(&caster, sensor, way.normalize(), 10.0) {
                        assert_eq!(hit.object, 0, "leaked at {way}");
                        worst = worst.max((hit.range_m - way.length()).abs());
                    }
                    rays += 1;
                    let found = textbook(&faces, sensor, way.normalize());
                    lost += usize::from(found.is_none_or(|range| range > way.length() + 1e-3));
                }
            }
        }
    }
    assert!(rays > 3000 && worst < 1e-12, "{rays} rays, {worst:e}");
    assert!(lost > 0);
    row(
        Family::Casting,
        "through vertices and along edges that face the sensor",
        &format!("triangles in f32: {lost} of {rays} rays leak through"),
        &format!("none leaks, off by {worst:.1e} m at most"),
    );
}

#[test]
fn extreme_sensors_on_a_face_and_inside_a_body() {
    let shape = cube(DVec3::new(10.0, 10.0, 5.0), 1.0);
    let scene = yard(20.0, Polynomial::flat(20.0), vec![shape.clone()]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let faces = triangles(&shape);
    let (mut rays, mut met_itself) = (0, 0);
    for k in 0..400 {
        let on = DVec3::new(11.0, 9.05 + 0.1 * f64::from(k % 20), 4.05 + 0.1 * f64::from(k / 20));
        let out = DVec3::new(1.0, 0.3 * math::sin(f64::from(k)), 0.2 * math::cos(f64::from(k))).normalize();
        for hit in both(&caster, on, out, 6.0) {
            assert_eq!(hit, Hit::NONE, "{on} {out}");
        }
        rays += 1;
        met_itself += usize::from(textbook(&faces, on, out).is_some());
        // From inside it is met on the way out.
        let inside = on - DVec3::new(0.75, 0.0, 0.0);
        let way_out = (0..3).map(|i| {
            let wall = if out[i] > 0.0 { [11.0, 11.0, 6.0][i] } else { [9.0, 9.0, 4.0][i] };
            if out[i] == 0.0 { f64::INFINITY } else { (wall - inside[i]) / out[i] }
        });
        let exit = way_out.fold(f64::INFINITY, f64::min);
        for hit in both(&caster, inside, out, 6.0) {
            assert!(hit.object == 0 && (hit.range_m - exit).abs() < 1e-13, "{hit:?} {exit}");
        }
    }
    assert!(met_itself > 0);
    row(
        Family::Casting,
        "from on a body, outwards; from inside it",
        &format!("triangles in f32: {met_itself} of {rays} rays meet the face that they leave"),
        "none does; from inside, the way out to 1e-13 m",
    );
}

#[test]
fn extreme_tangents_to_a_crest() {
    let crest = 0.4;
    let mut coefficients = vec![0.0; 6];
    coefficients[5] = -crest / 5f64.sqrt();
    let ground = Polynomial::new(20.0, 2, coefficients);
    let scene = yard(20.0, ground, vec![]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let march = |origin: DVec3| (0..600).any(|k| caster.inside(origin + 0.05 * f64::from(k) * DVec3::X).is_some());
    let gaps = [1e-3, 1e-5, 1e-7, 1e-9, 1e-10f64];
    let (mut wrong, mut worst) = (0, 0.0_f64);
    for gap in gaps {
        let [above, below] = [gap, -gap].map(|by| DVec3::new(1.01, 3.0, 0.5 * crest + by));
        for hit in both(&caster, above, DVec3::X, 18.0) {
            assert_eq!(hit, Hit::NONE, "{gap:e} above the crest");
        }
        let before = 12.0 * (gap / (1.5 * crest)).sqrt();
        for hit in both(&caster, below, DVec3::X, 18.0) {
            let off = (hit.range_m - (8.99 - before)).abs();
            assert!(off < 1e-9 + 1e-12 * before / (2.0 * gap), "{gap:e} below the crest: {hit:?}");
            worst = worst.max(off);
        }
        wrong += usize::from(march(above)) + usize::from(!march(below));
    }
    assert!(wrong > 0);
    row(
        Family::Casting,
        "tangent to a crest, 1 mm to 0.1 nm above and below it",
        &format!("steps of 0.05 m: {wrong} of {} rays on the wrong side", 2 * gaps.len()),
        &format!("all on the right side, off by {worst:.1e} m at most"),
    );
}

#[test]
fn extreme_yards_a_thousand_kilometres_off() {
    // A power of two: what is near the corner has its exact copy there.
    let far = 1_048_576.0;
    let (mut worst, mut textbook_worst, mut textbook_other, mut bodies) = (0.0_f64, 0.0_f64, 0, 0);
    let mut compare = |near: (&Scene, DVec3), off: (&Scene, DVec3), reach_m: f64, dirs: &[DVec3]| {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        let [near_caster, far_caster] = [near.0, off.0].map(|scene| Caster::new(scene, &Cast::Exact));
        near_caster.from(near.1, reach_m).cast(dirs, &mut a);
        far_caster.from(off.1, reach_m).cast(dirs, &mut b);
        let faces: Vec<Vec<[Vec3; 3]>> = off.0.obstacles.iter().map(|o| triangles(&o.body().shape)).collect();
        for ((dir, near_hit), far_hit) in dirs.iter().zip(&a).zip(&b) {
            let single = far_caster.first_hit(off.1, *dir, reach_m);
            for hit in [*far_hit, single] {
                assert_eq!(hit.object, near_hit.object, "{dir}");
                if hit.object != Hit::NOTHING {
                    let point = near.1 + *dir * near_hit.range_m;
                    let rate = near_caster.normal_at(hit.object, point).dot(*dir).abs();
                    let error = (hit.range_m - near_hit.range_m).abs();
                    // Coordinates round at 1.2e-10 m there; along the ray that is as much over the sine of the angle.
                    assert!(error <= 1e-8_f64.max(1e-9 / rate), "{dir}: {error:e} at {rate}");
                    worst = worst.max(error * (rate / 0.1).min(1.0));
                }
            }
            if near_hit.object >= 0 {
                bodies += 1;
                match textbook(&faces[near_hit.object as usize], off.1, *dir) {
                    Some(range) => textbook_worst = textbook_worst.max((range - near_hit.range_m).abs()),
                    None => textbook_other += 1,
                }
            }
        }
    };
    let shapes = |by: DVec3| -> Vec<Shape> {
        (0..24)
            .map(|k| {
                let round = |v: f64| (v * 64.0).round() / 64.0;
                let (sin, cos) = math::sin_cos(f64::from(k));
                let out = 2.0 + 0.25 * f64::from(k);
                cube(DVec3::new(round(20.0 + out * cos), round(20.0 + out * sin), 0.25) + by, 0.25)
            })
            .collect()
    };
    let dirs = fan(20_000);
    let sensor = DVec3::new(20.0, 20.0, 1.5);
    // Upwards, with a bumpy ground below.
    let up = DVec3::new(0.0, 0.0, far);
    let ground = bumps(40.0, 8);
    let mut lifted = ground.clone();
    lifted.coefficients[0] = (ground.coefficients[0] * 1024.0).round() / 1024.0;
    let ground = lifted.clone();
    lifted.coefficients[0] += far;
    let (near, high) = (yard(40.0, ground, shapes(DVec3::ZERO)), yard(40.0, lifted, shapes(up)));
    compare((&near, sensor), (&high, sensor + up), 15.0, &dirs);
    // Sideways, in a yard of two thousand kilometres, on the level and on a slope.
    let aside = DVec3::new(far, far, 0.0);
    for slope in [DVec2::ZERO, DVec2::new(0.125, -0.0625)] {
        let at = |place: DVec3| -slope.dot(place.truncate());
        let near = yard(40.0, Polynomial::plane(40.0, at(sensor), slope), shapes(DVec3::ZERO));
        let off = yard(2.0 * far, Polynomial::plane(2.0 * far, at(sensor + aside), slope), shapes(aside));
        compare((&near, sensor), (&off, sensor + aside), 15.0, &dirs);
    }
    assert!(bodies > 2000, "{bodies}");
    row(
        Family::Casting,
        "yards a thousand kilometres off",
        &format!(
            "triangles in f32, world coordinates: {textbook_other} of {bodies} missed, others off by up to {textbook_worst:.2} m"
        ),
        &format!("the same objects; off by {worst:.1e} m at most (at angles below 0.1 rad, times the angle over 0.1)"),
    );
}

#[test]
fn extreme_rocks_from_a_millimetre_to_ten_kilometres() {
    for size in [1e-3, 1.0, 1e4] {
        let distance = 2.0 * size + 3.0;
        let sensor = DVec3::new(40_000.0, 40_000.0, 1.0);
        let shape = cube(sensor + DVec3::new(distance, 0.0, 0.0), 0.5 * size);
        let faces = triangles(&shape);
        let scene = yard(90_000.0, Polynomial::flat(90_000.0), vec![shape]);
        let caster = Caster::new(&scene, &Cast::Exact);
        let (mut worst, mut lost, mut textbook_worst) = (0.0_f64, 0, 0.0_f64);
        for k in 0..400 {
            // All over the face that looks here, its border left out; and as far beside it.
            let (u, v) = (0.049 * f64::from(k % 20 - 10), 0.049 * f64::from(k / 20 - 10) + 0.01);
            let way = DVec3::new(distance - 0.5 * size, size * u, size * v.abs());
            for hit in both(&caster, sensor, way.normalize(), 1e5) {
                assert_eq!(hit.object, 0, "{size} m: {way}");
                worst = worst.max((hit.range_m - way.length()).abs() / way.length());
            }
            match textbook(&faces, sensor, way.normalize()) {
                Some(range) => textbook_worst = textbook_worst.max((range - way.length()).abs() / way.length()),
                None => lost += 1,
            }
            let beside = way + DVec3::new(0.0, size * 1.1 * if u < 0.0 { -1.0 } else { 1.0 }, 0.0);
            for hit in both(&caster, sensor, beside.normalize(), 1e5) {
                assert_eq!(hit.object, Hit::NOTHING, "{size} m, beside: {beside}");
            }
        }
        assert!(worst < 1e-11, "{size} m: {worst:e}");
        row(
            Family::Casting,
            &format!("a rock of {size:.0e} m, 57 km from the corner"),
            &match lost {
                400 => "triangles in f32: all 400 rays lost".to_string(),
                _ => {
                    format!("triangles in f32: {lost} of 400 rays lost, others off by a share of {textbook_worst:.0e}")
                }
            },
            &format!("none lost or invented, off by a share of {worst:.0e}"),
        );
    }
}

#[test]
fn extreme_slivers_and_coplanar_faces() {
    // A plate of a nanometre, seen on its edge and on its face.
    let plate = Shape::Convex(Convex::cuboid(DVec3::new(12.0, 10.0, 3.0), DVec3::new(1.0, 1.0, 0.5e-9), 0.0));
    let faces = triangles(&plate);
    let scene = yard(20.0, Polynomial::flat(20.0), vec![plate]);
    let caster = Caster::new(&scene, &Cast::Exact);
    expect(&caster, DVec3::new(8.0, 10.2, 3.0), DVec3::X, 30.0, 3.0, 0, 1e-12);
    expect(&caster, DVec3::new(8.0, 10.2, 3.0 + 1e-9), DVec3::X, 30.0, f64::INFINITY, Hit::NOTHING, 0.0);
    expect(&caster, DVec3::new(12.3, 10.2, 5.0), -DVec3::Z, 30.0, 2.0, 0, 2e-9);
    row(
        Family::Casting,
        "a plate of a nanometre, seen on its edge",
        &format!("triangles in f32: {}", judged(textbook(&faces, DVec3::new(8.0, 10.2, 3.0), DVec3::X), 3.0)),
        "met on its edge, passed a nanometre above",
    );

    // A dome of 40 points that bulges by a micrometre: faces that are all but one plane.
    let points: Vec<DVec3> = fan(80)
        .into_iter()
        .filter(|p| p.z > 0.0)
        .map(|p| DVec3::new(10.0 + p.x, 10.0 + p.y, 3.0 + 1e-6 * (1.0 - p.x * p.x - p.y * p.y)))
        .chain([DVec3::new(10.0, 10.0, 2.0)])
        .collect();
    let dome = Shape::Convex(Convex::hull(&points).expect("a body"));
    // Two crates that stand wall to wall, and a third in the place of the first.
    let (left, right) = (cube(DVec3::new(5.0, 5.0, 1.0), 1.0), cube(DVec3::new(7.0, 5.0, 1.0), 1.0));
    let twin = left.clone();
    let scene = yard(20.0, Polynomial::flat(20.0), vec![dome, left, right, twin]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let (mut rays, mut leaked) = (0, 0);
    let soup: Vec<[Vec3; 3]> = scene.obstacles[1..3].iter().flat_map(|o| triangles(&o.body().shape)).collect();
    for k in 0..400 {
        let (sin, cos) = math::sin_cos(f64::from(k));
        let inside = 0.9 * f64::from(k) / 400.0;
        let above = DVec3::new(10.0 + inside * cos, 10.0 + inside * sin, 5.0);
        for hit in both(&caster, above, -DVec3::Z, 30.0) {
            assert!(hit.object == 0 && (hit.range_m - 2.0).abs() < 2e-6, "{hit:?}");
        }
        // Into the seam of the two crates, from above and aslant: never between them.
        let seam = DVec3::new(6.0, 4.1 + 1.8 * f64::from(k) / 400.0, 2.0);
        let from = seam + DVec3::new(0.3 + 0.2 * cos, 0.3 * sin, 2.0 + cos);
        let way = seam - from;
        let [sweep, single] = both(&caster, from, way.normalize(), 30.0);
        for hit in [sweep, single] {
            assert!((1..=3).contains(&hit.object) && (hit.range_m - way.length()).abs() < 1e-12, "{hit:?} {way}");
        }
        rays += 1;
        leaked += usize::from(textbook(&soup, from, way.normalize()).is_none_or(|range| range > way.length() + 0.01));
    }
    row(
        Family::Casting,
        "coplanar faces: into the seam of two crates",
        &format!("triangles in f32: {leaked} of {rays} rays fall through"),
        "none does; a third crate in the place of the first changes no range",
    );
}

#[test]
fn extreme_reaches_from_2_cm_to_a_kilometre() {
    let scene = level(4096.0);
    let caster = Caster::new(&scene, &Cast::Exact);
    for (reach, height) in [(0.02, 0.01), (1.0, 0.01), (1000.0, 0.5)] {
        let origin = DVec3::new(1000.0, 2000.0, FLOOR_M + height);
        let dir = DVec3::new((1.0 - height * height / (reach * reach)).sqrt(), 0.0, -height / reach);
        let range_m = (origin.z - FLOOR_M) / -dir.z;
        let hits = both(&caster, origin, dir, reach * (1.0 + 1e-9));
        let worst_m = hits.iter().fold(0.0_f64, |worst, hit| worst.max((hit.range_m - range_m).abs()));
        assert!(worst_m < 1e-9 + 1e-12 * reach / height, "{hits:?}");
        for hit in both(&caster, origin, dir, reach * (1.0 - 1e-6)) {
            assert_eq!(hit, Hit::NONE, "beyond its reach");
        }
        row(
            Family::Casting,
            &format!("a reach of {reach} m, {height} m above the ground"),
            &format!("triangles in f32: {}", judged(textbook(&floor(4096.0), origin, dir), range_m)),
            &format!("off by {worst_m:.1e} m; no hit where the reach is a millionth shorter"),
        );
    }
}

#[test]
fn extreme_flat_ground_and_no_rays_at_all() {
    // A quadric's roots by the school formula: on flat ground its leading coefficient is 0.
    let (a, b, c) = (0.0_f64, -0.6, 0.8);
    let school = (-b - (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
    let scene = yard(20.0, Polynomial::new(20.0, 2, vec![0.0; 6]), vec![]);
    let caster = Caster::new(&scene, &Cast::Exact);
    let (origin, dir) = (DVec3::new(10.0, 10.0, 0.8), DVec3::new(0.8, 0.0, -0.6));
    expect(&caster, origin, dir, 30.0, 0.8 / 0.6, Hit::GROUND, 1e-12);
    assert!(school.is_nan() || school.is_infinite());
    row(
        Family::Casting,
        "flat ground of degree 2",
        &format!("school formula for the quadric's root: {school}"),
        "the plane's range to 1e-12 m",
    );
    let mut hits = vec![Hit::NONE; 3];
    caster.from(origin, 30.0).cast(&[], &mut hits);
    assert!(hits.is_empty());
    caster.from(origin, 30.0).cast(&[dir], &mut hits);
    let (alone, direction) = (hits[0], DVec3::ZERO / DVec3::ZERO.length());
    let mut many = vec![dir; 41];
    many[7] = DVec3::ZERO;
    caster.from(origin, 30.0).cast(&many, &mut hits);
    assert!(hits.iter().enumerate().all(|(k, hit)| if k == 7 { *hit == Hit::NONE } else { *hit == alone }));
    assert!(direction.x.is_nan());
    row(
        Family::Casting,
        "no rays, one ray, a ray without a direction",
        "a direction of length 0, normalised: NaN",
        "no answers; the same bits alone and among others; no hit",
    );
}
