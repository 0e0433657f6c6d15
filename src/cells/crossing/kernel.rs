//! A run of nodes -> how much of each limit the rover takes up there, the worst of eight headings.
//!
//! In: a lattice, stances and axes. Out: per node of the run
//!
//! - rise and fall: what a wheel on the node climbs or drops within its reach, less what the slope makes of it;
//! - touch: how far the node's top stands above the plane of the outermost wheels, the belly's middle over it;
//! - slope squared, and the slope across the heading.
//!
//! The slope along an axis is what both halves of the rover's length share (the smaller, 0 where they differ in sign): a plane's is exact,
//! and a single step under the rover, which rise and fall judge, makes none. A stance with a wheel so far above or below the node that
//! slope and step limit together do not explain it says nothing of the belly: what lies between is judged where it lies. Wheels stand on
//! the ground; bodies count at the node and within a wheel's reach. Plain products and sums, no order of lanes matters.

use super::headings::{Axis, Stance};
use super::lattice::Lattice;
use crate::wide::Work;

/// What nodes of a run take up; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Demands {
    pub rise_m: Vec<f64>,
    pub fall_m: Vec<f64>,
    pub touch_m: Vec<f64>,
    pub slope_squared: Vec<f64>,
    pub side_slope: Vec<f64>,
    along: Vec<f64>,
}

/// A run of nodes on a row.
pub(super) struct Run<'a> {
    pub lattice: &'a Lattice,
    pub axes: &'a [Axis; 4],
    pub stances: &'a [Stance; 4],
    /// Slope and step limit: what a wheel's height may differ from the node's.
    pub tilt: f64,
    pub step_m: f64,
    pub row: usize,
    pub col: usize,
    pub count: usize,
    pub out: &'a mut Demands,
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// What two slopes share.
#[inline(always)]
fn shared(a: f64, b: f64) -> f64 {
    let smaller = if a.abs() < b.abs() { a } else { b };
    if a * b > 0.0 { smaller } else { 0.0 }
}

impl Work for Run<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let Run { lattice, axes, stances, tilt, step_m, row, col, count, out } = self;
        let Demands { rise_m, fall_m, touch_m, slope_squared, side_slope, along } = out;
        for list in [&mut *rise_m, &mut *fall_m, &mut *slope_squared, &mut *side_slope] {
            list.clear();
            list.resize(count, 0.0);
        }
        touch_m.clear();
        touch_m.resize(count, f64::NEG_INFINITY);
        along.clear();
        along.resize(count, 0.0);
        let here = row * lattice.side + col;
        let at = |heights_m: &'_ [f64], [cols, rows]: [i64; 2]| {
            let first = (here as i64 + rows * lattice.side as i64 + cols) as usize;
            first..first + count.min(heights_m.len())
        };
        let ground = &lattice.ground_m[at(&lattice.ground_m, [0, 0])];
        let top = &lattice.top_m[at(&lattice.top_m, [0, 0])];
        for (axis, stance) in axes.iter().zip(stances) {
            let [fl, fr, rl, rr] = stance.wheels.map(|wheel| &lattice.ground_m[at(&lattice.ground_m, wheel)]);
            let (over_length, over_width) = (0.5 / stance.half_length_m, 0.5 / stance.half_width_m);
            let (half_m, half_width_m) = (stance.half_length_m, stance.half_width_m);
            let reach_m = tilt * (half_m * half_m + half_width_m * half_width_m).sqrt() + step_m;
            let outs =
                touch_m.iter_mut().zip(slope_squared.iter_mut()).zip(side_slope.iter_mut()).zip(along.iter_mut());
            for (x, (((touch, slope_squared), side_slope), along)) in outs.enumerate() {
                let (own, a, b, c, d) = (ground[x], fl[x], fr[x], rl[x], rr[x]);
                let twice = own + own;
                let (front, rear, left, right) = (a + b, c + d, a + c, b + d);
                let pitch = shared((front - twice) * over_length, (twice - rear) * over_length);
                let roll = shared((left - twice) * over_width, (twice - right) * over_width);
                let squared = pitch * pitch + roll * roll;
                *slope_squared = larger(*slope_squared, squared);
                *side_slope = larger(*side_slope, roll.abs());
                *along = pitch;
                let most = larger(larger((a - own).abs(), (b - own).abs()), larger((c - own).abs(), (d - own).abs()));
                let over = top[x] - 0.25 * (front + rear);
                *touch = larger(*touch, if most <= reach_m { over } else { f64::NEG_INFINITY });
            }
            for nodes in 1..=axis.reach as i64 {
                let [ahead, behind] = [nodes, -nodes].map(|nodes| {
                    let span = at(&lattice.top_m, [nodes * axis.cols, nodes * axis.rows]);
                    &lattice.top_m[span]
                });
                let way_m = nodes as f64 * axis.length_m;
                let outs = rise_m.iter_mut().zip(fall_m.iter_mut()).zip(along.iter());
                for (x, ((rise, fall), along)) in outs.enumerate() {
                    let sloped_m = along * way_m;
                    let (up_m, down_m) = (ahead[x] - top[x] - sloped_m, behind[x] - top[x] + sloped_m);
                    *rise = larger(*rise, larger(up_m, down_m));
                    *fall = larger(*fall, larger(-up_m, -down_m));
                }
            }
        }
    }
}
