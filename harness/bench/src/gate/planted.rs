//! A program with planted slow-downs, for the gate's own test. It meshes nothing: it has three phases of a known number of
//! operations and reports their CPU times and counts in the way meshers do.

use cpu_time::ProcessTime;
use serde_json::json;
use std::fs;
use std::hint::black_box;
use std::io;
use std::path::Path;
use std::time::Instant;

/// The phases, in order. A function of the same name does the work of each.
pub const PHASES: [&str; 3] = ["planted_first", "planted_second", "planted_third"];

/// Operations of the phases without a slow-down.
const OPERATIONS: [u64; 3] = [4_000_000, 10_000_000, 6_000_000];

/// How a program is slowed down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// More operations, which the program counts.
    Counted,
    /// More operations, which it does not count.
    Uncounted,
    /// Waiting without operations after the last phase, as for a disk.
    Waiting,
}

/// A slow-down; none if it has 0 percent.
#[derive(Clone, Copy, Debug)]
pub struct SlowDown {
    /// How.
    pub kind: Kind,
    /// Index of the phase.
    pub phase: usize,
    /// Additional time, in percent of that of the whole program.
    pub percent: f64,
}

/// Does the work, and writes a run report to `json`.
///
/// # Errors
/// If the report cannot be written.
pub fn run(json: Option<&Path>, slow: SlowDown) -> io::Result<()> {
    let start = Instant::now();
    let total: u64 = OPERATIONS.iter().sum();
    let mut counters = serde_json::Map::new();
    let mut phases = Vec::new();
    for (i, work) in [planted_first, planted_second, planted_third].into_iter().enumerate() {
        let here = slow.phase == i && slow.kind != Kind::Waiting;
        let more = if here { (slow.percent / 100.0 * total as f64) as u64 } else { 0 };
        let cpu = ProcessTime::now();
        black_box(work(black_box(OPERATIONS[i] + more)));
        phases.push(json!({ "name": PHASES[i], "time_cpu_s": [cpu.elapsed().as_secs_f64()] }));
        let counted = if slow.kind == Kind::Counted { more } else { 0 };
        counters.insert(format!("{}_operations", PHASES[i]), json!([OPERATIONS[i] + counted]));
    }
    if slow.kind == Kind::Waiting {
        std::thread::sleep(start.elapsed().mul_f64(slow.percent / 100.0));
    }
    let Some(path) = json else { return Ok(()) };
    let report = json!({
        "cells": 1, "digest": "0".repeat(32), "time_wall_s": start.elapsed().as_secs_f64(),
        "counters": counters, "phases": phases,
    });
    fs::write(path, report.to_string())
}

/// Operations that depend on each other, so that their time is proportional to their number.
macro_rules! phase {
    ($name:ident, $factor:literal) => {
        #[inline(never)]
        fn $name(operations: u64) -> u64 {
            (0..operations).fold(1u64, |x, i| black_box(x).wrapping_mul($factor).wrapping_add(i))
        }
    };
}

phase!(planted_first, 6_364_136_223_846_793_005);
phase!(planted_second, 2_862_933_555_777_941_757);
phase!(planted_third, 3_202_034_522_624_059_733);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_counted_operations_are_counted() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("run.json");
        for (kind, counted) in [(Kind::Counted, 12_000_000), (Kind::Uncounted, 10_000_000)] {
            run(Some(&path), SlowDown { kind, phase: 1, percent: 10.0 }).unwrap();
            let report = run::engine::report::RunReport::read(&path).unwrap();
            assert_eq!(report.counters["planted_second_operations"], [counted], "{kind:?}");
            assert_eq!(report.counters["planted_first_operations"], [4_000_000]);
            assert!(report.phases.len() == 3 && report.time_cpu_s().is_some());
        }
    }
}
