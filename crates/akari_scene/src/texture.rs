//! Images and how materials look them up.

use glam::{Affine2, Vec2, Vec4};

/// How stored colour values relate to light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// sRGB transfer function on RGB; alpha is linear.
    Srgb,
    /// Values are used as they are.
    Linear,
}

/// Behaviour outside of [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tiles.
    #[default]
    Repeat,
    /// Tiles, every other one mirrored.
    Mirror,
    /// The border goes on.
    Clamp,
}

/// Interpolation between texels. No mip levels: the path tracer resolves footprints by sampling them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear, after decoding to linear values (as GPUs do).
    #[default]
    Linear,
}

/// Texels as stored.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// 8 bits a channel.
    U8(Vec<[u8; 4]>),
    /// 16 bits a channel (16-bit PNG).
    U16(Vec<[u16; 4]>),
}

/// A decoded image, RGBA, rows from the top; width × height texels, both at least 1.
#[derive(Clone, Debug)]
pub struct Image {
    /// Name, or the file's name, or `image N`.
    pub name: String,
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The texels.
    pub pixels: Pixels,
}

/// A reference to an image with the way to sample it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`](crate::Scene::images).
    pub image: usize,
    /// How to decode texels: decided by the use, not by the file.
    pub color_space: ColorSpace,
    /// 0 or 1: which of [`Primitive::uvs`](crate::Primitive::uvs).
    pub tex_coord: usize,
    /// `KHR_texture_transform`: texture uv from vertex uv.
    pub transform: Affine2,
    /// Horizontal wrapping.
    pub wrap_u: Wrap,
    /// Vertical wrapping.
    pub wrap_v: Wrap,
    /// Magnification filter.
    pub filter: Filter,
}

/// Linear value of an sRGB-encoded one in [0, 1] (IEC 61966-2-1).
pub fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

/// sRGB encoding of a linear value in [0, 1] (IEC 61966-2-1).
pub fn srgb_from_linear(x: f32) -> f32 {
    if x <= 0.003_130_8 {
        x * 12.92
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// `linear_from_srgb(i / 255)` for every byte: the decode is on the path tracer's hottest path.
static LINEAR_FROM_SRGB_U8: std::sync::LazyLock<[f32; 256]> =
    std::sync::LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)));

impl Image {
    /// The texel at column `x` of row `y` as linear values. Both are clamped to the image.
    pub fn texel(&self, x: u32, y: u32, color_space: ColorSpace) -> Vec4 {
        let x = x.min(self.width - 1) as usize;
        let y = y.min(self.height - 1) as usize;
        let i = y * self.width as usize + x;
        match (&self.pixels, color_space) {
            (Pixels::U8(p), ColorSpace::Srgb) => {
                let t = &*LINEAR_FROM_SRGB_U8;
                let [r, g, b, a] = p[i];
                Vec4::new(
                    t[r as usize],
                    t[g as usize],
                    t[b as usize],
                    f32::from(a) / 255.0,
                )
            }
            (Pixels::U8(p), ColorSpace::Linear) => Vec4::from(p[i].map(|c| f32::from(c) / 255.0)),
            (Pixels::U16(p), ColorSpace::Srgb) => {
                let [r, g, b, a] = p[i].map(|c| f32::from(c) / 65535.0);
                Vec4::new(
                    linear_from_srgb(r),
                    linear_from_srgb(g),
                    linear_from_srgb(b),
                    a,
                )
            }
            (Pixels::U16(p), ColorSpace::Linear) => {
                Vec4::from(p[i].map(|c| f32::from(c) / 65535.0))
            }
        }
    }
}

/// Texel index of `i`, which may lie outside of `0..n`.
fn wrap(i: i64, n: u32, mode: Wrap) -> u32 {
    let n = i64::from(n);
    let j = match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let k = i.rem_euclid(2 * n);
            if k < n { k } else { 2 * n - 1 - k }
        }
    };
    j as u32
}

impl Texture {
    /// Linear RGBA at vertex coordinates `uv` (origin at the image's top left, v down, as in glTF).
    ///
    /// `images` is [`Scene::images`](crate::Scene::images). Non-finite coordinates read the texel at 0.
    pub fn sample(&self, images: &[Image], uv: Vec2) -> Vec4 {
        let image = &images[self.image];
        let uv = self.transform.transform_point2(uv);
        // Beyond this, f32 cannot tell neighbouring texels apart anyway, and i64 stays far from overflow.
        const LARGEST: f32 = 1e9;
        let st = if uv.is_finite() {
            uv.clamp(Vec2::splat(-LARGEST), Vec2::splat(LARGEST))
        } else {
            Vec2::ZERO
        };
        let x = st.x * image.width as f32;
        let y = st.y * image.height as f32;
        let fetch = |i: i64, j: i64| {
            image.texel(
                wrap(i, image.width, self.wrap_u),
                wrap(j, image.height, self.wrap_v),
                self.color_space,
            )
        };
        match self.filter {
            Filter::Nearest => fetch(x.floor() as i64, y.floor() as i64),
            Filter::Linear => {
                let (x, y) = (x - 0.5, y - 0.5);
                let (x0, y0) = (x.floor(), y.floor());
                let (fx, fy) = (x - x0, y - y0);
                let (i, j) = (x0 as i64, y0 as i64);
                let top = fetch(i, j).lerp(fetch(i + 1, j), fx);
                let bottom = fetch(i, j + 1).lerp(fetch(i + 1, j + 1), fx);
                top.lerp(bottom, fy)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Image {
        Image {
            name: "checker".into(),
            width: 2,
            height: 1,
            pixels: Pixels::U8(vec![[0, 0, 0, 255], [255, 255, 255, 128]]),
        }
    }

    fn texture(filter: Filter, wrap: Wrap) -> Texture {
        Texture {
            image: 0,
            color_space: ColorSpace::Srgb,
            tex_coord: 0,
            transform: Affine2::IDENTITY,
            wrap_u: wrap,
            wrap_v: wrap,
            filter,
        }
    }

    #[test]
    fn wraps_and_filters() {
        let images = [checker()];
        let near = texture(Filter::Nearest, Wrap::Repeat);
        assert_eq!(near.sample(&images, Vec2::new(0.25, 0.5)).x, 0.0);
        assert_eq!(near.sample(&images, Vec2::new(0.75, 0.5)).x, 1.0);
        assert_eq!(near.sample(&images, Vec2::new(-0.25, 0.5)).x, 1.0);
        let mirrored = texture(Filter::Nearest, Wrap::Mirror);
        assert_eq!(mirrored.sample(&images, Vec2::new(-0.25, 0.5)).x, 0.0);
        let clamped = texture(Filter::Nearest, Wrap::Clamp);
        assert_eq!(clamped.sample(&images, Vec2::new(7.3, 0.5)).x, 1.0);
        let bilinear = texture(Filter::Linear, Wrap::Clamp);
        assert!((bilinear.sample(&images, Vec2::new(0.5, 0.5)).x - 0.5).abs() < 1e-6);
        assert!(
            bilinear
                .sample(&images, Vec2::new(f32::NAN, 0.5))
                .is_finite()
        );
    }

    #[test]
    fn transfer_function_round_trips() {
        for i in 0..=255 {
            let x = i as f32 / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(x)) - x).abs() < 2e-6);
        }
        // Mid grey, from the standard's formula in f64.
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
    }
}
