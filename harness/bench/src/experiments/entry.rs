//! The record: a file of [JSON lines](crate::jsonl) to which every result is appended immediately. reports/README.md describes
//! its schema, `octree-bench/1`.
//!
//! Invariants: a line depends on no other line but the first of its session, which describes the machine; seconds, bytes
//! and counts are plain numbers in the units of their names; values over the ranks are stored as sum and maximum, and
//! rank by rank only for useful times on up to [`BY_RANK_MAX`] ranks, so that a record stays small.

use crate::jsonl;
use jiff::Timestamp;
use run::engine::report::{CLOCKS_S, SECONDS_MAX};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::{fmt, io};

/// Name and version of the schema.
pub const SCHEMA: &str = "octree-bench/1";
/// The [`Setup::experiment`] of runs for targets.
pub const TARGETS: &str = "targets";
/// The greatest number of ranks whose values are stored rank by rank.
pub const BY_RANK_MAX: usize = 1024;

/// One line of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// [`SCHEMA`].
    pub schema: String,
    /// Identifier of the invocation of `harness bench` that wrote it.
    pub session: String,
    /// Time of writing, such as `2026-01-31T12:00:00Z`.
    pub time_utc: String,
    /// The content.
    #[serde(flatten)]
    pub entry: Entry,
}

impl Line {
    /// A line of a session, as of now.
    pub fn new(session: &str, entry: Entry) -> Self {
        let (schema, session) = (SCHEMA.to_owned(), session.to_owned());
        Self { schema, session, time_utc: now_utc(), entry }
    }

    /// Whether the numbers are those that a run can have. All tables and figures take them as such.
    pub fn is_possible(&self) -> bool {
        match &self.entry {
            Entry::Network(network) => network.is_possible(),
            // Only a coarser mesh, by which a spacing is found, may have no cells.
            Entry::Run(run) => run.cells > 0 && run.is_possible(),
            _ => true,
        }
    }

    /// Returns the session that the line begins, if it begins one.
    pub fn session(&self) -> Option<&Session> {
        let Entry::Session(session) = &self.entry else { return None };
        Some(session)
    }

    /// Returns the network of the line, if it states one, with its session.
    pub fn network(&self) -> Option<(&str, Network)> {
        let Entry::Network(network) = &self.entry else { return None };
        Some((&self.session, *network))
    }

    /// Returns the parameters of the line's run, with or without a result.
    pub fn setup(&self) -> Option<&Setup> {
        match &self.entry {
            Entry::Run(run) => Some(&run.setup),
            Entry::Failure(without) | Entry::LeftOut(without) => Some(&without.setup),
            _ => None,
        }
    }

    /// Returns the run of the line, if it has one.
    pub fn run(&self) -> Option<&Run> {
        let Entry::Run(run) = &self.entry else { return None };
        Some(run)
    }
}

/// The content of a line, by kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Entry {
    /// A session begins.
    Session(Box<Session>),
    /// The cost of messages.
    Network(Network),
    /// A program ran.
    Run(Box<Run>),
    /// A program failed.
    Failure(NoResult),
    /// A program was not run on a mesh.
    LeftOut(NoResult),
}

/// The circumstances of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The harness's command line.
    pub command: Vec<String>,
    /// The machine.
    pub machine: Machine,
    /// Names of the machines on which ranks run: those of Slurm's job, else of this one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub nodes: String,
    /// Load average at the beginning: a high value means that other work may have disturbed the runs.
    pub load_average: f64,
    /// By program: what it does not do or promise.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub lacks: Lacks,
}

impl Session {
    /// A sentence, if the load was so high that other work may have disturbed the runs.
    pub fn disturbed(&self) -> Option<String> {
        let load = self.load_average;
        let why = "other processes may have disturbed a session, whose load average was";
        (load > 0.5 * self.machine.cores as f64).then(|| format!("{why} {load:.1}"))
    }
}

/// By program: what it does not do or promise.
pub type Lacks = BTreeMap<String, Vec<String>>;

/// A machine, and the software that affects measurements on it.
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
    /// The MPI library; empty if there is none.
    pub mpi: String,
    /// The compiler on the path; the programs were built with it unless they come from another machine.
    pub compiler: String,
    /// The repository's commit, with `-dirty` if files differ from it.
    pub commit: String,
}

/// Latency and bandwidth of the network between ranks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Time of an empty message, one way.
    pub latency_s: f64,
    /// Bandwidth of a long message, in bytes per second.
    pub bandwidth_bytes_per_s: f64,
    /// Whether a ping-pong measured them; otherwise they are given, or [`ASSUMED`].
    pub measured: bool,
    /// Whether the user gave them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub given: bool,
}

/// The default: a current cluster interconnect.
pub const ASSUMED: Network =
    Network { latency_s: 2e-6, bandwidth_bytes_per_s: 1e10, measured: false, given: false };

impl Network {
    /// Whether the times of an empty message, and of one more byte, are those that a clock can show.
    pub(super) fn is_possible(&self) -> bool {
        let is_finite = self.bandwidth_bytes_per_s.is_finite();
        is_finite && are_times([self.latency_s, 1.0 / self.bandwidth_bytes_per_s])
    }

    /// Returns the time of a rank's messages, in seconds.
    pub(crate) fn time_s(&self, messages: f64, bytes: f64) -> f64 {
        messages * self.latency_s + bytes / self.bandwidth_bytes_per_s
    }
}

/// How the ranks of a run communicate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Comm {
    /// One rank, no messages.
    #[default]
    Solo,
    /// Ranks started by a launcher.
    Mpi,
    /// Ranks in one process, of which one runs at a time: CPU times are undisturbed, wall times are meaningless.
    Sim,
}

/// Whether a clock can show all of these times.
fn are_times(times: impl IntoIterator<Item = f64>) -> bool {
    times.into_iter().all(|time| (0.0..=SECONDS_MAX).contains(&time))
}

/// How far a sum may be from that of so many stored values.
fn rounding(count: usize, sum: f64) -> f64 {
    1e-6 * (1 + count) as f64 + 1e-9 * sum
}

/// A quantity over the ranks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Over all ranks.
    pub sum: f64,
    /// Maximum over the ranks.
    pub max: f64,
    /// The rank with the maximum.
    pub at: usize,
    /// Values rank by rank, if they are stored.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_rank: Vec<f64>,
}

impl Spread {
    /// The spread of the values of ranks 0, 1, ..., rounded to six decimals: a microsecond for times.
    pub fn of(values: &[f64]) -> Self {
        let round = |v: &mut f64| *v = (*v * 1e6).round() / 1e6;
        let mut all = Self::exact(values);
        all.by_rank.iter_mut().chain([&mut all.sum, &mut all.max]).for_each(round);
        all
    }

    /// The same without rounding.
    pub fn exact(values: &[f64]) -> Self {
        let at = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let keep = if values.len() <= BY_RANK_MAX { values } else { &[] };
        let (sum, by_rank) = (values.iter().sum(), keep.to_vec());
        Self { sum, max: values.get(at).copied().unwrap_or(0.0), at, by_rank }
    }

    /// The same without values rank by rank.
    pub fn brief(values: &[f64]) -> Self {
        Self { by_rank: Vec::new(), ..Self::of(values) }
    }

    /// Whether no value is negative, and sum and maximum are those of the values rank by rank, as far as these are stored, to their
    /// rounding.
    pub(crate) fn is_possible(&self) -> bool {
        let Self { sum, max, at, by_rank } = self;
        let is = |value: f64, of: f64| (value - of).abs() <= rounding(by_rank.len(), of);
        let is_of_ranks = by_rank.is_empty() || {
            let most = by_rank.iter().copied().fold(0.0, f64::max);
            let at = by_rank.get(*at).is_some_and(|value| is(*value, *max));
            at && is(*max, most) && is(*sum, by_rank.iter().sum())
        };
        let mut all = by_rank.iter().chain([sum, max]);
        is_of_ranks && all.all(|v| *v >= 0.0 && v.is_finite()) && *max <= sum + rounding(1, *sum)
    }

    /// Maximum over mean: 1 if all values are equal, also if all are 0, or too small to be kept.
    pub fn lambda(&self, ranks: usize) -> f64 {
        if self.sum.min(self.max) > 0.0 { self.max * ranks as f64 / self.sum } else { 1.0 }
    }
}

/// A phase of a run over its ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// The program's name for it.
    pub name: String,
    /// CPU time outside calls to other ranks, in seconds.
    pub useful_s: Spread,
    /// Wall time, in seconds; meaningless for simulated ranks.
    pub wall_s: Spread,
    /// Messages sent.
    pub messages: Spread,
    /// Bytes sent.
    pub message_bytes: Spread,
}

/// A run's parameters. A line with another one is not read: runs that differ in it are no repetitions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// The experiment: `strong`, `weak`, `spacing`, `layers`, `weights`; or `targets`.
    pub experiment: String,
    /// The program.
    pub engine: String,
    /// The case from which the run's case was derived.
    pub case: String,
    /// Edge length of the finest cell at the surface.
    pub spacing_min: f64,
    /// n.
    pub layer_cells_min: u32,
    /// Number of ranks.
    pub ranks: usize,
    /// How they communicate.
    pub comm: Comm,
    /// `metis`, `morton` or `paper`; empty if the choice was left to the program.
    pub partitioner: String,
    /// Level of the base leaves, if it was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level_base: Option<u32>,
    /// `unit`, `area` or `rebalance`; empty if the choice was left to the program.
    pub weights: String,
    /// Cells that a series of several meshes was asked for, so that two such series of a case are apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series_cells: Option<f64>,
}

impl Setup {
    /// A serial run of the mesher outside of all experiments.
    pub fn serial(case: &str, spacing_min: f64, layer_cells_min: u32) -> Self {
        let (engine, case) = ("mesher".to_owned(), case.to_owned());
        Self { engine, case, spacing_min, layer_cells_min, ranks: 1, ..Self::default() }
    }

    /// Returns partitioner and weights, or `default`.
    pub fn division(&self) -> String {
        let chosen = format!("{} {}", self.partitioner, self.weights);
        let chosen = if chosen == " " { "default" } else { chosen.trim() };
        let depth = self.level_base.map_or(String::new(), |level| format!(" depth {level}"));
        format!("{chosen}{depth}")
    }
}

/// A run by all that was given, so that two setups differ.
impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { engine, case, experiment, spacing_min, layer_cells_min: n, ranks, .. } = self;
        let (comm, by) = (crate::name_of(&self.comm), self.division());
        let of = self.series_cells.map_or(String::new(), |cells| format!(" of {cells:e}"));
        write!(f, "{engine} {case} {experiment}{of} {spacing_min:e} n={n} {comm}:{ranks} {by}")
    }
}

/// A run and its measurements.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// A run's parameters.
    pub setup: Setup,
    /// Repetition, from 0.
    pub repeat: usize,
    /// Whether it only fills caches and is left out of statistics.
    pub warm_up: bool,
    /// Whether there were more ranks than cores, so that wall times are not those of parallel ranks.
    pub oversubscribed: bool,
    /// The command line.
    pub command: String,
    /// Digest of the program's files; empty if one cannot be read.
    pub program: String,
    /// Digest of those of its files that lie in the directory of the engine file, or below; empty without such.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub scripts: String,
    /// Facets of the geometry.
    pub facets: u64,
    /// Digest of the facets as the program read them, if it reports one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<String>,
    /// Digest of the rules and the geometry of the case from which the run's case was derived.
    pub inputs: String,
    /// Leaves of the mesh.
    pub cells: u64,
    /// The mesh's digest.
    pub digest: String,
    /// Wall time by the program's own clock, including reading but not the start and end of processes.
    pub time_wall_s: f64,
    /// Wall time by the harness's clock, from the start of the launcher to its end.
    pub time_launch_s: f64,
    /// CPU time of the whole process and of all its descendants, seen from outside, in seconds; of simulated ranks, that of `useful_s`.
    pub time_cpu_s: f64,
    /// Peak resident memory per rank, or of the whole process if ranks are simulated.
    pub peak_rss_bytes: Spread,
    /// CPU time outside calls to other ranks, over all phases; unknown without phases, of which older records have the wall time.
    pub useful_s: Spread,
    /// Phase by phase, in order.
    pub phases: Vec<Phase>,
    /// The program's counters.
    pub counters: BTreeMap<String, Spread>,
}

impl Run {
    /// Returns the critical path on an ideal network: ranks wait for each other at the end of a phase. A program that reports no phases has one.
    pub(crate) fn path_s(&self) -> f64 {
        let path = self.phases.iter().map(|phase| phase.useful_s.max).reduce(|a, b| a + b);
        path.unwrap_or(self.useful_s.max)
    }

    /// Whether it has ranks, at most a million, of which all values are stored, or none; a wall time, which is at most that of the launcher
    /// and at least that of any phase, or on simulated ranks a useful time, from which theirs is projected; times that a clock can show; and
    /// sums that are those of the ranks and of the phases, of which the slowest rank takes no longer than all phases on theirs.
    pub(crate) fn is_possible(&self) -> bool {
        let Self { setup, time_wall_s, useful_s, phases, counters, peak_rss_bytes, .. } = self;
        let times = phases.iter().flat_map(|of| [of.useful_s.sum, of.wall_s.sum]);
        let of_run = [useful_s.sum, *time_wall_s, self.time_launch_s, self.time_cpu_s];
        let of_phases =
            phases.iter().flat_map(|p| [&p.useful_s, &p.wall_s, &p.messages, &p.message_bytes]);
        let mut spreads = of_phases.chain(counters.values()).chain([useful_s, peak_rss_bytes]);
        let is_of_all = |of: &Spread| of.by_rank.is_empty() || of.by_rank.len() == setup.ranks;
        let is_by_rank = phases.iter().all(|phase| phase.useful_s.by_rank.len() == setup.ranks);
        let total: f64 = phases.iter().map(|phase| phase.useful_s.sum).sum();
        let equal = setup.ranks as f64 * useful_s.max;
        let off = rounding(setup.ranks * phases.len(), total);
        let slowest = phases.iter().map(|phase| phase.wall_s.max).fold(0.0, f64::max);
        let path = self.path_s();
        (1..=1_000_000).contains(&setup.ranks)
            && (setup.comm != Comm::Sim || path > 0.0)
            && *time_wall_s > 0.0
            && *time_wall_s <= 1.01 * self.time_launch_s + CLOCKS_S
            && (setup.comm == Comm::Sim || slowest <= 1.01 * time_wall_s + CLOCKS_S)
            && are_times(times.chain(of_run))
            && spreads.all(|of| of.is_possible() && is_of_all(of))
            && useful_s.sum <= equal + rounding(setup.ranks, equal)
            && useful_s.max <= path + rounding(phases.len(), path)
            && (phases.is_empty() || !is_by_rank || (useful_s.sum - total).abs() <= off)
    }
}

/// A run without a result: one that failed, or was not made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoResult {
    /// A run's parameters.
    pub setup: Setup,
    /// The reason in a sentence.
    pub why: String,
}

/// The lines of a record in chronological order, and the numbers (from 1) of invalid ones, with the reason.
pub type Content = (Vec<Line>, Vec<(usize, String)>);

/// Reads a record.
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> io::Result<Content> {
    let (mut lines, mut broken) = Content::default();
    for jsonl::Line { number, content: line, .. } in jsonl::read::<Line>(path)? {
        match line {
            Ok(line) if line.schema != SCHEMA => {
                broken.push((number, format!("its schema is {}", line.schema)));
            }
            Ok(line) if line.is_possible() => lines.push(line),
            Ok(_) => broken.push((number, "it has numbers that no run can have".to_owned())),
            Err(why) => broken.push((number, why)),
        }
    }
    Ok((lines, broken))
}

/// Returns the current time, as `2026-01-31T12:00:00Z`.
pub fn now_utc() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_stores_single_ranks_up_to_a_limit() {
        let few = Spread::of(&[1.0, 3.0, 2.0]);
        assert_eq!((few.sum, few.max, few.at, few.by_rank.len()), (6.0, 3.0, 1, 3));
        assert_eq!(few.lambda(3), 1.5);
        let many = Spread::of(&[1.0; BY_RANK_MAX + 1]);
        assert_eq!((many.sum, many.by_rank.len()), ((BY_RANK_MAX + 1) as f64, 0));
        assert_eq!(Spread::of(&[0.0, 0.0]).lambda(2), 1.0);
        // The sum is a microsecond, the maximum less than half of one.
        assert_eq!(Spread::of(&[2e-7, 4e-7, 0.0]).lambda(3), 1.0);
    }

    #[test]
    fn a_line_has_its_kind_and_is_read_back_unchanged() {
        let network =
            Network { latency_s: 1e-6, bandwidth_bytes_per_s: 1e10, measured: true, ..ASSUMED };
        let line = Line {
            schema: SCHEMA.into(),
            session: "s".into(),
            time_utc: "2026-01-31T12:00:00Z".into(),
            entry: Entry::Network(network),
        };
        let text = serde_json::to_string(&line).unwrap();
        assert!(text.contains(r#""kind":"network""#), "{text}");
        assert_eq!(serde_json::from_str::<Line>(&text).unwrap(), line);
    }

    fn network(latency_s: f64) -> Entry {
        Entry::Network(Network { latency_s, bandwidth_bytes_per_s: 1e9, ..ASSUMED })
    }

    fn append(path: &Path, latency_s: f64) {
        jsonl::append(path, &Line::new("s", network(latency_s))).unwrap();
    }

    #[test]
    fn an_interrupted_line_does_not_damage_others() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        append(&path, 1.0);
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str(&text.clone()[..20]);
        std::fs::write(&path, &text).unwrap();
        let (lines, broken) = read(&path).unwrap();
        assert_eq!((lines.len(), broken.len(), broken[0].0), (1, 1, 2));
        append(&path, 2.0);
        let (lines, broken) = read(&path).unwrap();
        assert_eq!((lines.len(), broken.len()), (2, 0));
    }

    #[test]
    fn a_line_of_another_schema_is_reported() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        append(&path, 1.0);
        let text = std::fs::read_to_string(&path).unwrap().replace("bench/1", "bench/9");
        std::fs::write(&path, text).unwrap();
        assert!(read(&path).unwrap().1[0].1.contains("octree-bench/9"));
    }

    #[test]
    fn times_are_utc_without_fractions_of_a_second() {
        let now = now_utc();
        let read: Timestamp = now.parse().unwrap();
        assert_eq!((read.to_string(), read.subsec_nanosecond()), (now, 0));
        assert!(read.duration_until(Timestamp::now()).as_secs() < 60);
    }
}
