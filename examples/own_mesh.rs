//! A sweep against a mesh of one's own: a dolmen of three stones on flat ground, cast exactly, beside the textbook's ray and triangles.
//!
//! `cargo run --release --example own_mesh`. A body of a scene is convex; what is not is given as convex parts, here the stones of the
//! mesh. The picture shows ranges, near ones dark; the last line the greatest distance from Möller and Trumbore's intersections.

use std::error::Error;

use marsyard::geometry::DVec3;
use marsyard::math;
use marsyard::scene::{Class, Convex, Ground, Polynomial, Scene, Shape};
use marsyard::sweep::params::Cast;
use marsyard::sweep::{Caster, Hit};

/// Corners of the stones, metres: two that stand, and one that lies across.
const STONES: [[[f64; 3]; 8]; 3] = [
    stone([6.0, 3.2, 0.0], [0.8, 0.6, 1.4]),
    stone([6.0, 6.1, 0.0], [0.7, 0.7, 1.4]),
    stone([5.8, 2.9, 1.4], [1.2, 4.2, 0.5]),
];

/// Faces of a stone, each two triangles.
const TRIANGLES: [[usize; 3]; 12] = [
    [0, 2, 1],
    [0, 3, 2],
    [4, 5, 6],
    [4, 6, 7],
    [0, 1, 5],
    [0, 5, 4],
    [1, 2, 6],
    [1, 6, 5],
    [2, 3, 7],
    [2, 7, 6],
    [3, 0, 4],
    [3, 4, 7],
];

const RANGE_M: f64 = 20.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut yard = Scene::bare(12.0, Ground::Polynomial(Polynomial::flat(12.0)));
    for corners in STONES {
        let hull = Convex::hull(&corners.map(DVec3::from_array)).ok_or("a stone has a volume")?;
        yard = yard.with_obstacle(Class::Rock, Shape::Convex(hull));
    }
    let caster = Caster::new(&yard, &Cast::Exact);
    let eye_m = DVec3::new(1.0, 5.0, 1.0);
    let directions: Vec<DVec3> = (0..24)
        .flat_map(|row| (0..72).map(move |col| (12.0 - f64::from(row) * 1.5, 36.0 - f64::from(col))))
        .map(|(up, left): (f64, f64)| (math::sin_cos(up.to_radians()), math::sin_cos(left.to_radians())))
        .map(|((su, cu), (sl, cl))| DVec3::new(cu * cl, cu * sl, su))
        .collect();

    // All rays of a sweep leave one point: what is worked out for it serves them all.
    let mut hits = Vec::new();
    caster.from(eye_m, RANGE_M).cast(&directions, &mut hits);
    for row in hits.chunks(72) {
        println!("{}", row.iter().map(shade).collect::<String>().trim_end());
    }
    let off = |(hit, direction): (&Hit, &DVec3)| {
        let textbook_m = nearest(eye_m, *direction);
        if hit.range_m == textbook_m { 0.0 } else { (hit.range_m - textbook_m).abs() }
    };
    let most_m = hits.iter().zip(&directions).map(off).fold(0.0, f64::max);
    println!("{} rays, at most {most_m:.1e} m from ray and triangle", hits.len());
    if most_m < 1e-9 { Ok(()) } else { Err("the sweep and the mesh disagree".into()) }
}

/// A stone by its lower corner and its size; drawn in at the top, so that no two faces are parallel.
const fn stone([x, y, z]: [f64; 3], [dx, dy, dz]: [f64; 3]) -> [[f64; 3]; 8] {
    let (e, top) = (0.05, z + dz);
    [
        [x, y, z],
        [x + dx, y, z],
        [x + dx, y + dy, z],
        [x, y + dy, z],
        [x + e, y + e, top],
        [x + dx - e, y + e, top],
        [x + dx - e, y + dy - e, top],
        [x + e, y + dy - e, top],
    ]
}

fn shade(hit: &Hit) -> char {
    match hit.object {
        Hit::NOTHING => ' ',
        Hit::GROUND => '.',
        _ => ['@', '%', '#', '*', '+', '='][((hit.range_m - 4.8) * 5.0).clamp(0.0, 5.0) as usize],
    }
}

/// The nearest triangle of the stones or point of the ground, by Möller and Trumbore 1997.
fn nearest(from_m: DVec3, direction: DVec3) -> f64 {
    let at = -from_m.z / direction.z;
    let ground_m = from_m + direction * at;
    let is_ground = at > 0.0 && ground_m.min_element() >= 0.0 && ground_m.truncate().max_element() <= 12.0;
    let stones = STONES.iter().flat_map(|corners| TRIANGLES.map(|t| t.map(|k| DVec3::from_array(corners[k]))));
    let met = stones.filter_map(|[a, b, c]| {
        let (ab, ac, to) = (b - a, c - a, from_m - a);
        let across = direction.cross(ac);
        let scale = 1.0 / ab.dot(across);
        let (u, v) = (scale * to.dot(across), scale * direction.dot(to.cross(ab)));
        let t = scale * ac.dot(to.cross(ab));
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
    });
    met.chain(is_ground.then_some(at)).fold(f64::INFINITY, f64::min)
}
