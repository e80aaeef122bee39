//! Repetitions of the same setup, and the statistics of each such group.
//!
//! Only runs of one machine, one build of the program and one geometry are repetitions of each other. Those of a second
//! machine or build are runs of another program, `mesher [2]`, and those of a second geometry are runs on another case, `cube [2]`.
//!
//! Invariants, executed by [`Groups::check_invariants`] before anything is computed from them: a group has runs, all of its
//! setup and with its number of cells if the mesh is the same; its time lies in its interval, and that in the range of the
//! repetitions extended to it; sums and maxima over ranks agree with the values rank by rank.

use super::cause::sentence;
use super::entry::{Comm, Entry, Failure, LeftOut, Line, Network, Run, Setup, Spread};
use super::network::ASSUMED;
use super::pop::{self, Efficiency};
use crate::order::{Origins, by_key, distinct};
use run::engine::takes::{EQUAL_RANKS, EQUAL_RUNS};
use statistics::{Median, median};
use std::collections::{BTreeMap, HashMap};

/// The repetitions of one run.
#[derive(Clone, Debug)]
pub struct Group {
    /// The parameters of the runs.
    pub setup: Setup,
    /// The runs without warm-ups, in chronological order.
    pub runs: Vec<Run>,
    /// Time in seconds, measured or projected (see [`pop::time_s`]). A projected time with values by rank is that of the
    /// typical run; the interval of the repetitions' projections is then extended to include it.
    pub time_s: Median,
    /// Represents single ranks: the run whose time is closest to the median, with that median as its time, and every rank's useful time in
    /// every phase replaced by its median over the repetitions if all repetitions report it.
    pub typical: Run,
    /// Whether the typical run consists of such medians.
    pub by_rank: bool,
    /// The network of projected times: the last one that a session on the machine of the runs states.
    pub network: Network,
}

impl Group {
    /// Groups the repetitions of one setup; `None` for no repetitions.
    fn of(setup: Setup, runs: Vec<Run>, network: Network) -> Option<Self> {
        let times: Vec<f64> = runs.iter().map(|r| pop::time_s(r, &network)).collect();
        let mut time_s = median(&times)?;
        let off = |run: &&Run| (pop::time_s(run, &network) - time_s.value).abs();
        let mut typical = runs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?.clone();
        let by_rank = reports_ranks(&runs);
        if by_rank {
            quieten(&mut typical, &runs);
        }
        if setup.comm != Comm::Sim {
            typical.time_wall_s = time_s.value;
        } else if by_rank {
            time_s.value = pop::time_s(&typical, &network);
            time_s.low = time_s.low.min(time_s.value);
            time_s.high = time_s.high.max(time_s.value);
        }
        Some(Self { setup, runs, time_s, typical, by_rank, network })
    }

    /// Returns the number of cells of the mesh.
    pub fn cells(&self) -> u64 {
        self.runs[0].cells
    }

    /// Returns cells per second and rank.
    pub fn rate(&self) -> f64 {
        self.cells() as f64 / self.time_s.value / self.setup.ranks as f64
    }

    /// Returns the median over the repetitions of a quantity that every run has; `None` if one does not have it.
    pub fn median_of(&self, value: impl Fn(&Run) -> Option<f64>) -> Option<Median> {
        median(&self.runs.iter().map(value).collect::<Option<Vec<f64>>>()?)
    }

    /// Returns the median of peak memory per cell, in bytes.
    pub fn bytes_per_cell(&self) -> Median {
        let bytes = self.median_of(|r| Some(r.peak_rss_bytes.sum / r.cells.max(1) as f64));
        bytes.expect("a group has runs")
    }

    /// Whether more ranks than cores ran.
    pub fn oversubscribed(&self) -> bool {
        self.runs.iter().any(|r| r.oversubscribed)
    }

    /// Returns `projected`, `oversubscribed`, `measured` or `serial`, which is measured without MPI.
    pub fn how(&self) -> &'static str {
        match self.setup.comm {
            Comm::Sim => "projected",
            Comm::Solo => "serial",
            _ if self.oversubscribed() => "oversubscribed",
            _ => "measured",
        }
    }

    /// Returns the efficiencies of the typical run relative to that of `reference`.
    pub fn efficiency(&self, reference: &Group) -> Efficiency {
        pop::efficiency(&self.typical, &reference.typical, &self.network)
    }
}

/// Whether there are several runs, and each has the same phases with the times of all ranks.
fn reports_ranks(runs: &[Run]) -> bool {
    let phases = |r: &Run| {
        let phase = |p: &super::entry::Phase| (p.name.clone(), p.useful_s.by_rank.len());
        r.phases.iter().map(phase).collect::<Vec<_>>()
    };
    let first = phases(&runs[0]);
    let is_complete = !first.is_empty() && first.iter().all(|p| p.1 == runs[0].setup.ranks);
    runs.len() > 1 && is_complete && runs.iter().all(|run| phases(run) == first)
}

/// Replaces the useful time of every rank in every phase by its median over the runs.
fn quieten(typical: &mut Run, runs: &[Run]) {
    let mut total = vec![0.0; typical.setup.ranks];
    for (p, phase) in typical.phases.iter_mut().enumerate() {
        let of_rank = |rank: usize| {
            let times: Vec<f64> = runs.iter().map(|r| r.phases[p].useful_s.by_rank[rank]).collect();
            median(&times).expect("a group has runs").value
        };
        let times: Vec<f64> = (0..total.len()).map(of_rank).collect();
        phase.useful_s = Spread::of(&times);
        total.iter_mut().zip(times).for_each(|(total, time)| *total += time);
    }
    typical.useful_s = Spread::of(&total);
}

/// The runs of a record, grouped.
#[derive(Clone, Debug)]
pub struct Groups {
    /// In the order of their first runs.
    pub all: Vec<Group>,
    /// Runs that failed or were left out.
    pub left_out: Vec<LeftOut>,
    /// By program: what it does not do or promise.
    pub lacks: BTreeMap<String, Vec<String>>,
    /// A sentence for every program and case of which there are several series.
    pub origins: Vec<String>,
}

impl Groups {
    /// Groups the runs of a record's lines.
    pub fn of(lines: &[Line]) -> Self {
        let (lines, origins) = apart(lines);
        let mut lacks = BTreeMap::new();
        let (mut left_out, mut runs) = (Vec::new(), Vec::new());
        let mut digests = HashMap::new();
        let (mut machines, mut networks) = (HashMap::new(), HashMap::new());
        let machine =
            |machines: &HashMap<&str, String>, session: &str| machines.get(session).cloned();
        for line in &lines {
            match &line.entry {
                Entry::Network(network) => {
                    networks.insert(machine(&machines, &line.session), *network);
                }
                Entry::Session(session) => {
                    lacks.extend(session.lacks.clone());
                    machines.insert(line.session.as_str(), session.machine.label());
                }
                Entry::LeftOut(left) => left_out.push(left.clone()),
                Entry::Failure(Failure { setup, why, .. }) => {
                    let why = format!("{} failed: {why}", setup.engine);
                    left_out.push(LeftOut { setup: setup.clone(), why });
                }
                Entry::Run(run) if run.warm_up => {}
                Entry::Run(run) => match another_mesh(run, &lacks, &mut digests) {
                    None => runs.push((&**run, &line.session)),
                    Some(why) => left_out.push(LeftOut { setup: run.setup.clone(), why }),
                },
                Entry::Former => {}
            }
        }
        let group = |(setup, runs): (Setup, Vec<(&Run, &String)>)| {
            // All are of one machine.
            let network = networks.get(&machine(&machines, runs[0].1)).copied().unwrap_or(ASSUMED);
            Group::of(setup, runs.into_iter().map(|(run, _)| run.clone()).collect(), network)
        };
        let all = by_key(runs, |(run, _)| run.setup.clone()).into_iter().filter_map(group);
        let groups = Self { all: all.collect(), left_out, lacks, origins };
        groups.check_invariants();
        groups
    }

    /// Executes the invariants at the head of this file.
    pub fn check_invariants(&self) {
        for Group { setup, runs, time_s: t, typical, by_rank, network } in &self.all {
            let name = format!("{} on {} at {} ranks", setup.engine, setup.case, setup.ranks);
            let count = runs.len();
            assert!(count > 0 && t.count == count, "{name} has {count} runs");
            assert!(runs.iter().all(|run| run.setup == *setup), "{name} pools other setups");
            assert!(t.low <= t.value && t.value <= t.high, "{name}: {t:?} is in its interval");
            let is_in_phases = setup.comm == Comm::Sim && !*by_rank;
            assert!(
                is_in_phases || pop::time_s(typical, network) == t.value,
                "{name} has one time"
            );
            assert!((0.0..=1.0).contains(&t.coverage), "{name}: {t:?} is a coverage");
            for spread in typical.phases.iter().map(|p| &p.useful_s).chain([&typical.useful_s]) {
                spread.check_invariants();
            }
        }
    }

    /// Returns the reference of a group's efficiency: the same mesh on the fewest ranks, or in weak scaling the smallest mesh.
    pub fn reference<'a>(&'a self, group: &'a Group) -> &'a Group {
        let (s, weak) = (&group.setup, group.setup.experiment == "weak");
        let is_comparable = |o: &&Group| {
            let o = &o.setup;
            let alike = (o.comm, &o.experiment) == (s.comm, &s.experiment);
            let size = match weak {
                true => o.experiment == "weak",
                // Another partition on as many ranks is no base.
                false => {
                    let is_base = o.ranks == 1 || alike && s.experiment != "weights";
                    o.spacing_min == s.spacing_min && is_base
                }
            };
            // A measured time has no projected base.
            let is_measured = s.comm == Comm::Sim || o.comm != Comm::Sim;
            let is_of_series = !weak || o.series_cells == s.series_cells;
            size && is_measured
                && is_of_series
                && (&o.case, o.layer_cells_min, &o.engine)
                    == (&s.case, s.layer_cells_min, &s.engine)
        };
        // Fewest ranks first; among those the same communication, then the same experiment.
        let rank = |o: &&Group| {
            (o.setup.ranks, o.setup.comm != s.comm, o.setup.experiment != s.experiment)
        };
        self.all.iter().filter(is_comparable).min_by_key(rank).unwrap_or(group)
    }

    /// Returns the speedup of a group over its reference, times the ranks of that: over one rank, if it ran on one.
    pub fn speedup(&self, group: &Group) -> Median {
        let base = self.reference(group);
        let base_s = base.time_s.value * base.setup.ranks as f64;
        group.time_s.falling(|time_s| base_s / time_s)
    }

    /// Whether a group has a reference on fewer ranks, or is on one.
    pub fn has_reference(&self, group: &Group) -> bool {
        group.setup.ranks == 1 || self.reference(group).setup.ranks < group.setup.ranks
    }

    /// Returns the efficiencies of a group relative to its reference.
    pub fn efficiency(&self, group: &Group) -> Efficiency {
        group.efficiency(self.reference(group))
    }

    /// Returns the networks of these groups, as text.
    pub fn networks<'a>(groups: impl IntoIterator<Item = &'a Group>) -> String {
        let networks = groups.into_iter().map(|group| group.network.to_string());
        distinct(networks).join("; on another machine ")
    }

    /// Returns the largest loss of efficiency of a group in one sentence.
    pub fn cause(&self, group: &Group) -> String {
        sentence(&group.typical, &self.reference(group).typical, &group.network)
    }

    /// Returns simulated groups, each with that of the same mesh on equally many ranks of MPI without oversubscription.
    pub fn projections(&self) -> Vec<[&Group; 2]> {
        let measured = |sim: &Group| {
            let setup = Setup { comm: Comm::Mpi, ..sim.setup.clone() };
            self.all.iter().find(|m| m.setup == setup && !m.oversubscribed())
        };
        let sims = self.all.iter().filter(|g| g.setup.comm == Comm::Sim);
        sims.filter_map(|sim| Some([sim, measured(sim)?])).collect()
    }
}

/// Returns why a run has another mesh than an earlier one of which it must have the mesh, although it may be of another session.
pub(crate) fn another_mesh(
    run: &Run,
    lacks: &BTreeMap<String, Vec<String>>,
    digests: &mut HashMap<String, String>,
) -> Option<String> {
    let s = &run.setup;
    let engine = s.engine.split(" [").next().unwrap_or_default();
    let lacks = lacks.get(engine).map_or(&[][..], Vec::as_slice);
    if run.digest.is_empty() || lacks.iter().any(|what| what == EQUAL_RUNS) {
        return None;
    }
    let mut mesh = format!("{} {} {:e} {}", s.engine, s.case, s.spacing_min, s.layer_cells_min);
    if lacks.iter().any(|what| what == EQUAL_RANKS) {
        mesh += &format!(" {} {}", s.ranks, s.partitioner);
    }
    let first = digests.entry(mesh).or_insert_with(|| run.digest.clone());
    let digest = &run.digest;
    (first != digest)
        .then(|| format!("its mesh has the digest {digest}, and that of an earlier run {first}"))
}

/// Returns the lines with the runs of every further machine, build or geometry as those of another program or case, and a
/// sentence for each program and case of which there are several.
fn apart(lines: &[Line]) -> (Vec<Line>, Vec<String>) {
    let mut machines: HashMap<&str, [String; 2]> = HashMap::new();
    let (mut programs, mut geometries) = (Origins::default(), Origins::default());
    let mut apart = lines.to_vec();
    for (line, of) in apart.iter_mut().zip(lines) {
        match &mut line.entry {
            Entry::Session(session) => {
                let machine = &session.machine;
                machines.insert(&of.session, [machine.label(), machine.commit.clone()]);
            }
            Entry::Run(run) => {
                let machine = machines.get(of.session.as_str());
                // Old records have no digest of the program: the commit stands for it.
                let origin = match (machine, run.program.as_str()) {
                    (None, "") => String::new(),
                    (None, program) => format!("program {program}"),
                    (Some([label, commit]), "") => format!("{label}; commit {commit}"),
                    (Some([label, _]), program) => format!("{label}; program {program}"),
                };
                let s = &mut run.setup;
                if let Some(digest) = &run.geometry {
                    let (case, n) = (&s.case, s.layer_cells_min);
                    let mesh = format!("{case} at spacing {:e}, n {n}", s.spacing_min);
                    s.case += &geometries.suffix(&mesh, digest);
                }
                s.engine += &programs.suffix(&s.engine, &origin);
            }
            _ => {}
        }
    }
    let sentences = programs.described().into_iter().chain(geometries.described());
    (apart, sentences.collect())
}

#[cfg(test)]
mod tests;
