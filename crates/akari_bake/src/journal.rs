//! What is done so far, on disk: a bake that is killed at any moment goes on from there.
//!
//! A file beside the output, to which finished units of work are appended, each with a checksum. What follows the last
//! whole record, a record that was being written when the process died, is cut off at the next start. One process has
//! the file at a time.
//!
//! | bytes | of the header |
//! |---|---|
//! | 16 | `akari-journal 2\n` |
//! | 64 | identity of scene and settings |
//! | 16 | shard index, shard count, triangles, 0 |
//!
//! | bytes | of a record |
//! |---|---|
//! | 4 | kind |
//! | 4 | unit |
//! | 8 | length of the content |
//! | 16 | checksum: first half of the BLAKE3 hash of kind, unit and content |
//! | … | content |

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use akari_visibility::identity::Identity;
use akari_visibility::part::Shard;

use crate::Error;

const MAGIC: &[u8; 16] = b"akari-journal 2\n";
const HEADER: usize = 96;
const RECORD_HEADER: usize = 32;
/// Longest content: units are far below it, and a damaged length must not be allocated.
const MAX_CONTENT: u64 = 1 << 30;

/// What a unit of work is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Levels of some triangles.
    Levels = 1,
    /// Trees of some samples.
    Samples = 2,
}

/// A unit that is in the journal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    pub(crate) kind: Kind,
    pub(crate) unit: u32,
    /// Where its content is.
    at: u64,
    length: usize,
}

/// The open journal.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: Mutex<File>,
}

/// Where the journal of an output is.
#[must_use]
pub fn journal_path(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".journal");
    output.with_file_name(name)
}

fn header(identity: &Identity, shard: Shard, triangles: u32) -> [u8; HEADER] {
    let mut bytes = [0; HEADER];
    bytes[..16].copy_from_slice(MAGIC);
    bytes[16..48].copy_from_slice(&identity.source.0);
    bytes[48..80].copy_from_slice(&identity.settings.0);
    for (k, number) in [shard.index, shard.count, triangles, 0]
        .into_iter()
        .enumerate()
    {
        bytes[80 + 4 * k..84 + 4 * k].copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn checksum(kind: u32, unit: u32, content: &[u8]) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&kind.to_le_bytes());
    hasher.update(&unit.to_le_bytes());
    hasher.update(content);
    let mut short = [0; 16];
    short.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    short
}

impl Journal {
    /// Opens the journal of an output, and tells what is in it. One of another bake, or `resume` being off, begins anew.
    pub(crate) fn open(
        output: &Path,
        identity: &Identity,
        shard: Shard,
        triangles: u32,
        resume: bool,
    ) -> Result<(Self, Vec<Record>), Error> {
        let path = journal_path(output);
        let problem = |what: &str, e: &dyn std::fmt::Display| Error::Journal {
            path: path.clone(),
            problem: format!(
                "cannot {what}: {e}; check that the output's folder exists and can be written to"
            ),
        };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(|e| problem("open the journal", &e))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::Journal {
                    path,
                    problem:
                        "another bake is writing this output; wait for it, or name another one"
                            .into(),
                });
            }
            // Some file systems have no locks: then it is up to the user.
            Err(TryLockError::Error(_)) => {}
        }
        let expected = header(identity, shard, triangles);
        let (records, end) = if resume {
            scan(&mut file, &expected).map_err(|e| problem("read the journal", &e))?
        } else {
            (Vec::new(), 0)
        };
        let prepare = |file: &mut File| -> std::io::Result<()> {
            file.set_len(end)?;
            file.seek(SeekFrom::Start(end))?;
            if end == 0 {
                file.write_all(&expected)?;
            }
            Ok(())
        };
        prepare(&mut file).map_err(|e| problem("write the journal", &e))?;
        Ok((
            Self {
                path,
                file: Mutex::new(file),
            },
            records,
        ))
    }

    fn error(&self, e: &std::io::Error) -> Error {
        Error::Journal {
            path: self.path.clone(),
            problem: format!("cannot be used: {e}; free some space and run the same command again"),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, File> {
        // A thread that panicked while it wrote has left at worst a record without its end, which is found out.
        self.file
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Adds a unit. It is there whole after a crash of the process, or not at all.
    pub(crate) fn append(&self, kind: Kind, unit: u32, content: &[u8]) -> Result<Record, Error> {
        let mut bytes = Vec::with_capacity(RECORD_HEADER + content.len());
        bytes.extend((kind as u32).to_le_bytes());
        bytes.extend(unit.to_le_bytes());
        bytes.extend((content.len() as u64).to_le_bytes());
        bytes.extend(checksum(kind as u32, unit, content));
        bytes.extend(content);
        let mut file = self.lock();
        let write = |file: &mut File| -> std::io::Result<u64> {
            let at = file.seek(SeekFrom::End(0))?;
            if let Err(e) = file.write_all(&bytes) {
                // What is there of it would hide the records that come after.
                let _ = file.set_len(at);
                return Err(e);
            }
            Ok(at)
        };
        let at = write(&mut file).map_err(|e| self.error(&e))?;
        Ok(Record {
            kind,
            unit,
            at: at + RECORD_HEADER as u64,
            length: content.len(),
        })
    }

    /// The content of a unit.
    pub(crate) fn read(&self, record: &Record) -> Result<Vec<u8>, Error> {
        let mut content = vec![0; record.length];
        let mut file = self.lock();
        file.seek(SeekFrom::Start(record.at))
            .and_then(|_| file.read_exact(&mut content))
            .map_err(|e| self.error(&e))?;
        Ok(content)
    }

    /// Removes the file: the output is complete.
    pub(crate) fn remove(self) {
        // A journal that stays is found to be of the same bake next time, and removed then.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The whole records, and where the last one ends; 0 if the header is not the expected one.
fn scan(file: &mut File, expected: &[u8; HEADER]) -> std::io::Result<(Vec<Record>, u64)> {
    let mut records = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    let length = file.metadata()?.len();
    let mut reader = BufReader::new(file);
    let mut header = [0; HEADER];
    if length < HEADER as u64 {
        return Ok((records, 0));
    }
    reader.read_exact(&mut header)?;
    if header != *expected {
        return Ok((records, 0));
    }
    let mut end = HEADER as u64;
    let mut content = Vec::new();
    while length - end >= RECORD_HEADER as u64 {
        let mut head = [0; RECORD_HEADER];
        reader.read_exact(&mut head)?;
        let word =
            |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let size = u64::from(word(8)) | u64::from(word(12)) << 32;
        let at = end + RECORD_HEADER as u64;
        if size > MAX_CONTENT || size > length - at {
            break;
        }
        content.resize(size as usize, 0);
        reader.read_exact(&mut content)?;
        let kind = match word(0) {
            1 => Kind::Levels,
            2 => Kind::Samples,
            _ => break,
        };
        if checksum(word(0), word(4), &content) != head[16..] {
            break;
        }
        records.push(Record {
            kind,
            unit: word(4),
            at,
            length: size as usize,
        });
        end = at + size;
    }
    Ok((records, end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_visibility::identity::Hash;

    const SHARD: Shard = Shard { index: 1, count: 2 };

    fn identity(x: u8) -> Identity {
        Identity {
            source: Hash([x; 32]),
            settings: Hash([7; 32]),
        }
    }

    fn open(output: &Path, x: u8) -> (Journal, Vec<Record>) {
        Journal::open(output, &identity(x), SHARD, 9, true).unwrap()
    }

    #[test]
    fn keeps_whole_records_and_cuts_off_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.akari");
        let contents: Vec<Vec<u8>> = (0..5).map(|i| vec![i as u8; 100 * i]).collect();
        {
            let (journal, records) = open(&output, 1);
            assert!(records.is_empty());
            for (i, content) in contents.iter().enumerate() {
                journal.append(Kind::Samples, i as u32, content).unwrap();
            }
        }
        let path = journal_path(&output);
        let bytes = std::fs::read(&path).unwrap();
        // Cut at every length, and every byte damaged: what is found is a prefix of what was written.
        for cut in 0..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let (journal, records) = open(&output, 1);
            for (i, record) in records.iter().enumerate() {
                assert_eq!((record.kind, record.unit), (Kind::Samples, i as u32));
                assert_eq!(journal.read(record).unwrap(), contents[i]);
            }
            let whole = (0..=5).rev().find(|&n| {
                let end = HEADER
                    + contents[..n]
                        .iter()
                        .map(|c| c.len() + RECORD_HEADER)
                        .sum::<usize>();
                cut >= end
            });
            assert_eq!(records.len(), whole.unwrap_or(0), "cut at {cut}");
        }
        for at in (0..bytes.len()).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            std::fs::write(&path, &damaged).unwrap();
            let (journal, records) = open(&output, 1);
            assert!(records.len() < 5, "a flipped bit at {at} was not noticed");
            for (i, record) in records.iter().enumerate() {
                assert_eq!(journal.read(record).unwrap(), contents[i]);
            }
            // What is appended after the cut is found again.
            journal.append(Kind::Levels, 77, b"after").unwrap();
            let count = records.len();
            drop(journal);
            let (_, records) = open(&output, 1);
            assert_eq!(records.len(), count + 1);
            assert_eq!(records[count].unit, 77);
        }
    }

    #[test]
    fn begins_anew_for_another_scene_and_refuses_company() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.akari");
        let (journal, _) = open(&output, 1);
        journal.append(Kind::Samples, 0, b"x").unwrap();
        let message = Journal::open(&output, &identity(1), SHARD, 9, true)
            .unwrap_err()
            .to_string();
        assert!(message.contains("another bake is writing"), "{message}");
        drop(journal);
        assert_eq!(open(&output, 1).1.len(), 1);
        assert_eq!(open(&output, 2).1.len(), 0);
        assert_eq!(open(&output, 1).1.len(), 0);
        let missing = folder.path().join("no/such/a.akari");
        let message = Journal::open(&missing, &identity(1), SHARD, 9, true)
            .unwrap_err()
            .to_string();
        assert!(message.contains("no/such/a.akari.journal"), "{message}");
    }
}
