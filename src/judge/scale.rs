//! The coordinates of a scan -> the question to ask of them, where they can be no metres from a sensor.

use crate::geometry::DVec3;

/// No LiDAR of a rover sees so far.
const FARTHEST_M: f64 = 300.0;

/// What the coordinates look like instead. A scan in millimetres spreads as wide as it is away; one in the coordinates of a map is far
/// from the origin and lies close together.
pub(crate) fn question(points_m: &[DVec3]) -> Option<&'static str> {
    let median = |mut values: Vec<f64>| {
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    if points_m.is_empty() {
        return None;
    }
    let axis = |k: usize| median(points_m.iter().map(|point| point[k]).collect());
    let centre_m = DVec3::new(axis(0), axis(1), axis(2));
    let spread_m = median(points_m.iter().map(|&point| (point - centre_m).length()).collect());
    if spread_m > FARTHEST_M {
        Some("are these millimetres? Coordinates are metres: divide by 1000")
    } else if centre_m.length() > FARTHEST_M {
        Some(
            "are these coordinates of a map, such as UTM? Subtract the origin, or give --frame map with the pose in the same \
             coordinates",
        )
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_scans_in_millimetres_and_in_utm_are_told_apart() {
        let scan: Vec<DVec3> = (0..200)
            .map(|k| {
                let (sin, cos) = crate::math::sin_cos(f64::from(k) * 0.37);
                DVec3::new(cos, sin, 0.0) * (2.0 + 0.1 * f64::from(k % 60)) - DVec3::Z
            })
            .collect();
        assert_eq!(question(&scan), None);
        let millimetres: Vec<DVec3> = scan.iter().map(|&point| 1000.0 * point).collect();
        assert!(question(&millimetres).unwrap().contains("millimetres"));
        let utm: Vec<DVec3> = scan.iter().map(|&point| point + DVec3::new(445e3, 5030e3, 200.0)).collect();
        assert!(question(&utm).unwrap().contains("Subtract the origin"));
        assert_eq!(question(&[]), None);
    }
}
