//! Repetitions of the same setup, and the statistics of each such group.
//!
//! Only runs of one machine, one build of the program, one network that was given, and one case with one geometry are repetitions of each
//! other. Those of a second machine, build or network are runs of another program, `mesher [2]`, and those of a case that was edited, or of
//! a second geometry, are runs on another case, `cube [2]`. A run without a result is of the program and the case of its session's runs.
//!
//! Invariants, executed by [`Groups::check_invariants`] before anything is computed from them: a group has runs, all of its
//! setup and with its number of cells if the mesh is the same; its time lies in its interval, and that in the range of the
//! repetitions extended to it; sums and maxima over ranks agree with the values rank by rank.

use super::entry::{
    ASSUMED, Comm, Entry, Lacks, Line, Network, NoResult, Run, Session, Setup, Spread, TARGETS,
};
use super::pop::{self, Efficiency};
use crate::order::{Origins, by_key, distinct};
use run::engine::description::{EQUAL_RANKS, EQUAL_RUNS};
use statistics::{Median, median, median_of};
use std::collections::{BTreeMap, HashMap};

/// The repetitions of one run.
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
    /// The network of projected times: that of the last repetition's session, so that groups of the same sessions have the same one.
    pub network: Network,
}

impl Group {
    /// Groups the repetitions of one setup; `None` for no repetitions.
    fn of(setup: Setup, repetitions: &[&(Run, Network)]) -> Option<Self> {
        let network = repetitions.last()?.1;
        let runs: Vec<Run> = repetitions.iter().map(|of| of.0.clone()).collect();
        let time_of = |run: &Run| pop::time_s(run, &network);
        let mut time_s = median(&runs.iter().map(time_of).collect::<Vec<f64>>())?;
        let off = |run: &Run| (time_of(run) - time_s.value).abs();
        let mut typical = runs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?.clone();
        let by_rank = quieten(&mut typical, &runs);
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

    /// Returns million cells per second and rank.
    pub fn rates(&self) -> Median {
        self.time_s.falling(|s| self.cells() as f64 / s / self.setup.ranks as f64 / 1e6)
    }

    /// Returns the median over the repetitions of a quantity that every run has; `None` if one does not have it.
    pub fn median_of(&self, value: impl Fn(&Run) -> Option<f64>) -> Option<Median> {
        median(&self.runs.iter().map(value).collect::<Option<Vec<f64>>>()?)
    }

    /// Returns the median of peak memory per cell, in bytes; `None` if it is unknown in a run. Simulated ranks share one process, whose memory
    /// says nothing of as many processes.
    pub fn bytes_per_cell(&self) -> Option<Median> {
        let is_known = self.setup.comm != Comm::Sim || self.setup.ranks == 1;
        let peak = |run: &Run| Some(run.peak_rss_bytes.sum).filter(|of| is_known && *of > 0.0);
        self.median_of(|run| Some(peak(run)? / run.cells.max(1) as f64))
    }

    /// Returns the load imbalance of useful time, max / mean; `None` if that is unknown in a run. The interval of the repetitions is extended
    /// to that of the typical run.
    pub fn imbalance(&self) -> Option<Median> {
        let repeated = self.median_of(pop::imbalance)?;
        let value = pop::imbalance(&self.typical)?;
        let (low, high) = (repeated.low.min(value), repeated.high.max(value));
        Some(Median { value, low, high, ..repeated })
    }

    /// Returns the load imbalance of cells, max / mean, if the program counts them by rank.
    pub fn lambda_cells(&self) -> Option<f64> {
        Some(self.typical.counters.get("leaves")?.lambda(self.setup.ranks))
    }

    /// Returns the CPU time of the whole process, in seconds; `None` if it is unknown in a run.
    pub fn cpu_s(&self) -> Option<Median> {
        // A launcher such as srun has its own, as ranks are not its children. Ranks without phases are taken to be busy all the time.
        let is_alone = self.setup.comm == Comm::Solo && self.typical.phases.is_empty();
        let all_s = |run: &Run| run.time_wall_s * self.setup.ranks as f64;
        let busy_s = |run: &Run| if run.phases.is_empty() { all_s(run) } else { run.useful_s.sum };
        let is_of_ranks = |run: &Run| is_alone || run.time_cpu_s > 0.9 * busy_s(run);
        self.median_of(|run| is_of_ranks(run).then_some(run.time_cpu_s))
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

    /// Returns that and the ranks, as in `projected on 4 ranks`.
    pub fn how_on(&self) -> String {
        let s = if self.setup.ranks == 1 { "" } else { "s" };
        format!("{} on {} rank{s}", self.how(), self.setup.ranks)
    }

    /// Returns the efficiencies of the typical run relative to that of `reference`; `None` if one has no useful times.
    pub fn efficiency(&self, reference: &Group) -> Option<Efficiency> {
        pop::efficiency(&self.typical, &reference.typical, &self.network)
    }

    /// Returns the global efficiency relative to `reference`: by times alone, if one has no useful times.
    pub fn global_efficiency(&self, reference: &Self) -> f64 {
        let per_cell = |of: &Self| of.time_s.value * of.setup.ranks as f64 / of.cells() as f64;
        let by_times = || per_cell(reference) / per_cell(self);
        self.efficiency(reference).map_or_else(by_times, |of| of.global())
    }
}

/// Replaces the useful time of every rank in every phase by its median over the runs, if there are several and each has the same phases
/// with the times of all ranks; returns whether they have.
fn quieten(typical: &mut Run, runs: &[Run]) -> bool {
    let phases = |run: &Run| -> Vec<(String, usize)> {
        run.phases.iter().map(|p| (p.name.clone(), p.useful_s.by_rank.len())).collect()
    };
    let (first, ranks) = (phases(typical), typical.setup.ranks);
    let is_complete = !first.is_empty() && first.iter().all(|phase| phase.1 == ranks);
    if runs.len() < 2 || !is_complete || runs.iter().any(|run| phases(run) != first) {
        return false;
    }
    for (p, phase) in typical.phases.iter_mut().enumerate() {
        let of_rank = |rank: usize| {
            let of_run = |run: &Run| run.phases[p].useful_s.by_rank[rank];
            median_of(&runs.iter().map(of_run).collect::<Vec<f64>>())
        };
        phase.useful_s = Spread::exact(&(0..ranks).map(of_rank).collect::<Vec<f64>>());
    }
    let total = |rank: usize| typical.phases.iter().map(|p| p.useful_s.by_rank[rank]).sum();
    typical.useful_s = Spread::exact(&(0..ranks).map(total).collect::<Vec<f64>>());
    true
}

/// The runs of a record, grouped.
pub struct Groups {
    /// In the order of their first runs.
    pub all: Vec<Group>,
    /// By program: what it does not do or promise.
    pub lacks: Lacks,
    /// A sentence for every program and case of which there are several series, for nodes whose runs are pooled, for every run with
    /// another mesh, and for every program without any run on a case.
    pub notes: Vec<String>,
    /// Those of them about runs that are missing.
    pub missing: Vec<String>,
}

impl Groups {
    /// Groups the runs of a record's lines.
    pub fn of(lines: &[Line]) -> Self {
        let mut sessions = HashMap::new();
        let networks: HashMap<&str, Network> = lines.iter().filter_map(Line::network).collect();
        let (mut origins, mut meshes) = (<[Origins; 2]>::default(), Meshes::new());
        let (mut left_out, mut lacks, mut notes) = (Vec::new(), BTreeMap::new(), Vec::new());
        let (mut runs, mut warm_ups) = (Vec::<(Run, Network)>::new(), Vec::<Run>::new());
        let mut named: Vec<(&str, &Setup, Setup)> = Vec::new();
        for line in lines {
            let session: Option<&Session> = sessions.get(&line.session).copied();
            let network = networks.get(line.session.as_str());
            match &line.entry {
                Entry::Session(session) => {
                    lacks.extend(session.lacks.clone());
                    sessions.insert(&line.session, session);
                }
                Entry::LeftOut(NoResult { setup, why }) => {
                    left_out.push((named.len(), &line.session, setup, why.clone()));
                }
                Entry::Failure(NoResult { setup, why }) => {
                    let why = format!("{} failed: {why}", setup.engine);
                    left_out.push((named.len(), &line.session, setup, why));
                }
                Entry::Run(as_recorded) => {
                    let setup = apart(as_recorded, session, network, &mut origins);
                    named.push((&line.session, &as_recorded.setup, setup.clone()));
                    let mut run = Run { setup, ..(**as_recorded).clone() };
                    if run.warm_up {
                        warm_ups.push(run);
                        continue;
                    }
                    // A program may have a digest only of a mesh that it writes, as in warm-ups.
                    if run.digest.is_empty() {
                        let same = warm_ups.iter().rfind(|warm| warm.setup == run.setup);
                        run.digest = same.map_or(String::new(), |warm| warm.digest.clone());
                    }
                    match another_mesh(&run, &lacks, &mut meshes) {
                        None => runs.push((run, network.copied().unwrap_or(ASSUMED))),
                        Some(why) => {
                            notes.push(format!("a run is left out, {}: {why}", run.setup));
                            left_out.push((0, &line.session, &as_recorded.setup, why));
                        }
                    }
                }
                Entry::Network(_) => {}
            }
        }
        let by_setup = by_key(&runs, |(run, _)| run.setup.clone()).into_iter();
        let all: Vec<Group> = by_setup.filter_map(|(setup, of)| Group::of(setup, &of)).collect();
        let is_of = |g: &Group, s: &Setup| (&g.setup.engine, &g.setup.case) == (&s.engine, &s.case);
        let as_named = |(at, session, setup, why): (usize, &String, &Setup, String)| {
            let of_runs = |is_same: &dyn Fn(&Setup) -> bool| {
                let last = named.iter().rfind(|(of, ran, _)| of == session && is_same(ran));
                last.map_or(setup, |(.., named)| named)
            };
            let engine = of_runs(&|ran| ran.engine == setup.engine).engine.clone();
            let case = of_runs(&|ran| case_of(ran) == case_of(setup)).case.clone();
            (at, Setup { engine, case, ..setup.clone() }, why)
        };
        // Without any run, or with no run after it: further repetitions are missing.
        let is_missing = |(at, setup, _): &(usize, Setup, String)| {
            let has_later = named[*at..].iter().any(|(.., later)| later == setup);
            !has_later || all.iter().all(|group| group.setup != *setup)
        };
        let missing = left_out.into_iter().map(as_named).filter(is_missing);
        notes.extend(missing.map(|(_, setup, why)| match all.iter().any(|g| is_of(g, &setup)) {
            true => format!("a run is missing, {setup}: {why}"),
            false => format!("{} has no run on {}: {why}", setup.engine, setup.case),
        }));
        let origins = origins.each_ref().map(Origins::described).concat();
        let missing = distinct(notes);
        let notes = origins.into_iter().chain(pooled_nodes(lines)).chain(missing.clone()).collect();
        let groups = Self { all, lacks, notes, missing };
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
            let has_one_time = pop::time_s(typical, network) == t.value;
            assert!(has_one_time || setup.comm == Comm::Sim && !*by_rank, "{name} has one time");
            assert!((0.0..=1.0).contains(&t.coverage), "{name}: {t:?} is a coverage");
            for spread in typical.phases.iter().map(|p| &p.useful_s).chain([&typical.useful_s]) {
                let is_right = spread.is_possible();
                assert!(is_right, "sum and maximum are those of the ranks: {name}, {spread:?}");
            }
        }
    }

    /// Returns the reference of a group's efficiency: the same mesh on the fewest ranks, or in weak scaling the smallest mesh.
    pub fn reference<'a>(&'a self, group: &'a Group) -> &'a Group {
        let (s, weak) = (&group.setup, group.setup.experiment == "weak");
        let is_comparable = |o: &&Group| {
            let o = &o.setup;
            let same_size = match weak {
                true => o.experiment == "weak" && o.series_cells == s.series_cells,
                false => o.spacing_min == s.spacing_min,
            };
            let alike = (o.comm, &o.experiment) == (s.comm, &s.experiment);
            // Another partition is no base.
            let is_base = o.ranks == 1 || (weak || alike) && o.division() == s.division();
            // A projected time has a projected base, and a measured one a measured.
            let [mesh, other] =
                [s, o].map(|s| (case_of(s), s.layer_cells_min, &s.engine, s.comm == Comm::Sim));
            same_size && is_base && mesh == other
        };
        // Fewest ranks first; among those the same communication, then the same experiment, then the same series.
        let rank = |o: &&Group| {
            let o = &o.setup;
            let is_other = o.experiment != s.experiment;
            (o.ranks, o.comm != s.comm, is_other, o.series_cells != s.series_cells)
        };
        self.all.iter().filter(is_comparable).min_by_key(rank).unwrap_or(group)
    }

    /// Returns the speedup of a group over its reference, times the ranks of that: over one rank, if it ran on one.
    pub fn speedup(&self, group: &Group) -> Median {
        let base = self.reference(group);
        let value = base.time_s.value * base.setup.ranks as f64 / group.time_s.value;
        self.of_times(group, value, base.time_s)
    }

    /// Returns the efficiency of a group: over the useful time of its reference, if that is known.
    pub fn global_efficiency(&self, group: &Group) -> Median {
        let base = self.reference(group);
        let useful = base.median_of(|run| group.efficiency(base).map(|_| run.useful_s.sum));
        let time = useful.filter(|of| of.low > 0.0).unwrap_or(base.time_s);
        self.of_times(group, group.global_efficiency(base), time)
    }

    /// Returns a value that is proportional to a time of a group's reference over that of the group. It is in its interval if both times are in
    /// theirs: with at least the coverage that remains when both may fail (Bonferroni).
    fn of_times(&self, group: &Group, value: f64, b: Median) -> Median {
        let t = group.time_s;
        let coverage = (t.coverage + b.coverage - 1.0).max(0.0);
        if self.reference(group).setup == group.setup || coverage == 0.0 {
            return Median { value, low: value, high: value, coverage, ..t };
        }
        let low = value * (b.low / b.value) * (t.value / t.high);
        let high = value * (b.high / b.value) * (t.value / t.low);
        Median { value, low, high, coverage, count: t.count.min(b.count) }
    }

    /// Whether a group has a reference on fewer ranks, or is on one.
    pub fn has_reference(&self, group: &Group) -> bool {
        group.setup.ranks == 1 || self.reference(group).setup.ranks < group.setup.ranks
    }

    /// Returns the efficiencies of a group relative to its reference; `None` if one has no useful times.
    pub fn efficiency(&self, group: &Group) -> Option<Efficiency> {
        group.efficiency(self.reference(group))
    }

    /// Returns the networks of those of these groups that are projected, as text.
    pub fn networks<'a>(groups: impl IntoIterator<Item = &'a Group>) -> String {
        let of = groups.into_iter().filter(|group| group.setup.comm == Comm::Sim);
        let text = distinct(of.map(|of| of.network.to_string())).join("; in another session ");
        if text.is_empty() { "nothing, as no ranks are simulated".to_owned() } else { text }
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

/// What the runs on a mesh report of it: facets, cells or digest.
pub(crate) type Meshes = HashMap<String, String>;

/// Returns why a run has another mesh than an earlier one of which it must have the mesh, although it may be of another session.
pub(crate) fn another_mesh(run: &Run, lacks: &Lacks, meshes: &mut Meshes) -> Option<String> {
    let s = &run.setup;
    let engine = s.engine.split(" [").next().unwrap_or_default();
    let lacks = |of: &str| lacks.get(engine).is_some_and(|all| all.iter().any(|what| what == of));
    let given = format!("{} {:e} {}", case_of(s), s.spacing_min, s.layer_cells_min);
    let mut mesh = format!("{} {given}", s.engine);
    if lacks(EQUAL_RANKS) {
        mesh += &format!(" {} {}", s.ranks, s.partitioner);
    }
    let [facets, cells] = [run.facets, run.cells].map(|count| count.to_string());
    let of_mesh = [("number of cells", &mesh, cells), ("digest", &mesh, run.digest.clone())];
    // Any mesh, of any program, is of the facets that were given.
    let all = [("number of facets", &given, facets)].into_iter().chain(of_mesh);
    let all = all.take(if lacks(EQUAL_RUNS) { 1 } else { 3 });
    for (what, of, here) in all.filter(|(.., here)| !["", "0"].contains(&here.as_str())) {
        let first = meshes.entry(format!("{what} {of}")).or_insert(here.clone());
        if *first != here {
            return Some(format!("its mesh has the {what} {here}, that of an earlier run {first}"));
        }
    }
    None
}

/// A sentence for every machine whose runs are of several nodes. Names of nodes do not make series: those of a cloud are new in every
/// session.
fn pooled_nodes(lines: &[Line]) -> Vec<String> {
    let sessions = lines.iter().filter_map(Line::session).filter(|of| !of.nodes.is_empty());
    let by_machine = by_key(sessions, |session| session.machine.label()).into_iter();
    let counts = by_machine.map(|(_, of)| distinct(of.into_iter().map(|s| &s.nodes)).len());
    let several = counts.filter(|count| *count > 1);
    several.map(|n| format!("runs on {n} lists of nodes are taken for one machine's")).collect()
}

/// What the case of a run is by name: that of a series, or a mesh of targets, which may have the name of another case.
fn case_of(Setup { experiment, case, .. }: &Setup) -> String {
    if experiment == TARGETS { format!("mesh {case}") } else { case.clone() }
}

/// Returns the setup of a run as that of another program or case, if there were runs of another machine, build, given network, rules or
/// geometry before.
fn apart(
    run: &Run,
    session: Option<&Session>,
    network: Option<&Network>,
    [programs, cases]: &mut [Origins; 2],
) -> Setup {
    let mut setup = run.setup.clone();
    let machine = session.map(|session| session.machine.label());
    let given = network.filter(|network| network.given).map(Network::to_string);
    let origin = [machine, given, Some(format!("program {}", run.program))];
    let origin = origin.into_iter().flatten().collect::<Vec<_>>().join("; ");
    setup.engine += &programs.suffix(&run.setup.engine, &origin);
    setup.case += &cases.suffix(&case_of(&run.setup), &run.inputs);
    if let Some(digest) = &run.geometry {
        let Setup { spacing_min, layer_cells_min: n, .. } = &setup;
        let mesh = format!("{} at spacing {spacing_min:e}, n {n}", case_of(&setup));
        setup.case += &cases.suffix(&mesh, digest);
    }
    setup
}

#[cfg(test)]
mod tests;
