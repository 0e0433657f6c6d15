//! Ground and a rover's limits -> outlines of the ground that it cannot cross.
//!
//! In: a scene's ground, step, gap and tilt of the rover's file. Out: rectangles seen from above, one for each row of barred nodes that
//! stand side by side on a lattice of a wheel's radius. A node is barred where, along one of four axes, a wheel meets a step beyond the limit
//! within its reach, less what the slope makes of it, or where the slope under the wheelbase is beyond the tilt. The slope counts as far as
//! both halves share it, so that a lip is a step where it lies and no ring around it (the rule of `cells::crossing`, kept apart since labels judge
//! finer and along headings). A gap no wider than the limit from node to node is bridged before steps are asked for. Frame: world, metres. Not
//! modelled: which way the rover comes: what bars one heading bars all.

use super::Rover;
use super::limits::RoverLimits;
use super::outline::Outline;
use crate::geometry::DVec2;
use crate::math;
use crate::scene::Scene;

/// Nodes stand this far apart, or a wheel's radius where that lies between.
const SPACING_M: [f64; 2] = [0.02, 0.1];
/// A side has no more nodes.
const MOST_NODES: f64 = 4000.0;
/// Columns and rows a node along each axis.
const AXES: [[i64; 2]; 4] = [[1, 0], [1, 1], [0, 1], [-1, 1]];

/// Heights of a yard's ground at the middles of square tiles.
struct Tiles {
    spacing_m: f64,
    side: i64,
    heights_m: Vec<f64>,
}

/// What a wheel may meet, metres and rise over run.
#[derive(Clone, Copy)]
struct Bars {
    step_m: f64,
    gap_m: f64,
    tilt: f64,
    reach_m: f64,
    half_wheelbase_m: f64,
}

/// Outlines of the ground that bars this rover, row by row from the south.
pub(super) fn of_ground(scene: &Scene, rover: &Rover, limits: &RoverLimits) -> Vec<Outline> {
    let bars = Bars {
        step_m: limits.max_step_m,
        gap_m: limits.max_gap_m,
        tilt: math::tan(limits.max_tilt_deg.to_radians()),
        reach_m: rover.wheel_radius_m(),
        half_wheelbase_m: 0.5 * rover.wheelbase_m(),
    };
    let tiles = Tiles::of(scene, rover.wheel_radius_m().clamp(SPACING_M[0], SPACING_M[1]));
    let mut outlines = Vec::new();
    for row in 0..tiles.side {
        let mut begun = None;
        for col in 0..=tiles.side {
            let is_barred = col < tiles.side && tiles.bars([col, row], &bars);
            match (begun, is_barred) {
                (None, true) => begun = Some(col),
                (Some(from), false) => {
                    outlines.push(tiles.outline(row, from..col));
                    begun = None;
                }
                _ => (),
            }
        }
    }
    outlines
}

impl Tiles {
    fn of(scene: &Scene, wanted_m: f64) -> Tiles {
        let side = (scene.extent_m / wanted_m * (1.0 - 1e-9)).ceil().clamp(1.0, MOST_NODES);
        let spacing_m = scene.extent_m / side;
        let side = side as i64;
        let middle_m = |number: i64| (number as f64 + 0.5) * spacing_m;
        let places = (0..side).flat_map(|row| (0..side).map(move |col| [col, row]));
        let heights_m = places.map(|[col, row]| scene.ground_below_m(middle_m(col), middle_m(row))).collect();
        Tiles { spacing_m, side, heights_m }
    }

    /// The height so many nodes along an axis from a node; at the yard's edge the edge's.
    fn height_m(&self, [col, row]: [i64; 2], axis: [i64; 2], along: i64) -> f64 {
        let [col, row] = [col + along * axis[0], row + along * axis[1]].map(|number| number.clamp(0, self.side - 1));
        self.heights_m[(row * self.side + col) as usize]
    }

    fn bars(&self, node: [i64; 2], bars: &Bars) -> bool {
        let length_m = |axis: [i64; 2]| {
            if axis[0] * axis[1] == 0 { self.spacing_m } else { self.spacing_m * std::f64::consts::SQRT_2 }
        };
        let slope = |axis: [i64; 2]| {
            let nodes = (bars.half_wheelbase_m / length_m(axis)).round().max(1.0);
            let [behind_m, own_m, ahead_m] = [-1, 0, 1].map(|k| self.height_m(node, axis, k * nodes as i64));
            shared(ahead_m - own_m, own_m - behind_m) / (nodes * length_m(axis))
        };
        let slopes = AXES.map(slope);
        // Either pair of axes at a right angle to each other; written so that NaN bars.
        let is_gentle = [0, 1].into_iter().all(|first| math::hypot(slopes[first], slopes[first + 2]) <= bars.tilt);
        let is_stepped = AXES.into_iter().zip(slopes).any(|(axis, slope)| {
            let reach = (bars.reach_m.max(2.0 * self.spacing_m) / length_m(axis) * (1.0 + 1e-9)) as i64;
            let own_m = self.height_m(node, axis, 0);
            let mut around = (1..=reach).flat_map(|nodes| [-nodes, nodes]);
            around.any(|nodes| {
                let way_m = slope * nodes as f64 * length_m(axis);
                let is_step = |from_m: f64, to_m: f64| (to_m - from_m - way_m).abs() > bars.step_m;
                is_step(own_m, self.height_m(node, axis, nodes)) && {
                    let there = [node[0] + nodes * axis[0], node[1] + nodes * axis[1]];
                    is_step(self.bridged_m(node, bars, length_m), self.bridged_m(there, bars, length_m))
                }
            })
        });
        !is_gentle || is_stepped
    }

    /// The height of the ground, or of the straight way between two nodes to either side that a wheel bridges.
    fn bridged_m(&self, node: [i64; 2], bars: &Bars, length_m: impl Fn([i64; 2]) -> f64) -> f64 {
        AXES.into_iter().fold(self.height_m(node, [0, 0], 0), |highest_m, axis| {
            let most = (bars.gap_m * (1.0 + 1e-9) / length_m(axis)) as i64;
            let spans = (1..most).flat_map(|before| (1..=most - before).map(move |after| (before, after)));
            spans.fold(highest_m, |highest_m, (before, after)| {
                let lips_m = [self.height_m(node, axis, -before), self.height_m(node, axis, after)];
                highest_m.max(lips_m[0].min(lips_m[1]))
            })
        })
    }

    /// The tiles of these columns of a row.
    fn outline(&self, row: i64, cols: std::ops::Range<i64>) -> Outline {
        let corner = |col: i64, row: i64| DVec2::new(col as f64, row as f64) * self.spacing_m;
        let corners_m = vec![
            corner(cols.start, row),
            corner(cols.end, row),
            corner(cols.end, row + 1),
            corner(cols.start, row + 1),
        ];
        Outline { corners_m, radius_m: 0.0 }
    }
}

/// What two slopes have in common: the smaller, 0 where they differ in sign.
fn shared(a: f64, b: f64) -> f64 {
    let smaller = if a.abs() < b.abs() { a } else { b };
    if a * b > 0.0 { smaller } else { 0.0 * (a + b) }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{kapvik, plane, raster};
    use super::*;

    fn barred(scene: &Scene) -> Vec<Outline> {
        let rover = kapvik();
        of_ground(scene, &rover, rover.limits.as_ref().expect("a shipped rover has limits"))
    }

    #[test]
    fn exact_a_plane_bars_beyond_the_tilt_and_not_below() {
        for along in [DVec2::X, DVec2::NEG_Y, DVec2::ONE.normalize()] {
            for (slope_deg, is_barred) in [(0.0, false), (29.9, false), (30.1, true)] {
                let slope = math::tan(f64::to_radians(slope_deg));
                let outlines = barred(&plane(4.0, 0.0, along * slope));
                // Off the edge, whose height holds beyond it.
                let is_inside = |outline: &Outline| outline.corners_m[0].min_element() < 2.0;
                assert_eq!(outlines.iter().any(is_inside), is_barred, "{slope_deg} {along}");
            }
        }
    }

    #[test]
    fn exact_a_ditch_bars_at_its_lips_unless_a_wheel_bridges_it() {
        for (width_m, depth_m, is_barred) in [(0.5, 0.4, true), (0.5, 0.05, false), (0.04, 0.4, false)] {
            let scene = raster(6.0, 0.01, |x, _| if (x - 3.025).abs() < 0.5 * width_m { -depth_m } else { 0.0 });
            let outlines = barred(&scene);
            assert_eq!(!outlines.is_empty(), is_barred, "{width_m} {depth_m}");
            for outline in outlines {
                let off_m = [outline.corners_m[0], outline.corners_m[1]].map(|corner| (corner.x - 3.025).abs());
                assert!(off_m.into_iter().all(|off_m| off_m < 0.5 * width_m + 0.16), "{outline:?}");
            }
        }
    }

    #[test]
    fn extreme_ground_without_a_height_is_barred() {
        let scene = raster(4.0, 0.05, |x, _| if x > 3.0 { f64::NAN } else { 0.0 });
        let outlines = barred(&scene);
        assert!(outlines.iter().any(|outline| outline.corners_m[1].x > 3.9));
        assert!(outlines.iter().all(|outline| outline.corners_m[0].x > 2.5));
    }
}
