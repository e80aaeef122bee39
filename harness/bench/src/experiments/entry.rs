//! What a line of a benchmark record says: schema `octree-bench/1`, described in reports/README.md.
//!
//! Invariants: a line stands by itself but for its session, whose first line describes the machine; seconds,
//! bytes and counts are plain numbers in the units of their names; ranks are told by sum and greatest value,
//! and one by one only in useful times, up to [`BY_RANK_MAX`] ranks, so that a record stays small.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name and version of the schema.
pub const SCHEMA: &str = "octree-bench/1";
/// Most ranks whose values are kept one by one.
pub const BY_RANK_MAX: usize = 1024;

/// One line of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// [`SCHEMA`].
    pub schema: String,
    /// The invocation of `harness bench` that wrote it.
    pub session: String,
    /// When it was written, as `2026-01-31T12:00:00Z`.
    pub time_utc: String,
    /// What it says.
    #[serde(flatten)]
    pub what: What,
}

/// The kinds of lines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum What {
    /// A session begins.
    Session(Box<Session>),
    /// What a message costs.
    Network(Network),
    /// A program ran.
    Run(Box<Run>),
    /// A program ran and did not do what it should.
    Failure(Failure),
    /// A mesh was written and `harness audit` read it.
    Audit(Audited),
    /// A target was held against what was measured.
    Target(Judged),
}

/// What stays the same in a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The harness's command line.
    pub command: Vec<String>,
    /// Where it ran.
    pub machine: Machine,
    /// Runs that other work on the machine may have disturbed: load average when it began.
    pub load_average: f64,
}

/// A machine and the software that matters for what was measured on it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the processor.
    pub cpu: String,
    /// Cores that the harness may use.
    pub cores: usize,
    /// Main memory.
    pub memory_bytes: u64,
    /// Operating system and kernel.
    pub kernel: String,
    /// The MPI library; empty where there is none.
    pub mpi: String,
    /// The compiler on the path; the programs were built with it unless they were brought from elsewhere.
    pub compiler: String,
    /// The repository's commit, `-dirty` if files differ from it.
    pub commit: String,
}

/// Latency and bandwidth of the network between ranks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Time of an empty message, one way.
    pub latency_s: f64,
    /// Bytes per second of a long message.
    pub bandwidth_bytes_per_s: f64,
    /// Whether a ping-pong measured them; otherwise they were given.
    pub measured: bool,
}

/// How ranks of a run talked to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Comm {
    /// One rank, no messages.
    Solo,
    /// Ranks started by a launcher.
    Mpi,
    /// Ranks in one process, one at a time: CPU times are clean, wall times mean nothing.
    Sim,
}

/// A quantity over the ranks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Over all ranks.
    pub sum: f64,
    /// Of the rank that has most.
    pub max: f64,
    /// That rank.
    pub at: usize,
    /// Rank by rank, where that is kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_rank: Vec<f64>,
}

impl Spread {
    /// Of the values of ranks 0, 1, ... To six digits behind the point: a microsecond where it is time.
    pub fn of(values: &[f64]) -> Self {
        let round = |v: f64| (v * 1e6).round() / 1e6;
        let at = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let keep = if values.len() <= BY_RANK_MAX { values } else { &[] };
        Self {
            sum: round(values.iter().sum()),
            max: round(values.get(at).copied().unwrap_or(0.0)),
            at,
            by_rank: keep.iter().map(|v| round(*v)).collect(),
        }
    }

    /// The same without values rank by rank.
    pub fn brief(values: &[f64]) -> Self {
        Self { by_rank: Vec::new(), ..Self::of(values) }
    }

    /// Greatest over mean: 1 where all ranks have the same, and where none has anything.
    pub fn lambda(&self, ranks: usize) -> f64 {
        if self.sum > 0.0 { self.max * ranks as f64 / self.sum } else { 1.0 }
    }
}

/// A phase of a run over its ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// The program's name for it.
    pub name: String,
    /// CPU time outside calls to other ranks, in seconds.
    pub useful_s: Spread,
    /// Wall time, in seconds; meaningless where ranks take turns.
    pub wall_s: Spread,
    /// Wall time in calls to other ranks, waiting included, in seconds; as meaningless.
    pub comm_s: Spread,
    /// Messages sent.
    pub messages: Spread,
    /// Bytes sent.
    pub message_bytes: Spread,
}

/// What was run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Which experiment it belongs to: `strong`, `weak`, `spacing`, `layers`, `weights`; or `targets`.
    pub experiment: String,
    /// The program.
    pub engine: String,
    /// The case that was varied.
    pub case: String,
    /// Edge length of the finest cell at the surface.
    pub spacing_min: f64,
    /// n.
    pub layer_cells_min: u32,
    /// Number of ranks.
    pub ranks: usize,
    /// How they talked.
    pub comm: Comm,
    /// `metis` or `morton`; empty for a program that has no choice.
    pub partitioner: String,
    /// `unit`, `area`, `rehearsal` or `rebalance`; empty likewise.
    pub weights: String,
}

/// A run and what it took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What was run.
    pub setup: Setup,
    /// Repetition, from 0.
    pub repeat: usize,
    /// Left out of statistics: it fills caches.
    pub warm_up: bool,
    /// More ranks than cores: wall times are those of a crowd.
    pub oversubscribed: bool,
    /// The command line.
    pub command: String,
    /// Facets of the geometry.
    pub facets: u64,
    /// Leaves of the mesh.
    pub cells: u64,
    /// The mesh's digest.
    pub digest: String,
    /// Wall time by the program's own clock, reading included, starting and ending of processes not.
    pub time_wall_s: f64,
    /// Wall time as the harness saw it, from the launcher's start to its end.
    pub time_launch_s: f64,
    /// Peak resident memory by rank; of the whole process where ranks are simulated, told by rank 0.
    pub peak_rss_bytes: Spread,
    /// CPU time outside calls to other ranks, over all phases.
    pub useful_s: Spread,
    /// Phase by phase, in order.
    pub phases: Vec<Phase>,
    /// The program's counters.
    pub counters: BTreeMap<String, Spread>,
    /// Who sent how much to whom in exchanges, where that was asked for: sender, receiver, messages and
    /// bytes of every pair that exchanged anything.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub message_matrix: Vec<[u64; 4]>,
}

/// A run that came to nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// What was run.
    pub setup: Setup,
    /// The command line.
    pub command: String,
    /// In a sentence.
    pub why: String,
}

/// A mesh that was written to disk and audited.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Audited {
    /// What was meshed.
    pub setup: Setup,
    /// The audit's command line.
    pub command: String,
    /// Leaves of the mesh.
    pub cells: u64,
    /// Whether every check of the audit holds.
    pub holds: bool,
    /// Checks that found something.
    pub found: Vec<String>,
    /// CPU time of the audit's process.
    pub time_cpu_s: f64,
    /// Its wall time.
    pub time_wall_s: f64,
    /// Its peak resident memory.
    pub peak_rss_bytes: u64,
}

/// A row of a table of targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The row's name.
    pub name: String,
    /// The runs that it is about, by their names in the file of targets.
    pub runs: Vec<String>,
    /// The run that they are held against, where the measure has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<String>,
    /// What is measured.
    pub measure: String,
    /// Least value wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
    /// Greatest value wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// What was measured; nothing where the row was left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<f64>,
    /// `measured`, `oversubscribed`, `projected` or `audited`; empty where the row was left out.
    pub how: String,
    /// What came of it.
    pub verdict: Verdict,
    /// Why it was left out or failed.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// What came of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Within its bounds.
    Met,
    /// Measured and not within them.
    Missed,
    /// It has no bounds: it is there for comparison.
    Told,
    /// It was to be measured, and a run failed.
    Failed,
    /// It was not measured, by the user's wish or for want of something.
    LeftOut,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_keeps_ranks_up_to_a_number() {
        let few = Spread::of(&[1.0, 3.0, 2.0]);
        assert_eq!((few.sum, few.max, few.at, few.by_rank.len()), (6.0, 3.0, 1, 3));
        assert_eq!(few.lambda(3), 1.5);
        let many = Spread::of(&[1.0; BY_RANK_MAX + 1]);
        assert_eq!((many.sum, many.by_rank.len()), ((BY_RANK_MAX + 1) as f64, 0));
        assert_eq!(Spread::of(&[0.0, 0.0]).lambda(2), 1.0);
    }

    #[test]
    fn lines_say_their_kind_and_survive_the_journey() {
        let network = Network { latency_s: 1e-6, bandwidth_bytes_per_s: 1e10, measured: true };
        let line = Line {
            schema: SCHEMA.into(),
            session: "s".into(),
            time_utc: "2026-01-31T12:00:00Z".into(),
            what: What::Network(network),
        };
        let text = serde_json::to_string(&line).unwrap();
        assert!(text.contains(r#""kind":"network""#), "{text}");
        assert_eq!(serde_json::from_str::<Line>(&text).unwrap(), line);
    }
}
