//! The file around the chunks: header, table, checksums, compression.
//!
//! All numbers are little endian.
//!
//! | bytes | holds |
//! |---|---|
//! | 0 to 7 | `89 41 4B 41 52 49 0D 0A`: a byte above 127, `AKARI`, and a line end that text transfers change |
//! | 8 to 11 | version of the format, [`VERSION`] |
//! | 12 to 15 | kind: `BAKE`, a whole bake; `PART`, a part of one |
//! | 16 to 23 | length of the file |
//! | 24 to 27 | number of chunks |
//! | 28 to 31 | 0 |
//! | 32 to 63 | hash of the source, [`Identity::source`] |
//! | 64 to 95 | hash of the settings, [`Identity::settings`] |
//! | 96 to 111 | first 16 bytes of the BLAKE3 hash of bytes 0 to 95 and of the table |
//! | 112 … | table: per chunk its name (4 letters), codec (0: as it is, 1: zstd), offset, length in the file, length of its content (8 bytes each), and the first 16 bytes of the BLAKE3 hash of what is in the file |
//! | … | chunks, each at a multiple of 16 |
//!
//! A chunk is a plain array that a storage buffer takes as it is. A chunk that this version does not know is left alone
//! where its name begins with a small letter, and refused otherwise.
//!
//! **Memory.** [`Container::read`] takes the file into memory; [`Container::map`] maps it, which saves that copy: pages
//! of the chunks that are asked for are read when they are, and compressed chunks are decoded straight from the page
//! cache. A chunk that is stored as it is is used in place, either way. What a file makes a reader allocate is at most
//! [`MAX_RATIO`] times its own length.

use crate::identity::{Hash, Identity};
use bytemuck::{AnyBitPattern, NoUninit, Pod};
use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Version of the format that is written and read.
pub const VERSION: u32 = 1;

/// A chunk's content is at most this many times its length in the file; what would shrink further is stored as it is.
pub const MAX_RATIO: u64 = 1024;

/// A chunk that compression shortens by less than one part in so many is stored as it is, to be used in place.
const LEAST_GAIN: usize = 16;

/// Level of zstd. It takes a seventh off the trees; level 19 takes a hundredth more.
const ZSTD_LEVEL: i32 = 3;

const MAGIC: [u8; 8] = *b"\x89AKARI\r\n";
const HEADER_BYTES: usize = 112;
const ENTRY_BYTES: usize = 48;
const CHECKED_HEADER_BYTES: usize = 96;
const ALIGNMENT: usize = 16;
/// Far more than there are kinds of chunks.
const MAX_CHUNKS: usize = 64;
const CODEC_PLAIN: u32 = 0;
const CODEC_ZSTD: u32 = 1;

/// Whether a file that begins so is of this format, of whatever version and in whatever state.
#[must_use]
pub fn has_magic(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole bake.
    Bake,
    /// A part of a bake.
    Part,
}

impl Kind {
    fn code(self) -> [u8; 4] {
        match self {
            Self::Bake => *b"BAKE",
            Self::Part => *b"PART",
        }
    }

    fn from_code(code: &[u8]) -> Option<Self> {
        [Self::Bake, Self::Part]
            .into_iter()
            .find(|kind| kind.code() == code)
    }
}

/// Why a file is refused. Each message names the file and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Not a file of this format, or of another version.
    #[error("{}: {reason}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// What it is instead, and what to do.
        reason: String,
    },
    /// Damaged: bits differ from what was written.
    #[error("{}: damaged at {place}: {reason}; copy it again or bake again", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Chunk.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// A bake of something else.
    #[error("{}: {reason}; run `akari bake` again for this scene", path.display())]
    Stale {
        /// File.
        path: PathBuf,
        /// What differs.
        reason: String,
    },
}

/// Name of a chunk.
pub type ChunkName = [u8; 4];

/// A chunk of a file, as its table lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkInfo {
    /// Name.
    pub name: ChunkName,
    /// Whether it is compressed.
    pub is_compressed: bool,
    /// Bytes in the file.
    pub stored_bytes: u64,
    /// Bytes of its content.
    pub bytes: u64,
    offset: u64,
    checksum: [u8; 16],
}

impl ChunkInfo {
    /// The name as text.
    #[must_use]
    pub fn name_text(&self) -> String {
        self.name.escape_ascii().to_string()
    }
}

fn checksum(parts: &[&[u8]]) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    let mut short = [0; 16];
    short.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    short
}

/// Collects the chunks of a file.
#[derive(Debug)]
pub(crate) struct ContainerWriter {
    kind: Kind,
    identity: Identity,
    chunks: Vec<(ChunkInfo, Vec<u8>)>,
}

impl ContainerWriter {
    pub(crate) fn new(kind: Kind, identity: Identity) -> Self {
        Self {
            kind,
            identity,
            chunks: Vec::new(),
        }
    }

    /// Adds an array. Compressed where that makes it smaller.
    pub(crate) fn chunk<T: NoUninit>(
        &mut self,
        name: ChunkName,
        content: &[T],
    ) -> std::io::Result<()> {
        const { assert!(cfg!(target_endian = "little"), "files are little endian") };
        let content: &[u8] = bytemuck::cast_slice(content);
        let compressed = zstd::bulk::compress(content, ZSTD_LEVEL)?;
        let is_worth_it = compressed.len() + content.len() / LEAST_GAIN < content.len();
        let is_compressed =
            is_worth_it && content.len() as u64 <= compressed.len() as u64 * MAX_RATIO;
        let stored = if is_compressed {
            compressed
        } else {
            content.to_vec()
        };
        let info = ChunkInfo {
            name,
            is_compressed,
            stored_bytes: stored.len() as u64,
            bytes: content.len() as u64,
            offset: 0,
            checksum: checksum(&[&stored]),
        };
        self.chunks.push((info, stored));
        Ok(())
    }

    /// The whole file.
    pub(crate) fn bytes(mut self) -> Vec<u8> {
        let mut end = HEADER_BYTES + self.chunks.len() * ENTRY_BYTES;
        for (info, stored) in &mut self.chunks {
            info.offset = end.next_multiple_of(ALIGNMENT) as u64;
            end = info.offset as usize + stored.len();
        }
        let mut file = Vec::with_capacity(end);
        file.extend(MAGIC);
        file.extend(VERSION.to_le_bytes());
        file.extend(self.kind.code());
        file.extend((end as u64).to_le_bytes());
        file.extend((self.chunks.len() as u32).to_le_bytes());
        file.extend([0; 4]);
        file.extend(self.identity.source.0);
        file.extend(self.identity.settings.0);
        let mut table = Vec::with_capacity(self.chunks.len() * ENTRY_BYTES);
        for (info, _) in &self.chunks {
            table.extend(info.name);
            table.extend(u32::from(info.is_compressed).to_le_bytes());
            table.extend(info.offset.to_le_bytes());
            table.extend(info.stored_bytes.to_le_bytes());
            table.extend(info.bytes.to_le_bytes());
            table.extend(info.checksum);
        }
        let sum = checksum(&[&file, &table]);
        file.extend(sum);
        file.extend(table);
        for (info, stored) in &self.chunks {
            file.resize(info.offset as usize, 0);
            file.extend(stored);
        }
        file
    }

    /// Writes the file: whole or not at all.
    pub(crate) fn write(self, path: &Path) -> Result<(), FileError> {
        write_atomically(path, &self.bytes())
    }
}

/// Writes a temporary file beside `path`, brings it to the disk, and gives it the name.
///
/// Whoever reads `path` meanwhile, or has mapped it, keeps what was there before. A process that is killed meanwhile leaves
/// a file `.akari-….tmp`, which nobody reads.
fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let fail = |source| FileError::Io {
        path: path.to_owned(),
        source,
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".akari-").suffix(".tmp");
    // A temporary file is readable by its owner alone by default; this one is to be what any other new file is.
    #[cfg(unix)]
    let permissions = {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::Permissions::from_mode(0o666)
    };
    #[cfg(unix)]
    builder.permissions(permissions);
    let mut file = builder.tempfile_in(folder).map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    file.as_file().sync_all().map_err(fail)?;
    file.persist(path).map_err(|error| fail(error.error))?;
    // The name is on the disk once the folder is; where folders cannot be opened as files, there is no such step.
    #[cfg(unix)]
    File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(fail)?;
    Ok(())
}

/// Bytes that begin where any chunk may.
#[derive(Debug)]
enum Bytes {
    /// So many bytes of words that are aligned.
    Owned(Vec<u128>, usize),
    Mapped(memmap2::Mmap),
}

impl Bytes {
    fn as_slice(&self) -> &[u8] {
        match self {
            Self::Owned(words, length) => &bytemuck::cast_slice(words)[..*length],
            Self::Mapped(map) => map,
        }
    }
}

/// A file whose header and table are checked; its chunks are when they are asked for.
#[derive(Debug)]
pub struct Container {
    path: PathBuf,
    bytes: Bytes,
    kind: Kind,
    identity: Identity,
    chunks: Vec<ChunkInfo>,
}

impl Container {
    /// Takes a file into memory.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let fail = |source| FileError::Io {
            path: path.to_owned(),
            source,
        };
        let (mut file, length) = open(path)?;
        let mut words = vec![0_u128; length.div_ceil(ALIGNMENT)];
        file.read_exact(&mut bytemuck::cast_slice_mut(&mut words)[..length])
            .map_err(fail)?;
        Self::new(path, Bytes::Owned(words, length))
    }

    /// Maps a file into memory.
    ///
    /// # Safety
    ///
    /// Nobody may change or shorten the file while it is mapped. Files of this crate are never changed in place: a new
    /// one takes the name of an old one, which stays what it was for those who have mapped it.
    #[allow(
        unsafe_code,
        reason = "what another process does to a mapped file cannot be checked"
    )]
    pub unsafe fn map(path: &Path) -> Result<Self, FileError> {
        let (file, _) = open(path)?;
        // SAFETY: the caller's promise.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(|source| FileError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::new(path, Bytes::Mapped(map))
    }

    /// Takes the bytes of a file; `path` is what errors call it.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, FileError> {
        let mut words = vec![0_u128; bytes.len().div_ceil(ALIGNMENT)];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self::new(path, Bytes::Owned(words, bytes.len()))
    }

    fn new(path: &Path, bytes: Bytes) -> Result<Self, FileError> {
        let (kind, identity, chunks) =
            parse(bytes.as_slice()).map_err(|problem| match problem {
                Problem::Format(reason) => FileError::Format {
                    path: path.to_owned(),
                    reason,
                },
                Problem::Damaged(place, reason) => FileError::Damaged {
                    path: path.to_owned(),
                    place: place.to_owned(),
                    reason,
                },
            })?;
        Ok(Self {
            path: path.to_owned(),
            bytes,
            kind,
            identity,
            chunks,
        })
    }

    /// What it is called in errors.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it is.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Of which scene and settings it is.
    #[must_use]
    pub fn identity(&self) -> Identity {
        self.identity
    }

    /// Its chunks, in their order.
    #[must_use]
    pub fn chunks(&self) -> &[ChunkInfo] {
        &self.chunks
    }

    /// Refuses a file of the other kind.
    pub fn expect_kind(&self, kind: Kind) -> Result<(), FileError> {
        let reason = match (kind, self.kind) {
            (Kind::Bake, Kind::Part) => {
                "is a part of a bake: join all parts with `akari merge` first"
            }
            (Kind::Part, Kind::Bake) => "is a whole bake, not a part of one",
            _ => return Ok(()),
        };
        Err(FileError::Format {
            path: self.path.clone(),
            reason: reason.into(),
        })
    }

    pub(crate) fn damaged(&self, name: ChunkName, reason: impl Into<String>) -> FileError {
        FileError::Damaged {
            path: self.path.clone(),
            place: format!("chunk {}", name.escape_ascii()),
            reason: reason.into(),
        }
    }

    /// Refuses chunks that a reader would have to know.
    pub(crate) fn expect_known(&self, known: &[ChunkName]) -> Result<(), FileError> {
        let foreign = self
            .chunks
            .iter()
            .find(|chunk| chunk.name[0].is_ascii_uppercase() && !known.contains(&chunk.name));
        foreign.map_or(Ok(()), |chunk| {
            Err(FileError::Format {
                path: self.path.clone(),
                reason: format!(
                    "holds a chunk {} that this version does not know: use a newer version, or bake again",
                    chunk.name_text()
                ),
            })
        })
    }

    /// Whether there is a chunk of this name.
    #[must_use]
    pub fn has_chunk(&self, name: ChunkName) -> bool {
        self.chunks.iter().any(|chunk| chunk.name == name)
    }

    /// The content of a chunk, checked against its checksum; in place where it is stored as it is.
    pub fn chunk<T: Pod>(&self, name: ChunkName) -> Result<Cow<'_, [T]>, FileError> {
        let Some(info) = self.chunks.iter().find(|chunk| chunk.name == name) else {
            return Err(self.damaged(name, "is missing"));
        };
        // Within the file: `parse` has checked it.
        let start = info.offset as usize;
        let stored = &self.bytes.as_slice()[start..start + info.stored_bytes as usize];
        if checksum(&[stored]) != info.checksum {
            return Err(self.damaged(name, "its checksum differs"));
        }
        let count = info.bytes as usize / size_of::<T>();
        if count * size_of::<T>() != info.bytes as usize {
            return Err(self.damaged(name, "its length is not that of whole elements"));
        }
        if !info.is_compressed {
            return Ok(match bytemuck::try_cast_slice(stored) {
                Ok(content) => Cow::Borrowed(content),
                // Mapped or not, chunks are aligned for any type of this format; this is for those of other crates.
                Err(_) => Cow::Owned(bytemuck::pod_collect_to_vec(stored)),
            });
        }
        let mut content = zeroed::<T>(count);
        let length = zstd::bulk::decompress_to_buffer(
            stored,
            bytemuck::cast_slice_mut::<T, u8>(&mut content),
        )
        .map_err(|error| self.damaged(name, format!("does not decompress: {error}")))?;
        if length as u64 != info.bytes {
            return Err(self.damaged(name, "decompresses to another length"));
        }
        Ok(Cow::Owned(content))
    }
}

fn zeroed<T: AnyBitPattern>(count: usize) -> Vec<T> {
    vec![T::zeroed(); count]
}

fn open(path: &Path) -> Result<(File, usize), FileError> {
    let fail = |source| FileError::Io {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(fail)?;
    let metadata = file.metadata().map_err(fail)?;
    // A device has no length to bound what is read of it.
    let length = usize::try_from(metadata.len()).ok();
    match length {
        Some(length) if metadata.is_file() && length >= HEADER_BYTES => Ok((file, length)),
        _ => Err(FileError::Format {
            path: path.to_owned(),
            reason: NOT_OURS.into(),
        }),
    }
}

const NOT_OURS: &str = "is not a bake: `akari bake` writes them";

enum Problem {
    Format(String),
    Damaged(&'static str, String),
}

/// Numbers of a header, one after the other.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut taken = [0; N];
        let (head, rest) = self.0.split_at(N);
        taken.copy_from_slice(head);
        self.0 = rest;
        taken
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }
}

/// Header and table, and that all chunks are within the file.
fn parse(bytes: &[u8]) -> Result<(Kind, Identity, Vec<ChunkInfo>), Problem> {
    if bytes.len() < HEADER_BYTES || bytes[..MAGIC.len()] != MAGIC {
        return Err(Problem::Format(NOT_OURS.into()));
    }
    let (header, rest) = bytes.split_at(HEADER_BYTES);
    let mut fields = Fields(&header[MAGIC.len()..]);
    let version = fields.u32();
    if version != VERSION {
        return Err(Problem::Format(format!(
            "is of version {version} of the format, and this program reads version {VERSION}: bake again, or use the other version of the program"
        )));
    }
    let kind = fields.take::<4>();
    let length = fields.u64();
    let count = fields.u32() as usize;
    let zero = fields.u32();
    let identity = Identity {
        source: Hash(fields.take()),
        settings: Hash(fields.take()),
    };
    let sum = fields.take::<16>();
    if length != bytes.len() as u64 {
        return Err(Problem::Damaged(
            "its end",
            format!("it has {} bytes of {length}", bytes.len()),
        ));
    }
    let table_bytes = count.saturating_mul(ENTRY_BYTES);
    if count > MAX_CHUNKS || table_bytes > rest.len() {
        return Err(Problem::Damaged("its header", format!("{count} chunks")));
    }
    let table = &rest[..table_bytes];
    if checksum(&[&header[..CHECKED_HEADER_BYTES], table]) != sum {
        return Err(Problem::Damaged(
            "its header",
            "its checksum differs".into(),
        ));
    }
    let Some(kind) = Kind::from_code(&kind).filter(|_| zero == 0) else {
        return Err(Problem::Format(format!(
            "is of a kind {} that this version does not know: use a newer version",
            kind.escape_ascii()
        )));
    };
    let mut chunks: Vec<ChunkInfo> = Vec::with_capacity(count);
    for entry in table.chunks_exact(ENTRY_BYTES) {
        let mut fields = Fields(entry);
        let name = fields.take();
        let codec = fields.u32();
        let info = ChunkInfo {
            name,
            is_compressed: codec == CODEC_ZSTD,
            offset: fields.u64(),
            stored_bytes: fields.u64(),
            bytes: fields.u64(),
            checksum: fields.take(),
        };
        let wrong = |what: &str| {
            Err(Problem::Damaged(
                "its table",
                format!("chunk {}: {what}", info.name_text()),
            ))
        };
        if codec != CODEC_PLAIN && codec != CODEC_ZSTD {
            return wrong("an unknown compression");
        }
        let is_inside = info
            .offset
            .checked_add(info.stored_bytes)
            .is_some_and(|end| end <= length);
        if !is_inside || !info.offset.is_multiple_of(ALIGNMENT as u64) {
            return wrong("not within the file");
        }
        let bound = if info.is_compressed {
            info.stored_bytes.saturating_mul(MAX_RATIO)
        } else {
            info.stored_bytes
        };
        if info.bytes > bound || (!info.is_compressed && info.bytes != info.stored_bytes) {
            return wrong("its content has an impossible length");
        }
        if chunks.iter().any(|other| other.name == name) {
            return wrong("there twice");
        }
        chunks.push(info);
    }
    Ok((kind, identity, chunks))
}
