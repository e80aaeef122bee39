//! Writing files.

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
        fs::write(path, text)
    };
    make().map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}
