//! Reading without waiting, and files that are either complete or absent.

use std::fs::{self, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

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

/// Writes a file so that no reader and no crash ever leaves a partial one at `path`: `write` fills a temporary
/// file in the same directory, which is flushed to disk and then renamed. An existing file is replaced.
///
/// # Errors
/// If the directory is not writable, or with whatever `write` returns; `path` is untouched in both cases.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    // The mode of an ordinary new file, which the umask restricts: temporary files are private by default.
    let mut builder = tempfile::Builder::new();
    let mut file = builder.permissions(Permissions::from_mode(0o666)).tempfile_in(directory)?;
    let mut buffer = BufWriter::new(file.as_file_mut());
    write(&mut buffer)?;
    buffer.flush()?;
    drop(buffer);
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|error| error.error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        let failed = write_atomically(&path, |out| {
            out.write_all(b"new")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
        write_atomically(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }
}
