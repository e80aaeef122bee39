//! Directories of files that belong to one run.
//!
//! Invariants:
//! - the claim is a file, created only if it does not exist, in a directory that has no other. So two runs never write to one directory;
//! - the claim becomes the last file of the directory by a rename, with which all files are complete. A process of the run that gives
//!   up removes the claim, so that the rename fails;
//! - a run removes files only in the directory that it opened, and only under the names that it gave when it claimed.

use crate::draft::Draft;
use crate::unfinished::{Output, Unfinished, open_file, rename_to_new};
use rustix::fs::{AtFlags, CWD, Mode, OFlags, RawDir, fsync, mkdirat, openat, unlinkat};
use rustix::io::Errno;
use std::ffi::{CStr, CString};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

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
        let taken = |why: &str| Err(io::Error::new(io::ErrorKind::DirectoryNotEmpty, why));
        match Self::begin(path, last, others, Self::make) {
            Err(Errno::EXIST) => {
                taken("another run is writing to this directory, or was killed while it did")
            }
            Err(Errno::NOTEMPTY) => taken("the directory is not empty"),
            claim => Ok(claim?),
        }
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
            let created = is_new.then_some(path);
            Ok((Output { dir, names, id, others, created }, (last, is_new)))
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
        Draft::claimed(self.unfinished.dir()?, names_of(name))
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
