//! The report of a run: a table for people, JSON for programs.
//!
//! Invariants of a report, which [`Report::check_invariants`] executes before it is returned:
//! - leaves by level, by side and by rank add up to all leaves, and a rank's heaviest base leaf has no more than the rank;
//! - no more components are enclosed than outside, each with a leaf, and no more decided by majority than there are; both have an example
//!   if and only if there are any;
//! - times are finite and not negative.

use crate::Mesh;
use crate::output::leaves::{MeshEntry, SIDES};
use crate::output::warnings;
use crate::partition::Partitioner;
use crate::record::{Job, Phase, peak_rss_bytes};
use crate::sides::Summary;
use bricks::octant::Level;
use ranks::gather;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

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
    /// CPU time in calls to other ranks, by rank, in seconds; includes busy waiting.
    pub time_comm_cpu_s: Vec<f64>,
    /// Messages sent, by rank.
    pub messages: Vec<u64>,
    /// Bytes sent, by rank.
    pub message_bytes: Vec<u64>,
}

/// A run's results: those of its mesh, which the manifest has as well, and those of its ranks. In JSON, under `schema`, `octree-mesher-run/2`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    schema: &'static str,
    /// The mesh in numbers.
    #[serde(flatten)]
    pub mesh: MeshEntry,
    /// Facets in the geometry.
    pub facets: u64,
    /// Leaves of the mesh.
    pub cells: u64,
    /// Level of the base leaves, or of the octants between which partition boundaries lie.
    pub level_base: Level,
    /// The partitioner that was used: METIS leaves few base leaves to the curve. None for a single rank.
    pub partitioner: Option<Partitioner>,
    /// What is probably not as the user intended, and what to try: a sentence each.
    pub warnings: Vec<String>,
    /// Number of ranks.
    pub ranks: usize,
    /// Wall time of the slowest rank, in seconds, from reading to the last leaf.
    pub time_wall_s: f64,
    /// Peak resident memory by rank; simulated ranks report equal fractions of their process's.
    pub peak_rss_bytes: Vec<u64>,
    /// Times by phase and rank.
    pub phases: Vec<PhaseEntry>,
    /// Counters by rank.
    pub counters: BTreeMap<String, Vec<u64>>,
}

impl Report {
    /// The report of a run that has made `mesh`, with the counters and times of all ranks. Collective.
    pub(crate) fn new(mesh: &Mesh, entry: MeshEntry, job: &Job) -> Self {
        let Job { comm, record, counters, .. } = job;
        let counters: BTreeMap<String, u64> = serde_json::to_value(counters)
            .and_then(serde_json::from_value)
            .expect("counters are numbers with names");
        let mut words: Vec<u64> = counters.values().copied().collect();
        words.extend(record.phases.iter().flat_map(|p| {
            let t = p.traffic;
            let times = [p.time_wall_s, p.time_cpu_s, t.time_wall_s, t.time_cpu_s];
            times.map(f64::to_bits).into_iter().chain([t.messages, t.bytes])
        }));
        let all = comm.all_gather(&words);
        // The columns of the table that has a row for each rank.
        let mut columns = (0..).map(|i| all.messages().map(|(_, w)| w[i]).collect::<Vec<u64>>());
        let mut column = || columns.next().expect("columns have no end");
        let counters = counters.into_keys().map(|name| (name, column())).collect();
        let phase = |phase: &Phase| {
            let mut seconds = || column().into_iter().map(f64::from_bits).collect::<Vec<f64>>();
            PhaseEntry {
                name: phase.name.into(),
                time_wall_s: seconds(),
                time_cpu_s: seconds(),
                time_comm_wall_s: seconds(),
                time_comm_cpu_s: seconds(),
                messages: column(),
                message_bytes: column(),
            }
        };
        let phases: Vec<PhaseEntry> = record.phases.iter().map(phase).collect();
        // The tables of all ranks take memory, too.
        comm.sum(0);
        let peak_rss_bytes = gather(*comm, &[peak_rss_bytes() / comm.ranks_in_process() as u64]);
        let total = |r: usize| phases.iter().map(|p| p.time_wall_s[r]).sum::<f64>();
        let report = Self {
            schema: "octree-mesher-run/2",
            facets: mesh.facets.total,
            cells: entry.leaves,
            mesh: entry,
            level_base: mesh.level_base,
            partitioner: mesh.partitioner,
            warnings: warnings::of(mesh, &job.options.case_name),
            ranks: comm.size(),
            time_wall_s: (0..comm.size()).map(total).fold(0.0, f64::max),
            peak_rss_bytes,
            phases,
            counters,
        };
        report.check_invariants();
        report
    }

    /// # Panics
    /// If an invariant at the head of this file is violated.
    pub fn check_invariants(&self) {
        let (all, mesh) = (self.cells, &self.mesh);
        let check = |by: &str, sum: u64| assert_eq!(sum, all, "leaves by {by} must add up to all");
        check("level", mesh.leaves_by_level.iter().sum());
        check("side", mesh.leaves_by_side.values().sum());
        check("rank", self.counters["leaves"].iter().sum());
        let heaviest = self.counters["base_leaf_cells_max"].iter().zip(&self.counters["leaves"]);
        for (rank, (heaviest, leaves)) in heaviest.enumerate() {
            assert!(heaviest <= leaves, "rank {rank}: a base leaf of {heaviest} of all {leaves}");
        }
        let Summary { outside, inside, enclosed: e, ambiguous: a, .. } = mesh.components;
        let is_right = e.count <= outside.min(e.leaves) && e.example.is_some() == (e.count > 0);
        assert!(is_right, "{e:?} of {outside} outside components");
        let is_right = a.count <= outside + inside && a.example.is_some() == (a.count > 0);
        assert!(is_right, "{a:?} of all components");
        for p in &self.phases {
            let times = [&p.time_wall_s, &p.time_cpu_s, &p.time_comm_wall_s, &p.time_comm_cpu_s];
            let are_times = times.into_iter().flatten().all(|t| t.is_finite() && *t >= 0.0);
            assert!(are_times, "{p:?} must have times");
        }
    }
}

/// The greatest value divided by the mean: 1 is perfect balance.
fn imbalance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    if mean > 0.0 { values.iter().fold(0.0, |m: f64, v| m.max(*v)) / mean } else { 1.0 }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mesh, level_base, ranks, .. } = self;
        let (root, level_surface) = (&mesh.rules.root, mesh.rules.level_surface);
        let [outside, inside, crossing] = SIDES.map(|side| grouped(mesh.leaves_by_side[side]));
        writeln!(f, "facets         {}", grouped(self.facets))?;
        writeln!(f, "root edge      {} (level 0), surface level {level_surface}", root.edge)?;
        writeln!(f, "cells          {}", grouped(self.cells))?;
        writeln!(f, "  by side      outside {outside}, inside {inside}, crossing {crossing}")?;
        for (l, &n) in mesh.leaves_by_level.iter().enumerate().filter(|(_, n)| **n > 0) {
            let (cells, edge) = (grouped(n), root.edge_of(l as Level));
            writeln!(f, "  level {l:>2}     {cells:>16}   edge {edge:e}")?;
        }
        let Summary { outside, inside, enclosed, ambiguous, .. } = mesh.components;
        let [outside, inside, enclosed, ambiguous] =
            [outside, inside, enclosed.count, ambiguous.count].map(grouped);
        write!(f, "components     outside {outside}, inside {inside}; ")?;
        writeln!(f, "enclosed {enclosed}, decided by majority {ambiguous}")?;
        writeln!(f, "digest         {}", mesh.digest)?;
        let leaves: Vec<f64> = self.counters["leaves"].iter().map(|n| *n as f64).collect();
        let lambda = imbalance(&leaves);
        let partitioned = match self.partitioner {
            None => "",
            Some(Partitioner::Metis) => ", partitioned by METIS",
            Some(Partitioner::Morton) => ", partitioned along the curve",
            Some(Partitioner::Paper) => ", partitioned as in the paper",
        };
        write!(f, "ranks          {ranks}, cells max/mean {lambda:.3}, ")?;
        writeln!(f, "base level {level_base}{partitioned}")?;
        writeln!(f, "phase              wall s     cpu s   cpu max/mean")?;
        for PhaseEntry { name, time_wall_s, time_cpu_s, .. } in &self.phases {
            let wall = time_wall_s.iter().copied().fold(0.0, f64::max);
            let (cpu, lambda) = (time_cpu_s.iter().sum::<f64>(), imbalance(time_cpu_s));
            writeln!(f, "  {name:<12} {wall:>10.3} {cpu:>9.3}   {lambda:>8.3}")?;
        }
        let (cells, wall) = (self.cells as f64, self.time_wall_s);
        let (rate, peak) = (cells / wall.max(1e-9) / 1e6, self.peak_rss_bytes.iter().sum::<u64>());
        writeln!(f, "time           {wall:.3} s wall, {rate:.2} M cells/s")?;
        write!(f, "peak memory    {:.1} MB over all ranks", peak as f64 / 1e6)?;
        if cells > 0.0 { write!(f, ", {:.2} bytes per cell", peak as f64 / cells) } else { Ok(()) }
    }
}

/// A number with a comma before each group of three digits.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sides::{Ambiguous, EnclosedComponents};
    use ranks::{Comm, sim};

    fn report() -> Report {
        let of_rank = |comm: &dyn Comm| {
            let mut record = crate::record::Recorder::default();
            let options = crate::tests::options();
            let mut job = Job::new(&options, comm, &mut record);
            crate::mesh(&crate::tests::case(), &mut job, |_, _| Ok(()))
        };
        sim::run(2, 1, |comm| of_rank(comm)).swap_remove(0).expect("a good case")
    }

    #[test]
    fn a_wrong_report_is_not_returned() {
        let sound = report();
        sound.check_invariants();
        let example = Some([0.0; 3]);
        let enclosed = |count, leaves| EnclosedComponents { count, leaves, example };
        let corruptions: [&dyn Fn(&mut Report); 11] = [
            &|r| r.cells += 1,
            &|r| r.mesh.leaves_by_level[3] += 1,
            &|r| *r.mesh.leaves_by_side.get_mut("inside").expect("a side") += 1,
            &|r| r.counters.get_mut("leaves").expect("a counter")[1] += 1,
            &|r| r.counters.get_mut("base_leaf_cells_max").expect("a counter")[0] = r.cells,
            &|r| r.mesh.components.enclosed = enclosed(2, 9),
            &|r| r.mesh.components.enclosed = enclosed(1, 0),
            &|r| r.mesh.components.enclosed = enclosed(0, 0),
            &|r| r.mesh.components.ambiguous = Ambiguous { count: 3, example },
            &|r| r.mesh.components.ambiguous = Ambiguous { count: 1, example: None },
            &|r| r.phases[2].time_cpu_s[1] = f64::NAN,
        ];
        for (number, corrupt) in corruptions.into_iter().enumerate() {
            let mut report = sound.clone();
            corrupt(&mut report);
            let check = std::panic::AssertUnwindSafe(|| report.check_invariants());
            assert!(std::panic::catch_unwind(check).is_err(), "corruption {number}");
        }
    }

    #[test]
    fn digits_are_grouped_in_threes() {
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

    #[test]
    fn a_report_shows_its_numbers() {
        let phase = PhaseEntry {
            name: "sides".into(),
            time_wall_s: vec![0.25, 0.5],
            time_cpu_s: vec![1.0, 3.0],
            time_comm_wall_s: vec![],
            time_comm_cpu_s: vec![],
            messages: vec![],
            message_bytes: vec![],
        };
        let mut report = report();
        (report.facets, report.cells, report.phases) = (1280, 3_000_000, vec![phase]);
        report.mesh.leaves_by_level = vec![0, 0, 1234];
        report.mesh.leaves_by_side = SIDES.into_iter().zip([1000, 2000, 3]).collect();
        (report.mesh.rules.root.edge, report.mesh.rules.level_surface) = (8.0, 2);
        report.mesh.digest = "abc".into();
        let example = Some([0.0; 3]);
        report.mesh.components = Summary {
            outside: 1500,
            inside: 1,
            enclosed: EnclosedComponents { count: 1000, leaves: 2000, example },
            ambiguous: Ambiguous { count: 7, example },
            ..Summary::default()
        };
        (report.level_base, report.time_wall_s) = (1, 0.5);
        report.peak_rss_bytes = vec![2_000_000, 4_000_000];
        report.counters.insert("leaves".into(), vec![1, 3]);
        let text = "facets         1,280\n\
                    root edge      8 (level 0), surface level 2\n\
                    cells          3,000,000\n  by side      outside 1,000, inside 2,000, crossing 3\n  \
                    level  2                1,234   edge 2e0\n\
                    components     outside 1,500, inside 1; enclosed 1,000, decided by majority 7\n\
                    digest         abc\n\
                    ranks          2, cells max/mean 1.500, base level 1, partitioned along the curve\n\
                    phase              wall s     cpu s   cpu max/mean\n  \
                    sides             0.500     4.000      1.500\n\
                    time           0.500 s wall, 6.00 M cells/s\n\
                    peak memory    6.0 MB over all ranks, 2.00 bytes per cell";
        assert_eq!(report.to_string(), text);
        report.cells = 0;
        assert!(
            report.to_string().ends_with("0.00 M cells/s\npeak memory    6.0 MB over all ranks")
        );
    }
}
