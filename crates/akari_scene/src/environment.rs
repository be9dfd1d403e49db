//! Equirectangular environment maps.

use std::path::Path;

use glam::Vec3;

use crate::error::SceneError;
use crate::exr_io::{self, RgbImage};

/// A light at infinity in every direction, from an equirectangular image.
///
/// Axes (glTF's, world space): the centre of the image is −Z (forward), the top row +Y, +X lies at three quarters
/// of the width, the left and right borders are +Z. With `u` to the right and `v` down, both in [0, 1]:
/// `u = 1/2 + atan2(x, −z)/2π`, `v = acos(y)/π`. Values are linear radiance, nits.
#[derive(Clone, Debug)]
pub struct Environment {
    /// The map; every value finite and not negative.
    pub image: RgbImage,
    /// What was repaired, in words.
    pub warnings: Vec<String>,
}

/// The largest 16-bit float.
const HALF_MAX: f32 = 65504.0;

impl Environment {
    /// Reads a Radiance `.hdr` or an OpenEXR `.exr` file; the content decides, not the name.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
        let bytes = std::fs::read(path).map_err(|e| SceneError::read(path, e))?;
        let image = if bytes.starts_with(&EXR_MAGIC) {
            exr_io::decode_rgb(path, &bytes)?
        } else if bytes.starts_with(b"#?") {
            decode_hdr(path, &bytes)?
        } else {
            return Err(SceneError::invalid(
                path,
                "environment map",
                "is neither a Radiance .hdr nor an OpenEXR .exr file",
                "convert it to one of them",
            ));
        };
        Self::from_image(path, image)
    }

    /// An environment from an image in memory; `path` is for messages.
    pub fn from_image(path: &Path, mut image: RgbImage) -> Result<Self, SceneError> {
        if image.width == 0
            || image.height == 0
            || image.data.len() != image.width as usize * image.height as usize
        {
            return Err(SceneError::invalid(
                path,
                "environment map",
                format!("has {} x {} pixels", image.width, image.height),
                "use an image with pixels",
            ));
        }
        let mut repaired = 0_usize;
        for pixel in &mut image.data {
            if pixel.iter().any(|c| !c.is_finite() || *c < 0.0) {
                // Infinity is what brighter than the largest half float became.
                *pixel = pixel.map(|c| match c {
                    _ if c.is_nan() => 0.0,
                    f32::INFINITY => HALF_MAX,
                    _ => c.max(0.0),
                });
                repaired += 1;
            }
        }
        let mut warnings = Vec::new();
        if repaired > 0 {
            warnings.push(format!(
                "{}: {repaired} pixels of the environment map were negative, not a number (now 0) or infinite (now {HALF_MAX})",
                path.display()
            ));
        }
        if image.width != 2 * image.height {
            warnings.push(format!(
                "{}: the environment map is {} x {}, an equirectangular one is twice as wide as high",
                path.display(),
                image.width,
                image.height
            ));
        }
        Ok(Self { image, warnings })
    }

    /// The same radiance from everywhere.
    pub fn uniform(radiance: [f32; 3]) -> Self {
        Self {
            image: RgbImage::filled(2, 1, radiance),
            warnings: Vec::new(),
        }
    }

    /// Image coordinates of a unit direction.
    pub fn uv(direction: Vec3) -> (f32, f32) {
        use std::f32::consts::{PI, TAU};
        let u = 0.5 + direction.x.atan2(-direction.z) / TAU;
        let v = direction.y.clamp(-1.0, 1.0).acos() / PI;
        (u, v)
    }

    /// Unit direction of image coordinates; the inverse of [`Environment::uv`].
    pub fn direction(u: f32, v: f32) -> Vec3 {
        use std::f32::consts::{PI, TAU};
        let (sin_phi, cos_phi) = ((u - 0.5) * TAU).sin_cos();
        let (sin_theta, cos_theta) = (v * PI).sin_cos();
        Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
    }

    /// Radiance from a unit direction, bilinear between pixel centres; wraps around horizontally.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (u, v) = Self::uv(direction);
        let (w, h) = (self.image.width as usize, self.image.height as usize);
        let x = u * w as f32 - 0.5;
        let y = (v * h as f32 - 0.5).clamp(0.0, (h - 1) as f32);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let i0 = (x0 as i64).rem_euclid(w as i64) as usize;
        let i1 = (i0 + 1) % w;
        let j0 = y0 as usize;
        let j1 = (j0 + 1).min(h - 1);
        let at = |i: usize, j: usize| Vec3::from(self.image.data[j * w + i]);
        at(i0, j0)
            .lerp(at(i1, j0), fx)
            .lerp(at(i0, j1).lerp(at(i1, j1), fx), fy)
    }
}

fn decode_hdr(path: &Path, bytes: &[u8]) -> Result<RgbImage, SceneError> {
    let bad = |problem: String| {
        SceneError::invalid(
            path,
            "Radiance HDR image",
            problem,
            "write it again as .hdr or .exr",
        )
    };
    let undecodable = |e: image::ImageError| bad(format!("cannot be decoded ({e})"));
    let reader =
        || image::ImageReader::with_format(std::io::Cursor::new(bytes), image::ImageFormat::Hdr);
    let (width, height) = reader().into_dimensions().map_err(undecodable)?;
    crate::load::check_claim(width, height, bytes.len()).map_err(bad)?;
    let mut reader = reader();
    reader.limits(crate::load::image_limits());
    let decoded = reader.decode().map_err(undecodable)?.into_rgb32f();
    Ok(RgbImage {
        width: decoded.width(),
        height: decoded.height(),
        data: decoded.pixels().map(|p| p.0).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes() {
        let close = |a: Vec3, b: Vec3| (a - b).length() < 1e-6;
        assert!(close(Environment::direction(0.5, 0.5), Vec3::NEG_Z));
        assert!(close(Environment::direction(0.75, 0.5), Vec3::X));
        assert!(close(Environment::direction(0.0, 0.5), Vec3::Z));
        assert!(close(Environment::direction(0.3, 0.0), Vec3::Y));
        for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.9, 0.7)] {
            let (u2, v2) = Environment::uv(Environment::direction(u, v));
            assert!((u - u2).abs() < 1e-6 && (v - v2).abs() < 1e-6);
        }
    }

    #[test]
    fn repairs_what_is_no_radiance() {
        let mut image = RgbImage::filled(4, 2, [1e6; 3]);
        image.data[1] = [f32::NAN, f32::INFINITY, -1.0];
        let map = Environment::from_image(Path::new("test"), image).unwrap();
        assert_eq!(map.image.data[1], [0.0, HALF_MAX, 0.0]);
        assert_eq!(map.image.data[0], [1e6; 3]);
        assert!(map.warnings[0].contains("1 pixels"), "{:?}", map.warnings);
    }

    #[test]
    fn looks_up_the_marked_pixel() {
        let mut image = RgbImage::filled(8, 4, [0.0; 3]);
        image.data[8 + 5] = [1.0, 2.0, 3.0];
        let map = Environment::from_image(Path::new("test"), image).unwrap();
        let direction = Environment::direction(5.5 / 8.0, 1.5 / 4.0);
        assert!((map.radiance(direction) - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-5);
        assert!(map.radiance(-direction).length() < 1e-6);
    }

    #[test]
    fn reads_hdr_and_refuses_other_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.hdr");
        let mut bytes = Vec::new();
        let pixels = vec![image::Rgb([0.5_f32, 1.0, 2.0]); 32];
        image::codecs::hdr::HdrEncoder::new(&mut bytes)
            .encode(&pixels, 8, 4)
            .unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let map = Environment::load(&path).unwrap();
        assert!((map.radiance(Vec3::Y) - Vec3::new(0.5, 1.0, 2.0)).length() < 0.02);
        for i in 0..20 {
            std::fs::write(&path, &bytes[..bytes.len() * i / 20]).unwrap();
            assert!(Environment::load(&path).is_err());
        }
        std::fs::write(&path, b"PNG?").unwrap();
        let message = Environment::load(&path).unwrap_err().to_string();
        assert!(
            message.contains("map.hdr") && message.contains("convert"),
            "{message}"
        );
    }
}
