//! The end of a program in whatever it does, and without unfinished files: at once on a signal, or when it gets no more memory, with one
//! sentence and exit code 71.
//!
//! Signals wake a thread of their own, which removes what is unfinished. In a signal handler, that would have to do without locks.
//! Without memory, the standard library ends a process with SIGABRT, and its hook for that is not stable. A global allocator is.

use crate::uses::forget;
use libc::{SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGPWR, SIGQUIT, SIGSTKFLT};
use libc::{SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Signal, getpid, kill_process};
use signal_hook::low_level::{pipe, register};
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{self, Cursor, Read, Write, stderr};
use std::mem::MaybeUninit;
use std::os::unix::net::UnixStream;
use std::ptr::null;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Barrier, Mutex, Once, OnceLock};
use std::thread::{self, sleep};
use std::time::Duration;
use std::{env, fmt};

pub use crate::unfinished::{abandon, decide};
/// Ends the process without what it would run at its exit.
pub use signal_hook::low_level::exit as exit_at_once;

/// Exit code of an interrupted program.
pub const INTERRUPTED: i32 = 130;

/// All that another process, a timer or a limit sends to end this one. SIGPIPE is ignored by the standard library.
const SIGNALS: [i32; 13] = [
    SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU,
    SIGIO, SIGPWR, SIGSTKFLT,
];

/// What the thread that handles signals is sent in place of a signal by whoever waits for it.
const WAITING: u8 = 0;

/// Reaches the thread that handles signals: it takes part in the barrier when it starts, and when it reads [WAITING].
static HANDLER: OnceLock<(UnixStream, Barrier)> = OnceLock::new();

/// Whether a signal was ignored, as the outcome of a run was decided.
static IS_IGNORED: AtomicBool = AtomicBool::new(false);

/// Time for threads of MPI or of other ranks to take a signal after the process was stopped at a point.
const TAKING: Duration = Duration::from_millis(300);

/// Makes each of the signals remove all unfinished files, print `message` on the standard error and end the process with exit code 130,
/// after the time `linger`. If output is complete or the outcome [decided](decide), the first signal is ignored, as the process is about to end.
/// Signals that the process was started to ignore, as `nohup` does, stay ignored.
///
/// # Errors
/// If a handler cannot be installed; its signal then ends the process the default way.
pub fn install(message: &'static str, linger: Duration) -> io::Result<()> {
    let (mut received, sent) = UnixStream::pair()?;
    let (sent, barrier) = HANDLER.get_or_init(|| (sent, Barrier::new(2)));
    let handle = move || {
        barrier.wait();
        let mut is_first = true;
        let mut byte = [0];
        while received.read_exact(&mut byte).is_ok() {
            if byte == [WAITING] {
                barrier.wait();
                continue;
            }
            // Before the state is asked for, so that a run which begins afterwards knows of it.
            IS_IGNORED.store(true, Relaxed);
            if !(abandon(true) && is_first) {
                print(message);
                sleep(linger);
                exit_at_once(INTERRUPTED);
            }
            is_first = false;
        }
    };
    thread::Builder::new().name("signals".into()).stack_size(64 << 10).spawn(handle)?;
    // Afterwards the thread allocates nothing, so the number of allocations is the same in all runs.
    barrier.wait();
    for signal in signals()? {
        pipe::register(signal, sent.try_clone()?)?;
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
    unsafe { register(SIGXFSZ, || ())? };
    Ok(SIGNALS.into_iter().filter(|&signal| !is_ignored(signal)))
}

/// Notes that another run begins, whose outcome is open and whose files are others: for a program that stays for several runs. Ends the
/// process if a signal was ignored at the end of the last one.
pub fn begin() {
    forget();
    decide(false);
    if IS_IGNORED.load(Relaxed) {
        // Like a second signal, which ends the process.
        wait_for_handler(!WAITING);
    }
}

/// Stops the process, as SIGSTOP does, where it first reaches the point that the environment variable `STOP_AT` names. Tests then send
/// signals, and let it continue: what happens at a point does not depend on the speed of the machine.
pub fn stop_at(point: fmt::Arguments) {
    static STOP: Once = Once::new();
    if env::var_os("STOP_AT").is_some_and(|at| *at == *point.to_string()) {
        STOP.call_once(|| {
            let _ = kill_process(getpid(), Signal::STOP);
            sleep(TAKING);
            // A signal that the handling thread itself took comes after what it is sent meanwhile, but before what it is sent then.
            wait_for_handler(WAITING);
            wait_for_handler(WAITING);
        });
    }
}

/// Waits until the signals that were taken before, and then a byte, are handled; they may end the process.
fn wait_for_handler(byte: u8) {
    if let Some((sent, barrier)) = HANDLER.get() {
        (&*sent).write_all(&[byte]).expect("the thread reads until the process ends");
        barrier.wait();
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
fn print(message: &str) {
    let stderr = rustix::stdio::stderr();
    let mut ready = [PollFd::new(&stderr, PollFlags::OUT)];
    // At once.
    if poll(&mut ready, Some(&Timespec::default())).is_ok_and(|n| n == 1) {
        let _ = rustix::io::write(stderr, message.as_bytes());
    }
}

/// Exit code of a program that ran out of memory, or whose work does not fit into it.
pub const OUT_OF_MEMORY: i32 = 71;

/// The system's allocator, as the global one of a program. It ends the program when the system has no more memory.
pub struct Heap {
    /// The program's name.
    pub program: &'static str,
    /// What the user can do.
    pub advice: &'static str,
    /// Ends the program with an exit code.
    pub end: fn(i32) -> !,
}

// SAFETY: all calls go to the system's allocator with the caller's arguments, and so do its results, except that null ends the process.
unsafe impl GlobalAlloc for Heap {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        self.obtained(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        self.obtained(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        self.obtained(unsafe { System.realloc(block, layout, size) }, size)
    }

    #[inline]
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

impl Heap {
    #[inline]
    fn obtained(&self, block: *mut u8, bytes: usize) -> *mut u8 {
        if block.is_null() {
            self.end(bytes);
        }
        block
    }

    /// Ends the program. Nothing in here allocates, unless a library does.
    #[cold]
    fn end(&self, bytes: usize) -> ! {
        static ENDING: Mutex<()> = Mutex::new(());
        // The thread that came first ends the process.
        let _first = ENDING.lock();
        abandon(true);
        // The exit code remains if the standard error is full. A launcher puts lines of its own between two writes.
        let mut line = Cursor::new([0; 256]);
        let Self { program, advice, .. } = self;
        let _ =
            writeln!(line, "{program}: memory ran out at a request for {bytes} bytes: {advice}");
        let _ = stderr().write_all(&line.get_ref()[..line.position() as usize]);
        (self.end)(OUT_OF_MEMORY)
    }
}
