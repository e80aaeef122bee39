//! The end of a program on a signal: at once, in whatever it does, and without unfinished files.

use crate::unfinished::{abandon_all, complete};
use crate::uses::forget;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Signal, getpid, kill_process};
use rustix::stdio::stderr;
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM,
    SIGXCPU, SIGXFSZ,
};
use signal_hook::low_level;
pub use signal_hook::low_level::exit as exit_at_once;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{park, sleep};
use std::time::Duration;
use std::{env, fmt, io};

/// Exit code of an interrupted program.
pub const INTERRUPTED: i32 = 130;

/// All that another process, a timer or a limit sends to end this one. SIGPIPE is ignored by the standard library.
const SIGNALS: [i32; 13] = [
    SIGINT,
    SIGTERM,
    SIGHUP,
    SIGQUIT,
    SIGUSR1,
    SIGUSR2,
    SIGALRM,
    SIGVTALRM,
    SIGPROF,
    SIGXCPU,
    SIGIO,
    libc::SIGPWR,
    libc::SIGSTKFLT,
];

/// Makes each of the signals remove all unfinished files, print `message` on the standard error and end the process with exit code 130.
/// If output is complete or the outcome [decided], the first signal is ignored, as the process is about to end. Signals that the process was started to
/// ignore, as `nohup` does, stay ignored. The process waits for the time `linger` before it ends, unless another signal arrives.
///
/// # Errors
/// If a handler cannot be installed; its signal then ends the process the default way.
pub fn install(message: &str, linger: Duration) -> io::Result<()> {
    let message: Arc<[u8]> = message.as_bytes().into();
    let is_second = Arc::new(AtomicBool::new(false));
    for signal in signals()? {
        let (message, is_second) = (message.clone(), is_second.clone());
        let end = move || {
            let is_second = is_second.swap(true, Ordering::AcqRel);
            if abandon_all(true) && !is_second {
                return;
            }
            print(&message);
            if !is_second {
                sleep(linger);
            }
            exit_at_once(INTERRUPTED);
        };
        // SAFETY: the action makes system calls and uses atomics; it neither allocates nor locks.
        unsafe { low_level::register(signal, end)? };
    }
    Ok(())
}

/// The signals that end a program: all that it was not started to ignore. At the limit on file sizes, from now on, writing fails instead.
///
/// # Errors
/// If a handler cannot be installed.
pub fn signals() -> io::Result<impl Iterator<Item = i32>> {
    // A handler, unlike an ignored signal, is not inherited by the programs that this one starts.
    // SAFETY: the action does nothing.
    unsafe { low_level::register(SIGXFSZ, || ())? };
    Ok(SIGNALS.into_iter().filter(|&signal| !is_ignored(signal)))
}

/// Whether another thread ends the process and has removed what was unfinished. Held while output is begun.
static IS_ENDING: Mutex<bool> = Mutex::new(false);

/// Runs `body` without a signal in between on this thread, and not while another thread removes what is unfinished: for steps that create
/// a file and note that it exists. After [`abandon_unfinished`] it waits for the end of the process.
pub fn uninterrupted<T>(body: impl FnOnce() -> T) -> T {
    let mut before = MaybeUninit::uninit();
    // SAFETY: the sets are initialised by sigemptyset and by the first pthread_sigmask, which cannot fail with these arguments.
    unsafe {
        let mut signals = MaybeUninit::uninit();
        libc::sigemptyset(signals.as_mut_ptr());
        SIGNALS.iter().for_each(|&s| _ = libc::sigaddset(signals.as_mut_ptr(), s));
        libc::pthread_sigmask(libc::SIG_BLOCK, signals.as_ptr(), before.as_mut_ptr());
    }
    let ending = IS_ENDING.lock().unwrap_or_else(PoisonError::into_inner);
    if *ending {
        drop(ending);
        loop {
            park();
        }
    }
    let result = body();
    drop(ending);
    // SAFETY: as above. A panic in `body` ends the process.
    unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, before.as_ptr(), null_mut()) };
    result
}

/// Notes that the program's outcome is decided: from now on a first signal changes nothing.
pub fn decided() {
    complete(true);
}

/// Notes that another run begins, whose outcome is open and whose files are others: for a program that stays for several runs.
pub fn begin() {
    forget();
    complete(false);
}

/// Removes all unfinished files: before the process ends because of a bug.
pub fn abandon() {
    abandon_all(true);
}

/// Removes all files that are unfinished, also if others are complete, and lets no other thread begin one: for a program with several
/// outputs, whose process then ends.
pub fn abandon_unfinished() {
    *IS_ENDING.lock().unwrap_or_else(PoisonError::into_inner) = true;
    abandon_all(false);
}

/// Stops the process, as SIGSTOP does, if the environment variable `STOP_AT` is this point. Tests then send signals, and let it
/// continue: what happens at a point does not depend on the speed of the machine.
pub fn stop_at(point: fmt::Arguments) {
    if env::var_os("STOP_AT").is_some_and(|at| *at == *point.to_string()) {
        let _ = kill_process(getpid(), Signal::STOP);
    }
}

fn is_ignored(signal: i32) -> bool {
    let mut action = MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: the call only writes `action`, for which zeros are valid.
    unsafe {
        libc::sigaction(signal, null(), action.as_mut_ptr());
        action.assume_init().sa_sigaction == libc::SIG_IGN
    }
}

/// Prints on the standard error, unless that would wait for a reader.
fn print(message: &[u8]) {
    let stderr = stderr();
    let mut ready = [PollFd::new(&stderr, PollFlags::OUT)];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    if poll(&mut ready, Some(&at_once)).is_ok_and(|n| n == 1) {
        let _ = rustix::io::write(stderr, message);
    }
}
