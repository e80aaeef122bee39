//! Single files.

use crate::unfinished::{Output, Unfinished, locked, open_file, rename_to_new};
use crate::uses::register_output;
use rustix::fs::{CWD, Mode, OFlags, openat, renameat};
use rustix::stdio::{stderr, stdout};
use std::ffi::CString;
use std::fs::{self, File, Metadata, OpenOptions};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file that is being written, removed if it is dropped before [`publish`](Self::publish).
#[derive(Debug)]
pub struct Draft {
    /// To write or to seek in; what is not a regular file may not allow the latter.
    pub file: File,
    place: Place,
}

#[derive(Debug)]
enum Place {
    /// Written under a temporary name in the same directory.
    Beside(Unfinished),
    /// A file of a claimed directory, under a temporary name; the claim removes it.
    Claimed { dir: OwnedFd, names: [CString; 2] },
    /// Not a regular file: written directly.
    Through,
}

impl Draft {
    /// Begins the file `path`. A regular file is replaced when it is published. A symbolic link stays: the file that it leads to is
    /// replaced. Whatever else the path leads to is written through: devices, FIFOs, and the standard output and error, even
    /// if they are regular files.
    ///
    /// # Errors
    /// If the file is a directory or an input of this run, or cannot be created or opened.
    pub fn create(path: &Path) -> io::Result<Self> {
        register_output(path)?;
        if let Some(file) = special(path)? {
            return Ok(Self { file, place: Place::Through });
        }
        let path = target(path);
        let folder = folder_of(&path);
        if !folder.is_dir() {
            let why = format!("{} is not a directory: create it", folder.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, why));
        }
        let dir =
            openat(CWD, folder, OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
        let random = RandomState::new().hash_one(0);
        let name = path.file_name().unwrap_or_default().as_bytes();
        let names = [CString::new(format!(".{random:016x}.draft"))?, CString::new(name)?];
        let (unfinished, file) = Unfinished::begin(|| {
            let (file, id) = open_file(&dir, &names[0], OFlags::CREATE | OFlags::EXCL)?;
            Ok((Output { dir, names, id, others: Vec::new(), created: None }, file))
        })?;
        Ok(Self { file, place: Place::Beside(unfinished) })
    }

    /// A file of a claimed directory with a temporary and a final name.
    pub(crate) fn claimed(dir: OwnedFd, names: [CString; 2]) -> io::Result<Self> {
        let file = locked(|| open_file(&dir, &names[0], OFlags::CREATE | OFlags::EXCL))?.0;
        Ok(Self { file, place: Place::Claimed { dir, names } })
    }

    /// Synchronises the file with the disk and gives it its final name.
    ///
    /// # Errors
    /// If that fails; the file is removed.
    pub fn publish(self) -> io::Result<()> {
        if !matches!(self.place, Place::Through) {
            self.file.sync_all()?;
        }
        match self.place {
            Place::Through => {}
            Place::Claimed { dir, names } => locked(|| rename_to_new(&dir, &names))?,
            Place::Beside(unfinished) => {
                unfinished.publish(|Output { dir, names: [from, to], .. }| {
                    renameat(dir, from, dir, to)
                })?;
                unfinished.keep();
            }
        }
        Ok(())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Draft {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Writes a whole file: what `fill` writes appears at `path` complete or not at all, if that is a regular file. See
/// [`Draft::create`] for others.
///
/// # Errors
/// If the file cannot be written, or with whatever `fill` returns; then a regular file is untouched.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::new(Draft::create(path)?);
    fill(&mut out)?;
    out.into_inner()?.publish()
}

/// Finds out early whether a file can be written, without leaving anything: a process that is killed cannot remove its drafts. What is
/// not a regular file is not opened, as its reader would notice.
///
/// # Errors
/// As [`Draft::create`].
pub fn check_writable(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() && !found.is_dir() => Ok(()),
        _ => Draft::create(path).map(drop),
    }
}

/// The file that is written through at this path; none if it is a regular file, or does not exist.
fn special(path: &Path) -> io::Result<Option<File>> {
    let found = match fs::metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        found => found?,
    };
    let stream = standard_stream(&found);
    if found.is_dir() {
        Err(io::ErrorKind::IsADirectory.into())
    } else if stream.is_some() || found.is_file() {
        Ok(stream.map(File::from))
    } else {
        OpenOptions::new().write(true).open(path).map(Some)
    }
}

/// The file that symbolic links lead to, which may not exist yet.
fn target(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    while let Ok(next) = fs::read_link(&path) {
        path = folder_of(&path).join(next);
    }
    path
}

/// The standard output or error, if that is the file: opening `/dev/stdout` again would overwrite what has been printed.
fn standard_stream(file: &Metadata) -> Option<OwnedFd> {
    [stdout(), stderr()].into_iter().find_map(|stream| {
        let open = rustix::fs::fstat(stream).ok()?;
        let is_same = (open.st_dev, open.st_ino) == (file.dev(), file.ino());
        is_same.then(|| stream.try_clone_to_owned().ok())?
    })
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
