//! Memory of a program as seen from outside, for programs that do not report it.

use super::session;
use std::time::{Duration, Instant};

/// Longest time between samples.
const PERIOD: Duration = Duration::from_millis(100);

/// Samples of a program of any age, at least, up to that period: what a short run uses last is missed as seldom as in a long one.
const SAMPLES: u32 = 16;

/// Samples the memory of all processes of a session.
#[derive(Debug)]
pub(super) struct MemorySampler {
    start: Instant,
    last: Instant,
    peak_bytes: u64,
}

impl MemorySampler {
    /// A sampler without samples.
    pub(super) fn new() -> Self {
        let now = Instant::now();
        Self { start: now, last: now, peak_bytes: 0 }
    }

    /// Takes a sample of the session, unless one was taken a short time ago. The system keeps the peak of each
    /// process, so only memory that is first used after the last sample is missed.
    pub(super) fn sample(&mut self, leader: u32) {
        if self.last.elapsed() < PERIOD.min(self.start.elapsed() / SAMPLES) {
            return;
        }
        self.last = Instant::now();
        let peaks = session::members(leader).into_iter().filter_map(|id| {
            let path = format!("/proc/{}/status", id.as_raw_nonzero());
            peak_bytes(&std::fs::read_to_string(path).ok()?)
        });
        self.peak_bytes = self.peak_bytes.max(peaks.sum());
    }

    /// The greatest sum, over all samples, of the peaks of the processes alive at that time. 0 if the system does
    /// not report them.
    pub(super) fn peak_bytes(&self) -> u64 {
        self.peak_bytes
    }
}

/// The peak resident memory in the text of `/proc/ID/status`.
fn peak_bytes(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::process::{Command, Stdio};

    #[test]
    fn the_memory_of_a_grandchild_is_sampled() {
        let mut command = Command::new("setsid");
        // `tail` keeps the last line, which is all 30 MB of it, until its input ends, and then waits to print it.
        command.args([
            "sh",
            "-c",
            "(head -c 30000000 /dev/zero; echo ready >&2; cat) | tail -n 1 > /dev/null",
        ]);
        command.stdin(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = [0; 6];
        child.stderr.take().unwrap().read_exact(&mut line).unwrap();
        let mut sampler = MemorySampler::new();
        // The last bytes may still be in the pipe.
        while sampler.peak_bytes() < 29_000_000 {
            sampler.sample(child.id());
        }
        drop(child.stdin.take());
        assert!(child.wait().unwrap().success());
    }

    #[test]
    fn the_peak_is_parsed() {
        assert_eq!(peak_bytes("Name:\ta\nVmHWM:\t    12 kB\nVmRSS:\t 3 kB\n"), Some(12 * 1024));
        assert_eq!(peak_bytes("Name:\ta\n"), None);
    }
}
