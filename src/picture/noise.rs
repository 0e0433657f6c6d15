//! A place -> a number in [0, 1) that looks random: textures of sand, rock and leaves. Of no meaning to any stage.

use crate::geometry::{DVec2, DVec3};

fn mixed(words: [i64; 3]) -> f64 {
    const ODD: [u64; 3] = [0x9e37_79b9_7f4a_7c15, 0xc2b2_ae3d_27d4_eb4f, 0x1656_67b1_9e37_79f9];
    let mut word =
        (0..3).fold(0x2545_f491_4f6c_dd1d_u64, |sum, i| (sum ^ (words[i] as u64).wrapping_mul(ODD[i])).rotate_left(23));
    word ^= word >> 29;
    word = word.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word ^= word >> 32;
    (word >> 11) as f64 / (1u64 << 53) as f64
}

/// One number for each square of a plane.
pub(super) fn speckle(at_m: DVec2, size_m: f64) -> f64 {
    let square = (at_m / size_m).floor();
    mixed([square.x as i64, square.y as i64, 0])
}

/// One number for each cube of space.
pub(super) fn speckle3(at_m: DVec3, size_m: f64) -> f64 {
    let cube = (at_m / size_m).floor();
    mixed([cube.x as i64, cube.y as i64, cube.z as i64])
}

/// Smooth noise over a plane, and its slope per metre: quintic blend of the corners' numbers (Perlin 2002).
pub(super) fn grain(at_m: DVec2, size_m: f64) -> (f64, DVec2) {
    let (scaled, corner) = (at_m / size_m, (at_m / size_m).floor());
    let t = scaled - corner;
    let at = |dx: i64, dy: i64| mixed([corner.x as i64 + dx, corner.y as i64 + dy, 1]);
    let (sw, se, nw, ne) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
    let blend = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let rate = t * t * 30.0 * (t * (t - 2.0) + 1.0) / size_m;
    let (south, north) = (sw + (se - sw) * blend.x, nw + (ne - nw) * blend.x);
    let along_x = ((se - sw) * (1.0 - blend.y) + (ne - nw) * blend.y) * rate.x;
    (south + (north - south) * blend.y, DVec2::new(along_x, (north - south) * rate.y))
}

/// Smooth noise in space.
pub(super) fn grain3(at_m: DVec3, size_m: f64) -> f64 {
    let (scaled, corner) = (at_m / size_m, (at_m / size_m).floor());
    let t = scaled - corner;
    let blend = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let at = |dx: i64, dy: i64, dz: i64| mixed([corner.x as i64 + dx, corner.y as i64 + dy, corner.z as i64 + dz]);
    let along_x = |dy, dz| at(0, dy, dz) + (at(1, dy, dz) - at(0, dy, dz)) * blend.x;
    let along_y = |dz| along_x(0, dz) + (along_x(1, dz) - along_x(0, dz)) * blend.y;
    along_y(0) + (along_y(1) - along_y(0)) * blend.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_slopes_of_the_grain_agree_with_differences() {
        for k in 0..50 {
            let p = DVec2::new(0.37 * f64::from(k) - 5.0, 2.0 - 0.23 * f64::from(k));
            let (h, slope) = (1e-6, grain(p, 0.4).1);
            let difference = |step: DVec2| (grain(p + step, 0.4).0 - grain(p - step, 0.4).0) / (2.0 * h);
            let expected = DVec2::new(difference(DVec2::X * h), difference(DVec2::Y * h));
            assert!((slope - expected).length() < 1e-5, "{slope} {expected}");
        }
    }
}
