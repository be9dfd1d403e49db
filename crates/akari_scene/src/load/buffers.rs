//! Bytes: buffers, URIs, accessors.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine as _;
use gltf::accessor::{DataType, Dimensions};

use super::{Loader, label};
use crate::error::SceneError;

/// Most elements of an accessor without data of its own (all others are bounded by their buffer).
const MAX_SPARSE_ELEMENTS: usize = 1 << 26;

const REEXPORT: &str = "export the file again";

/// Reads all buffers of the document.
pub(super) fn load(
    path: &Path,
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<Vec<u8>>, SceneError> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let place = format!("buffer {}", label(buffer.name(), buffer.index()));
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or_else(|| {
                SceneError::invalid(path, &place, "its binary chunk is missing", REEXPORT)
            })?,
            gltf::buffer::Source::Uri(uri) => read_uri(path, uri, &place)?,
        };
        if data.len() < buffer.length() {
            return Err(SceneError::invalid(
                path,
                place,
                format!(
                    "has {} bytes where {} are declared",
                    data.len(),
                    buffer.length()
                ),
                "the data is truncated: copy or export it again",
            ));
        }
        buffers.push(data);
    }
    Ok(buffers)
}

/// The bytes of a data URI or of a file relative to the glTF.
pub(super) fn read_uri(path: &Path, uri: &str, place: &str) -> Result<Vec<u8>, SceneError> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let Some((header, payload)) = rest.split_once(',') else {
            return Err(SceneError::invalid(
                path,
                place,
                "its data URI has no comma",
                REEXPORT,
            ));
        };
        return if header.ends_with(";base64") {
            base64::engine::general_purpose::STANDARD
                .decode(payload.trim())
                .map_err(|e| {
                    SceneError::invalid(
                        path,
                        place,
                        format!("its data URI is no base64 ({e})"),
                        REEXPORT,
                    )
                })
        } else {
            Ok(percent_decode(payload))
        };
    }
    if uri.contains("://") {
        return Err(SceneError::invalid(
            path,
            place,
            format!("refers to '{uri}', and nothing is fetched from a network"),
            "put the file beside the glTF",
        ));
    }
    let decoded = percent_decode(uri);
    let relative = String::from_utf8_lossy(&decoded).into_owned();
    let file = path.parent().unwrap_or(Path::new("")).join(&relative);
    std::fs::read(&file).map_err(|e| {
        SceneError::invalid(
            path,
            place,
            format!("refers to '{}', which cannot be read ({e})", file.display()),
            "put the file there or correct the reference",
        )
    })
}

/// Resolves `%20` and the like; anything malformed stays as it is.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let hex = (bytes[i] == b'%')
            .then(|| bytes.get(i + 1..i + 3))
            .flatten()
            .and_then(|h| std::str::from_utf8(h).ok())
            .and_then(|h| u8::from_str_radix(h, 16).ok());
        if let Some(byte) = hex {
            out.push(byte);
            i += 3;
        } else {
            out.push(bytes[i]);
            i += 1;
        }
    }
    out
}

fn component_size(data_type: DataType) -> usize {
    match data_type {
        DataType::I8 | DataType::U8 => 1,
        DataType::I16 | DataType::U16 => 2,
        DataType::U32 | DataType::F32 => 4,
    }
}

/// One component at the start of `bytes` as `f32`; integers scaled to [−1, 1] or [0, 1] if `normalized`.
fn component_f32(bytes: &[u8], data_type: DataType, normalized: bool) -> f32 {
    let scale = |value: f32, max: f32| {
        if normalized {
            (value / max).max(-1.0)
        } else {
            value
        }
    };
    match data_type {
        DataType::I8 => scale(f32::from(bytes[0] as i8), 127.0),
        DataType::U8 => scale(f32::from(bytes[0]), 255.0),
        DataType::I16 => scale(f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        DataType::U16 => scale(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        DataType::U32 => scale(
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
            u32::MAX as f32,
        ),
        DataType::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}

/// One unsigned integer at the start of `bytes`.
fn component_u32(bytes: &[u8], data_type: DataType) -> Option<u32> {
    match data_type {
        DataType::U8 => Some(u32::from(bytes[0])),
        DataType::U16 => Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
        DataType::U32 => Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        _ => None,
    }
}

impl Loader<'_> {
    /// The bytes of a buffer view.
    pub(super) fn view(&self, view: &gltf::buffer::View, place: &str) -> Result<&[u8], SceneError> {
        let buffer = &self.buffers[view.buffer().index()];
        view.offset()
            .checked_add(view.length())
            .and_then(|end| buffer.get(view.offset()..end))
            .ok_or_else(|| {
                self.invalid(
                    place,
                    format!(
                        "buffer view {} (offset {}, length {}) lies outside of its buffer of {} bytes",
                        view.index(),
                        view.offset(),
                        view.length(),
                        buffer.len()
                    ),
                    REEXPORT,
                )
            })
    }

    /// `count` elements of `size` bytes at `offset` of a view, each as a slice.
    fn elements<'b>(
        &'b self,
        view: &gltf::buffer::View,
        offset: usize,
        size: usize,
        count: usize,
        place: &str,
    ) -> Result<impl Iterator<Item = &'b [u8]> + use<'b>, SceneError> {
        let data = self.view(view, place)?;
        let stride = view.stride().unwrap_or(size);
        let end = count
            .checked_sub(1)
            .map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size))
            .and_then(|n| n.checked_add(offset));
        match end {
            Some(end) if end <= data.len() && stride >= size => {
                Ok((0..count).map(move |i| &data[offset + i * stride..offset + i * stride + size]))
            }
            _ => Err(self.invalid(
                place,
                format!(
                    "{count} elements of {size} bytes (stride {stride}) at offset {offset} do not fit into a \
                     buffer view of {} bytes",
                    data.len()
                ),
                REEXPORT,
            )),
        }
    }

    /// Elements of an accessor converted by `convert`, sparse ones replaced.
    fn read<T: Clone + Default>(
        &self,
        accessor: &gltf::Accessor,
        place: &str,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let size = accessor.size();
        let count = accessor.count();
        let mut values: Vec<T> = match accessor.view() {
            Some(view) => self
                .elements(&view, accessor.offset(), size, count, place)?
                .map(&convert)
                .collect(),
            None if count <= MAX_SPARSE_ELEMENTS => vec![T::default(); count],
            None => {
                return Err(self.invalid(
                    place,
                    format!("{count} elements without data"),
                    REEXPORT,
                ));
            }
        };
        if let Some(sparse) = accessor.sparse() {
            let indices = sparse.indices();
            let index_type = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => DataType::U8,
                gltf::accessor::sparse::IndexType::U16 => DataType::U16,
                gltf::accessor::sparse::IndexType::U32 => DataType::U32,
            };
            let at = self.elements(
                &indices.view(),
                indices.offset(),
                component_size(index_type),
                sparse.count(),
                place,
            )?;
            let new = self.elements(
                &sparse.values().view(),
                sparse.values().offset(),
                size,
                sparse.count(),
                place,
            )?;
            for (index, bytes) in at.zip(new) {
                let index = component_u32(index, index_type).unwrap_or(u32::MAX) as usize;
                let Some(value) = values.get_mut(index) else {
                    return Err(self.invalid(
                        place,
                        format!("sparse index {index} is out of range ({count} elements)"),
                        REEXPORT,
                    ));
                };
                *value = convert(bytes);
            }
        }
        Ok(values)
    }

    /// Finite vectors of `N` floats; an accessor of fewer components is filled with `fill`.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &gltf::Accessor,
        place: &str,
        attribute: &str,
        allowed: &[Dimensions],
        fill: f32,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        if !allowed.contains(&accessor.dimensions()) {
            return Err(self.invalid(
                place,
                format!(
                    "{attribute} is {:?}, not {allowed:?}",
                    accessor.dimensions()
                ),
                REEXPORT,
            ));
        }
        let components = accessor.dimensions().multiplicity().min(N);
        let (data_type, normalized) = (accessor.data_type(), accessor.normalized());
        let size = component_size(data_type);
        let values = self.read(accessor, &format!("{place}: {attribute}"), |bytes| {
            let mut v = [fill; N];
            for (k, c) in v.iter_mut().take(components).enumerate() {
                *c = component_f32(&bytes[k * size..], data_type, normalized);
            }
            Element(v)
        })?;
        for (i, Element(v)) in values.iter().enumerate() {
            if let Some(c) = v.iter().find(|c| !c.is_finite()) {
                let what = if c.is_nan() { "NaN" } else { "infinite" };
                return Err(self.invalid(
                    place,
                    format!("{attribute}[{i}] is {what}"),
                    "repair the mesh where it was made and export again",
                ));
            }
        }
        Ok(values.into_iter().map(|Element(v)| v).collect())
    }

    /// Vertex indices, each below `vertices`.
    pub(super) fn indices(
        &self,
        accessor: &gltf::Accessor,
        vertices: usize,
        place: &str,
    ) -> Result<Vec<u32>, SceneError> {
        let data_type = accessor.data_type();
        let is_index = matches!(data_type, DataType::U8 | DataType::U16 | DataType::U32);
        if accessor.dimensions() != Dimensions::Scalar || !is_index {
            return Err(self.invalid(
                place,
                format!(
                    "indices are {:?} of {data_type:?}, not unsigned scalars",
                    accessor.dimensions()
                ),
                REEXPORT,
            ));
        }
        let indices = self.read(accessor, &format!("{place}: indices"), |bytes| {
            component_u32(bytes, data_type).unwrap_or(u32::MAX)
        })?;
        if let Some((i, index)) = indices
            .iter()
            .enumerate()
            .find(|(_, index)| **index as usize >= vertices)
        {
            return Err(self.invalid(
                place,
                format!("index[{i}] = {index} is out of range ({vertices} vertices)"),
                REEXPORT,
            ));
        }
        Ok(indices)
    }

    /// Encoded bytes of an image, with its name for messages.
    pub(super) fn image_bytes(
        &self,
        image: &gltf::Image,
        place: &str,
    ) -> Result<Cow<'_, [u8]>, SceneError> {
        // Not `image.source()`: it panics (gltf 1.4.1) where mimeType or both sources are missing.
        let json = &self.document.as_json().images[image.index()];
        if let Some(uri) = &json.uri {
            return read_uri(self.path, uri, place).map(Cow::Owned);
        }
        let view = json
            .buffer_view
            .and_then(|index| self.document.views().nth(index.value()));
        match view {
            Some(view) => Ok(Cow::Borrowed(self.view(&view, place)?)),
            None => Err(self.invalid(place, "has neither a uri nor a bufferView", REEXPORT)),
        }
    }
}

/// `[f32; N]` with a default for every `N`.
#[derive(Clone)]
struct Element<const N: usize>([f32; N]);

impl<const N: usize> Default for Element<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}
