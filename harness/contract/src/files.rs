//! Reading without waiting, and files that are either complete or absent.

use crate::failure::{Failure, Result};
use ::files::{Draft, folder_of};
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use tempfile::TempDir;

pub use ::files::{append_log, read, read_log, read_text, write_atomically};

/// Like [`write_atomically`], for files that are not written from the beginning to the end. Returns the number of bytes.
///
/// # Errors
/// If the file cannot be written, or with whatever `fill` returns.
pub fn fill_atomically(path: &Path, fill: impl FnOnce(&mut File) -> Result<()>) -> Result<u64> {
    let named = |error| Failure::at(path, error);
    let mut draft = Draft::create(path).map_err(named)?;
    fill(&mut draft.file)?;
    let bytes = draft.file.metadata().map_err(named)?.len();
    draft.publish().map_err(named)?;
    Ok(bytes)
}

/// Directories that an interrupt removes.
static STAGED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Waits until no output is given its final names, and prevents that as long as the result exists. Returns the directories that are
/// being filled, or must not outlive an interrupt for another reason; those that were published or removed may remain in the list.
pub fn publications() -> MutexGuard<'static, Vec<PathBuf>> {
    STAGED.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// A directory that is being filled beside its final place. It is deleted when it is dropped, or when the user interrupts.
pub struct Staging(TempDir);

impl Staging {
    /// An empty directory in the same directory as `path`.
    ///
    /// # Errors
    /// If the directory is missing or not writable.
    pub fn beside(path: &Path) -> io::Result<Self> {
        Self::inside(folder_of(path))
    }

    /// An empty directory in this one.
    ///
    /// # Errors
    /// If this one is missing or not writable.
    pub fn inside(directory: &Path) -> io::Result<Self> {
        // An interrupt waits until the directory is known.
        let mut staged = publications();
        // Errors of `tempdir_in` name the temporary directory, which means nothing to the user.
        fs::metadata(directory)?;
        let mut builder = tempfile::Builder::new();
        let dir = builder.permissions(Permissions::from_mode(0o777)).tempdir_in(directory);
        let dir = dir.map_err(|error| error.kind())?;
        staged.push(dir.path().to_owned());
        ::files::interrupt::stop_at(format_args!("staged"));
        Ok(Self(dir))
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Lets `publish` move the content to its final names, or the directory itself. An interrupt waits meanwhile.
    ///
    /// # Errors
    /// With whatever `publish` returns.
    pub fn publish<T, E>(&self, publish: impl FnOnce(&Path) -> Result<T, E>) -> Result<T, E> {
        let _publication = publications();
        publish(self.path())
    }
}

/// The nearest directory above a path that exists.
pub fn nearest_directory(path: &Path) -> &Path {
    path.ancestors().map(folder_of).find(|dir| dir.is_dir()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staged_directory_is_removed_unless_it_is_moved() {
        assert_eq!(
            ["a/b", "b", "/b"].map(|path| folder_of(Path::new(path))),
            ["a", ".", "/"].map(Path::new)
        );
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("absent/target");
        assert_eq!(nearest_directory(&target), place.path());
        drop(Staging::inside(place.path()).unwrap());
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
        let staging = Staging::inside(place.path()).unwrap();
        fs::write(staging.path().join("file"), "").unwrap();
        let moved = place.path().join("target");
        staging.publish(|staged| fs::rename(staged, &moved)).unwrap();
        drop(staging);
        assert!(moved.join("file").exists());
    }
}
