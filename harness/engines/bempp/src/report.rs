//! The run report: times of phases, memory and digest, of all ranks.

use contract::digest::Digest;
use mpi::datatype::Equivalence;
use mpi::traits::CommunicatorCollectives;
use rustix::time::{ClockId, clock_gettime};
use serde_json::json;
use std::path::Path;
use std::{fs, io};

/// Wall and CPU time of the phases of this rank, in seconds.
pub struct Clock {
    phases: Vec<(&'static str, [f64; 2])>,
    last: [f64; 2],
}

impl Clock {
    /// Starts the first phase.
    pub fn start() -> Self {
        Self { phases: Vec::new(), last: now() }
    }

    /// Ends a phase and starts the next.
    pub fn end(&mut self, name: &'static str) {
        let now = now();
        self.phases.push((name, [now[0] - self.last[0], now[1] - self.last[1]]));
        self.last = now;
    }
}

fn now() -> [f64; 2] {
    [ClockId::Monotonic, ClockId::ProcessCPUTime].map(|clock| {
        let time = clock_gettime(clock);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    })
}

/// Writes the report. Collective; only rank 0 writes.
///
/// # Errors
/// If the file cannot be written.
pub fn write(
    path: &Path,
    clock: &Clock,
    words: &[u64],
    comm: &impl CommunicatorCollectives,
) -> io::Result<()> {
    let digest = Digest::of(words).0;
    let counts = gathered(
        comm,
        &[words.len() as u64, peak_rss_bytes(), (digest >> 64) as u64, digest as u64],
    );
    let times: Vec<f64> = clock.phases.iter().flat_map(|phase| phase.1).collect();
    let times = gathered(comm, &times);
    if comm.rank() != 0 {
        return Ok(());
    }
    let sum = counts.iter().map(|c| u128::from(c[2]) << 64 | u128::from(c[3]));
    let digest = Digest(sum.fold(0, u128::wrapping_add));
    let column = |i: usize| -> Vec<f64> { times.iter().map(|rank| rank[i]).collect() };
    let phases = clock.phases.iter().enumerate();
    let phases: Vec<_> = phases
        .map(|(i, (name, _))| json!({"name": name, "time_wall_s": column(2 * i), "time_cpu_s": column(2 * i + 1)}))
        .collect();
    let walls = times.iter().map(|rank| rank.iter().step_by(2).sum::<f64>());
    let report = json!({
        "cells": counts.iter().map(|c| c[0]).sum::<u64>(),
        "digest": digest.to_string(),
        "ranks": counts.len(),
        "time_wall_s": walls.fold(0.0, f64::max),
        "peak_rss_bytes": counts.iter().map(|c| c[1]).collect::<Vec<_>>(),
        "phases": phases,
    });
    fs::write(path, report.to_string())
}

/// The values of every rank.
fn gathered<T: Equivalence + Clone + Default>(
    comm: &impl CommunicatorCollectives,
    own: &[T],
) -> Vec<Vec<T>> {
    let mut all = vec![T::default(); own.len() * comm.size() as usize];
    comm.all_gather_into(own, &mut all[..]);
    all.chunks(own.len()).map(<[T]>::to_vec).collect()
}

/// The peak of this process so far, from `/proc`; 0 if it is not known.
fn peak_rss_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = status.lines().find_map(|line| {
        line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<u64>().ok()
    });
    kib.unwrap_or(0) * 1024
}
