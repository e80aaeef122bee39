//! Files that appear complete or not at all.

use serde::Serialize;
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile};

/// A file under a temporary name in the directory of its final one. Removed if it is dropped before
/// [`publish`](Self::publish).
#[derive(Debug)]
pub struct Draft {
    path: PathBuf,
    file: NamedTempFile,
}

impl Draft {
    /// Creates the temporary file for a file with the final name `path`, which must be no directory.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        if path.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // As for any other file, the user's umask decides who may read it.
        let permissions = std::fs::Permissions::from_mode(0o666);
        let file = Builder::new().permissions(permissions).tempfile_in(folder)?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Synchronises the file with the disk and renames it to its final name.
    ///
    /// # Errors
    /// If that fails; the file is removed.
    pub fn publish(self) -> io::Result<()> {
        self.file.as_file().sync_all()?;
        self.file.persist(&self.path).map_err(|e| e.error)?;
        Ok(())
    }

    /// Writes `value` as JSON with a final newline, and publishes the file.
    ///
    /// # Errors
    /// As [`publish`](Self::publish).
    pub fn publish_json(mut self, value: &impl Serialize) -> io::Result<()> {
        let mut buffer = io::BufWriter::new(&mut self.file);
        serde_json::to_writer_pretty(&mut buffer, value)?;
        buffer.write_all(b"\n")?;
        buffer.into_inner()?;
        self.publish()
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Draft {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
