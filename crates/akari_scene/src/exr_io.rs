//! OpenEXR images of 32-bit floats.
//!
//! Any compression that the `exr` crate decodes is read (also DWAA/DWAB); what it does not is named in the error.
//! Written files are ZIP-compressed (lossless), scan lines, channels `R`, `G`, `B` or `Y`.

use std::io::Cursor;
use std::path::Path;

use exr::prelude as ex;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};

use crate::error::SceneError;
use crate::write_atomic;

/// Most pixels of an image that is read: a header that claims more is taken for damage, not for a plan.
const MAX_PIXELS: usize = 1 << 28;

/// Most pixels for each byte of a file: deflate's best ratio, of the encodings that are read the best one.
const MOST_PIXELS_PER_BYTE: usize = 1032;

/// A linear RGB image, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RgbImage {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width × height` pixels.
    pub data: Vec<[f32; 3]>,
}

impl RgbImage {
    /// An image of one colour.
    pub fn filled(width: u32, height: u32, color: [f32; 3]) -> Self {
        Self {
            width,
            height,
            data: vec![color; width as usize * height as usize],
        }
    }

    /// Pixel at column `x` of row `y`.
    ///
    /// # Panics
    /// Outside of the image.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        assert!(
            x < self.width && y < self.height,
            "pixel outside of the image"
        );
        self.data[y as usize * self.width as usize + x as usize]
    }
}

/// Reads channels `R`, `G`, `B`, or one channel (`Y`, or the only one there is) three times, of the first layer.
pub fn read_rgb(path: &Path) -> Result<RgbImage, SceneError> {
    let bytes = std::fs::read(path).map_err(|e| SceneError::read(path, e))?;
    decode_rgb(path, &bytes)
}

/// [`read_rgb`] of a file's content; `path` is for messages.
pub fn decode_rgb(path: &Path, bytes: &[u8]) -> Result<RgbImage, SceneError> {
    let bad = |problem: String| {
        SceneError::invalid(
            path,
            "EXR image",
            problem,
            "write it again as a flat EXR with channels R, G, B (or Y), ZIP or no compression",
        )
    };
    let describe = |error: exr::error::Error| match error {
        exr::error::Error::NotSupported(what) => {
            format!("uses a feature that cannot be decoded ({what})")
        }
        exr::error::Error::Invalid(what) => format!("is no valid EXR file ({what})"),
        exr::error::Error::Io(e) => format!("ends too early or cannot be read ({e})"),
        exr::error::Error::Aborted => "reading was aborted".to_owned(),
    };
    let meta = ex::MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|e| bad(describe(e)))?;
    for header in &meta.headers {
        let size = header.layer_size;
        if size.0 == 0 || size.1 == 0 {
            return Err(bad(format!("has a size of {} x {} pixels", size.0, size.1)));
        }
        if size.0.saturating_mul(size.1) > MAX_PIXELS {
            return Err(bad(format!(
                "claims {} x {} pixels (at most {MAX_PIXELS} in all are read)",
                size.0, size.1
            )));
        }
    }
    for header in &meta.headers {
        let size = header.layer_size;
        if size.0 * size.1 / MOST_PIXELS_PER_BYTE > bytes.len() {
            return Err(bad(format!(
                "claims {} x {} pixels, which {} bytes cannot hold",
                size.0,
                size.1,
                bytes.len()
            )));
        }
    }
    let compression = meta
        .headers
        .first()
        .map_or_else(String::new, |h| format!("{:?}", h.compression));
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| bad(format!("{} (compression {compression})", describe(e))))?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.0, layer.size.1);
    let channels = &layer.channel_data.list;
    let find = |wanted: &str| {
        channels.iter().find(|c| {
            let name = c.name.to_string();
            // `layer.R` is how multi-layer files name the channel R.
            name.eq_ignore_ascii_case(wanted)
                || name
                    .rsplit_once('.')
                    .is_some_and(|(_, last)| last.eq_ignore_ascii_case(wanted))
        })
    };
    let rgb = match (find("R"), find("G"), find("B")) {
        (Some(r), Some(g), Some(b)) => [r, g, b],
        _ => match find("Y").or(if channels.len() == 1 {
            channels.first()
        } else {
            None
        }) {
            Some(y) => [y, y, y],
            None => {
                let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
                return Err(bad(format!(
                    "has neither R, G, B nor Y among its channels ({})",
                    names.join(", ")
                )));
            }
        },
    };
    let planes = rgb.map(|c| c.sample_data.values_as_f32().collect::<Vec<f32>>());
    let count = width * height;
    if planes.iter().any(|p| p.len() != count) {
        return Err(bad("has subsampled channels".to_owned()));
    }
    let [r, g, b] = planes;
    Ok(RgbImage {
        width: width as u32,
        height: height as u32,
        data: (0..count).map(|i| [r[i], g[i], b[i]]).collect(),
    })
}

/// Writes channels `R`, `G`, `B`, 32-bit float, through a temporary file.
pub fn write_rgb(path: &Path, image: &RgbImage) -> Result<(), SceneError> {
    let plane = |k: usize| image.data.iter().map(|p| p[k]).collect::<Vec<f32>>();
    write_channels(
        path,
        image.width,
        image.height,
        vec![("R", plane(0)), ("G", plane(1)), ("B", plane(2))],
    )
}

/// Writes one channel `Y`, 32-bit float, through a temporary file.
pub fn write_gray(path: &Path, width: u32, height: u32, data: &[f32]) -> Result<(), SceneError> {
    write_channels(path, width, height, vec![("Y", data.to_vec())])
}

fn write_channels(
    path: &Path,
    width: u32,
    height: u32,
    channels: Vec<(&str, Vec<f32>)>,
) -> Result<(), SceneError> {
    let size = (width as usize, height as usize);
    let bad = |problem: String| {
        SceneError::invalid(
            path,
            "EXR output",
            problem,
            "this is a mistake of the caller",
        )
    };
    if size.0 == 0 || size.1 == 0 {
        return Err(bad(format!("the image has {width} x {height} pixels")));
    }
    if let Some((name, values)) = channels.iter().find(|(_, v)| v.len() != size.0 * size.1) {
        return Err(bad(format!(
            "channel {name} has {} values for {width} x {height} pixels",
            values.len()
        )));
    }
    let list = channels
        .into_iter()
        .map(|(name, values)| ex::AnyChannel::new(name, ex::FlatSamples::F32(values)))
        .collect();
    let layer = ex::Layer::new(
        size,
        ex::LayerAttributes::default(),
        ex::Encoding {
            compression: ex::Compression::ZIP16,
            blocks: ex::Blocks::ScanLines,
            line_order: ex::LineOrder::Increasing,
        },
        ex::AnyChannels::sort(list),
    );
    let mut bytes = Cursor::new(Vec::new());
    ex::Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|e| bad(format!("cannot be encoded ({e})")))?;
    write_atomic(path, bytes.get_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_is_exact() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let image = RgbImage {
            width: 3,
            height: 2,
            data: (0..6)
                .map(|i| [i as f32, 1e-30 * i as f32, -1e30 * i as f32])
                .collect(),
        };
        write_rgb(&path, &image).unwrap();
        assert_eq!(read_rgb(&path).unwrap(), image);
        write_gray(&path, 2, 1, &[0.5, f32::INFINITY]).unwrap();
        let gray = read_rgb(&path).unwrap();
        assert_eq!(gray.data, [[0.5; 3], [f32::INFINITY; 3]]);
    }

    #[test]
    fn errors_name_the_file_and_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.exr");
        std::fs::write(&path, b"this is no EXR file at all").unwrap();
        let message = read_rgb(&path).unwrap_err().to_string();
        assert!(
            message.contains("bad.exr") && message.contains("write it again"),
            "{message}"
        );
        let image = RgbImage::filled(2, 2, [1.0; 3]);
        let nowhere = folder.path().join("missing/out.exr");
        let message = write_rgb(&nowhere, &image).unwrap_err().to_string();
        assert!(
            message.contains("missing/out.exr") && message.contains("folder"),
            "{message}"
        );
        assert!(write_gray(&path, 2, 2, &[0.0]).is_err());
    }

    #[test]
    fn damaged_files_are_errors_not_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_rgb(&path, &RgbImage::filled(20, 40, [0.1, 0.2, 0.3])).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for i in 0..50 {
            let cut = bytes.len() * i / 50;
            assert!(decode_rgb(&path, &bytes[..cut]).is_err(), "cut at {cut}");
        }
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 0x81;
            // Some flips hit pixels or names and stay readable; none may panic.
            let _ = decode_rgb(&path, &damaged);
        }
    }
}
