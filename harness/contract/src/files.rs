//! Reading without waiting, and files that are either complete or absent.

use crate::failure::Failure;
use ::files::Draft;
use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use tempfile::TempDir;

pub use ::files::{append_log, read, read_log, read_text, write_atomically};

/// Like [`write_atomically`], for files that are not written from the beginning to the end. Returns the number of bytes.
///
/// # Errors
/// If the file cannot be written, or with whatever `fill` returns.
pub fn fill_atomically(
    path: &Path,
    fill: impl FnOnce(&mut File) -> Result<(), Failure>,
) -> Result<u64, Failure> {
    let named = |error| Failure::at(path, error);
    let mut draft = Draft::create(path).map_err(named)?;
    fill(draft.file_mut())?;
    let bytes = draft.file_mut().metadata().map_err(named)?.len();
    draft.publish().map_err(named)?;
    Ok(bytes)
}

/// What [`write_together`] writes into a file.
pub type Content<'a> = &'a dyn Fn(&mut dyn Write) -> io::Result<()>;

/// Like [`write_atomically`], for several files that are complete or absent together.
///
/// # Errors
/// If a file cannot be written.
pub fn write_together(files: &[(&Path, Content<'_>)]) -> Result<(), Failure> {
    let draft = |(path, fill): &(&Path, Content<'_>)| {
        let mut out = BufWriter::new(Draft::create(path)?);
        fill(&mut out)?;
        let draft = out.into_inner()?;
        draft.synchronise()?;
        Ok(draft)
    };
    let failed = |path: &Path, error| Failure::at(path, error);
    let drafts = files.iter().map(|file| draft(file).map_err(|error| failed(file.0, error)));
    let drafts = drafts.collect::<Result<Vec<Draft>, Failure>>()?;
    let _publication = publications();
    let mut drafts = files.iter().zip(drafts);
    drafts.try_for_each(|((path, _), draft)| draft.publish().map_err(|error| failed(path, error)))
}

/// Directories that an interrupt removes.
static STAGED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Waits until no output is given its final names, and prevents that as long as the result exists. Returns the directories that are
/// being filled, or must not outlive an interrupt for another reason; those that were published or removed may remain in the list.
pub fn publications() -> MutexGuard<'static, Vec<PathBuf>> {
    STAGED.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// A directory that is being filled beside its final place. It is deleted when it is dropped, or when the user interrupts.
#[derive(Debug)]
pub struct Staging(TempDir);

impl Staging {
    /// An empty directory in the same directory as `path`.
    ///
    /// # Errors
    /// If the directory is missing or not writable.
    pub fn beside(path: &Path) -> io::Result<Self> {
        Self::inside(directory_of(path))
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

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The nearest directory above a path that exists.
pub fn nearest_directory(path: &Path) -> &Path {
    path.ancestors().map(directory_of).find(|dir| dir.is_dir()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_written_together_replace_older_ones_only_if_all_can_be_written() {
        let place = tempfile::tempdir().unwrap();
        let [first, second] = ["first", "second"].map(|name| place.path().join(name));
        let fail = std::cell::Cell::new(true);
        let write = || {
            let content: [(&Path, Content<'_>); 2] = [
                (&first, &|out| out.write_all(b"new")),
                (&second, &|out| match fail.get() {
                    true => Err(io::Error::other("full")),
                    false => out.write_all(b"new"),
                }),
            ];
            write_together(&content).map_err(|failure| failure.why)
        };
        fs::write(&first, "old").unwrap();
        assert_eq!(write(), Err(format!("{}: full", second.display())));
        assert_eq!(fs::read(&first).unwrap(), b"old");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
        fail.set(false);
        assert_eq!(write(), Ok(()));
        assert!([&first, &second].iter().all(|path| fs::read(path).unwrap() == b"new"));
    }

    #[test]
    fn a_staged_directory_is_removed_unless_it_is_moved() {
        assert_eq!(
            ["a/b", "b", "/b"].map(|path| directory_of(Path::new(path))),
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
