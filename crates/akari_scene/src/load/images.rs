//! Decoding of PNG and JPEG.

use gltf::texture::{MagFilter, WrappingMode};
use image::{DynamicImage, ImageReader};

use super::{Loader, label, name_or};
use crate::error::SceneError;
use crate::texture::{Filter, Image, Pixels, Wrap};

/// Largest side of an image.
const MAX_SIDE: u32 = 1 << 15;
/// Most bytes that decoding one image may take.
const MAX_ALLOCATION: u64 = 4 << 30;

/// Limits for the decoders: a header that claims more is taken for damage.
pub(crate) fn image_limits() -> image::Limits {
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_ALLOCATION);
    limits
}

/// Decodes one image that `place` (a material's texture) uses.
pub(super) fn decode(
    loader: &Loader,
    image: &gltf::Image,
    place: &str,
) -> Result<Image, SceneError> {
    let place = format!("{place}, image {}", label(image.name(), image.index()));
    let bytes = loader.image_bytes(image, &place)?;
    let bad = |problem: String| {
        loader.invalid(&place, problem, "replace it by a valid PNG or JPEG image")
    };
    let mut reader = ImageReader::new(std::io::Cursor::new(&bytes[..]))
        .with_guessed_format()
        .map_err(|e| bad(format!("cannot be read ({e})")))?;
    if reader.format().is_none() {
        return Err(bad(format!(
            "is neither PNG nor JPEG ({} bytes)",
            bytes.len()
        )));
    }
    reader.limits(image_limits());
    let decoded = reader
        .decode()
        .map_err(|e| bad(format!("cannot be decoded ({e})")))?;
    let (width, height) = (decoded.width(), decoded.height());
    if width == 0 || height == 0 {
        return Err(bad(format!("has a size of {width} x {height} pixels")));
    }
    let wide = matches!(
        decoded,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    let pixels = if wide {
        Pixels::U16(decoded.into_rgba16().pixels().map(|p| p.0).collect())
    } else {
        Pixels::U8(decoded.into_rgba8().pixels().map(|p| p.0).collect())
    };
    Ok(Image {
        name: name_or(image.name(), "image", image.index()),
        width,
        height,
        pixels,
    })
}

pub(super) fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::Repeat => Wrap::Repeat,
    }
}

pub(super) fn filter(mode: Option<MagFilter>) -> Filter {
    match mode {
        Some(MagFilter::Nearest) => Filter::Nearest,
        Some(MagFilter::Linear) | None => Filter::Linear,
    }
}
