//! Linear radiance → 8-bit sRGB, the one way of the project, so that two of its pictures look alike.
//!
//! `display = sRGB(neutral(radiance × scale))`, where `scale` comes from [`Exposure`] and `neutral` is the Khronos
//! PBR Neutral tone mapper (Khronos Group 2024, `KHR PBR Neutral specification`): exact below 0.8 minus a 0.04 toe,
//! compressed above, so base colours under grey light keep their values.

use std::path::Path;

use glam::Vec3;

use crate::error::SceneError;
use crate::exr_io::RgbImage;
use crate::texture::srgb_from_linear;
use crate::write_atomic;

/// How bright the picture is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// The geometric mean of the luminance of all lit pixels becomes [`KEY`], see [`auto_scale`].
    #[default]
    Auto,
    /// `scale = 2^ev`: 0 shows radiance 1 as white before compression.
    Ev(f32),
}

/// Middle grey.
pub const KEY: f32 = 0.18;
/// Rec.709 luminance weights.
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

impl Exposure {
    /// The factor on radiance for `image`.
    pub fn scale(self, image: &RgbImage) -> f32 {
        match self {
            Self::Auto => auto_scale(image),
            Self::Ev(ev) => ev.exp2().clamp(f32::MIN_POSITIVE, f32::MAX),
        }
    }
}

/// [`KEY`] over the geometric mean of the luminance of all finite pixels brighter than 1e-4 of the brightest 1 %'s
/// lower bound: black background and deep shadow would drag a plain log-average down, a lamp in view barely moves
/// this one. 1 for an image without a positive pixel.
pub fn auto_scale(image: &RgbImage) -> f32 {
    let mut luminance: Vec<f32> = image
        .data
        .iter()
        .map(|p| Vec3::from(*p).dot(LUMINANCE))
        .filter(|l| l.is_finite() && *l > 0.0)
        .collect();
    if luminance.is_empty() {
        return 1.0;
    }
    let rank = (luminance.len() - 1) * 99 / 100;
    let (_, &mut bright, _) = luminance.select_nth_unstable_by(rank, f32::total_cmp);
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for &l in &luminance {
        if l >= 1e-4 * bright {
            sum += f64::from(l).ln();
            count += 1;
        }
    }
    let mean = (sum / f64::from(count.max(1))).exp();
    (f64::from(KEY) / mean).clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)) as f32
}

/// The Khronos PBR Neutral tone mapper on linear Rec.709; output in [0, 1].
fn neutral(color: Vec3) -> Vec3 {
    const START_COMPRESSION: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let x = color.min_element();
    let offset = if x < 0.08 { x - 6.25 * x * x } else { 0.04 };
    let color = color - offset;
    let peak = color.max_element();
    if peak < START_COMPRESSION {
        return color;
    }
    let d = 1.0 - START_COMPRESSION;
    let new_peak = 1.0 - d * d / (peak + d - START_COMPRESSION);
    let color = color * (new_peak / peak);
    let g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.lerp(Vec3::splat(new_peak), g)
}

/// One pixel: radiance × `scale`, tone mapped, sRGB-encoded. NaN and negative values become 0, infinity white.
pub fn pixel(radiance: [f32; 3], scale: f32) -> [u8; 3] {
    // A finite cap, far above white, so that infinity does not turn into NaN inside.
    const CAP: f32 = 1e8;
    let c = radiance.map(|c| {
        let c = c * scale;
        if c.is_nan() { 0.0 } else { c.clamp(0.0, CAP) }
    });
    neutral(Vec3::from(c))
        .to_array()
        .map(|c| (srgb_from_linear(c.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8)
}

/// The whole image as RGB bytes, rows from the top.
pub fn to_srgb8(image: &RgbImage, scale: f32) -> Vec<u8> {
    image.data.iter().flat_map(|&p| pixel(p, scale)).collect()
}

/// Writes a tone-mapped PNG through a temporary file.
pub fn write_png(path: &Path, image: &RgbImage, exposure: Exposure) -> Result<(), SceneError> {
    use image::ImageEncoder;
    let bad = |problem: String| {
        SceneError::invalid(
            path,
            "PNG output",
            problem,
            "this is a mistake of the caller",
        )
    };
    if image.data.is_empty() || image.data.len() != image.width as usize * image.height as usize {
        return Err(bad(format!(
            "{} values for {} x {} pixels",
            image.data.len(),
            image.width,
            image.height
        )));
    }
    let rgb = to_srgb8(image, exposure.scale(image));
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(
            &rgb,
            image.width,
            image.height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|e| bad(format!("cannot be encoded ({e})")))?;
    write_atomic(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_card_lands_on_middle_grey_whatever_its_radiance() {
        for radiance in [1e-6, 0.3, 5e4] {
            let mut image = RgbImage::filled(16, 16, [radiance; 3]);
            // A tenth of black background must not change it.
            for p in image.data.iter_mut().take(25) {
                *p = [0.0; 3];
            }
            let scale = auto_scale(&image);
            assert!((scale * radiance - KEY).abs() < 1e-3 * KEY);
        }
        assert_eq!(auto_scale(&RgbImage::filled(2, 2, [0.0; 3])), 1.0);
        assert_eq!(auto_scale(&RgbImage::filled(2, 2, [f32::NAN; 3])), 1.0);
    }

    #[test]
    fn monotone_and_bounded() {
        let mut last = 0;
        for i in 0..200 {
            let value = 10.0_f32.powf(i as f32 / 20.0 - 4.0);
            let [r, g, b] = pixel([value; 3], 1.0);
            assert!(r == g && g == b && r >= last);
            last = r;
        }
        assert_eq!(pixel([f32::INFINITY; 3], 1.0), [255; 3]);
        assert_eq!(pixel([f32::NAN, -1.0, 0.0], 1.0), [0; 3]);
    }

    #[test]
    fn png_is_readable() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_png(
            &path,
            &RgbImage::filled(4, 3, [1.0, 0.5, 0.25]),
            Exposure::Ev(0.0),
        )
        .unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!((read.width(), read.height()), (4, 3));
        assert_eq!(read.get_pixel(1, 1).0, pixel([1.0, 0.5, 0.25], 1.0));
    }
}
