//! Single files.

use crate::interrupt::uninterrupted;
use crate::unfinished::{self, Output, Unfinished};
use crate::uses::register_output;
use rustix::fs::{CWD, RenameFlags, renameat, renameat_with};
use rustix::io::Errno;
use std::ffi::{CStr, CString};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use tempfile::{Builder, TempPath};

/// A file that is being written, removed if it is dropped before [`publish`](Self::publish).
#[derive(Debug)]
pub struct Draft {
    place: Place,
    file: File,
}

#[derive(Debug)]
enum Place {
    /// Written under a temporary name in the same directory.
    Beside { draft: TempPath, entry: Unfinished, path: PathBuf },
    /// A file of a claimed directory, under a temporary name; the claim removes it.
    Claimed { dir: OwnedFd, draft: CString, name: CString },
    /// Not a regular file: written directly.
    Through,
}

/// The kind of file that a path leads to.
enum Destination {
    /// A regular file, or none yet, at this path without symbolic links.
    Regular(PathBuf),
    /// Any other.
    Special(OwnedFd),
}

impl Draft {
    /// Begins the file `path`. A regular file is replaced when it is published. A symbolic link stays: the file that it leads to is
    /// replaced. Whatever else the path leads to is written through: devices, FIFOs, sockets, and the standard output and error, even
    /// if they are regular files.
    ///
    /// # Errors
    /// If the file is a directory or an input of this run, or cannot be created or opened.
    pub fn create(path: &Path) -> io::Result<Self> {
        register_output(path)?;
        match destination(path)? {
            Destination::Special(file) => Ok(Self { place: Place::Through, file: file.into() }),
            Destination::Regular(path) => uninterrupted(|| Self::beside(path)),
        }
    }

    fn beside(path: PathBuf) -> io::Result<Self> {
        // As for any other file, the user's umask decides who may read it.
        let mut options = OpenOptions::new();
        options.write(true).create_new(true).mode(0o666);
        // An error from here names no temporary file, unlike those of `tempfile_in`.
        let folder = folder_of(&path);
        if !folder.is_dir() {
            let why = format!("{} is not a directory: create it", folder.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, why));
        }
        let file = Builder::new().make_in(folder, |draft| options.open(draft))?;
        let (file, draft) = file.into_parts();
        let (from, to) = (c_string(&draft)?, c_string(&path)?);
        let output = Output {
            dir: CWD.as_raw_fd(),
            names: [from, to],
            file: file.as_raw_fd(),
            others: Vec::new(),
            created: None,
        };
        Ok(Self { place: Place::Beside { entry: Unfinished::new(output), draft, path }, file })
    }

    /// A file in a claimed directory.
    pub(crate) fn claimed(file: File, dir: OwnedFd, draft: CString, name: CString) -> Self {
        Self { place: Place::Claimed { dir, draft, name }, file }
    }

    /// The file, to write or to seek in; what is not a regular file may not allow the latter.
    pub fn file_mut(&mut self) -> &mut File {
        &mut self.file
    }

    /// Synchronises the file with the disk, so that publishing it takes no time.
    ///
    /// # Errors
    /// If that fails.
    pub fn synchronise(&self) -> io::Result<()> {
        match self.place {
            Place::Through => Ok(()),
            _ => self.file.sync_all(),
        }
    }

    /// Synchronises the file with the disk and gives it its final name.
    ///
    /// # Errors
    /// If that fails; the file is removed.
    pub fn publish(self) -> io::Result<()> {
        let Self { place, file } = self;
        match place {
            Place::Through => {}
            Place::Claimed { dir, draft, name } => {
                file.sync_all()?;
                rename_to_new(dir.as_fd(), &draft, &name)?;
            }
            Place::Beside { entry, draft, path } => {
                file.sync_all()?;
                draft.persist(&path).map_err(|e| e.error)?;
                unfinished::complete(true);
                // The handler compares the final name with the open file until here.
                drop(entry);
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

/// Renames a file in a directory, without replacing another.
pub(crate) fn rename_to_new(dir: BorrowedFd, from: &CStr, to: &CStr) -> io::Result<()> {
    match renameat_with(dir, from, dir, to, RenameFlags::NOREPLACE) {
        // Some network file systems cannot. The claim excludes other runs.
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => Ok(renameat(dir, from, dir, to)?),
        result => Ok(result?),
    }
}

fn destination(path: &Path) -> io::Result<Destination> {
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            // A symbolic link may lead to a file that does not exist yet.
            let mut path = path.to_owned();
            while let Ok(next) = fs::read_link(&path) {
                path = folder_of(&path).join(next);
            }
            return Ok(Destination::Regular(path));
        }
        Err(e) => return Err(e),
    };
    let kind = found.file_type();
    if kind.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if let Some(stream) = standard_stream(&found) {
        return Ok(Destination::Special(stream));
    }
    if kind.is_file() {
        return Ok(Destination::Regular(fs::canonicalize(path)?));
    }
    Ok(Destination::Special(match kind.is_socket() {
        true => UnixStream::connect(path)?.into(),
        false => OpenOptions::new().write(true).open(path)?.into(),
    }))
}

/// The standard output or error, if that is the file: opening `/dev/stdout` again would overwrite what has been printed.
fn standard_stream(file: &Metadata) -> Option<OwnedFd> {
    let (out, err) = (io::stdout(), io::stderr());
    [out.as_fd(), err.as_fd()].into_iter().find_map(|stream| {
        let open = rustix::fs::fstat(stream).ok()?;
        let is_same = (open.st_dev, open.st_ino) == (file.dev(), file.ino());
        is_same.then(|| stream.try_clone_to_owned().ok())?
    })
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

pub(crate) fn c_string(path: &Path) -> io::Result<CString> {
    Ok(CString::new(path.as_os_str().as_bytes())?)
}
