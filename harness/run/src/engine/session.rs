//! The processes of a session, read from `/proc`.

use rustix::process::{Pid, Signal, WaitOptions, kill_process, waitpid};
use std::fs;
use std::thread::sleep;
use std::time::Duration;

/// How often processes are ended that start others meanwhile.
const ATTEMPTS: usize = 500;

pub(super) fn pid_of(id: u32) -> Option<Pid> {
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

/// Ends the processes that this one has adopted, and waits for them: children that it has not started itself, which are of other
/// sessions. Their descendants are adopted in turn, so this repeats until none is found. Not while a child that leads a session runs,
/// but for those `except`.
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
pub(super) fn session_and_liveness(stat: &str) -> Option<(u32, bool)> {
    // The name, in parentheses, may itself contain spaces and parentheses.
    let (_, rest) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = rest.split(' ').collect();
    Some((fields.get(3)?.parse().ok()?, !matches!(*fields.first()?, "Z" | "X")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_session_is_found_after_a_name_with_parentheses() {
        assert_eq!(session_and_liveness("12 (a) b) S 1 12 77 0 -1"), Some((77, true)));
        assert_eq!(session_and_liveness("12 (x) Z 1 12 77 0 -1"), Some((77, false)));
        assert_eq!(session_and_liveness(""), None);
    }
}
