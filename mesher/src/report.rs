//! What a run says at its end: a table for people, JSON for programs.

use crate::comm::{Comm, Traffic, matrix};
use crate::digest::{Digests, hex};
use crate::lattice::Rules;
use crate::octant::{LEVEL_MAX, Level};
use crate::record::{Phase, Recorder, peak_rss_bytes};
use crate::sides::{Ambiguous, Sides};
use crate::stream::Counts;
use crate::{grade, voxelise};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// What a rank did, in numbers that repeat exactly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counters {
    values: [u64; COUNTERS.len()],
}

/// Names of the counters, in the order of their values.
const COUNTERS: [&str; 10] = [
    "facet_brick_tests",
    "bricks_voxelised",
    "rays",
    "octants_split_graded",
    "words_dilated",
    "halo_bricks",
    "messages",
    "message_bytes",
    "leaves",
    "base_leaf_cells_max",
];

impl Counters {
    fn add(&mut self, name: &str, v: u64) {
        let at =
            COUNTERS.iter().position(|n| *n == name).expect("the counter has a name in the list");
        self.values[at] += v;
    }

    pub(crate) fn voxelise(&mut self, w: &voxelise::Work) {
        self.add("facet_brick_tests", w.facet_brick_tests);
        self.add("bricks_voxelised", w.bricks_voxelised);
    }

    pub(crate) fn grade(&mut self, w: &grade::Work) {
        self.add("octants_split_graded", w.octants_split);
        self.add("words_dilated", w.words_dilated);
        self.add("halo_bricks", w.bricks_sent);
    }

    /// Rays are the same on all ranks, each casting them at its share of the facets; rank 0 counts them.
    pub(crate) fn sides(&mut self, s: &Sides, rank: usize) {
        self.add("rays", if rank == 0 { s.rays } else { 0 });
    }

    pub(crate) fn traffic(&mut self, t: Traffic) {
        self.add("messages", t.messages);
        self.add("message_bytes", t.bytes);
    }

    /// Cells in the heaviest of the rank's base leaves.
    pub(crate) fn base_leaf(&mut self, cells: u64) {
        self.add("base_leaf_cells_max", cells);
    }

    pub(crate) fn leaves(&mut self, n: u64) {
        self.add("leaves", n);
    }
}

/// One phase over all ranks.
#[derive(Clone, Debug, Serialize)]
pub struct PhaseEntry {
    /// Its name.
    pub name: String,
    /// Wall time by rank, in seconds.
    pub time_wall_s: Vec<f64>,
    /// CPU time by rank, in seconds, calls to other ranks included.
    pub time_cpu_s: Vec<f64>,
    /// Wall time in calls to other ranks, waiting included, by rank, in seconds.
    pub time_comm_wall_s: Vec<f64>,
    /// CPU time in calls to other ranks, by rank, in seconds; waiting may spin.
    pub time_comm_cpu_s: Vec<f64>,
    /// Messages sent, by rank.
    pub messages: Vec<u64>,
    /// Bytes sent, by rank.
    pub message_bytes: Vec<u64>,
}

/// Words that a phase takes in the gathering of the report.
const PHASE_WORDS: usize = 6;

/// A run's results. In JSON, under `schema`, `octree-mesher-run/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    schema: &'static str,
    program: &'static str,
    /// Facets in the geometry.
    pub facets: u64,
    /// Leaves of the mesh.
    pub cells: u64,
    /// Leaves by level, 0 to 19.
    pub cells_by_level: Vec<u64>,
    /// Leaves by side: outside, inside, crossing.
    pub cells_by_side: [u64; 3],
    /// The mesh's digest.
    pub digest: String,
    /// Edge of the root in the geometry's unit.
    pub root_edge: f64,
    /// Surface level.
    pub level_surface: Level,
    /// Level at which the tree was cut into base leaves.
    pub level_base: Level,
    /// Components of non-crossing leaves.
    pub components: u64,
    /// Those decided by majority.
    pub components_ambiguous: u64,
    /// Where one of them is.
    pub ambiguous_example: Option<[f64; 3]>,
    /// Number of ranks.
    pub ranks: usize,
    /// Wall time of the slowest rank, in seconds, from reading to the last leaf.
    pub time_wall_s: f64,
    /// Peak resident memory by rank; simulated ranks have equal parts of their process's.
    pub peak_rss_bytes: Vec<u64>,
    /// Times by phase and rank.
    pub phases: Vec<PhaseEntry>,
    /// Counters by rank.
    pub counters: BTreeMap<&'static str, Vec<u64>>,
    /// Who sent how much to whom, where asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message_matrix: Option<Vec<matrix::Entry>>,
}

impl Report {
    /// Gathers what all ranks have. Collective.
    #[expect(clippy::too_many_arguments, reason = "a report draws on everything")]
    pub(crate) fn gather(
        facets: u64,
        rules: &Rules,
        counts: &Counts,
        digests: &Digests,
        parts: &[[u64; 3]],
        sides: &Sides,
        level_base: Level,
        record: &Recorder,
        counters: &Counters,
        comm: &dyn Comm,
    ) -> Self {
        let mut counters = *counters;
        counters.leaves(parts[comm.rank()][0]);
        let mut words = vec![peak_rss_bytes() / comm.ranks_in_process() as u64];
        words.extend(counters.values);
        words.extend(record.phases().iter().flat_map(|p| {
            let t = p.traffic;
            let times =
                [p.time_wall_s, p.time_cpu_s, t.time_wall_s, t.time_cpu_s].map(f64::to_bits);
            [times[0], times[1], times[2], times[3], t.messages, t.bytes] as [u64; PHASE_WORDS]
        }));
        let all = comm.all_gather(&words);
        let column = |i: usize| all.messages().map(|(_, w)| w[i]).collect::<Vec<u64>>();
        let seconds = |i: usize| column(i).into_iter().map(f64::from_bits).collect::<Vec<f64>>();
        let first = 1 + COUNTERS.len();
        let entry = |(i, p): (usize, &Phase)| {
            let at = first + PHASE_WORDS * i;
            PhaseEntry {
                name: p.name.into(),
                time_wall_s: seconds(at),
                time_cpu_s: seconds(at + 1),
                time_comm_wall_s: seconds(at + 2),
                time_comm_cpu_s: seconds(at + 3),
                messages: column(at + 4),
                message_bytes: column(at + 5),
            }
        };
        let phases: Vec<PhaseEntry> = record.phases().iter().enumerate().map(entry).collect();
        let total = |r: usize| phases.iter().map(|p| p.time_wall_s[r]).sum::<f64>();
        let side = |s: usize| counts.by_level.iter().map(|l| l[s]).sum();
        let ambiguous: Option<Ambiguous> = sides.ambiguous;
        Self {
            schema: "octree-mesher-run/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            facets,
            cells: counts.total(),
            cells_by_level: counts.by_level[..=LEVEL_MAX as usize]
                .iter()
                .map(|l| l.iter().sum())
                .collect(),
            cells_by_side: std::array::from_fn(side),
            digest: hex(digests.whole()),
            root_edge: rules.root.edge,
            level_surface: rules.level_surface,
            level_base,
            components: sides.components,
            components_ambiguous: ambiguous.map_or(0, |a| a.count),
            ambiguous_example: ambiguous.map(|a| rules.root.locate(a.example)),
            ranks: comm.size(),
            time_wall_s: (0..comm.size()).map(total).fold(0.0, f64::max),
            peak_rss_bytes: column(0),
            phases,
            counters: COUNTERS.iter().enumerate().map(|(i, n)| (*n, column(1 + i))).collect(),
            message_matrix: None,
        }
    }

    /// Adds the message matrix of the run to rank 0's report. Collective.
    pub fn with_message_matrix(self, comm: &dyn Comm) -> Self {
        Self { message_matrix: Some(matrix::gather(comm)), ..self }
    }
}

/// Greatest over mean: 1 is perfect balance.
fn imbalance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    if mean > 0.0 { values.iter().fold(0.0, |m: f64, v| m.max(*v)) / mean } else { 1.0 }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [outside, inside, crossing] = self.cells_by_side;
        let peak: u64 = self.peak_rss_bytes.iter().sum();
        let cells = self.cells.max(1) as f64;
        writeln!(f, "facets         {}", grouped(self.facets))?;
        writeln!(
            f,
            "root edge      {} (level 0), surface level {}",
            self.root_edge, self.level_surface
        )?;
        writeln!(f, "cells          {}", grouped(self.cells))?;
        writeln!(
            f,
            "  by side      outside {}, inside {}, crossing {}",
            grouped(outside),
            grouped(inside),
            grouped(crossing)
        )?;
        for (l, &n) in self.cells_by_level.iter().enumerate().filter(|(_, n)| **n > 0) {
            writeln!(
                f,
                "  level {l:>2}     {:>16}   edge {:e}",
                grouped(n),
                self.root_edge / f64::from(1u32 << l)
            )?;
        }
        write!(f, "components     {}", grouped(self.components))?;
        match self.ambiguous_example {
            None => writeln!(f)?,
            Some(p) => writeln!(
                f,
                ", {} decided by majority, one at ({}, {}, {})",
                self.components_ambiguous, p[0], p[1], p[2]
            )?,
        }
        writeln!(f, "digest         {}", self.digest)?;
        let ownership: Vec<f64> = self.counters["leaves"].iter().map(|n| *n as f64).collect();
        writeln!(
            f,
            "ranks          {}, cells max/mean {:.3}, base level {}",
            self.ranks,
            imbalance(&ownership),
            self.level_base
        )?;
        writeln!(f, "phase              wall s     cpu s   cpu max/mean")?;
        for p in &self.phases {
            let wall = p.time_wall_s.iter().fold(0.0, |m: f64, v| m.max(*v));
            let cpu: f64 = p.time_cpu_s.iter().sum();
            writeln!(
                f,
                "  {:<12} {wall:>10.3} {cpu:>9.3}   {:>8.3}",
                p.name,
                imbalance(&p.time_cpu_s)
            )?;
        }
        writeln!(
            f,
            "time           {:.3} s wall, {:.2} M cells/s",
            self.time_wall_s,
            cells / self.time_wall_s.max(1e-9) / 1e6
        )?;
        write!(
            f,
            "peak memory    {:.1} MB over all ranks, {:.2} bytes per cell",
            peak as f64 / 1e6,
            peak as f64 / cells
        )
    }
}

/// A number with its digits in threes.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_in_threes() {
        assert_eq!(
            [0, 12, 123, 1234, 1_234_567].map(grouped),
            ["0", "12", "123", "1,234", "1,234,567"]
        );
    }

    #[test]
    fn imbalance_is_greatest_over_mean() {
        assert_eq!(imbalance(&[1.0, 3.0]), 1.5);
        assert_eq!(imbalance(&[0.0]), 1.0);
    }
}
