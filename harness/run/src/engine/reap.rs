//! The end of a child process, with the CPU time of the whole process.

use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};

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
