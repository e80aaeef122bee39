//! Reading without waiting, and files that are either complete or absent.

use ::files::Draft;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use tempfile::TempDir;

/// Reads a regular file. A pipe could wait for a writer forever, and a device has no end.
///
/// # Errors
/// If it is no regular file, or cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    refuse_special(path)?;
    fs::read(path)
}

/// Reads a regular file of text.
///
/// # Errors
/// If it is no regular file, cannot be read, or is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    refuse_special(path)?;
    fs::read_to_string(path)
}

/// Refuses what is there and is no regular file.
///
/// # Errors
/// If it is a directory, a pipe or a device, or missing.
pub fn refuse_special(path: &Path) -> io::Result<()> {
    match fs::metadata(path)?.is_file() {
        true => Ok(()),
        false => Err(io::Error::other("it is a directory, a pipe or a device: give a file")),
    }
}

pub use ::files::write_atomically;

/// An error that names the file.
pub fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// Like [`write_atomically`], for files that are not written from the beginning to the end.
///
/// # Errors
/// If the file cannot be written, through `failed`, or with whatever `fill` returns.
pub fn fill_atomically<T, E>(
    path: &Path,
    failed: impl Fn(io::Error) -> E,
    fill: impl FnOnce(&mut File) -> Result<T, E>,
) -> Result<T, E> {
    let mut draft = Draft::create(path).map_err(&failed)?;
    let result = fill(draft.file_mut())?;
    draft.publish().map_err(failed)?;
    Ok(result)
}

/// An empty directory in the same directory as `path`, which is deleted when it is dropped.
///
/// # Errors
/// If the directory is not writable.
pub fn temporary_directory(path: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.permissions(Permissions::from_mode(0o777)).tempdir_in(directory_of(path))
}

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
