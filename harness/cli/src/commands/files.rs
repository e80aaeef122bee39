//! Writing files.

use contract::files::{named, write_atomically};
use std::path::Path;
use std::{fs, io};

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
