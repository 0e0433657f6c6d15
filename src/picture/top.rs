//! A view -> two maps side by side: the yard with drive and sweep, and the labelled cells.

use embedded_graphics::text::Alignment;

use super::View;
use super::canvas::{Canvas, NORMAL, Spot, TITLE};
use super::colour::{Colour, Palette, of_class, palette};
use super::map::Map;
use super::relief::{self, Style};
use crate::drive::rover::Chassis;
use crate::geometry::{DVec2, GridSpec, Pose};
use crate::scene::{Class, Scene, Shape};
use crate::sweep::Status;

pub(super) const SIDE: usize = 720;
pub(super) const LEFT: usize = 64;
pub(super) const TOP: usize = 84;
pub(super) const BETWEEN: usize = 84;
const BELOW: usize = 118;

/// PNG: on the left the whole yard from above with the drive and the sweep's points; on the right the cells of the sweep.
///
/// The left map is the world: truth. The cells lie in the map frame, where the estimate puts them.
pub(crate) fn top_view(view: &View) -> Vec<u8> {
    let palette = palette();
    let mut canvas = Canvas::new(LEFT + 2 * SIDE + BETWEEN + 28, TOP + SIDE + BELOW, palette.paper);
    canvas.text(view.title, (LEFT as f64, 16.0), TITLE, Alignment::Left, palette.ink);

    let extent_m = view.scene.extent_m;
    let yard = Map::new((LEFT, TOP), SIDE, DVec2::ZERO, extent_m);
    draw_yard(&mut canvas, &yard, view, &palette);
    let heading = format!("Yard {extent_m:.0} x {extent_m:.0} m, drive and sweep ({} points)", hits(view));
    canvas.text(&heading, (LEFT as f64, TOP as f64 - 32.0), NORMAL, Alignment::Left, palette.ink);

    let cells_left = LEFT + SIDE + BETWEEN;
    let (corner_m, side_m) = scanned_square(view);
    let zoom = Map::new((cells_left, TOP), SIDE, corner_m, side_m);
    draw_cells(&mut canvas, &zoom, view, &palette);
    let dark = view.cells.rows.iter().filter(|r| r.untraversable()).count();
    let heading = format!("{} cells of {} m, {} untraversable", view.cells.rows.len(), view.cell_size_m, dark);
    canvas.text(&heading, (cells_left as f64, TOP as f64 - 32.0), NORMAL, Alignment::Left, palette.ink);

    legends(&mut canvas, view, cells_left as f64, &palette);
    canvas.png()
}

fn hits(view: &View) -> usize {
    view.sweep.returns.status.iter().filter(|&&s| s == Status::Hit).count()
}

/// The least square that holds all cells and the rover, with a border.
pub(super) fn scanned_square(view: &View) -> (DVec2, f64) {
    let grid = GridSpec { size_m: view.cell_size_m };
    let rover_m = view.pose_among_cells().position_m.truncate();
    let centres = view.cells.rows.iter().map(|r| grid.centre_m(r.index)).map(|(x, y)| view.place_m(DVec2::new(x, y)));
    let (low, high) = centres.fold((rover_m, rover_m), |(a, b), p| (a.min(p), b.max(p)));
    let side_m = (high - low).max_element() * 1.06 + 4.0 * view.cell_size_m;
    ((low + high) / 2.0 - DVec2::splat(side_m / 2.0), side_m)
}

fn draw_yard(canvas: &mut Canvas, map: &Map, view: &View, palette: &Palette) {
    relief::draw(canvas, map, view.scene, Style { fade: 0.0, contours: true }, palette);
    let world_from_sensor = view.world_from_sensor();
    for (slot, &direction) in view.sweep.returns.pattern.directions.iter().enumerate() {
        if view.sweep.returns.status[slot] == Status::Hit {
            let point_m = world_from_sensor.point(direction * view.sweep.returns.range_m[slot]);
            let (colour, alpha) =
                if view.on_object(slot) { (palette.obstacle_point, 0.8) } else { (palette.ground_point, 0.4) };
            canvas.disc(map.clip(), map.spot(point_m.truncate()), 0.8, colour, alpha);
        }
    }
    map.path(canvas, view.truth, palette.true_path, palette.halo, false);
    map.path(canvas, view.estimates, palette.estimated_path, palette.halo, true);
    draw_rover(canvas, map, view, &view.true_pose(), palette.rover_body, palette);
    map.axes(canvas, palette);
}

fn draw_cells(canvas: &mut Canvas, map: &Map, view: &View, palette: &Palette) {
    relief::draw(canvas, map, view.scene, Style { fade: 0.45, contours: false }, palette);
    let grid = GridSpec { size_m: view.cell_size_m };
    // A seam between cells where they are large enough to show one.
    let half = view.cell_size_m / 2.0 / map.metres_a_pixel;
    let inner = if half > 2.5 { half - 0.4 } else { half };
    for row in &view.cells.rows {
        let (x_m, y_m) = grid.centre_m(row.index);
        let colour = if row.untraversable() { palette.untraversable } else { palette.traversable };
        if view.levelled {
            // Turned against the picture.
            let half_m = inner * map.metres_a_pixel;
            let corner = |(x, y): (f64, f64)| map.spot(view.place_m(DVec2::new(x_m + x * half_m, y_m + y * half_m)));
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner);
            canvas.polygon(map.clip(), &corners, colour, 0.94);
            continue;
        }
        let (x, y) = map.spot(DVec2::new(x_m, y_m));
        canvas.rectangle(map.clip(), (x - inner, y - inner), (x + inner, y + inner), colour, 0.94);
    }
    outline_obstacles(canvas, map, view.scene, palette.obstacle_point);
    map.path(canvas, view.estimates, palette.estimated_path, palette.halo, true);
    draw_rover(canvas, map, view, &view.pose_among_cells(), palette.rover_body, palette);
    map.axes(canvas, palette);
}

/// The outline of each body from above: the hull of its corners.
fn outline_obstacles(canvas: &mut Canvas, map: &Map, scene: &Scene, colour: Colour) {
    for obstacle in &scene.obstacles {
        let corners: Vec<DVec2> = match &obstacle.body().shape {
            Shape::Convex(convex) => convex.vertices_m.iter().map(|v| v.truncate()).collect(),
            Shape::Cylinder(cylinder) => {
                let turn = |k: i32| DVec2::from(crate::math::sin_cos(f64::from(k) * std::f64::consts::TAU / 48.0));
                (0..48).map(|k| cylinder.base_m.truncate() + turn(k) * cylinder.radius_m).collect()
            }
        };
        let spots: Vec<Spot> = hull(corners).into_iter().map(|p| map.spot(p)).collect();
        canvas.outline(map.clip(), &spots, 1.6, colour);
    }
}

/// The convex hull in the plane, counter-clockwise (Andrew 1979).
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - a) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut lower = chain(&mut points.iter().copied());
    lower.extend(chain(&mut points.iter().rev().copied()));
    lower
}

/// Outline, wheels, and an arrow to the front.
fn draw_rover(canvas: &mut Canvas, map: &Map, view: &View, pose: &Pose, fill: Colour, palette: &Palette) {
    let rover = view.rover;
    let half = DVec2::new(rover.length_m, rover.width_m) / 2.0;
    let clip = map.clip();
    let body = map.footprint(pose, -half, half);
    canvas.outline(clip, &body, 3.5, palette.halo);
    canvas.polygon(clip, &body, fill, 0.92);
    let tread = DVec2::new(rover.wheel_diameter_m / 2.0, rover.wheel_diameter_m / 5.0);
    for axle in axles(&rover.chassis) {
        canvas.polygon(clip, &map.footprint(pose, axle - tread, axle + tread), palette.wheel, 1.0);
    }
    canvas.outline(clip, &body, 1.4, palette.ink);
    let nose = map.footprint(pose, DVec2::new(0.1, -0.22) * half.x * 2.0, DVec2::new(0.42, 0.22) * half.x * 2.0);
    let tip = ((nose[1].0 + nose[2].0) / 2.0, (nose[1].1 + nose[2].1) / 2.0);
    canvas.polygon(clip, &[nose[0], tip, nose[3]], palette.estimated_path, 1.0);
}

/// Where the wheels stand, rover frame.
pub(super) fn axles(chassis: &Chassis) -> Vec<DVec2> {
    let (along, track_m) = match chassis {
        Chassis::Rigid(rigid) => (vec![-rigid.wheelbase_m / 2.0, rigid.wheelbase_m / 2.0], rigid.track_m),
        Chassis::RockerBogie(rocker) => {
            (vec![rocker.rocker_wheel_x_m, rocker.bogie_front_x_m, rocker.bogie_rear_x_m], rocker.track_m)
        }
    };
    along.into_iter().flat_map(|x| [DVec2::new(x, -track_m / 2.0), DVec2::new(x, track_m / 2.0)]).collect()
}

fn legends(canvas: &mut Canvas, view: &View, right: f64, palette: &Palette) {
    let (left, top) = (LEFT as f64, (TOP + SIDE) as f64 + 50.0);
    let below = top + 24.0;
    canvas.line_entry((left, top), false, palette.true_path, "true path", palette);
    canvas.line_entry((left, below), true, palette.estimated_path, "estimated path", palette);
    canvas.dot_entry((left + 200.0, top), palette.ground_point, "point on the ground", palette);
    canvas.dot_entry((left + 200.0, below), palette.obstacle_point, "point on an object", palette);
    for (k, class) in present(view.scene).into_iter().enumerate() {
        let at = (left + 430.0 + 96.0 * (k / 2) as f64, if k % 2 == 0 { top } else { below });
        canvas.square_entry(at, of_class(class), class.name(), palette);
    }
    canvas.square_entry((right, top), palette.traversable, "traversable", palette);
    canvas.square_entry((right, below), palette.untraversable, "untraversable", palette);
    canvas.line_entry((right + 190.0, top), false, palette.obstacle_point, "true outline", palette);
    canvas.line_entry((right + 190.0, below), true, palette.estimated_path, "estimated path", palette);
}

/// The classes that the yard holds, ground aside.
fn present(scene: &Scene) -> Vec<Class> {
    let mut classes: Vec<Class> = scene.obstacles.iter().map(|o| o.class).collect();
    classes.extend(scene.volumes.iter().map(|v| v.class).chain(scene.patches.iter().map(|p| p.class)));
    classes.sort_unstable();
    classes.dedup();
    classes
}
