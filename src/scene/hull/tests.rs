use super::*;
use crate::random::{Purpose, Stage, Streams};

/// Uniform points in the cube [-1, 1]^3.
fn cloud(count: usize, scene: u64) -> Vec<DVec3> {
    let streams = Streams { seed: 11, scene, attempt: 0, stage: Stage::Scene, step: 0 };
    let mut draws = vec![0.0; 3 * count];
    streams.open(Purpose::GroundNoise).fill_uniform(0, &mut draws);
    draws.chunks_exact(3).map(|c| DVec3::new(c[0], c[1], c[2]) * 2.0 - 1.0).collect()
}

/// Every plane through three of the points that has all others on one side: the facets by definition, O(n^4).
fn facets_by_brute_force(points: &[DVec3]) -> Vec<Plane> {
    let mut planes: Vec<Plane> = Vec::new();
    for a in points {
        for b in points {
            for c in points {
                let normal = (*b - *a).cross(*c - *a);
                if normal.length() < 1e-9 {
                    continue;
                }
                let normal = normal.normalize();
                let same = |p: &Plane| (p.normal - normal).length() < 1e-6;
                if points.iter().all(|p| normal.dot(*p - *a) <= 1e-9) && !planes.iter().any(same) {
                    planes.push(Plane { normal, offset_m: -normal.dot(*a) });
                }
            }
        }
    }
    planes
}

fn assert_is_the_hull_of(hull: &Convex, points: &[DVec3], size: f64) {
    for p in points {
        assert!(hull.depth_m(*p) <= 4e-10 * size, "a point stands {} out", hull.depth_m(*p));
    }
    for (plane, face) in hull.planes.iter().zip(&hull.faces) {
        assert!((plane.normal.length() - 1.0).abs() < 1e-12 && face.len() >= 3);
        for &v in face {
            let off = plane.normal.dot(hull.vertices_m[v as usize]) + plane.offset_m;
            assert!(off.abs() < 1e-9 * size, "a vertex of the face lies {off} off its plane");
        }
    }
    // Euler: V - E + F = 2, each edge in two faces, once each way.
    let edges: Vec<[u32; 2]> =
        hull.faces.iter().flat_map(|f| (0..f.len()).map(|k| [f[k], f[(k + 1) % f.len()]])).collect();
    assert!(edges.iter().all(|[a, b]| edges.iter().filter(|e| **e == [*b, *a]).count() == 1));
    assert_eq!(hull.vertices_m.len() + hull.faces.len(), edges.len() / 2 + 2);
}

#[test]
fn equal_hull_and_brute_force_facets() {
    for scene in 0..60 {
        let points = cloud(4 + scene as usize % 12, scene);
        let hull = Convex::hull(&points).unwrap();
        assert_is_the_hull_of(&hull, &points, 1.0);
        let facets = facets_by_brute_force(&points);
        assert_eq!(facets.len(), hull.planes.len());
        for f in &facets {
            assert!(
                hull.planes
                    .iter()
                    .any(|p| (p.normal - f.normal).length() < 1e-6 && (p.offset_m - f.offset_m).abs() < 1e-9)
            );
        }
    }
}

#[test]
fn exact_lattices_and_prisms_have_their_few_faces() {
    let lattice: Vec<DVec3> =
        (0..64).map(|k| DVec3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)) * 0.1).collect();
    // Any order of insertion: start at each of the 64 points.
    for start in 0..64 {
        let mut points = lattice.clone();
        points.rotate_left(start);
        let cube = Convex::hull(&points).unwrap();
        assert_eq!((cube.planes.len(), cube.vertices_m.len()), (6, 8), "start {start}");
        assert!((cube.volume_m3() - 0.027).abs() < 1e-15);
        assert_is_the_hull_of(&cube, &points, 0.3);
    }
    let prism: Vec<DVec3> = (0..48)
        .map(|k| {
            let (sin, cos) = math::sin_cos(std::f64::consts::TAU * f64::from(k / 2) / 24.0);
            DVec3::new(cos, sin, f64::from(k % 2))
        })
        .collect();
    let hull = Convex::hull(&prism).unwrap();
    assert_eq!((hull.planes.len(), hull.vertices_m.len()), (26, 48));
    assert_is_the_hull_of(&hull, &prism, 2.0);
}

#[test]
fn exact_cuboid_volume_and_containment() {
    let boxes = Convex::cuboid(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, 0.25), 0.7);
    assert!((boxes.volume_m3() - 1.0).abs() < 1e-14);
    assert!(boxes.contains(DVec3::new(1.0, 2.0, 3.0)) && !boxes.contains(DVec3::new(1.0, 2.0, 3.26)));
    let hull = Convex::hull(&boxes.vertices_m).unwrap();
    assert_eq!(hull.planes.len(), 6);
    assert!((hull.volume_m3() - 1.0).abs() < 1e-14);
    for plane in &boxes.planes {
        assert!(hull.planes.iter().any(|p| (p.normal - plane.normal).length() < 1e-14));
    }
}

#[test]
fn order_hull_of_a_sphere_nears_its_volume() {
    let fraction = |count: usize| {
        let points: Vec<DVec3> = cloud(count, 5).iter().map(|p| p.normalize()).collect();
        let hull = Convex::hull(&points).unwrap();
        // All points of a strictly convex surface are vertices, and all faces triangles: F = 2 V - 4.
        assert_eq!((hull.vertices_m.len(), hull.planes.len()), (count, 2 * count - 4));
        hull.volume_m3() / (4.0 / 3.0 * std::f64::consts::PI)
    };
    let (coarse, fine) = (fraction(50), fraction(400));
    // The lost share falls as 1 / n (Schneider & Wieacker 2008): eight times the points, an eighth of it.
    assert!(
        fine < 1.0 && (1.0 - coarse) / (1.0 - fine) > 6.0 && (1.0 - coarse) / (1.0 - fine) < 10.0,
        "{coarse} {fine}"
    );
}

#[test]
fn extreme_points_without_volume_have_no_hull() {
    let flat: Vec<DVec3> = cloud(20, 1).iter().map(|p| p.with_z(p.x + 2.0 * p.y)).collect();
    let line: Vec<DVec3> = cloud(20, 1).iter().map(|p| DVec3::splat(p.x)).collect();
    for points in [vec![], vec![DVec3::ONE; 9], cloud(3, 2), flat, line, vec![DVec3::NAN; 6]] {
        assert!(Convex::hull(&points).is_none());
    }
    let mut one_bad = cloud(10, 3);
    one_bad[4].y = f64::INFINITY;
    assert!(Convex::hull(&one_bad).is_none());
}

#[test]
fn extreme_sizes_and_doubled_points_change_nothing() {
    for (scale, shift) in [(1e-6, 0.0), (1e6, 0.0), (0.1, 1e4), (1e50, 0.0), (1e-50, 0.0)] {
        let mut points: Vec<DVec3> = cloud(12, 9).iter().map(|p| *p * scale + DVec3::splat(shift)).collect();
        points.extend_from_within(..);
        let hull = Convex::hull(&points).unwrap();
        let plain = Convex::hull(&cloud(12, 9)).unwrap();
        assert_eq!(hull.planes.len(), plain.planes.len(), "scale {scale}");
        assert_eq!(hull.vertices_m.len(), plain.vertices_m.len());
    }
}
