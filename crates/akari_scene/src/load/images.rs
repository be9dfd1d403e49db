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

/// Most pixels for each byte of a file: deflate's best ratio (1032) of pixels of one bit.
const MOST_PIXELS_PER_BYTE: u64 = 8 * 1032;

/// Tells of a header that claims more pixels than its file can hold, before anything is allocated for them.
pub(crate) fn check_claim(width: u32, height: u32, file_bytes: usize) -> Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels / MOST_PIXELS_PER_BYTE > file_bytes as u64 {
        return Err(format!(
            "claims {width} x {height} pixels, which {file_bytes} bytes cannot hold"
        ));
    }
    Ok(())
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
    // Without a size, decoding tells what is wrong.
    if let Ok((width, height)) = image_size(&bytes) {
        check_claim(width, height, bytes.len()).map_err(&bad)?;
    }
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

/// Width and height by the header.
fn image_size(bytes: &[u8]) -> Result<(u32, u32), image::ImageError> {
    let reader = ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format()?;
    reader.into_dimensions()
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
