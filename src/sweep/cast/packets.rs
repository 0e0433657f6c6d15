//! First hits of many rays from one point on convex bodies: shared-origin packets in inverse range.
//!
//! In: the obstacles within reach of a sensor, and blocks of unit directions with the ranges at which they already end. Out:
//! shorter ranges and ids. Source: Haines 1991 with the origin folded in: for a plane n . x + d = 0 and the sensor at
//! height c = n . o + d over it, a ray passes the plane at inverse range q = w . dir, w = -n / c. Planes that the sensor is
//! outside of (c > 0) bound q from above, the others from below; the ray enters at the least upper bound, if it is not
//! below the greatest lower bound. No division, three multiply-adds a plane.
//!
//! Bodies are sorted by their nearest point and listed by sectors of azimuth (diamond angle, no trigonometry); a block of
//! rays walks one list until its bodies lie beyond all that the block has met, and passes those by that are all above or all below it.

use std::sync::OnceLock;

use super::convex;
use super::newton::{LANES, Lanes, larger, smaller};
use crate::geometry::DVec3;
use crate::scene::{Cylinder, Obstacle, Shape};

/// Sectors of the turn, finest first. Each sector's list holds the bodies in it and in the sectors beside it, so that a block
/// which spills over a border still finds all in one list. The last level is the whole turn.
const SECTORS: [usize; 3] = [128, 16, 1];

/// The bodies in reach of a sensor.
pub struct Packets {
    bodies: Vec<Body>,
    /// Plane vectors w, front planes of a body before its back planes.
    planes: Vec<[f64; 3]>,
    cylinders: Vec<Cylinder>,
    /// Per level and sector: where its list begins in `listed`; one more entry at the end of each level.
    starts: [Vec<u32>; 3],
    /// Indices of bodies, nearest first in each list.
    listed: [Vec<u32>; 3],
    /// Room for the back planes of the body that is added.
    back: Vec<[f64; 3]>,
}

struct Body {
    id: i32,
    /// Bounding sphere: centre from the sensor, squared length of the tangent (minus infinity where the sensor is in it).
    centre: DVec3,
    tangent2: f64,
    /// Least cosine side: 0, or minus infinity where the sensor is in the sphere.
    ahead: f64,
    nearest: f64,
    /// Least and greatest z of a unit direction that can meet the sphere.
    rise: [f64; 2],
    front: std::ops::Range<u32>,
    back: std::ops::Range<u32>,
    cylinder: Option<u32>,
}

/// Centre and radius of a sphere that holds an obstacle, once it is known.
pub type Sphere = OnceLock<(DVec3, f64)>;

impl Packets {
    /// `spheres` hold the obstacles, one each; those of obstacles in reach are worked out here.
    pub fn new(obstacles: &[Obstacle], spheres: &[Sphere], origin: DVec3, reach_m: f64) -> Packets {
        let mut packets = Packets {
            bodies: Vec::new(),
            planes: Vec::new(),
            cylinders: Vec::new(),
            starts: Default::default(),
            listed: Default::default(),
            back: Vec::new(),
        };
        let mut near: Vec<(f64, usize, DVec3, f64)> = obstacles
            .iter()
            .zip(spheres)
            .enumerate()
            // What is out of reach is not even made.
            .filter(|(_, (o, _))| !o.is_beyond(origin.truncate(), reach_m))
            .filter_map(|(index, (o, sphere))| {
                let &(centre, radius) =
                    sphere.get_or_init(|| convex::bounding_sphere(&o.shape, o.centre_m, o.radius_m));
                // A hair of slack for the rounding of the centre's place.
                let radius = radius + 1e-14 * (centre.abs().max_element() + origin.abs().max_element());
                let centre = centre - origin;
                let nearest = (centre.length() - radius).max(0.0);
                (nearest <= reach_m).then_some((nearest, index, centre, radius))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut spans = Vec::with_capacity(near.len());
        for &(nearest, index, centre, radius) in &near {
            packets.add(&obstacles[index], origin, centre, radius, nearest);
            spans.push(azimuths(centre, radius));
        }
        for (level, &sectors) in SECTORS.iter().enumerate() {
            (packets.starts[level], packets.listed[level]) = sector_lists(&spans, sectors);
        }
        packets
    }

    fn add(&mut self, obstacle: &Obstacle, origin: DVec3, centre: DVec3, radius: f64, nearest: f64) {
        let distance2 = centre.length_squared();
        let within = distance2 <= radius * radius * (1.0 + 1e-9);
        let first = self.planes.len() as u32;
        let mut front = first..first;
        let mut cylinder = None;
        match &obstacle.shape {
            Shape::Convex(convex) => {
                self.back.clear();
                for plane in &convex.planes {
                    let height = plane.normal.dot(origin) + plane.offset_m;
                    // A sensor on the plane counts as just outside.
                    let over = if height == 0.0 { 1e-300 } else { height };
                    let side = if height >= 0.0 { &mut self.planes } else { &mut self.back };
                    side.push((-plane.normal / over).to_array());
                }
                front.end = self.planes.len() as u32;
                self.planes.extend_from_slice(&self.back);
            }
            Shape::Cylinder(upright) => {
                cylinder = Some(self.cylinders.len() as u32);
                self.cylinders.push(Cylinder { base_m: upright.base_m - origin, ..*upright });
            }
        }
        self.bodies.push(Body {
            id: obstacle.id,
            centre,
            // The last term is for the rounding of a ray's cosine side, which counts for small bodies far off.
            tangent2: if within { f64::NEG_INFINITY } else { distance2 - radius * radius - 1e-14 * distance2 },
            ahead: if within { f64::NEG_INFINITY } else { 0.0 },
            nearest,
            rise: rise(centre, radius),
            back: front.end..self.planes.len() as u32,
            front,
            cylinder,
        });
    }

    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Shortens the ranges of a block where a body is met first. `inverse` holds 1 / range of what each ray ends at.
    #[inline(always)]
    pub fn solve(&self, dirs: &[DVec3; LANES], inverse: &mut Lanes, objects: &mut [i32; LANES]) {
        let (mut x, mut y, mut z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            (x[l], y[l], z[l]) = (dirs[l].x, dirs[l].y, dirs[l].z);
        }
        let (level, sector) = sector_of(&x, &y);
        let list = self.starts[level][sector] as usize..self.starts[level][sector + 1] as usize;
        // A senseless ray (NaN) must not hide its neighbours.
        let lowest = of_all(&z.map(|dz| smaller(dz, f64::INFINITY)), smaller);
        let highest = of_all(&z.map(|dz| larger(dz, f64::NEG_INFINITY)), larger);
        let mut least = of_all(inverse, smaller);
        for &index in &self.listed[level][list] {
            let body = &self.bodies[index as usize];
            if body.nearest * least > 1.0 {
                break;
            }
            if highest < body.rise[0] || lowest > body.rise[1] {
                continue;
            }
            let mut seen = 0u32;
            for l in 0..LANES {
                let along = x[l].mul_add(body.centre.x, y[l].mul_add(body.centre.y, z[l] * body.centre.z));
                seen |= u32::from(along >= body.ahead && along * along >= body.tangent2);
            }
            if seen == 0 {
                continue;
            }
            if let Some(index) = body.cylinder {
                self.meet_cylinder(&self.cylinders[index as usize], body.id, dirs, inverse, objects);
                least = of_all(inverse, smaller);
                continue;
            }
            let (mut enter, mut exit) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
            for w in &self.planes[body.front.start as usize..body.front.end as usize] {
                for l in 0..LANES {
                    enter[l] = smaller(enter[l], x[l].mul_add(w[0], y[l].mul_add(w[1], z[l] * w[2])));
                }
            }
            for w in &self.planes[body.back.start as usize..body.back.end as usize] {
                for l in 0..LANES {
                    exit[l] = larger(exit[l], x[l].mul_add(w[0], y[l].mul_add(w[1], z[l] * w[2])));
                }
            }
            if body.front.is_empty() {
                // The sensor is inside: the surface is met on the way out.
                enter = exit;
            }
            for l in 0..LANES {
                let met = enter[l] > inverse[l] && enter[l] >= exit[l] && enter[l] > 0.0;
                inverse[l] = if met { enter[l] } else { inverse[l] };
                objects[l] = if met { body.id } else { objects[l] };
            }
            least = of_all(inverse, smaller);
        }
    }

    /// One upright cylinder, ray by ray.
    fn meet_cylinder(
        &self,
        cylinder: &Cylinder,
        id: i32,
        dirs: &[DVec3; LANES],
        inverse: &mut Lanes,
        objects: &mut [i32; LANES],
    ) {
        for l in 0..LANES {
            let reach = 1.0 / inverse[l];
            if let Some(range) = convex::cylinder_first_hit(cylinder, DVec3::ZERO, dirs[l], reach)
                && range < reach
            {
                inverse[l] = 1.0 / range.max(1e-300);
                objects[l] = id;
            }
        }
    }
}

/// Least and greatest z of the unit directions that meet a sphere: sines of its elevation less and plus its angular radius. A hair
/// wider than that, for directions that are of unit length but for rounding.
fn rise(centre: DVec3, radius: f64) -> [f64; 2] {
    let (distance, level) = (centre.length(), (centre.x * centre.x + centre.y * centre.y).sqrt());
    // Over or under the sensor, or around it: the angles add up beyond the vertical.
    if level <= 1.001 * radius {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let (sin, sin_radius) = (centre.z / distance, radius / distance);
    let (cos, cos_radius) = (level / distance, (1.0 - sin_radius * sin_radius).sqrt());
    let slack = 1e-9;
    [sin * cos_radius - cos * sin_radius - slack, sin * cos_radius + cos * sin_radius + slack]
}

/// Diamond angle of a horizontal direction, in turns: grows with the azimuth from 0 to 1, without trigonometry.
#[inline(always)]
pub fn diamond(x: f64, y: f64) -> f64 {
    let slope = y / (x.abs() + y.abs());
    let turn = if x < 0.0 { 2.0 - slope } else { slope };
    0.25 * if turn < 0.0 { turn + 4.0 } else { turn }
}

/// The azimuths that a sphere covers: start in [0, 1) and width in diamond turns; the whole turn where it holds the vertical
/// through the sensor.
fn azimuths(centre: DVec3, radius: f64) -> (f64, f64) {
    let level = (centre.x * centre.x + centre.y * centre.y).sqrt();
    // Near the vertical the tangents' directions are not worth the trouble.
    if level <= 1.001 * radius || level < 1e-9 {
        return (0.0, 1.0);
    }
    let sin = radius / level;
    let cos = (1.0 - sin * sin).sqrt();
    let (x, y) = (centre.x / level, centre.y / level);
    let (from, to) = (diamond(x * cos + y * sin, y * cos - x * sin), diamond(x * cos - y * sin, y * cos + x * sin));
    let slack = 1e-9;
    let width = to - from + f64::from(u8::from(to < from)) + 2.0 * slack;
    let from = from - slack;
    (if from < 0.0 { from + 1.0 } else { from }, width)
}

/// Lists of the bodies in each sector and the two beside it, in the bodies' order.
fn sector_lists(spans: &[(f64, f64)], sectors: usize) -> (Vec<u32>, Vec<u32>) {
    let count = sectors as f64;
    let covered = |&(from, width): &(f64, f64)| {
        let first = (from * count).floor() as usize + sectors - 1;
        let last = ((from + width) * count).floor() as usize + sectors + 1;
        first..=last.min(first + sectors - 1)
    };
    let mut starts = vec![0u32; sectors + 1];
    for span in spans {
        covered(span).for_each(|s| starts[s % sectors + 1] += 1);
    }
    for s in 0..sectors {
        starts[s + 1] += starts[s];
    }
    let mut next = starts.clone();
    let mut listed = vec![0u32; starts[sectors] as usize];
    for (index, span) in spans.iter().enumerate() {
        for s in covered(span) {
            let place = &mut next[s % sectors];
            listed[*place as usize] = index as u32;
            *place += 1;
        }
    }
    (starts, listed)
}

/// The least or the greatest of a block, half onto half: a chain of sixteen comparisons takes longer than the tests it saves.
#[inline(always)]
fn of_all(lanes: &Lanes, pick: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = *lanes;
    let mut half = LANES / 2;
    while half > 0 {
        for l in 0..half {
            lanes[l] = pick(lanes[l], lanes[l + half]);
        }
        half /= 2;
    }
    lanes[0]
}

/// The finest level and sector whose list holds all that a block of rays can meet.
#[inline(always)]
fn sector_of(x: &Lanes, y: &Lanes) -> (usize, usize) {
    let mut turns = [0.0; LANES];
    for l in 0..LANES {
        turns[l] = diamond(x[l], y[l]);
    }
    // From the first ray, the short way round.
    let (mut ahead, mut vertical) = ([0.0; LANES], 0u32);
    for l in 0..LANES {
        let way = turns[l] - turns[0];
        let way = if way > 0.5 { way - 1.0 } else { way };
        ahead[l] = if way < -0.5 { way + 1.0 } else { way };
        // A vertical ray has no azimuth: its turn is NaN.
        vertical |= u32::from(way.is_nan());
    }
    let (least, most) = (of_all(&ahead, smaller), of_all(&ahead, larger));
    let last = SECTORS.len() - 1;
    // Rays all round have no sector.
    if vertical != 0 || most - least >= 0.5 {
        return (last, 0);
    }
    let middle = turns[0] + 0.5 * (least + most);
    let middle = middle - middle.floor();
    for (level, &sectors) in SECTORS.iter().enumerate() {
        let count = sectors as f64;
        let sector = ((middle * count) as usize).min(sectors - 1);
        let (from, to) = ((sector as f64 - 1.0) / count, (sector as f64 + 2.0) / count);
        let half = 0.5 * (most - least);
        if middle - half >= from && middle + half <= to {
            return (level, sector);
        }
    }
    (last, 0)
}
