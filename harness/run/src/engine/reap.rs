//! The end of a child process, with the CPU time of the whole process.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};
use std::thread;
use std::time::Duration;

/// Waits for the end of a child. A pause of fixed length would round the child's wall time up to a multiple of it.
pub(super) struct Ending {
    /// Becomes readable when the child ends; `None` on a kernel without such descriptors (before Linux 5.3).
    descriptor: Option<OwnedFd>,
}

impl Ending {
    /// Of a child that was not reaped yet.
    pub(super) fn of(child: &Child) -> Self {
        let id = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
        Self { descriptor: id.and_then(|id| pidfd_open(id, PidfdFlags::empty()).ok()) }
    }

    /// Returns when the child has ended, a signal has arrived, or `pause` is over.
    pub(super) fn wait(&self, pause: Duration) {
        let Some(descriptor) = &self.descriptor else { return thread::sleep(pause) };
        let limit = Timespec::try_from(pause).expect("pauses are short");
        let waited = poll(&mut [PollFd::new(descriptor, PollFlags::IN)], Some(&limit));
        if waited.is_err_and(|error| error != rustix::io::Errno::INTR) {
            thread::sleep(pause);
        }
    }
}

/// Returns how the child ended and the CPU time, in seconds, of the child and of all its descendants that were waited for;
/// `None` while it runs. `Child::try_wait` gives no CPU time.
///
/// # Errors
/// If the child was reaped before. After this function has returned an end, nothing may wait for the child again.
pub(super) fn try_reap(child: &Child) -> io::Result<Option<(ExitStatus, f64)>> {
    let id = libc::pid_t::try_from(child.id()).map_err(io::Error::other)?;
    let mut status = 0;
    // SAFETY: all bits zero are a valid `rusage`, which contains only integers.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: both pointers are to live local variables.
    match unsafe { libc::wait4(id, &raw mut status, libc::WNOHANG, &raw mut usage) } {
        0 => Ok(None),
        reaped if reaped == id => {
            let seconds = |time: libc::timeval| time.tv_sec as f64 + time.tv_usec as f64 * 1e-6;
            let time_cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
            Ok(Some((ExitStatus::from_raw(status), time_cpu_s)))
        }
        _ => Err(io::Error::last_os_error()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};
    use std::time::Instant;

    #[test]
    fn a_wait_ends_with_the_child() {
        let mut child = Command::new("cat").stdin(Stdio::piped()).spawn().unwrap();
        let ending = Ending::of(&child);
        assert!(ending.descriptor.is_some() && try_reap(&child).unwrap().is_none());
        drop(child.stdin.take());
        let start = Instant::now();
        ending.wait(Duration::from_secs(600));
        assert!(start.elapsed() < Duration::from_secs(300));
        assert!(child.wait().unwrap().success());
    }
}
