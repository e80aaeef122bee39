//! Reading input files.

use crate::error::Error;
use std::path::Path;

/// The bytes of a regular file.
///
/// # Errors
/// It is not a regular file, is an output of this run, or cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    files::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })
}
