//! Signals: a flag that every loop that waits or runs programs checks, and an end for whatever does not.
//!
//! Invariants:
//! - a first signal lets a command return in the ordinary way, with a partial report, but not for longer than `GRACE`;
//! - after that time, or at a second signal, child processes are ended, unfinished files and temporary directories are removed, and
//!   the harness exits with code 130. Temporary directories are below one that this process has made, or staged beside their final
//!   place ([`contract::files::Staging`]);
//! - output that is about to get its final names gets all of them first.

use super::session::{PATIENCE, end_all, keep_children};
use contract::failure::INTERRUPTED;
use contract::files::publications;
use files::{OUT_OF_MEMORY, interrupt};
use rustix::process::{getpid, set_child_subreaper};
use signal_hook::low_level::{exit, pipe};
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Once, OnceLock};
use std::thread::{self, sleep};
use std::time::Duration;

/// Time for a command to return after a first signal.
const GRACE: Duration = Duration::from_secs(2);
/// How often a directory is removed to which other threads may still write.
const ATTEMPTS: usize = 20;

/// Wakes the thread that waits for signals, whose bytes are different.
const OUT_OF_MEMORY_BYTE: u8 = b'm';

static WAKE: OnceLock<UnixStream> = OnceLock::new();
/// The directory of all temporary files. Until it is known, a signal waits.
static TEMPORARY: OnceLock<PathBuf> = OnceLock::new();

/// Makes signals a request to stop. Once per process, before anything makes a temporary file.
///
/// # Errors
/// If a handler cannot be installed. Without one, a signal ends the harness without cleaning up; that does not prevent a run.
pub fn install() -> io::Result<()> {
    keep_children();
    // Processes that an engine detaches become children of this one, which ends them.
    let _ = set_child_subreaper(Some(getpid()));
    let (mut received, sent) = UnixStream::pair()?;
    let wait = move || {
        let mut byte = [0];
        if received.read_exact(&mut byte).is_ok() {
            if byte == [OUT_OF_MEMORY_BYTE] {
                clean();
                exit(OUT_OF_MEMORY);
            }
            INTERRUPTED.store(true, Ordering::SeqCst);
            // A second signal, or the time limit.
            let _ = received.set_read_timeout(Some(GRACE));
            let _ = received.read_exact(&mut byte);
            // Whatever other threads do.
            clean();
            announce();
            exit(interrupt::INTERRUPTED);
        }
    };
    thread::Builder::new().name("signals".into()).spawn(wait)?;
    let _ = WAKE.set(sent.try_clone()?);
    for signal in interrupt::signals()? {
        pipe::register(signal, sent.try_clone()?)?;
    }
    // A signal after this thread has made the directory removes it.
    let _unknown = publications();
    let place = tempfile::Builder::new().prefix("harness-").tempdir()?.keep();
    let _ = tempfile::env::override_temp_dir(TEMPORARY.get_or_init(|| place));
    Ok(())
}

/// Ends the harness because memory ran out. Another thread cleans up, as this one may hold any lock.
pub fn out_of_memory(code: i32) -> ! {
    if let Some(mut wake) = WAKE.get() {
        let _ = wake.write_all(&[OUT_OF_MEMORY_BYTE]);
        sleep(GRACE + 2 * PATIENCE);
    }
    exit(code)
}

/// Removes the directory of temporary files, unless a command has kept some, when the harness ends in the ordinary way.
pub fn uninstall() {
    let _ = TEMPORARY.get().map(fs::remove_dir);
}

/// Whether the user has interrupted the harness.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Prints that the harness was interrupted. Once: a command may be about to say so when its time is over.
pub fn announce() {
    static SAID: Once = Once::new();
    SAID.call_once(|| _ = writeln!(io::stderr(), "harness: interrupted"));
}

/// Ends the child processes, and removes unfinished files and temporary directories. Then the process must end.
pub fn clean() {
    let ended = end_all();
    let staged = publications();
    interrupt::abandon(false);
    staged.iter().chain(TEMPORARY.get()).for_each(|path| remove(path));
    // Until the process ends, other threads start, stage and publish nothing else.
    std::mem::forget((ended, staged));
}

fn remove(directory: &Path) {
    for _ in 0..ATTEMPTS {
        match fs::remove_dir_all(directory) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => sleep(Duration::from_millis(5)),
            _ => return,
        }
    }
}
