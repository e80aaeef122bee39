//! Directories of files that belong to one run.
//!
//! Invariants:
//! - the claim is a file, created only if it does not exist, in a directory that has no other. So two runs never write to one directory;
//! - the claim becomes the last file of the directory by a rename, with which all files are complete. A process of the run that gives
//!   up removes the claim, so that the rename fails;
//! - a run removes files only in the directory that it opened, and only under the names that it gave when it claimed.

use crate::draft::{Draft, c_string, rename_to_new};
use crate::interrupt::uninterrupted;
use crate::unfinished::{self, Output, Unfinished};
use rustix::fs::{AtFlags, CWD, Mode, OFlags, openat, unlinkat};
use rustix::io::Errno;
use std::ffi::CString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::path::Path;
use thiserror::Error;

/// A directory that this run alone writes to. All its files are removed if this is dropped before [`keep`](Self::keep), and the
/// directory as well if it is new.
#[derive(Debug)]
pub struct Claim {
    entry: Unfinished,
    dir: OwnedFd,
    /// The file that becomes the last one, and its temporary and its final name.
    last: (File, [CString; 2]),
    is_new: bool,
    is_kept: bool,
}

/// The reason why a directory cannot be claimed.
#[derive(Debug, Error)]
pub enum ClaimError {
    /// Another run has claimed it.
    #[error("another run is writing to this directory, or was killed while it did")]
    Claimed,
    /// It contains files.
    #[error("the directory is not empty")]
    NotEmpty,
    /// It cannot be created or written to.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl From<Errno> for ClaimError {
    fn from(e: Errno) -> Self {
        Self::Io(e.into())
    }
}

impl From<ClaimError> for io::Error {
    fn from(e: ClaimError) -> Self {
        match e {
            ClaimError::Io(e) => e,
            taken => {
                Self::new(io::ErrorKind::DirectoryNotEmpty, format!("{taken}: choose another"))
            }
        }
    }
}

/// Suffix of temporary names.
const DRAFT: &str = ".draft";
/// How often a directory is created that another run removes at the same time.
const ATTEMPTS: usize = 100;

/// The temporary and the final name of a file.
fn names_of(name: &str) -> [CString; 2] {
    [format!("{name}{DRAFT}"), name.to_owned()]
        .map(|name| CString::new(name).expect("output files have names without NUL"))
}

/// Whether a directory has a single entry.
fn is_alone(path: &Path) -> io::Result<bool> {
    let mut entries = fs::read_dir(path)?;
    entries.next().transpose()?;
    Ok(entries.next().transpose()?.is_none())
}

impl Claim {
    /// Claims a directory, which must be empty or not exist; its parent must exist. In one process of the run. `last` is the name of
    /// the file that is written last, `others` are the names of all others that this and other processes will write.
    ///
    /// # Errors
    /// If another run has claimed it, or it is not empty, or cannot be created or written to.
    pub fn create(
        path: &Path,
        last: &str,
        others: impl IntoIterator<Item = String>,
    ) -> Result<Self, ClaimError> {
        uninterrupted(|| {
            for _ in 0..ATTEMPTS {
                let is_new = match fs::create_dir(path) {
                    Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(e.into()),
                    created => created.is_ok(),
                };
                // A directory that another run has claimed since then is not empty, and stays.
                let give_up = |error| {
                    if is_new {
                        let _ = fs::remove_dir(path);
                    }
                    Err(error)
                };
                match Self::open(path, last, OFlags::CREATE | OFlags::EXCL) {
                    // Another run has removed the directory since then.
                    Err(Errno::NOENT) => {}
                    Err(Errno::EXIST) => return Err(ClaimError::Claimed),
                    Err(e) => return give_up(e.into()),
                    Ok((dir, file)) => {
                        let names = names_of(last);
                        let is_alone = is_alone(path);
                        if let Ok(true) = is_alone {
                            return Ok(Self::new(path, dir, (file, names), others, is_new)?);
                        }
                        let _ = unlinkat(&dir, &names[0], AtFlags::empty());
                        return give_up(is_alone.map_or_else(Into::into, |_| ClaimError::NotEmpty));
                    }
                }
            }
            Err(Errno::NOENT.into())
        })
    }

    /// The claim that another process of this run has created. `others` are names of files that this process removes if it gives up.
    ///
    /// # Errors
    /// If the directory cannot be opened.
    pub fn join(
        path: &Path,
        last: &str,
        others: impl IntoIterator<Item = String>,
        is_new: bool,
    ) -> io::Result<Self> {
        uninterrupted(|| {
            let (dir, file) = Self::open(path, last, OFlags::empty())?;
            Self::new(path, dir, (file, names_of(last)), others, is_new)
        })
    }

    fn open(path: &Path, last: &str, flags: OFlags) -> Result<(OwnedFd, File), Errno> {
        let always = OFlags::CLOEXEC;
        let dir = openat(CWD, path, OFlags::DIRECTORY | always, Mode::empty())?;
        let claim = &names_of(last)[0];
        let file = openat(&dir, claim, OFlags::WRONLY | always | flags, Mode::from(0o666))?;
        Ok((dir, file.into()))
    }

    fn new(
        path: &Path,
        dir: OwnedFd,
        last: (File, [CString; 2]),
        others: impl IntoIterator<Item = String>,
        is_new: bool,
    ) -> io::Result<Self> {
        let entry = Unfinished::new(Output {
            dir: dir.as_raw_fd(),
            created: is_new.then(|| c_string(path)).transpose()?,
            names: last.1.clone(),
            file: last.0.as_raw_fd(),
            others: others.into_iter().flat_map(|name| names_of(&name)).collect(),
        });
        Ok(Self { entry, dir, last, is_new, is_kept: false })
    }

    /// Whether the directory was created for this run.
    pub fn is_new(&self) -> bool {
        self.is_new
    }

    /// Begins a file of the directory.
    ///
    /// # Errors
    /// If it exists or cannot be created.
    pub fn draft(&self, name: &str) -> io::Result<Draft> {
        let [draft, name] = names_of(name);
        let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | OFlags::CLOEXEC;
        let file = openat(&self.dir, &draft, flags, Mode::from(0o666))?;
        Ok(Draft::claimed(file.into(), self.dir.try_clone()?, draft, name))
    }

    /// Writes the last file. In one process of the run, after all others have published their files.
    ///
    /// # Errors
    /// If the file cannot be written, or another process of the run has given up.
    pub fn commit(&self, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
        let (file, [draft, name]) = &self.last;
        let mut out = BufWriter::new(file);
        fill(&mut out)?;
        out.into_inner()?.sync_all()?;
        rename_to_new(self.dir.as_fd(), draft, name)?;
        match rustix::fs::fsync(&self.dir) {
            // Some network file systems cannot.
            Ok(()) | Err(Errno::INVAL) => unfinished::complete(true),
            Err(e) => {
                // Without its last file the directory is unfinished, and will be removed.
                let _ = unlinkat(&self.dir, name, AtFlags::empty());
                return Err(e.into());
            }
        }
        Ok(())
    }

    /// Keeps the files. In every process of the run, after [`commit`](Self::commit).
    pub fn keep(mut self) {
        unfinished::complete(true);
        self.is_kept = true;
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if !self.is_kept {
            self.entry.abandon();
        }
    }
}
