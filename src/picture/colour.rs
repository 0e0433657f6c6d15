//! Numbers and classes -> colours, as linear light (red, green, blue in [0, 1]).
//!
//! Blending and shading are done in linear light and turned to sRGB once, in the file. The scale for ranges is an eight-colour
//! subset of viridis (van der Walt & Smith 2015), which reads alike in grey and for colour-blind eyes.

use std::sync::LazyLock;

use crate::math;
use crate::scene::Class;

pub(super) type Colour = [f32; 3];

/// The linear light of an sRGB value in [0, 1] (IEC 61966-2-1).
fn linear(encoded: f64) -> f32 {
    (if encoded <= 0.040_45 { encoded / 12.92 } else { math::pow((encoded + 0.055) / 1.055, 2.4) }) as f32
}

/// sRGB as written in a style sheet -> linear light.
pub(super) fn srgb(hex: u32) -> Colour {
    static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| linear(byte as f64 / 255.0)));
    [16, 8, 0].map(|shift| LINEAR[((hex >> shift) & 0xff) as usize])
}

/// Linear light -> an sRGB byte. A search among the ends of the bytes: a picture has millions of channels, and a power each is what most
/// of its time would go to.
pub(super) fn srgb_byte(light: f32) -> u8 {
    static ENDS: LazyLock<[f32; 255]> =
        LazyLock::new(|| std::array::from_fn(|byte| linear((byte as f64 + 0.5) / 255.0)));
    ENDS.partition_point(|&end| end <= light) as u8
}

/// From `a` (share 0) to `b` (share 1).
pub(super) fn mix(a: Colour, b: Colour, share: f32) -> Colour {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

/// As bright as `light` makes it.
pub(super) fn lit(colour: Colour, light: f32) -> Colour {
    colour.map(|c| c * light)
}

pub(super) struct Palette {
    pub paper: Colour,
    pub ink: Colour,
    pub faint_ink: Colour,
    pub halo: Colour,
    pub true_path: Colour,
    pub estimated_path: Colour,
    pub ground_point: Colour,
    pub obstacle_point: Colour,
    pub traversable: Colour,
    pub untraversable: Colour,
    pub low_ground: Colour,
    pub high_ground: Colour,
    pub rover_body: Colour,
    pub rover_deck: Colour,
    pub rover_metal: Colour,
    pub wheel: Colour,
    pub horizon: Colour,
    pub zenith: Colour,
}

pub(super) fn palette() -> Palette {
    Palette {
        paper: srgb(0xfbf9f5),
        ink: srgb(0x2a2522),
        faint_ink: srgb(0x8b827a),
        halo: srgb(0xfffdf8),
        true_path: srgb(0x1f3f8f),
        estimated_path: srgb(0xe8590c),
        ground_point: srgb(0xfff3bf),
        obstacle_point: srgb(0xc2123a),
        traversable: srgb(0xe9e6df),
        untraversable: srgb(0x33302d),
        low_ground: srgb(0xa8683f),
        high_ground: srgb(0xe8c295),
        rover_body: srgb(0xd9d3c7),
        rover_deck: srgb(0x27364f),
        rover_metal: srgb(0x8d9196),
        wheel: srgb(0x3b3a3c),
        horizon: srgb(0xe9cfae),
        zenith: srgb(0xa98c77),
    }
}

/// The colour of a class of thing; ground is coloured by its height instead.
pub(super) fn of_class(class: Class) -> Colour {
    srgb(match class {
        Class::Ground => 0xc8935f,
        Class::Rock => 0x7d5a4a,
        Class::Box => 0x6f8ba8,
        Class::Trunk => 0x6b4a2f,
        Class::Grass => 0x8fa64a,
        Class::Bush => 0x5c7a35,
        Class::Crown => 0x49703a,
    })
}

/// Viridis: dark blue at 0, yellow at 1.
pub(super) fn scale(share: f64) -> Colour {
    const STOPS: [u32; 8] = [0x440154, 0x46327e, 0x365c8d, 0x277f8e, 0x1fa187, 0x4ac16d, 0xa0da39, 0xfde725];
    // NaN is as dark as 0.
    let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
    let at = share * (STOPS.len() - 1) as f64;
    let left = (at as usize).min(STOPS.len() - 2);
    mix(srgb(STOPS[left]), srgb(STOPS[left + 1]), (at - left as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_colours_survive_the_way_to_bytes() {
        for hex in [0x000000, 0xffffff, 0x123456, 0xfde725, 0x7d5a4a] {
            let [r, g, b] = srgb(hex).map(|c| u32::from(srgb_byte(c)));
            assert_eq!(r << 16 | g << 8 | b, hex);
        }
        assert_eq!([f32::NEG_INFINITY, -1.0, 2.0, f32::NAN].map(srgb_byte), [0, 0, 255, 0]);
        assert_eq!(scale(1.0).map(srgb_byte), [0xfd, 0xe7, 0x25]);
        assert_eq!(scale(f64::NAN).map(srgb_byte), scale(0.0).map(srgb_byte));
    }
}
