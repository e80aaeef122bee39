//! How much memory a program takes, as seen from outside: for programs that do not tell.

use super::session;
use std::time::{Duration, Instant};

/// From one look to the next; before that time has passed, at every occasion.
const PAUSE: Duration = Duration::from_millis(100);

/// Weighs the processes of a session again and again.
#[derive(Debug)]
pub struct Scales {
    begun: Instant,
    last: Instant,
    peak_bytes: u64,
}

impl Scales {
    /// Nothing weighed yet.
    pub fn new() -> Self {
        let now = Instant::now();
        Self { begun: now, last: now, peak_bytes: 0 }
    }

    /// Looks at the session, unless that was done just now. A process's peak is the system's own mark, so that
    /// only what it takes after the last look is missed.
    pub(super) fn weigh(&mut self, leader: u32) {
        if self.begun.elapsed() > PAUSE && self.last.elapsed() < PAUSE {
            return;
        }
        self.last = Instant::now();
        let marks = session::members(leader).into_iter().filter_map(|id| {
            let path = format!("/proc/{}/status", id.as_raw_nonzero());
            mark(&std::fs::read_to_string(path).ok()?)
        });
        self.peak_bytes = self.peak_bytes.max(marks.sum());
    }

    /// The greatest sum of the peaks of processes that lived at one time; 0 where the system does not tell.
    pub fn peak_bytes(&self) -> u64 {
        self.peak_bytes
    }
}

impl Default for Scales {
    fn default() -> Self {
        Self::new()
    }
}

/// The high-water mark in the text of `/proc/ID/status`.
fn mark(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_read() {
        assert_eq!(mark("Name:\ta\nVmHWM:\t    12 kB\nVmRSS:\t 3 kB\n"), Some(12 * 1024));
        assert_eq!(mark("Name:\ta\n"), None);
    }
}
