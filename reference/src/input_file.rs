//! Reading input files.

use crate::error::Error;
use std::io;
use std::path::Path;

/// The bytes of a regular file. A pipe could wait for a writer forever, and a device has no end.
///
/// # Errors
/// It is not a regular file, or cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let bytes = || match std::fs::metadata(path)?.is_file() {
        true => std::fs::read(path),
        false => Err(io::Error::other("it is a directory, a pipe or a device")),
    };
    bytes().map_err(|source| Error::Read { path: path.to_owned(), source })
}
