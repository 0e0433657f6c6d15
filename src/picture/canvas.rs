//! Shapes and text -> a picture's bytes.
//!
//! Pixels are linear light. Shapes are laid over by the share of each pixel that they cover, taken from the distance to their
//! border; text is embedded-graphics' bitmap fonts. (0, 0) is the upper left corner of the upper left pixel.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Size};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle, iso_8859_1};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::{Drawable, Pixel, Point};
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};

use super::colour::{Colour, Palette, mix, srgb_byte};

/// A picture in the making.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<Colour>,
}

/// A place on the canvas, pixels.
pub(super) type Spot = (f64, f64);

/// The part of the canvas that may be drawn on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clip {
    pub left: usize,
    pub top: usize,
    pub right: usize,
    pub bottom: usize,
}

pub(super) const SMALL: &MonoFont<'static> = &iso_8859_1::FONT_8X13;
pub(super) const NORMAL: &MonoFont<'static> = &iso_8859_1::FONT_9X15;
pub(super) const TITLE: &MonoFont<'static> = &iso_8859_1::FONT_10X20;

impl Canvas {
    pub(super) fn new(width: usize, height: usize, colour: Colour) -> Canvas {
        Canvas { width, height, pixels: vec![colour; width * height] }
    }

    pub(super) fn whole(&self) -> Clip {
        Clip { left: 0, top: 0, right: self.width, bottom: self.height }
    }

    /// Lays `colour` over one pixel with a share of coverage.
    pub(super) fn blend(&mut self, x: usize, y: usize, colour: Colour, share: f64) {
        let pixel = &mut self.pixels[y * self.width + x];
        *pixel = mix(*pixel, colour, share.clamp(0.0, 1.0) as f32);
    }

    /// Covers what lies within `half_width` of a shape, given the distance to it; `bounds` holds the shape's points.
    fn cover(
        &mut self,
        clip: Clip,
        bounds: &[Spot],
        half_width: f64,
        colour: Colour,
        alpha: f64,
        distance: impl Fn(Spot) -> f64,
    ) {
        if bounds.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
            return;
        }
        let reach = half_width + 1.0;
        let range = |of: fn(&Spot) -> f64, from: usize, to: usize| {
            let (low, high) =
                bounds.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            ((low - reach).max(from as f64) as usize, (high + reach).ceil().clamp(from as f64, to as f64) as usize)
        };
        let (left, right) = range(|p| p.0, clip.left, clip.right);
        let (top, bottom) = range(|p| p.1, clip.top, clip.bottom);
        for y in top..bottom {
            for x in left..right {
                let covered = half_width + 0.5 - distance((x as f64 + 0.5, y as f64 + 0.5));
                if covered > 0.0 {
                    self.blend(x, y, colour, covered.min(1.0) * alpha);
                }
            }
        }
    }

    pub(super) fn disc(&mut self, clip: Clip, centre: Spot, radius: f64, colour: Colour, alpha: f64) {
        self.cover(clip, &[centre], radius, colour, alpha, |p| crate::math::hypot(p.0 - centre.0, p.1 - centre.1));
    }

    /// A disc on those pixels alone that `keep` names.
    pub(super) fn disc_where(
        &mut self,
        clip: Clip,
        centre: Spot,
        radius: f64,
        colour: Colour,
        alpha: f64,
        keep: impl Fn(usize, usize) -> bool,
    ) {
        let distance = |p: Spot| {
            if keep(p.0 as usize, p.1 as usize) {
                crate::math::hypot(p.0 - centre.0, p.1 - centre.1)
            } else {
                f64::INFINITY
            }
        };
        self.cover(clip, &[centre], radius, colour, alpha, distance);
    }

    /// A straight stroke with round ends.
    pub(super) fn line(&mut self, clip: Clip, a: Spot, b: Spot, width: f64, colour: Colour, alpha: f64) {
        self.cover(clip, &[a, b], width / 2.0, colour, alpha, |p| distance_to_segment(p, a, b));
    }

    /// Strokes from point to point, over all of which the colour lies once.
    pub(super) fn polyline(&mut self, clip: Clip, points: &[Spot], width: f64, colour: Colour) {
        for pair in points.windows(2) {
            self.line(clip, pair[0], pair[1], width, colour, 1.0);
        }
    }

    /// Dashes of `dash` pixels with gaps as long.
    pub(super) fn dashed(&mut self, clip: Clip, points: &[Spot], width: f64, dash: f64, colour: Colour) {
        let mut done = 0.0;
        for pair in points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let length = crate::math::hypot(b.0 - a.0, b.1 - a.1);
            let mut at = 0.0;
            while at < length {
                let in_pattern = (done + at) % (2.0 * dash);
                let left = if in_pattern < dash { dash - in_pattern } else { 2.0 * dash - in_pattern };
                // Half a pixel at least, so that rounding cannot stop the march.
                let to = (at + left.max(0.5)).min(length);
                if in_pattern < dash {
                    let spot = |t: f64| (a.0 + (b.0 - a.0) * t / length, a.1 + (b.1 - a.1) * t / length);
                    self.line(clip, spot(at), spot(to), width, colour, 1.0);
                }
                at = to;
            }
            done += length;
        }
    }

    /// A filled convex polygon.
    pub(super) fn polygon(&mut self, clip: Clip, corners: &[Spot], colour: Colour, alpha: f64) {
        let area: f64 = edges(corners).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
        let side = if area < 0.0 { -1.0 } else { 1.0 };
        let outside = |p: Spot| {
            edges(corners).map(move |(a, b)| {
                let length = crate::math::hypot(b.0 - a.0, b.1 - a.1).max(1e-9);
                side * ((p.0 - a.0) * (b.1 - a.1) - (p.1 - a.1) * (b.0 - a.0)) / length
            })
        };
        self.cover(clip, corners, 0.0, colour, alpha, |p| outside(p).fold(f64::NEG_INFINITY, f64::max));
    }

    pub(super) fn outline(&mut self, clip: Clip, corners: &[Spot], width: f64, colour: Colour) {
        for (a, b) in edges(corners) {
            self.line(clip, a, b, width, colour, 1.0);
        }
    }

    /// A filled rectangle along the axes.
    pub(super) fn rectangle(&mut self, clip: Clip, from: Spot, to: Spot, colour: Colour, alpha: f64) {
        self.polygon(clip, &[from, (to.0, from.1), to, (from.0, to.1)], colour, alpha);
    }

    /// One line of text; `at` is its upper left, upper middle or upper right.
    pub(super) fn text(
        &mut self,
        text: &str,
        at: Spot,
        font: &MonoFont<'static>,
        alignment: Alignment,
        colour: Colour,
    ) {
        let style = MonoTextStyle::new(font, BinaryColor::On);
        let layout = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Top).build();
        let place = Point::new(at.0.round() as i32, at.1.round() as i32);
        // Drawing on memory cannot fail: the error type is empty.
        let Ok(_) = Text::with_text_style(text, place, style, layout).draw(&mut Ink { canvas: self, colour });
    }

    /// Text with a pale border, for uneven grounds.
    pub(super) fn haloed_text(
        &mut self,
        text: &str,
        at: Spot,
        font: &MonoFont<'static>,
        alignment: Alignment,
        colours: (Colour, Colour),
    ) {
        for (dx, dy) in
            [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)]
        {
            self.text(text, (at.0 + dx, at.1 + dy), font, alignment, colours.1);
        }
        self.text(text, at, font, alignment, colours.0);
    }

    /// A line of a legend: a dot and what it stands for.
    pub(super) fn dot_entry(&mut self, at: Spot, colour: Colour, text: &str, palette: &Palette) {
        let centre = (at.0 + 7.0, at.1 + 7.0);
        self.disc(self.whole(), centre, 6.0, palette.faint_ink, 1.0);
        self.disc(self.whole(), centre, 5.0, colour, 1.0);
        self.text(text, (at.0 + 21.0, at.1), NORMAL, Alignment::Left, palette.ink);
    }

    /// A line of a legend: a square and what it stands for.
    pub(super) fn square_entry(&mut self, at: Spot, colour: Colour, text: &str, palette: &Palette) {
        self.rectangle(self.whole(), at, (at.0 + 15.0, at.1 + 14.0), palette.faint_ink, 1.0);
        self.rectangle(self.whole(), (at.0 + 1.0, at.1 + 1.0), (at.0 + 14.0, at.1 + 13.0), colour, 1.0);
        self.text(text, (at.0 + 23.0, at.1), NORMAL, Alignment::Left, palette.ink);
    }

    /// A line of a legend: a stroke, solid or dashed, and what it stands for.
    pub(super) fn line_entry(&mut self, at: Spot, dashed: bool, colour: Colour, text: &str, palette: &Palette) {
        let ends = [(at.0, at.1 + 7.0), (at.0 + 34.0, at.1 + 7.0)];
        if dashed {
            self.dashed(self.whole(), &ends, 2.6, 7.0, colour)
        } else {
            self.polyline(self.whole(), &ends, 2.8, colour)
        }
        self.text(text, (at.0 + 42.0, at.1), NORMAL, Alignment::Left, palette.ink);
    }

    /// The file's bytes: PNG, 8-bit sRGB.
    pub(super) fn png(&self) -> Vec<u8> {
        let bytes: Vec<u8> = self.pixels.iter().flat_map(|p| p.map(srgb_byte)).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // A picture is looked at once: packed fast, it is somewhat larger than it could be.
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes));
        written.expect("a picture in memory has pixels and as many bytes as it says");
        file
    }
}

/// The sides of a polygon, the closing one included.
fn edges(corners: &[Spot]) -> impl Iterator<Item = (Spot, Spot)> + '_ {
    corners.iter().enumerate().map(|(i, &a)| (a, corners[(i + 1) % corners.len()]))
}

fn distance_to_segment(p: Spot, a: Spot, b: Spot) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let squared = dx * dx + dy * dy;
    let t = if squared > 0.0 { (((p.0 - a.0) * dx + (p.1 - a.1) * dy) / squared).clamp(0.0, 1.0) } else { 0.0 };
    crate::math::hypot(p.0 - a.0 - t * dx, p.1 - a.1 - t * dy)
}

/// A pen of one colour for bitmap fonts.
struct Ink<'a> {
    canvas: &'a mut Canvas,
    colour: Colour,
}

impl OriginDimensions for Ink<'_> {
    fn size(&self) -> Size {
        Size::new(self.canvas.width as u32, self.canvas.height as u32)
    }
}

impl DrawTarget for Ink<'_> {
    type Color = BinaryColor;
    type Error = std::convert::Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Self::Error> {
        for Pixel(Point { x, y }, value) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { continue };
            if value.is_on() && x < self.canvas.width && y < self.canvas.height {
                self.canvas.blend(x, y, self.colour, 1.0);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink_on(draw: impl Fn(&mut Canvas)) -> f64 {
        let mut canvas = Canvas::new(64, 64, [0.0; 3]);
        draw(&mut canvas);
        canvas.pixels.iter().map(|p| f64::from(p[0])).sum()
    }

    #[test]
    fn exact_shapes_cover_their_areas() {
        let white = [1.0; 3];
        let clip = Clip { left: 0, top: 0, right: 64, bottom: 64 };
        let square = ink_on(|c| c.rectangle(clip, (10.0, 10.0), (30.0, 20.0), white, 1.0));
        assert!((square - 200.0).abs() < 1e-3, "{square}");
        let disc = ink_on(|c| c.disc(clip, (32.3, 31.8), 12.0, white, 1.0));
        assert!((disc / (std::f64::consts::PI * 144.0) - 1.0).abs() < 0.01, "{disc}");
        let turned = ink_on(|c| c.polygon(clip, &[(32.0, 12.0), (52.0, 32.0), (32.0, 52.0), (12.0, 32.0)], white, 1.0));
        assert!((turned / 800.0 - 1.0).abs() < 0.02, "{turned}");
    }

    #[test]
    fn extreme_shapes_off_the_canvas_or_without_a_place_draw_nothing() {
        let clip = Clip { left: 0, top: 0, right: 64, bottom: 64 };
        let none = ink_on(|c| {
            c.disc(clip, (-1e9, 3.0), 5.0, [1.0; 3], 1.0);
            c.line(clip, (f64::NAN, 0.0), (3.0, 3.0), 2.0, [1.0; 3], 1.0);
            c.text("far", (1e6, -50.0), NORMAL, Alignment::Left, [1.0; 3]);
        });
        assert_eq!(none, 0.0);
    }
}
