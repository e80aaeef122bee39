//! The output that this process has begun, and its removal in a signal handler.
//!
//! Invariants:
//! - whatever the handler calls is async-signal-safe: system calls, atomics, and no allocation;
//! - entries are never freed, so the handler may walk the list at any time; an entry of finished or removed output is dead;
//! - output is complete once its final name belongs to the file that was begun. The file system decides between a rename to the final
//!   name and a removal, of which one succeeds.

use rustix::fs::{AtFlags, CWD, fstat, statat, unlinkat};
use std::ffi::{CStr, CString};
use std::os::fd::{BorrowedFd, RawFd};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};

/// The latest entry.
static LATEST: AtomicPtr<Entry> = AtomicPtr::new(null_mut());
/// Whether output has been completed: then the run ends with success.
static IS_COMPLETE: AtomicBool = AtomicBool::new(false);

struct Entry {
    output: Output,
    is_live: AtomicBool,
    before: *const Entry,
}

/// Unfinished output: a file, perhaps with others that are finished before it. Descriptors belong to the caller, who keeps them open as
/// long as the entry lives.
pub struct Output {
    /// The directory of the names.
    pub dir: RawFd,
    /// The file's temporary and final name.
    pub names: [CString; 2],
    /// The file.
    pub file: RawFd,
    /// Names of other files to remove, temporary and final.
    pub others: Vec<CString>,
    /// The directory's path if it was created for this output.
    pub created: Option<CString>,
}

/// Keeps an entry alive.
#[derive(Debug)]
pub struct Unfinished(&'static Entry);

// SAFETY: an entry is immutable but for an atomic, and so are those before it.
unsafe impl Sync for Entry {}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Entry").field("is_live", &self.is_live).finish_non_exhaustive()
    }
}

impl Unfinished {
    /// Enters output into the list.
    pub fn new(output: Output) -> Self {
        let entry = Entry { output, is_live: AtomicBool::new(true), before: null_mut() };
        let entry = Box::into_raw(Box::new(entry));
        let link = |before: *mut Entry| {
            // SAFETY: no one else has a pointer to the entry before it is in the list.
            unsafe { (*entry).before = before };
            Some(entry)
        };
        let _ = LATEST.fetch_update(Ordering::AcqRel, Ordering::Acquire, link);
        // SAFETY: the entry is never freed, and never changed from here on.
        Self(unsafe { &*entry })
    }

    /// Removes the output, unless it is complete. Returns whether it is.
    pub fn abandon(&self) -> bool {
        self.0.output.abandon()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        self.0.is_live.store(false, Ordering::Release);
    }
}

/// Notes that output has its final name, from when on [`abandon_all`] removes nothing; or that another run begins.
pub fn complete(is_complete: bool) {
    IS_COMPLETE.store(is_complete, Ordering::Release);
}

/// Removes all unfinished output, the latest first. If the process `ends`, only unless some output is complete: it would end with success
/// anyway. Returns whether some is. Async-signal-safe.
pub fn abandon_all(ends: bool) -> bool {
    let mut next = LATEST.load(Ordering::Acquire).cast_const();
    let mut is_complete = ends && IS_COMPLETE.load(Ordering::Acquire);
    // SAFETY: entries are never freed.
    while let Some(entry) = unsafe { next.as_ref() }.filter(|_| !is_complete) {
        is_complete = entry.is_live.load(Ordering::Acquire) && entry.output.abandon() && ends;
        next = entry.before;
    }
    is_complete
}

impl Output {
    /// Removes the output, unless it is complete. Returns whether it is.
    fn abandon(&self) -> bool {
        // SAFETY: the caller keeps the descriptor open.
        let dir = unsafe { BorrowedFd::borrow_raw(self.dir) };
        let [draft, name] = &self.names;
        let remove = |name: &CStr| unlinkat(dir, name, AtFlags::empty()).is_ok();
        // One process of the run succeeds: the others find the file gone.
        let is_first = is_name_of(dir, draft, self.file) && remove(draft);
        if !is_first && is_name_of(dir, name, self.file) {
            return true;
        }
        self.others.iter().for_each(|name| _ = remove(name));
        if let Some(path) = &self.created {
            // The last process of the run succeeds; a directory that is not empty stays.
            let _ = unlinkat(CWD, path, AtFlags::REMOVEDIR);
        }
        false
    }
}

/// Whether a name in a directory is that of an open file.
fn is_name_of(dir: BorrowedFd, name: &CStr, file: RawFd) -> bool {
    // SAFETY: the caller keeps the descriptor open.
    let file = unsafe { BorrowedFd::borrow_raw(file) };
    let found = statat(dir, name, AtFlags::SYMLINK_NOFOLLOW);
    fstat(file).is_ok_and(|mine| {
        found.is_ok_and(|found| (found.st_dev, found.st_ino) == (mine.st_dev, mine.st_ino))
    })
}
