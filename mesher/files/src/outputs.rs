//! Outputs: single files, and directories of files that belong to one run.
//!
//! Invariants of a claimed directory:
//! - the claim is a file, created only if it does not exist, in a directory that has no other. So two runs never write to one directory;
//! - the claim becomes the last file of the directory by a rename, with which all files are complete. A process of the run that gives
//!   up removes the claim, so that the rename fails;
//! - a run removes files only in the directory that it opened, and only under the names that it gave when it claimed.

use crate::unfinished::{Output, Unfinished, locked, open_file, rename_to_new};
use crate::uses::{folder_of, register_output, target};
use rustix::fs::{AtFlags, CWD, Mode, OFlags, RawDir, fsync, mkdirat, openat, renameat, unlinkat};
use rustix::io::Errno;
use rustix::stdio::{stderr, stdout};
use std::ffi::{CStr, CString};
use std::fs::{self, File, Metadata, OpenOptions};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// A file that is being written, removed if it is dropped before [`publish`](Self::publish).
#[derive(Debug)]
pub struct Draft {
    /// To write or to seek in; what is not a regular file may not allow the latter.
    pub file: File,
    /// None for what is not a regular file: it is written directly.
    place: Option<Place>,
}

#[derive(Debug)]
enum Place {
    /// Written under a temporary name in the same directory.
    Beside(Unfinished),
    /// A file of a claimed directory, under a temporary name; the claim removes it.
    Claimed { dir: OwnedFd, names: [CString; 2] },
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
            return Ok(Self { file, place: None });
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
        Ok(Self { file, place: Some(Place::Beside(unfinished)) })
    }

    /// Synchronises the file with the disk and gives it its final name.
    ///
    /// # Errors
    /// If that fails; the file is removed.
    pub fn publish(self) -> io::Result<()> {
        let Some(place) = self.place else { return Ok(()) };
        self.file.sync_all()?;
        match place {
            Place::Claimed { dir, names } => locked(|| rename_to_new(&dir, &names))?,
            Place::Beside(unfinished) => {
                unfinished.publish(|o| renameat(&o.dir, &o.names[0], &o.dir, &o.names[1]))?;
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

/// The standard output or error, if that is the file: opening `/dev/stdout` again would overwrite what has been printed.
fn standard_stream(file: &Metadata) -> Option<OwnedFd> {
    [stdout(), stderr()].into_iter().find_map(|stream| {
        let open = rustix::fs::fstat(stream).ok()?;
        let is_same = (open.st_dev, open.st_ino) == (file.dev(), file.ino());
        is_same.then(|| stream.try_clone_to_owned().ok())?
    })
}

/// A directory that this run alone writes to. All its files are removed if this is dropped before [`keep`](Self::keep), and the
/// directory as well if it is new.
#[derive(Debug)]
pub struct Claim {
    unfinished: Unfinished,
    /// The file that becomes the last one.
    last: File,
    /// Whether the directory was created for this run.
    pub is_new: bool,
}

/// The temporary and the final name of a file.
fn names_of(name: &str) -> [CString; 2] {
    [format!("{name}.draft"), name.to_owned()]
        .map(|name| CString::new(name).expect("output files have names without NUL"))
}

impl Claim {
    /// Claims a directory, which must be empty or not exist; its parent must exist. In one process of the run. `last` is the name of
    /// the file that is written last, `others` are the names of all others that this and other processes will write.
    ///
    /// # Errors
    /// If another run has claimed it or it is not empty, of the kind `DirectoryNotEmpty`; or if it cannot be created or written to.
    pub fn create(path: &Path, last: &str, others: Vec<String>) -> io::Result<Self> {
        let why = match Self::begin(path, last, others, Self::make) {
            Err(Errno::EXIST) => "another run is writing to this directory, or was killed doing so",
            Err(Errno::NOTEMPTY) => "the directory is not empty",
            claim => return Ok(claim?),
        };
        Err(io::Error::new(io::ErrorKind::DirectoryNotEmpty, why))
    }

    /// The claim that another process of this run has created. `others` are names of files that this process removes if it gives up.
    ///
    /// # Errors
    /// If the directory cannot be opened.
    pub fn join(path: &Path, last: &str, others: Vec<String>, is_new: bool) -> io::Result<Self> {
        let open = |path: &CStr, claim: &CStr| Ok((open(path, claim, OFlags::empty())?, is_new));
        Ok(Self::begin(path, last, others, open)?)
    }

    fn begin(
        path: &Path,
        last: &str,
        others: Vec<String>,
        open: impl FnOnce(&CStr, &CStr) -> Result<(Opened, bool), Errno>,
    ) -> Result<Self, Errno> {
        let path = CString::new(path.as_os_str().as_bytes()).map_err(|_| Errno::INVAL)?;
        let names = names_of(last);
        let others: Vec<CString> = others.iter().flat_map(|name| names_of(name)).collect();
        let (unfinished, (last, is_new)) = Unfinished::begin(|| {
            let ((dir, last, id), is_new) = open(&path, &names[0])?;
            Ok((Output { dir, names, id, others, created: is_new.then_some(path) }, (last, is_new)))
        })?;
        Ok(Self { unfinished, last, is_new })
    }

    /// Creates a claim, and its directory if it does not exist. Returns whether it did not.
    fn make(path: &CStr, claim: &CStr) -> Result<(Opened, bool), Errno> {
        let is_new = match mkdirat(CWD, path, Mode::from(0o777)) {
            Err(Errno::EXIST) => false,
            made => made.map(|()| true)?,
        };
        let opened = open(path, claim, OFlags::CREATE | OFlags::EXCL).and_then(|opened| {
            let dir = &opened.0;
            is_alone(dir).inspect_err(|_| _ = unlinkat(dir, claim, AtFlags::empty()))?;
            Ok(opened)
        });
        if opened.is_err() && is_new {
            // One that another run has claimed since then is not empty, and stays.
            let _ = unlinkat(CWD, path, AtFlags::REMOVEDIR);
        }
        opened.map(|opened| (opened, is_new))
    }

    /// Begins a file of the directory.
    ///
    /// # Errors
    /// If it exists or cannot be created.
    pub fn draft(&self, name: &str) -> io::Result<Draft> {
        let (dir, names) = (self.unfinished.dir()?, names_of(name));
        let (file, _) = locked(|| open_file(&dir, &names[0], OFlags::CREATE | OFlags::EXCL))?;
        Ok(Draft { file, place: Some(Place::Claimed { dir, names }) })
    }

    /// Writes the last file. In one process of the run, after all others have published their files.
    ///
    /// # Errors
    /// If the file cannot be written, or another process of the run has given up.
    pub fn commit(&self, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
        let mut out = BufWriter::new(&self.last);
        fill(&mut out)?;
        out.into_inner()?.sync_all()?;
        self.unfinished.publish(|Output { dir, names, .. }| {
            rename_to_new(dir, names)?;
            match fsync(dir) {
                // Some network file systems cannot.
                Err(Errno::INVAL) => Ok(()),
                // Without its last file the directory is unfinished, and will be removed.
                synchronised => {
                    synchronised.inspect_err(|_| _ = unlinkat(dir, &names[1], AtFlags::empty()))
                }
            }
        })
    }

    /// Keeps the files. In every process of the run, after [`commit`](Self::commit).
    pub fn keep(self) {
        self.unfinished.keep();
    }
}

/// A directory, the file of a claim, and its device and inode.
type Opened = (OwnedFd, File, (u64, u64));

fn open(path: &CStr, claim: &CStr, flags: OFlags) -> Result<Opened, Errno> {
    let dir = openat(CWD, path, OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
    let (file, id) = open_file(&dir, claim, flags)?;
    Ok((dir, file, id))
}

/// Finds out that a directory has an entry besides the claim.
fn is_alone(dir: &OwnedFd) -> Result<(), Errno> {
    let mut buffer = [MaybeUninit::uninit(); 2048];
    let mut entries = RawDir::new(dir, &mut buffer);
    let mut others = 0;
    while let Some(entry) = entries.next() {
        others += usize::from(![c".", c".."].contains(&entry?.file_name()));
    }
    if others > 1 { Err(Errno::NOTEMPTY) } else { Ok(()) }
}
