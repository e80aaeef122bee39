//! The processes of a session, read from `/proc`.

use rustix::process::{Pid, Signal, kill_process};
use std::fs;

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
    // SAFETY: getsid touches no memory. That of rustix has no result for kernel threads, whose session is 0.
    let session = |id: u32| libc::pid_t::try_from(id).map(|id| unsafe { libc::getsid(id) });
    let is_of_session = |&id: &u32| session(id).is_ok_and(|s| u32::try_from(s) == Ok(leader));
    let of_session = ids.filter(is_of_session).filter(|&id| {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        session_and_liveness(&stat) == Some((leader, true))
    });
    of_session.filter_map(pid_of).collect()
}

/// Sends a signal to every process of a session.
pub(super) fn signal(leader: u32, signal: Signal) {
    for member in members(leader) {
        // It may have ended since then.
        let _ = kill_process(member, signal);
    }
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
