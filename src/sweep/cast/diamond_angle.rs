//! Azimuths as diamond angles: around |x| + |y| = 1 instead of the circle, in turns. No trigonometry; grows with the azimuth, by
//! 1/8 to 1/4 turn a radian.

use crate::geometry::DVec2;

/// Turn of a horizontal direction, from 0 to 1.
#[inline(always)]
pub(super) fn turn_of(x: f64, y: f64) -> f64 {
    let slope = y / (x.abs() + y.abs());
    let turn = if x < 0.0 { 2.0 - slope } else { slope };
    0.25 * if turn < 0.0 { turn + 4.0 } else { turn }
}

/// Unit direction of a turn from 0 to 1.
pub(super) fn at_turn(turn: f64) -> DVec2 {
    let quarter = 4.0 * turn;
    // From (1, 0) through (0, 1).
    let y = if quarter <= 1.0 {
        quarter
    } else if quarter <= 3.0 {
        2.0 - quarter
    } else {
        quarter - 4.0
    };
    let x = if quarter > 1.0 && quarter < 3.0 { y.abs() - 1.0 } else { 1.0 - y.abs() };
    DVec2::new(x, y).normalize()
}
