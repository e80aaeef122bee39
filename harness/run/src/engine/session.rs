//! A child process that leads a session of its own, so that its descendants can be found even if they left its process group, as the
//! ranks of OpenMPI's `mpirun` do.
//!
//! Invariant: when a [`Session`] is dropped, no process of it is left.

use super::failure::End;
use super::interrupt;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{
    Pid, PidfdFlags, Signal, WaitOptions, kill_process, pidfd_open, setsid, waitpid,
};
use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How often processes are ended that start others meanwhile.
const ATTEMPTS: usize = 500;

/// How a child ended, and the CPU time, in seconds, of it and of all its descendants that were waited for.
pub(super) type Ended = (ExitStatus, f64);

/// The session of a child.
#[derive(Debug)]
pub(super) struct Session {
    leader: u32,
    /// Becomes readable when the child ends; `None` on a kernel without such descriptors (before Linux 5.3).
    ending: Option<OwnedFd>,
    ended: Option<Ended>,
}

impl Session {
    /// Starts the leader.
    pub(super) fn start(command: &mut Command) -> io::Result<(Self, Child)> {
        // SAFETY: setsid is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| setsid().map(drop).map_err(io::Error::from)) };
        let child = interrupt::spawn(command)?;
        let ending = pid_of(child.id()).and_then(|id| pidfd_open(id, PidfdFlags::empty()).ok());
        Ok((Self { leader: child.id(), ending, ended: None }, child))
    }

    /// The leader's process.
    pub(super) fn id(&self) -> u32 {
        self.leader
    }

    /// How the leader ended; `None` while it runs. `Child::try_wait` gives no CPU time.
    pub(super) fn reap(&mut self) -> Result<Option<Ended>, End> {
        if self.ended.is_some() {
            return Ok(self.ended);
        }
        let id = self.leader as libc::pid_t;
        let mut status = 0;
        // SAFETY: all bits zero are a valid `rusage`, which contains only integers.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        // SAFETY: both pointers are to live local variables.
        match unsafe { libc::wait4(id, &raw mut status, libc::WNOHANG, &raw mut usage) } {
            0 => {}
            reaped if reaped == id => {
                let seconds = |time: libc::timeval| time.tv_sec as f64 + time.tv_usec as f64 * 1e-6;
                let time_cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
                self.ended = Some((ExitStatus::from_raw(status), time_cpu_s));
            }
            _ => {
                let error = io::Error::last_os_error();
                return Err(End::Unusable(format!("could not be waited for: {error}")));
            }
        }
        Ok(self.ended)
    }

    /// Whether the leader runs.
    pub(super) fn runs(&mut self) -> bool {
        matches!(self.reap(), Ok(None))
    }

    /// Returns when the leader has ended, a signal has arrived, or the pause is over. A pause of fixed length would round the leader's
    /// wall time up to a multiple of it.
    pub(super) fn pause(&self, pause: Duration) {
        let Some(ending) = &self.ending else { return sleep(pause) };
        let limit = Timespec::try_from(pause).expect("pauses are short");
        let waited = poll(&mut [PollFd::new(ending, PollFlags::IN)], Some(&limit));
        if waited.is_err_and(|error| error != rustix::io::Errno::INTR) {
            sleep(pause);
        }
    }

    /// Sends SIGTERM to the leader and all its descendants, ranks included, and kills those that do not end in time.
    pub(super) fn end(&mut self) {
        signal(self.leader, Signal::TERM);
        let patience = Instant::now() + interrupt::PATIENCE;
        while self.runs() && Instant::now() < patience {
            sleep(Duration::from_millis(10));
        }
        self.kill();
        while self.runs() {
            sleep(Duration::from_millis(10));
        }
    }

    /// Kills every process of the session. Processes may be started while it is being killed, so this repeats until none is found.
    fn kill(&self) {
        for _ in 0..100 {
            if members(self.leader).is_empty() {
                return;
            }
            signal(self.leader, Signal::KILL);
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.kill();
        let _ = self.reap();
        interrupt::forget_child(self.leader);
    }
}

fn pid_of(id: u32) -> Option<Pid> {
    i32::try_from(id).ok().and_then(Pid::from_raw)
}

/// The live processes of a session. The leader is no longer among them after it was waited for.
pub(super) fn members(leader: u32) -> Vec<Pid> {
    let Ok(entries) = fs::read_dir("/proc") else {
        return Vec::new();
    };
    let ids = entries.flatten().filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    // A machine has hundreds of processes. To read a file of each takes longer than to mesh a small case.
    let of_session = ids.filter(|&id| session(id) == Some(leader)).filter(|&id| {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        session_and_liveness(&stat) == Some((leader, true))
    });
    of_session.filter_map(pid_of).collect()
}

/// The session of a process, with 0 for this one itself. It is 0 for kernel threads and for sessions whose leader is outside of a container.
fn session(id: u32) -> Option<u32> {
    let id = libc::pid_t::try_from(id).ok()?;
    // SAFETY: getsid touches no memory. That of rustix panics where the session is 0.
    u32::try_from(unsafe { libc::getsid(id) }).ok()
}

/// Sends a signal to every process of a session.
pub(super) fn signal(leader: u32, signal: Signal) {
    for member in members(leader) {
        // It may have ended since then.
        let _ = kill_process(member, signal);
    }
}

/// Ends the processes that this one has adopted, and waits for them: children of other sessions `except` those that it has started
/// itself. Their descendants are adopted in turn, so this repeats until none is found.
pub(super) fn end_adopted(except: &[u32]) {
    for _ in 0..ATTEMPTS {
        let adopted = adopted(except);
        if adopted.is_empty() {
            return;
        }
        for process in adopted {
            let _ = kill_process(process, Signal::KILL);
            let _ = waitpid(Some(process), WaitOptions::NOHANG);
        }
        sleep(Duration::from_millis(2));
    }
}

fn adopted(except: &[u32]) -> Vec<Pid> {
    let threads = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let children = threads.flat_map(|thread| {
        let text = fs::read_to_string(thread.path().join("children")).unwrap_or_default();
        text.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<_>>()
    });
    let own = session(0);
    let adopted = children.filter(|&child| session(child) != own && !except.contains(&child));
    adopted.filter_map(pid_of).collect()
}

/// The session of a process and whether it is alive (not a zombie), from the text of `/proc/ID/stat`.
fn session_and_liveness(stat: &str) -> Option<(u32, bool)> {
    // The name, in parentheses, may itself contain spaces and parentheses.
    let (_, rest) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = rest.split(' ').collect();
    Some((fields.get(3)?.parse().ok()?, !matches!(*fields.first()?, "Z" | "X")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Stdio;

    #[test]
    fn a_pause_ends_with_the_child() {
        let mut command = Command::new("cat");
        let (mut session, mut child) = Session::start(command.stdin(Stdio::piped())).unwrap();
        assert!(session.ending.is_some() && session.runs());
        drop(child.stdin.take());
        let start = Instant::now();
        session.pause(Duration::from_secs(600));
        assert!(start.elapsed() < Duration::from_secs(300));
        assert!(session.reap().unwrap().unwrap().0.success());
    }

    #[test]
    fn the_session_is_found_after_a_name_with_parentheses() {
        assert_eq!(session_and_liveness("12 (a) b) S 1 12 77 0 -1"), Some((77, true)));
        assert_eq!(session_and_liveness("12 (x) Z 1 12 77 0 -1"), Some((77, false)));
        assert_eq!(session_and_liveness(""), None);
    }
}
