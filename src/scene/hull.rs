//! Points -> the convex polyhedron they span.
//!
//! In: points in metres. Out: [`Convex`]: outward unit planes, vertices, faces; coplanar triangles merged.
//! Source: the incremental hull (O'Rourke, *Computational Geometry in C*, 4.2); bodies here have tens of points, so a linear
//! search for the visible faces beats a conflict graph. Deviation: a face that a new point lies *on* counts as visible once
//! any face is truly visible, so that no sliver of zero area can arise (a new triangle on an edge collinear with the point
//! would have been visible); and no exact predicates: what is thinner than 1e-10 of the body's size is flat.

use crate::geometry::{DVec2, DVec3};
use crate::math;

/// Thickness below which points count as coplanar, in body sizes.
const FLAT: f64 = 1e-10;
/// As `FLAT`, for merging two triangles into one face: above it, so that what was built across a flat seam is merged.
const MERGE: f64 = 1e-9;

/// Upright component of a normal up to which a plane counts as upright.
const UPRIGHT: f64 = 1e-12;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub normal: DVec3,
    pub offset_m: f64,
}

impl Plane {
    /// Whether it bounds a body from above; what is steeper than 1e-12 bounds it sideways.
    pub(crate) fn faces_up(&self) -> bool {
        self.normal.z > UPRIGHT
    }
}

/// A convex polyhedron: the points with n . x + d <= 0 for every plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Convex {
    /// Outward unit normals and offsets; coplanar faces merged.
    pub planes: Vec<Plane>,
    pub vertices_m: Vec<DVec3>,
    /// Per plane: its vertices, counter-clockwise seen from outside.
    pub faces: Vec<Vec<u32>>,
}

/// A hull under construction: triangles over the points inserted so far.
pub(super) struct Hull {
    points: Vec<DVec3>,
    triangles: Vec<Triangle>,
    flat: f64,
    visible: Vec<bool>,
    horizon: Vec<[u32; 2]>,
}

struct Triangle {
    corners: [u32; 3],
    normal: DVec3,
    offset: f64,
    area: f64,
}

impl Triangle {
    fn new(points: &[DVec3], corners: [u32; 3]) -> Triangle {
        let [a, b, c] = corners.map(|k| points[k as usize]);
        let doubled = (b - a).cross(c - a);
        let normal = doubled.normalize_or_zero();
        Triangle { corners, normal, offset: -normal.dot((a + b + c) / 3.0), area: 0.5 * doubled.length() }
    }

    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) + self.offset
    }

    fn edges(&self) -> [[u32; 2]; 3] {
        let [a, b, c] = self.corners;
        [[a, b], [b, c], [c, a]]
    }
}

impl Hull {
    /// The tetrahedron of four far points; `None` where the points span no volume.
    pub(super) fn seed(points: Vec<DVec3>) -> Option<Hull> {
        let farthest = |measure: &dyn Fn(DVec3) -> f64| {
            points
                .iter()
                .enumerate()
                .fold((0, 0.0), |best, (k, &p)| if measure(p) > best.1 { (k, measure(p)) } else { best })
        };
        let a = *points.first()?;
        if points.iter().any(|p| !p.is_finite()) {
            return None;
        }
        let (b, size) = farthest(&|p| p.distance(a));
        let along = (points[b] - a) / size;
        let (c, width) = farthest(&|p| (p - a).cross(along).length());
        let flat = FLAT * size;
        if size <= 0.0 || !size.is_finite() || width <= flat {
            return None;
        }
        let normal = (points[b] - a).cross(points[c] - a).normalize_or_zero();
        let (d, height) = farthest(&|p| (p - a).dot(normal).abs());
        if height <= flat {
            return None;
        }
        let [a, b, c, d] =
            if (points[d] - a).dot(normal) < 0.0 { [0, b, c, d] } else { [0, c, b, d] }.map(|k| k as u32);
        let triangles =
            [[a, b, c], [a, d, b], [b, d, c], [c, d, a]].map(|corners| Triangle::new(&points, corners)).into();
        Some(Hull { points, triangles, flat, visible: Vec::new(), horizon: Vec::new() })
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The bounding box of the hull as it is.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let corners = self.triangles.iter().flat_map(|t| t.corners).map(|k| self.points[k as usize]);
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// Takes one of the points into the hull.
    pub(super) fn insert(&mut self, point: u32) {
        let p = self.points[point as usize];
        self.visible.clear();
        self.visible.extend(self.triangles.iter().map(|t| t.distance(p) >= -self.flat));
        if !self.triangles.iter().any(|t| t.distance(p) > self.flat) {
            return;
        }
        // The horizon: edges of visible triangles whose other side is not visible, so that their twin is not among them.
        self.horizon.clear();
        for (triangle, _) in self.triangles.iter().zip(&self.visible).filter(|(_, visible)| **visible) {
            for [from, to] in triangle.edges() {
                match self.horizon.iter().position(|&twin| twin == [to, from]) {
                    Some(k) => _ = self.horizon.swap_remove(k),
                    None => self.horizon.push([from, to]),
                }
            }
        }
        let mut visible = self.visible.iter();
        self.triangles.retain(|_| !visible.next().expect("one flag a triangle"));
        let points = &self.points;
        self.triangles.extend(self.horizon.iter().map(|&[from, to]| Triangle::new(points, [from, to, point])));
    }

    /// The polyhedron: coplanar triangles merged, points inside dropped. `place` maps each point to where it shall be and
    /// must be affine and keep handedness.
    pub(super) fn finish(&self, place: impl Fn(DVec3) -> DVec3) -> Convex {
        let polygons: Vec<Vec<u32>> =
            self.groups().iter().map(|group| self.outline(group)).filter(|polygon| polygon.len() >= 3).collect();
        // A vertex of fewer than three faces lies inside an edge.
        let mut faces_at = vec![0; self.points.len()];
        polygons.iter().flatten().for_each(|&v| faces_at[v as usize] += 1);
        let mut renumbered = vec![u32::MAX; self.points.len()];
        let mut vertices_m = Vec::new();
        for (v, _) in faces_at.iter().enumerate().filter(|(_, count)| **count >= 3) {
            renumbered[v] = vertices_m.len() as u32;
            vertices_m.push(place(self.points[v]));
        }
        let faces: Vec<Vec<u32>> = polygons
            .iter()
            .map(|polygon| polygon.iter().map(|&v| renumbered[v as usize]).filter(|&v| v != u32::MAX).collect())
            .collect();
        Convex::from_faces(vertices_m, faces)
    }

    /// The triangles of each face.
    fn groups(&self) -> Vec<Vec<usize>> {
        let merge = self.flat * (MERGE / FLAT);
        // From the largest triangle on: a sliver's plane is not to be trusted, so it joins a face and never starts one that
        // has a larger triangle. Each face keeps to its first triangle's plane, so that a gently curved strip is not merged.
        let mut open: Vec<usize> = (0..self.triangles.len()).collect();
        open.sort_by(|&a, &b| self.triangles[b].area.total_cmp(&self.triangles[a].area));
        let mut groups = Vec::with_capacity(open.len());
        while let Some(&first) = open.first() {
            let plane = &self.triangles[first];
            let off = |&corner: &u32| plane.distance(self.points[corner as usize]).abs();
            let joins = |&k: &usize| {
                let triangle = &self.triangles[k];
                // The normals alone decide for most pairs.
                plane.normal.dot(triangle.normal) > 0.5 && triangle.corners.iter().all(|corner| off(corner) <= merge)
            };
            let mut group = vec![first];
            open.remove(0);
            open.retain(|k| {
                let joins = joins(k);
                if joins {
                    group.push(*k);
                }
                !joins
            });
            groups.push(group);
        }
        groups
    }

    /// The corners around a face.
    fn outline(&self, group: &[usize]) -> Vec<u32> {
        match group {
            [only] => self.triangles[*only].corners.to_vec(),
            _ => boundary(group.iter().flat_map(|&k| self.triangles[k].edges())),
        }
    }
}

/// The outline of a face: directed edges without their twins, head to tail.
fn boundary(edges: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut open: Vec<[u32; 2]> = Vec::new();
    for [from, to] in edges {
        match open.iter().position(|&twin| twin == [to, from]) {
            Some(k) => _ = open.swap_remove(k),
            None => open.push([from, to]),
        }
    }
    let Some(&[first, mut head]) = open.first() else { return Vec::new() };
    let mut outline = vec![first];
    while head != first && outline.len() < open.len() {
        outline.push(head);
        let Some(&[_, next]) = open.iter().find(|edge| edge[0] == head) else { break };
        head = next;
    }
    outline
}

impl Convex {
    /// The hull of a set of points; `None` where they are fewer than four, not finite, or span no volume (thinner than 1e-10
    /// of their size).
    pub fn hull(points_m: &[DVec3]) -> Option<Convex> {
        // About the first point, so that a small body far from the origin keeps its digits.
        let origin = *points_m.first()?;
        let mut hull = Hull::seed(points_m.iter().map(|p| *p - origin).collect())?;
        for point in 0..points_m.len() as u32 {
            hull.insert(point);
        }
        Some(hull.finish(|p| p + origin))
    }

    /// A box of half-sizes `half_m`, turned by `yaw_rad` about the vertical through its centre.
    pub fn cuboid(centre_m: DVec3, half_m: DVec3, yaw_rad: f64) -> Convex {
        let (sin, cos) = math::sin_cos(yaw_rad);
        let (east, north) = (DVec3::new(cos, sin, 0.0) * half_m.x, DVec3::new(-sin, cos, 0.0) * half_m.y);
        let up = DVec3::Z * half_m.z;
        let side = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
        let corner = |k: usize| centre_m + side(k & 1) * east + side(k & 2) * north + side(k & 4) * up;
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Convex::from_faces((0..8).map(corner).collect(), faces.iter().map(|face| face.to_vec()).collect())
    }

    /// Planes from faces: Newell normals, and offsets that leave every vertex inside.
    fn from_faces(vertices_m: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Convex {
        let plane = |face: &Vec<u32>| {
            let at = |k: usize| vertices_m[face[k % face.len()] as usize];
            let normal = (1..face.len() - 1).fold(DVec3::ZERO, |sum, k| sum + (at(k) - at(0)).cross(at(k + 1) - at(0)));
            let normal = normal.normalize_or_zero();
            Plane { normal, offset_m: -vertices_m.iter().fold(f64::NEG_INFINITY, |most, v| most.max(normal.dot(*v))) }
        };
        let planes = faces.iter().map(plane).collect();
        Convex { planes, vertices_m, faces }
    }

    /// The height of the body's upper side above or below a place; `None` beside it.
    pub(crate) fn top_m(&self, at: DVec2) -> Option<f64> {
        let (mut low_m, mut high_m) = (f64::NEG_INFINITY, f64::INFINITY);
        for plane in &self.planes {
            let level = plane.offset_m + plane.normal.x * at.x + plane.normal.y * at.y;
            if plane.faces_up() {
                high_m = high_m.min(-level / plane.normal.z);
            } else if plane.normal.z < -UPRIGHT {
                low_m = low_m.max(-level / plane.normal.z);
            } else if level > 0.0 {
                return None;
            }
        }
        (low_m <= high_m).then_some(high_m)
    }

    /// The body with its vertices moved by an affine map that keeps handedness.
    pub(crate) fn mapped(&self, map: impl Fn(DVec3) -> DVec3) -> Convex {
        Convex::from_faces(self.vertices_m.iter().map(|v| map(*v)).collect(), self.faces.clone())
    }

    /// Largest signed distance to a plane: negative inside, and the distance to the surface where positive is a lower bound.
    pub fn depth_m(&self, point_m: DVec3) -> f64 {
        self.planes.iter().fold(f64::NEG_INFINITY, |most, plane| most.max(plane.normal.dot(point_m) + plane.offset_m))
    }

    /// Whether the point lies in the body or on its surface.
    pub fn contains(&self, point_m: DVec3) -> bool {
        self.depth_m(point_m) <= 0.0
    }

    /// Volume, by cones over the faces.
    pub fn volume_m3(&self) -> f64 {
        let apex = self.vertices_m[0];
        let at = |v: u32| self.vertices_m[v as usize] - apex;
        let cone = |face: &Vec<u32>| -> f64 {
            (1..face.len() - 1).map(|k| at(face[0]).dot(at(face[k]).cross(at(face[k + 1]))) / 6.0).sum()
        };
        self.faces.iter().map(cone).sum()
    }

    /// Centre and radius of a sphere around the body: about the middle of its bounding box.
    pub(crate) fn bounding_sphere(&self) -> (DVec3, f64) {
        let low = self.vertices_m.iter().fold(DVec3::INFINITY, |low, v| low.min(*v));
        let high = self.vertices_m.iter().fold(DVec3::NEG_INFINITY, |high, v| high.max(*v));
        let centre = 0.5 * (low + high);
        let radius = self.vertices_m.iter().fold(0.0_f64, |most, v| most.max(v.distance(centre)));
        // Two rounding steps outwards: the sphere must not cut a vertex.
        (centre, radius * (1.0 + 4.0 * f64::EPSILON))
    }
}

#[cfg(test)]
mod tests;
