//! Files that are there whole or not at all.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::SceneError;

/// Writes `bytes` to `path` through a temporary file in the same folder and a rename, so that a reader never sees
/// half a file and an interrupted run leaves the old content in place.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    // Two writers in one process must not share the temporary file, nor may two processes.
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    let Some(file_name) = path.file_name() else {
        return Err(SceneError::invalid(
            path,
            "output",
            "the path names no file",
            "give a file name",
        ));
    };
    if path.is_dir() {
        return Err(SceneError::write(
            path,
            std::io::ErrorKind::IsADirectory.into(),
        ));
    }
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(file_name);
    temporary_name.push(format!(
        ".{}.{}.partial",
        std::process::id(),
        COUNTER.fetch_add(1, Ordering::Relaxed)
    ));
    let temporary = path.with_file_name(temporary_name);
    let write = || -> std::io::Result<()> {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        drop(file);
        fs::rename(&temporary, path)
    };
    write().map_err(|error| {
        // The first error is the one to report; a leftover that cannot be removed is no second one.
        let _ = fs::remove_file(&temporary);
        SceneError::write(path, error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_whole_files_and_cleans_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_atomic(&path, b"one").unwrap();
        write_atomic(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        let missing = folder.path().join("no/such/a.bin");
        let message = write_atomic(&missing, b"x").unwrap_err().to_string();
        assert!(message.contains("no/such/a.bin"), "{message}");
        assert!(write_atomic(folder.path(), b"x").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
