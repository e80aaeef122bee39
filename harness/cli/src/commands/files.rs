//! Writing files.

use contract::files::{named, write_atomically};
use rustix::fs::{Access, access};
use std::path::Path;
use std::{fs, io};

/// Creates the missing parent directories of a file, and refuses one that could not be written after a long run.
///
/// # Errors
/// The file's name and the reason.
pub fn prepare(path: &Path) -> io::Result<()> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let directory = directory.unwrap_or(Path::new("."));
    let writable = || {
        if path.is_dir() {
            return Err(io::Error::other("it is a directory: give a file"));
        }
        fs::create_dir_all(directory)?;
        // A trial file would remain if a signal arrived at that moment.
        Ok(access(directory, Access::WRITE_OK | Access::EXEC_OK)?)
    };
    writable().map_err(|error| named(path, &error))
}

/// Writes a file and creates its missing parent directories.
///
/// # Errors
/// The file's name and the reason.
pub fn put(path: &Path, text: &str) -> io::Result<()> {
    let make = || {
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory)?;
        }
        write_atomically(path, |out| out.write_all(text.as_bytes()))
    };
    make().map_err(|error| named(path, &error))
}
