//! A rover's geometry -> the nodes that its wheels meet along eight headings.
//!
//! In: limits, the lattice's spacing. Out: four axes (a heading and its opposite meet the same nodes) with how far a wheel reaches along
//! each, and the four stances of the outermost wheels around a node, rounded to nodes. Offsets are rounded away from zero, so that those
//! of a heading turned by 90 degrees are the turned offsets, and opposite wheels stand at opposite nodes: on a plane every mean is exact.

use super::params::Limits;

/// A line through a node: one node along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub cols: i64,
    pub rows: i64,
    /// Metres a node.
    pub length_m: f64,
    /// Nodes to either side that a wheel reaches.
    pub reach: usize,
}

/// Where the outermost wheels stand around a node, in nodes (columns, rows): front left, front right, rear left, rear right.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    pub wheels: [[i64; 2]; 4],
    /// From the middle to the front axle's middle, and to the left wheels' middle, metres.
    pub half_length_m: f64,
    pub half_width_m: f64,
}

/// How far a wheel reaches: its radius, and two nodes at least, so that a step that lies between two nodes is met whole.
pub(super) fn axes(limits: &Limits, spacing_m: f64) -> [Axis; 4] {
    let reach_m = limits.wheel_radius_m.max(2.0 * spacing_m) * (1.0 + 1e-9);
    [(1, 0), (1, 1), (0, 1), (-1, 1)].map(|(cols, rows)| {
        let length_m = if cols * rows == 0 { spacing_m } else { spacing_m * std::f64::consts::SQRT_2 };
        Axis { cols, rows, length_m, reach: ((reach_m / length_m) as usize).max(1) }
    })
}

/// One stance an axis, in their order.
pub(super) fn stances(limits: &Limits, spacing_m: f64) -> [Stance; 4] {
    let nodes = |metres: f64| (metres / spacing_m).round() as i64;
    let (ahead_m, aside_m) = (0.5 * limits.wheelbase_m, 0.5 * limits.track_m);
    let (ahead, aside) = (nodes(ahead_m).max(1), nodes(aside_m).max(1));
    let straight = Stance {
        wheels: [[ahead, aside], [ahead, -aside], [-ahead, aside], [-ahead, -aside]],
        half_length_m: ahead as f64 * spacing_m,
        half_width_m: aside as f64 * spacing_m,
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let near = nodes((ahead_m - aside_m) * half);
    let far = nodes((ahead_m + aside_m) * half).max(near.abs() + 1);
    let diagonal = Stance {
        wheels: [[near, far], [far, near], [-far, -near], [-near, -far]],
        half_length_m: (far + near) as f64 * half * spacing_m,
        half_width_m: (far - near) as f64 * half * spacing_m,
    };
    let turned = |stance: &Stance| Stance { wheels: stance.wheels.map(|[col, row]| [-row, col]), ..*stance };
    [straight, diagonal, turned(&straight), turned(&diagonal)]
}

/// Nodes from a node to the farthest that the stances and axes ask for.
pub(super) fn halo(axes: &[Axis; 4], stances: &[Stance; 4]) -> usize {
    let wheels = stances.iter().flat_map(|stance| stance.wheels).flatten().map(|nodes| nodes.unsigned_abs() as usize);
    axes.iter().map(|axis| axis.reach).chain(wheels).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_wheels_of_opposite_corners_stand_at_opposite_nodes_and_turn_with_the_heading() {
        let limits = Limits {
            tilt: 0.5,
            side_slip: 0.4,
            belly_m: 0.15,
            step_m: 0.1,
            gap_m: 0.1,
            wheel_radius_m: 0.05,
            wheelbase_m: 0.6,
            track_m: 0.55,
            length_m: 0.8,
        };
        for spacing_m in [0.02, 0.033, 0.05, 0.4] {
            let stances = stances(&limits, spacing_m);
            for stance in &stances {
                let [fl, fr, rl, rr] = stance.wheels;
                assert_eq!([fl, fr], [rr, rl].map(|wheel| wheel.map(|nodes| -nodes)), "{spacing_m}");
                // The length between the axles, and the sides at a right angle to it.
                let middle =
                    |a: [i64; 2], b: [i64; 2]| [a[0] + b[0], a[1] + b[1]].map(|sum| 0.5 * sum as f64 * spacing_m);
                let (front, left) = (middle(fl, fr), middle(fl, rl));
                let length = |v: [f64; 2]| (v[0] * v[0] + v[1] * v[1]).sqrt();
                assert!((length(front) - stance.half_length_m).abs() < 1e-12, "{spacing_m}");
                assert!((length(left) - stance.half_width_m).abs() < 1e-12, "{spacing_m}");
                assert!((front[0] * left[0] + front[1] * left[1]).abs() < 1e-12);
                assert!(front[0] * left[1] - front[1] * left[0] > 0.0, "left is left");
            }
            for (stance, axis) in stances.iter().zip(axes(&limits, spacing_m)) {
                let [fl, fr, ..] = stance.wheels;
                assert_eq!((fl[0] + fr[0]) * axis.rows, (fl[1] + fr[1]) * axis.cols);
            }
        }
        assert_eq!(axes(&limits, 0.05).map(|axis| axis.reach), [2, 1, 2, 1]);
    }
}
