//! The output that this process has begun, and its removal when the process ends before it is complete.
//!
//! Invariants:
//! - output is begun, completed and removed under one lock. Once a thread ends the process, others wait for the end instead of beginning or
//!   completing any;
//! - nothing is allocated under the lock: the process may end because memory ran out;
//! - output is complete once its final name belongs to the file that was begun. Of several processes of a run, the file system decides
//!   between a rename to the final name and a removal, of which one succeeds.

use rustix::fs::{AtFlags, CWD, Mode, OFlags, RenameFlags, fstat, openat, statat, unlinkat};
use rustix::fs::{renameat, renameat_with};
use rustix::io::Errno;
use std::ffi::{CStr, CString};
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::park;

/// Greatest number of unfinished outputs of a process: one for each of 4,096 simulated ranks, and reports.
const OUTPUTS: usize = 4096 + 8;

static STATE: Mutex<State> =
    Mutex::new(State { outputs: [const { None }; OUTPUTS], is_complete: false, is_ending: false });

struct State {
    outputs: [Option<Output>; OUTPUTS],
    /// Whether output has been completed: then the run ends with success.
    is_complete: bool,
    /// Whether a thread ends the process and has removed what was unfinished.
    is_ending: bool,
}

/// Unfinished output: a file, perhaps with others that are finished before it.
pub struct Output {
    /// The directory of the names.
    pub dir: OwnedFd,
    /// The file's temporary and final name.
    pub names: [CString; 2],
    /// Device and inode of the file.
    pub id: (u64, u64),
    /// Names of other files to remove.
    pub others: Vec<CString>,
    /// The directory's path if it was created for this output.
    pub created: Option<CString>,
}

/// Output that is removed if this is dropped: its place among all outputs.
#[derive(Debug)]
pub struct Unfinished(usize);

fn lock() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The lock of a thread that does not end the process; waits if another one does.
fn lock_to_work() -> MutexGuard<'static, State> {
    let state = lock();
    if state.is_ending {
        drop(state);
        loop {
            park();
        }
    }
    state
}

/// Runs `body`, which begins or completes a part of some output, unless the process is about to end.
pub fn locked<T>(body: impl FnOnce() -> T) -> T {
    let _state = lock_to_work();
    body()
}

impl Unfinished {
    /// Begins output. Also returns what `f` does beside it.
    ///
    /// # Errors
    /// With whatever `f` returns; then it leaves nothing.
    pub fn begin<T>(f: impl FnOnce() -> Result<(Output, T), Errno>) -> Result<(Self, T), Errno> {
        let outputs = &mut lock_to_work().outputs;
        let free = outputs.iter().position(Option::is_none).ok_or(Errno::MFILE)?;
        let (output, beside) = f()?;
        outputs[free] = Some(output);
        Ok((Self(free), beside))
    }

    /// Gives the output its final name with `publish`.
    pub fn publish(&self, publish: impl FnOnce(&Output) -> Result<(), Errno>) -> io::Result<()> {
        let state = &mut *lock_to_work();
        state.outputs[self.0].as_ref().map_or(Ok(()), publish)?;
        state.is_complete = true;
        Ok(())
    }

    /// The directory of the output.
    pub fn dir(&self) -> io::Result<OwnedFd> {
        lock().outputs[self.0].as_ref().ok_or(Errno::NOENT)?.dir.try_clone()
    }

    /// Keeps the output, which is complete.
    pub fn keep(self) {
        let state = &mut *lock_to_work();
        state.outputs[self.0] = None;
        state.is_complete = true;
        std::mem::forget(self);
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        lock().outputs[self.0].take().iter().for_each(Output::abandon);
    }
}

/// Notes whether the outcome of the run is decided: from then on a first signal changes nothing.
pub fn decide(is_decided: bool) {
    lock_to_work().is_complete = is_decided;
}

/// Removes all unfinished output before the process ends, and lets no other thread begin any. Removes none if some is complete and the process
/// therefore `ends_well`, which one with several outputs does not; returns whether that is so.
pub fn abandon(ends_well: bool) -> bool {
    let mut state = lock();
    let outputs = || state.outputs.iter().flatten();
    if ends_well && (state.is_complete || outputs().any(|output| output.is_at(1))) {
        return true;
    }
    outputs().for_each(Output::abandon);
    state.is_ending = true;
    false
}

impl Output {
    /// Removes the output, unless it is complete.
    fn abandon(&self) {
        let remove = |name: &CStr| unlinkat(&self.dir, name, AtFlags::empty()).is_ok();
        // One process of the run succeeds: the others find the file gone.
        let is_first = self.is_at(0) && remove(&self.names[0]);
        if !is_first && self.is_at(1) {
            return;
        }
        self.others.iter().for_each(|name| _ = remove(name));
        if let Some(path) = &self.created {
            // The last process of the run succeeds; a directory that is not empty stays.
            let _ = unlinkat(CWD, path, AtFlags::REMOVEDIR);
        }
    }

    /// Whether the file has its temporary or its final name.
    fn is_at(&self, name: usize) -> bool {
        let found = statat(&self.dir, &self.names[name], AtFlags::SYMLINK_NOFOLLOW);
        found.is_ok_and(|found| (found.st_dev, found.st_ino) == self.id)
    }
}

/// Creates a file, or opens it without `OFlags::CREATE`. Returns its device and inode as well.
pub fn open_file(dir: &OwnedFd, name: &CStr, flags: OFlags) -> Result<(File, (u64, u64)), Errno> {
    let always = OFlags::WRONLY | OFlags::CLOEXEC;
    // As for any other file, the user's umask decides who may read it.
    let file = openat(dir, name, always | flags, Mode::from(0o666))?;
    let found = fstat(&file)?;
    Ok((file.into(), (found.st_dev, found.st_ino)))
}

/// Gives a file its final name, which no other file has: one that somebody else put there during the run stays.
pub fn rename_to_new(dir: &OwnedFd, [from, to]: &[CString; 2]) -> Result<(), Errno> {
    match renameat_with(dir, from, dir, to, RenameFlags::NOREPLACE) {
        // Some network file systems cannot. The claim excludes other runs.
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => renameat(dir, from, dir, to),
        result => result,
    }
}
