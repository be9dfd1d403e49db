//! Files as bytes, and their checksums.

use super::bakes::{part, parts, topology};
use akari_visibility::part::merge;
use std::fs;
use std::sync::OnceLock;

/// Bytes of the header.
pub const HEADER: usize = 112;
/// Bytes of an entry of the table.
pub const ENTRY: usize = 48;

/// The bytes of a bake and of a part.
pub fn files() -> &'static [Vec<u8>; 2] {
    static FILES: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    FILES.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("x.akari");
        merge(&parts(&topology(5), 1))
            .expect("a bake")
            .write(&path)
            .expect("written");
        let bake = fs::read(&path).expect("read");
        part(&topology(5), 1, 1, 12).write(&path).expect("written");
        [bake, fs::read(&path).expect("read")]
    })
}

/// Replaces bytes.
pub fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

/// Sets the checksums right again, so that what is behind them is tested.
pub fn reseal(bytes: &mut [u8]) {
    let short = |parts: &[&[u8]]| {
        let mut hasher = blake3::Hasher::new();
        parts.iter().for_each(|part| {
            hasher.update(part);
        });
        hasher.finalize().as_bytes()[..16].to_vec()
    };
    let word = |bytes: &[u8], at: usize| {
        u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes")) as usize
    };
    let length = bytes.len() as u64;
    put(bytes, 16, &length.to_le_bytes());
    let count = u32::from_le_bytes(bytes[24..28].try_into().expect("four bytes")) as usize;
    let end = HEADER + count.min(64) * ENTRY;
    if end > bytes.len() {
        return;
    }
    for entry in (HEADER..end).step_by(ENTRY) {
        let (start, size) = (word(bytes, entry + 8), word(bytes, entry + 16));
        if let Some(content) = bytes.get(start..start.saturating_add(size)) {
            let sum = short(&[content]);
            put(bytes, entry + 32, &sum);
        }
    }
    let sum = short(&[&bytes[..96], &bytes[HEADER..end]]);
    put(bytes, 96, &sum);
}
