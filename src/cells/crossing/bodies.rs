//! Solid bodies -> the tops that they raise on a lattice.
//!
//! In: a scene's obstacles near a lattice. Out: each node's top: the highest of the ground and of the bodies over it. A body is asked at
//! the nodes, and along the edges of its upper faces, half a spacing apart, so that no ridge, wall or tip between nodes is missed: the
//! node whose square an edge crosses is as high as the edge. Bodies nobody is near are not made. Not modelled: hollows below an
//! overhanging side.

use super::lattice::Lattice;
use super::placement::Placement;
use crate::geometry::{DVec2, DVec3};
use crate::scene::{Convex, Cylinder, Scene, Shape};

/// Makes the lattice's tops: the ground, raised by the bodies within the map's square from `low_m` to `high_m`.
pub(super) fn raise(scene: &Scene, placement: &Placement, low_m: DVec2, high_m: DVec2, lattice: &mut Lattice) {
    lattice.top_m.clone_from(&lattice.ground_m);
    let middle = placement.world(0.5 * (low_m + high_m));
    let reach_m = 0.5 * (high_m - low_m).length();
    for obstacle in scene.obstacles.iter().filter(|obstacle| !obstacle.is_beyond(middle, reach_m)) {
        match &obstacle.body().shape {
            Shape::Convex(body) => raise_convex(body, placement, lattice),
            Shape::Cylinder(body) => raise_cylinder(body, placement, lattice),
        }
    }
}

fn raise_convex(body: &Convex, placement: &Placement, lattice: &mut Lattice) {
    let corners = body.vertices_m.iter().map(|vertex| placement.map(vertex.truncate()));
    for_nodes(corners, lattice, |lattice, at, node_m| {
        if let Some(top_m) = body.top_m(placement.world(node_m)) {
            lattice.top_m[at] = lattice.top_m[at].max(top_m);
        }
    });
    let upper = body.faces.iter().zip(&body.planes).filter(|(_, plane)| plane.faces_up());
    for (face, _) in upper {
        for (k, &from) in face.iter().enumerate() {
            let to = face[(k + 1) % face.len()];
            raise_edge(body.vertices_m[from as usize], body.vertices_m[to as usize], placement, lattice);
        }
    }
}

fn raise_edge(from: DVec3, to: DVec3, placement: &Placement, lattice: &mut Lattice) {
    let pieces = ((to - from).truncate().length() / (0.5 * lattice.spacing_m)).ceil().max(1.0);
    for piece in 0..=pieces as usize {
        raise_point(from + (to - from) * (piece as f64 / pieces), placement, lattice);
    }
}

fn raise_point(point: DVec3, placement: &Placement, lattice: &mut Lattice) {
    let at = placement.map(point.truncate()) / lattice.spacing_m;
    let [col, row] = [at.x.floor() as i64 - lattice.first[0], at.y.floor() as i64 - lattice.first[1]];
    let nodes = 0..lattice.side as i64;
    if nodes.contains(&row) && nodes.contains(&col) {
        let top_m = &mut lattice.top_m[row as usize * lattice.side + col as usize];
        *top_m = top_m.max(point.z);
    }
}

fn raise_cylinder(body: &Cylinder, placement: &Placement, lattice: &mut Lattice) {
    let (middle, top_m) = (body.base_m.truncate(), body.base_m.z + body.height_m);
    let in_map = placement.map(middle);
    let corners = [-1.0, 1.0].map(|side| in_map + DVec2::splat(side * body.radius_m));
    for_nodes(corners.into_iter(), lattice, |lattice, at, node_m| {
        if (node_m - in_map).length_squared() <= body.radius_m * body.radius_m {
            lattice.top_m[at] = lattice.top_m[at].max(top_m);
        }
    });
    body.rim_m().into_iter().for_each(|corner| raise_point(corner, placement, lattice));
    raise_point(middle.extend(top_m), placement, lattice);
}

/// Calls with each node of the lattice in the rectangle around these places: its number and where it lies in the map.
fn for_nodes(
    around: impl Iterator<Item = DVec2>,
    lattice: &mut Lattice,
    mut each: impl FnMut(&mut Lattice, usize, DVec2),
) {
    let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let (low, high) = around.fold(none, |(low, high), place| (low.min(place), high.max(place)));
    let (spacing_m, last) = (lattice.spacing_m, lattice.side as i64 - 1);
    let node = |place_m: f64, first: i64| (place_m / spacing_m).floor() as i64 - first;
    let span = |low_m: f64, high_m: f64, first: i64| node(low_m, first).max(0)..=node(high_m, first).min(last);
    for row in span(low.y, high.y, lattice.first[1]) {
        for col in span(low.x, high.x, lattice.first[0]) {
            let (row, col) = (row as usize, col as usize);
            let node_m = lattice.node_m(row, col);
            each(lattice, row * lattice.side + col, node_m);
        }
    }
}
