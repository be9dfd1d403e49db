//! What chunks hold, as plain arrays: conversions between them and the types of this crate.

use crate::container::{ChunkName, Container, ContainerWriter, FileError};
use crate::grid::MAX_LEVEL;
use crate::identity::Hash;
use crate::sites::{Instance, Site};
use bytemuck::{Pod, Zeroable};
use serde::Serialize;
use serde::de::DeserializeOwned;

pub(crate) const INFO: ChunkName = *b"INFO";
const INSTANCES: ChunkName = *b"INST";
const NAMES: ChunkName = *b"NAME";
/// Chunks of [`write_instances`].
pub(crate) const INSTANCE_CHUNKS: [ChunkName; 2] = [INSTANCES, NAMES];
/// Settings and counts take some hundred bytes.
const MAX_INFO_BYTES: usize = 1 << 16;

pub(crate) fn io_error(path: &std::path::Path) -> impl Fn(std::io::Error) -> FileError {
    let path = path.to_owned();
    move |source| FileError::Io {
        path: path.clone(),
        source,
    }
}

/// Writes a small structure as JSON.
pub(crate) fn write_info<T: Serialize>(
    writer: &mut ContainerWriter,
    info: &T,
) -> std::io::Result<()> {
    let text = serde_json::to_vec(info)?;
    writer.chunk(INFO, &text)
}

pub(crate) fn read_info<T: DeserializeOwned>(container: &Container) -> Result<T, FileError> {
    let text = container.chunk::<u8>(INFO)?;
    if text.len() > MAX_INFO_BYTES {
        return Err(container.damaged(INFO, "is too long"));
    }
    serde_json::from_slice(&text).map_err(|error| container.damaged(INFO, error.to_string()))
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct InstanceRecord {
    mesh: Hash,
    transform: [f32; 12],
    first_triangle: u32,
    triangle_count: u32,
    name_start: u32,
    name_length: u32,
}

pub(crate) fn write_instances(
    writer: &mut ContainerWriter,
    instances: &[Instance],
) -> std::io::Result<()> {
    let mut names = Vec::new();
    let mut records = Vec::with_capacity(instances.len());
    for instance in instances {
        records.push(InstanceRecord {
            mesh: instance.mesh,
            transform: instance.transform,
            first_triangle: instance.first_triangle,
            triangle_count: instance.triangle_count,
            name_start: names.len() as u32,
            name_length: instance.name.len() as u32,
        });
        names.extend_from_slice(instance.name.as_bytes());
    }
    writer.chunk(INSTANCES, &records)?;
    writer.chunk(NAMES, &names)
}

pub(crate) fn read_instances(container: &Container) -> Result<Vec<Instance>, FileError> {
    let records = container.chunk::<InstanceRecord>(INSTANCES)?;
    let names = container.chunk::<u8>(NAMES)?;
    // Names lie one after the other, so that they take no more memory than the chunk.
    let mut rest: &[u8] = &names;
    let mut instances = Vec::with_capacity(records.len());
    for record in records.iter() {
        let name = (record.name_start as usize == names.len() - rest.len())
            .then(|| rest.split_at_checked(record.name_length as usize))
            .flatten();
        let Some((name, after)) = name else {
            return Err(container.damaged(INSTANCES, "a name is not where it should be"));
        };
        rest = after;
        let name = std::str::from_utf8(name)
            .map_err(|_| container.damaged(NAMES, "is not UTF-8"))?
            .to_owned();
        instances.push(Instance {
            name,
            mesh: record.mesh,
            transform: record.transform,
            first_triangle: record.first_triangle,
            triangle_count: record.triangle_count,
        });
    }
    Ok(instances)
}

const SITE_VERTEX: u32 = 0;
const SITE_EDGE: u32 = 1;
const SITE_INTERIOR: u32 = 2;

/// A site in four words: kind and level, then its numbers.
pub(crate) fn site_record(site: Site) -> [u32; 4] {
    match site {
        Site::Vertex(vertex) => [SITE_VERTEX, vertex, 0, 0],
        Site::Edge {
            low,
            high,
            level,
            numerator,
        } => [
            SITE_EDGE | u32::from(level) << 8 | u32::from(numerator) << 16,
            low,
            high,
            0,
        ],
        Site::Interior {
            triangle,
            level,
            i,
            j,
        } => [
            SITE_INTERIOR | u32::from(level) << 8,
            triangle,
            u32::from(i),
            u32::from(j),
        ],
    }
}

/// The site of a record, where it is one that [`Site::of`] gives.
pub(crate) fn site_of_record(record: [u32; 4]) -> Option<Site> {
    let [head, a, b, c] = record;
    let level = (head >> 8) as u8;
    let n = 1_u32.checked_shl(u32::from(level))?;
    let site = match head & 0xff {
        SITE_VERTEX => Site::Vertex(a),
        SITE_EDGE => {
            let numerator = head >> 16;
            if a >= b || numerator >= n || numerator % 2 == 0 {
                return None;
            }
            Site::Edge {
                low: a,
                high: b,
                level,
                numerator: numerator as u16,
            }
        }
        SITE_INTERIOR => {
            let inside = b > 0 && c > 0 && b < n && c < n - b;
            if !inside || (b | c) % 2 == 0 {
                return None;
            }
            Site::Interior {
                triangle: a,
                level,
                i: b as u16,
                j: c as u16,
            }
        }
        _ => return None,
    };
    (u32::from(level) <= MAX_LEVEL && site_record(site) == record).then_some(site)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sites_survive() {
        for level in 0..5 {
            let n = 1 << level;
            for j in 0..=n {
                for i in 0..=n - j {
                    let site = Site::of(7, [30, 10, 20], level, i, j);
                    assert_eq!(site_of_record(site_record(site)), Some(site));
                }
            }
        }
    }

    #[test]
    fn what_is_not_a_site_is_refused() {
        for record in [
            [3, 0, 0, 0],
            [0, 1, 1, 0],
            // Ends in the wrong order, an even numerator, one beyond the edge, a level beyond the finest.
            [1 | 1 << 8 | 1 << 16, 5, 5, 0],
            [1 | 2 << 8 | 2 << 16, 5, 6, 0],
            [1 | 1 << 8 | 3 << 16, 5, 6, 0],
            [1 | 11 << 8 | 1 << 16, 5, 6, 0],
            [1 | 200 << 8 | 1 << 16, 5, 6, 0],
            // On the border, both even, a numerator where none belongs.
            [2 | 2 << 8, 0, 0, 1],
            [2 | 2 << 8, 0, 3, 1],
            [2 | 3 << 8, 0, 2, 2],
            [2 | 3 << 8 | 1 << 16, 0, 1, 2],
        ] {
            assert_eq!(site_of_record(record), None, "{record:?}");
        }
    }
}
