//! Repetitions of the same setup, and the statistics of each such group.
//!
//! Only runs of one machine, one build of the program and one geometry are repetitions of each other. Those of a second
//! machine or build are runs of another program, `mesher [2]`, and those of a second geometry are runs on another case, `cube [2]`.
//!
//! Invariants, executed by [`Groups::check_invariants`] before anything is computed from them: a group has runs, all of its
//! setup and with its number of cells if the mesh is the same; its time lies in its interval, and that in the range of the
//! repetitions extended to it; sums and maxima over ranks agree with the values rank by rank.

use super::entry::{Comm, Entry, Failure, LeftOut, Line, Network, Phase, Run, Setup, Spread};
use super::network::ASSUMED;
use super::pop::{self, Efficiency};
use crate::order::by_key;
use crate::origin::Origins;
use crate::statistics::{Median, median};
use std::collections::BTreeMap;

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
    /// Represents single ranks: the run whose time is closest to the median, with every rank's useful time in every phase
    /// replaced by its median over the repetitions if all repetitions report it.
    pub typical: Run,
    /// Whether the typical run consists of such medians.
    pub by_rank: bool,
}

impl Group {
    /// Groups the repetitions of one setup; `None` for no repetitions.
    fn of(setup: Setup, runs: Vec<Run>, network: &Network) -> Option<Self> {
        let times: Vec<f64> = runs.iter().map(|r| pop::time_s(r, network)).collect();
        let mut time_s = median(&times)?;
        let off = |run: &&Run| (pop::time_s(run, network) - time_s.value).abs();
        let mut typical = runs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?.clone();
        let medians = medians_by_rank(&runs);
        let by_rank = medians.is_some();
        if let Some(phases) = medians {
            quiet(&mut typical, &phases);
            if setup.comm == Comm::Sim {
                time_s.value = pop::time_s(&typical, network);
                time_s.low = time_s.low.min(time_s.value);
                time_s.high = time_s.high.max(time_s.value);
            }
        }
        Some(Self { setup, runs, time_s, typical, by_rank })
    }

    /// Returns the origin of the times of single ranks, for a caption.
    pub fn rank_times_caption(&self) -> String {
        let n = self.runs.len();
        match self.by_rank {
            true => format!("Times of a rank in a phase are medians of {n} runs"),
            false => format!("Run of median time among {n}"),
        }
    }

    /// Returns the number of cells of the mesh.
    pub fn cells(&self) -> u64 {
        self.runs[0].cells
    }

    /// Returns cells per second and rank.
    pub fn rate(&self) -> f64 {
        self.cells() as f64 / self.time_s.value / self.setup.ranks as f64
    }

    /// Returns the median of peak memory per cell, in bytes.
    pub fn bytes_per_cell(&self) -> Median {
        let values: Vec<f64> =
            self.runs.iter().map(|r| r.peak_rss_bytes.sum / r.cells.max(1) as f64).collect();
        median(&values).expect("a group has runs")
    }

    /// Whether more ranks than cores ran.
    pub fn oversubscribed(&self) -> bool {
        self.runs.iter().any(|r| r.oversubscribed)
    }

    /// Returns `projected`, `oversubscribed` or `measured`.
    pub fn how(&self) -> &'static str {
        match self.setup.comm {
            Comm::Sim => "projected",
            _ if self.oversubscribed() => "oversubscribed",
            _ => "measured",
        }
    }

    /// Returns the efficiencies of the typical run relative to that of `reference`.
    pub fn efficiency(&self, reference: &Group, network: &Network) -> Efficiency {
        pop::efficiency(&self.typical, &reference.typical, network)
    }

    /// Returns the critical path of CPU times without messages, in seconds.
    fn path_s(&self) -> f64 {
        if self.by_rank {
            return pop::path_s(&self.typical);
        }
        let paths: Vec<f64> = self.runs.iter().map(pop::path_s).collect();
        median(&paths).map_or(f64::NAN, |m| m.value)
    }
}

/// Returns the median over runs of the useful time by phase and rank; `None` for a single run, or if a run does not report
/// every rank.
fn medians_by_rank(runs: &[Run]) -> Option<Vec<Vec<f64>>> {
    let (first, rest) = runs.split_first()?;
    if rest.is_empty() || first.phases.is_empty() {
        return None;
    }
    let reports_ranks =
        |r: &Run| r.phases.iter().all(|p| p.useful_s.by_rank.len() == r.setup.ranks);
    let names = |r: &Run| r.phases.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
    if !runs.iter().all(|r| reports_ranks(r) && names(r) == names(first)) {
        return None;
    }
    let of = |phase: usize, rank: usize| {
        let values: Vec<f64> =
            runs.iter().map(|r| r.phases[phase].useful_s.by_rank[rank]).collect();
        median(&values).map(|m| m.value)
    };
    let ranks = first.setup.ranks;
    (0..first.phases.len()).map(|p| (0..ranks).map(|r| of(p, r)).collect()).collect()
}

/// Replaces a run's useful times, by phase and rank.
fn quiet(run: &mut Run, useful_s: &[Vec<f64>]) {
    let put = |(phase, values): (&mut Phase, &Vec<f64>)| phase.useful_s = Spread::of(values);
    run.phases.iter_mut().zip(useful_s).for_each(put);
    let of_rank = |r: usize| useful_s.iter().map(|phase| phase[r]).sum();
    run.useful_s = Spread::of(&(0..run.setup.ranks).map(of_rank).collect::<Vec<f64>>());
}

/// The runs of a record, grouped.
#[derive(Clone, Debug)]
pub struct Groups {
    /// In the order of their first runs.
    pub all: Vec<Group>,
    /// The last run of every setup that contains a message matrix, including warm-ups.
    pub matrices: Vec<Run>,
    /// Runs that failed or were left out.
    pub left_out: Vec<LeftOut>,
    /// By program: what it does not do or promise.
    pub lacks: BTreeMap<String, Vec<String>>,
    /// The network of the last line that has one.
    pub network: Network,
    /// A sentence for every program and case of which there are several series.
    pub origins: Vec<String>,
}

impl Groups {
    /// Groups the runs of a record's lines.
    pub fn of(lines: &[Line]) -> Self {
        let (lines, origins) = apart(lines);
        let mut network = ASSUMED;
        let (mut left_out, mut lacks) = (Vec::new(), BTreeMap::new());
        for line in &lines {
            match &line.entry {
                Entry::Network(n) => network = *n,
                Entry::Session(session) => lacks.extend(session.lacks.clone()),
                Entry::LeftOut(left) => left_out.push(left.clone()),
                Entry::Failure(Failure { setup, why, .. }) => {
                    let why = format!("{} failed: {why}", setup.engine);
                    left_out.push(LeftOut { setup: setup.clone(), why });
                }
                _ => {}
            }
        }
        let runs = lines.iter().filter_map(|line| match &line.entry {
            Entry::Run(run) => Some(&**run),
            _ => None,
        });
        let measured = by_key(runs.clone().filter(|run| !run.warm_up), |run| run.setup.clone());
        let group = |(setup, runs): (Setup, Vec<&Run>)| {
            Group::of(setup, runs.into_iter().cloned().collect(), &network)
        };
        let all = measured.into_iter().filter_map(group).collect();
        let with_matrix = runs.filter(|run| !run.message_matrix.is_empty());
        let matrices = by_key(with_matrix, |run| run.setup.clone()).into_iter();
        let matrices =
            matrices.filter_map(|(_, runs)| runs.last().map(|run| (*run).clone())).collect();
        let groups = Self { all, matrices, left_out, lacks, network, origins };
        groups.check_invariants();
        groups
    }

    /// Executes the invariants at the head of this file.
    pub fn check_invariants(&self) {
        for Group { setup, runs, time_s: t, typical, .. } in &self.all {
            let name = || format!("{} on {} at {} ranks", setup.engine, setup.case, setup.ranks);
            assert!(
                !runs.is_empty() && t.count == runs.len(),
                "{} has {} runs",
                name(),
                runs.len()
            );
            assert!(runs.iter().all(|run| run.setup == *setup), "{} pools other setups", name());
            assert!(t.low <= t.value && t.value <= t.high, "{}: {t:?} is in its interval", name());
            assert!((0.0..=1.0).contains(&t.coverage), "{}: {t:?} is a coverage", name());
            for spread in typical.phases.iter().map(|p| &p.useful_s).chain([&typical.useful_s]) {
                spread.check_invariants();
            }
        }
    }

    /// Returns the groups whose setup satisfies `predicate`, in ascending order of `key`.
    pub fn series<K: PartialOrd>(
        &self,
        predicate: impl Fn(&Setup) -> bool,
        key: impl Fn(&Group) -> K,
    ) -> Vec<&Group> {
        let mut found: Vec<&Group> = self.all.iter().filter(|g| predicate(&g.setup)).collect();
        found.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal));
        found
    }

    /// Returns the reference of a group's efficiency: the same mesh on the fewest ranks, or in weak scaling the smallest mesh.
    pub fn reference(&self, group: &Group) -> &Group {
        let (s, weak) = (&group.setup, group.setup.experiment == "weak");
        let same = |o: &&Group| {
            let o = &o.setup;
            let mesh =
                o.case == s.case && o.layer_cells_min == s.layer_cells_min && o.engine == s.engine;
            let size = if weak { o.experiment == "weak" } else { o.spacing_min == s.spacing_min };
            mesh && size
        };
        let rank = |o: &&Group| {
            // Fewest ranks first; among those the same communication, then the same experiment.
            (o.setup.ranks, o.setup.comm != s.comm, o.setup.experiment != s.experiment)
        };
        let candidates = self.all.iter().filter(same).filter(|o| {
            weak || o.setup.ranks == 1
                || o.setup.comm == s.comm && o.setup.experiment == s.experiment
        });
        candidates.min_by_key(rank).unwrap_or_else(|| {
            self.all.iter().find(|o| o.setup == *s).expect("a group is among its groups")
        })
    }

    /// Returns pairs of simulated and MPI runs of the same mesh on equally many ranks, without oversubscription.
    pub fn projections(&self) -> Vec<Projection<'_>> {
        let pair = |sim: &'_ Group| {
            let found = self.all.iter().find(|m| {
                m.setup.comm == Comm::Mpi
                    && !m.oversubscribed()
                    && Setup { comm: Comm::Mpi, ..sim.setup.clone() } == m.setup
            });
            found.map(|m| m.setup.clone())
        };
        let sims = self.all.iter().filter(|g| g.setup.comm == Comm::Sim);
        sims.filter_map(|sim| {
            let setup = pair(sim)?;
            let measured = self.all.iter().find(|m| m.setup == setup)?;
            Some(Projection { sim, measured })
        })
        .collect()
    }
}

/// Returns the lines with the runs of every further machine, build or geometry as those of another program or case, and a
/// sentence for each program and case of which there are several.
fn apart(lines: &[Line]) -> (Vec<Line>, Vec<String>) {
    let mut machines: BTreeMap<&str, String> = BTreeMap::new();
    let (mut programs, mut geometries) = (Origins::default(), Origins::default());
    let mut apart = lines.to_vec();
    for (line, of) in apart.iter_mut().zip(lines) {
        match &mut line.entry {
            Entry::Session(session) => {
                let machine = &session.machine;
                machines
                    .insert(&of.session, format!("{}; commit {}", machine.label(), machine.commit));
            }
            Entry::Run(run) => {
                let machine = machines.get(of.session.as_str()).map_or("", String::as_str);
                // Old records have no digest of the program: the commit stands for it.
                let origin = match run.program.as_str() {
                    "" => machine.to_owned(),
                    program => {
                        let machine = machine.split("; commit").next().unwrap_or_default();
                        format!("{machine}; program {program}")
                    }
                };
                let s = &mut run.setup;
                if let Some(digest) = &run.geometry {
                    let mesh = format!(
                        "{} at spacing {:e}, n {}",
                        s.case, s.spacing_min, s.layer_cells_min
                    );
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

/// A projected time and the measured one.
#[derive(Clone, Copy, Debug)]
pub struct Projection<'a> {
    /// Simulated ranks.
    pub sim: &'a Group,
    /// The same on MPI.
    pub measured: &'a Group,
}

impl Projection<'_> {
    /// Returns the relative error of the projected time; negative if it is too short.
    pub fn error(&self) -> f64 {
        self.sim.time_s.value / self.measured.time_s.value - 1.0
    }

    /// Returns the relative error of the critical path of CPU times, simulated versus MPI ranks; medians of both.
    pub fn path_error(&self) -> f64 {
        self.sim.path_s() / self.measured.path_s() - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::entry::{Machine, Session};
    use super::*;
    use crate::testing::line;
    use crate::testing::run;
    use proptest::prelude::*;

    fn line_of(run: Run) -> Line {
        line(Entry::Run(Box::new(run)))
    }

    fn free() -> Line {
        line(Entry::Network(Network {
            latency_s: 0.0,
            bandwidth_bytes_per_s: 1e30,
            measured: true,
        }))
    }

    fn of_machine(session: &str, cpu: &str) -> Line {
        let machine = Machine { cpu: cpu.into(), ..Machine::default() };
        let (command, lacks) = (Vec::new(), BTreeMap::new());
        let entry = Session { command, machine, load_average: 0.0, lacks };
        Line { session: session.into(), ..line(Entry::Session(Box::new(entry))) }
    }

    #[test]
    fn runs_of_another_machine_program_or_geometry_are_not_pooled() {
        let of = |session: &str, time_s: f64, program: &str, geometry: &str| {
            let mut run = run(Comm::Mpi, 9, &[("a", &[time_s])]);
            (run.program, run.geometry) = (program.into(), Some(geometry.into()));
            Line { session: session.into(), ..line_of(run) }
        };
        let lines = [
            of_machine("s", "fast"),
            of_machine("t", "slow"),
            of("s", 0.130, "p", "g"),
            of("t", 0.605, "p", "g"),
            of("s", 0.132, "p", "g"),
            of("s", 0.5, "q", "g"),
            of("s", 0.7, "p", "h"),
        ];
        let groups = Groups::of(&lines);
        let found: Vec<_> = groups
            .all
            .iter()
            .map(|g| {
                (g.setup.engine.as_str(), g.setup.case.as_str(), g.time_s.value, g.time_s.count)
            })
            .collect();
        let expected = [
            ("mesher", "cube", 0.131, 2),
            ("mesher [2]", "cube", 0.605, 1),
            ("mesher [3]", "cube", 0.5, 1),
            ("mesher", "cube [2]", 0.7, 1),
        ];
        assert_eq!(found, expected);
        assert_eq!(groups.origins.len(), 2);
        assert!(groups.origins[0].contains("[2]: slow"), "{:?}", groups.origins);
    }

    proptest! {
        #[test]
        fn drawn_records_satisfy_the_invariants(
            drawn in prop::collection::vec((0..3u8, prop::collection::vec(0.0..9.0f64, 1..4)), 1..12),
        ) {
            let comms = [Comm::Solo, Comm::Mpi, Comm::Sim];
            let of = |(comm, times): &(u8, Vec<f64>)| {
                line_of(run(comms[usize::from(*comm)], 9, &[("a", times), ("b", times)]))
            };
            let lines: Vec<Line> = drawn.iter().map(of).collect();
            let groups = Groups::of(&lines);
            let total: usize = groups.all.iter().map(|group| group.runs.len()).sum();
            prop_assert_eq!(total, lines.len());
        }
    }

    fn planted(fault: impl Fn(&mut Group)) {
        let lines = [line_of(run(Comm::Mpi, 9, &[("a", &[1.0, 2.0])]))];
        let mut groups = Groups::of(&lines);
        fault(&mut groups.all[0]);
        groups.check_invariants();
    }

    #[test]
    #[should_panic(expected = "is in its interval")]
    fn a_median_outside_its_interval_is_noticed() {
        planted(|group| group.time_s.value *= 2.0);
    }

    #[test]
    #[should_panic(expected = "pools other setups")]
    fn a_run_of_another_setup_is_noticed() {
        planted(|group| group.runs[0].setup.case = "ball".into());
    }

    #[test]
    #[should_panic(expected = "sum and maximum are those of the ranks")]
    fn a_sum_that_is_not_that_of_the_ranks_is_noticed() {
        planted(|group| group.typical.phases[0].useful_s.sum += 1.0);
    }

    #[test]
    fn repetitions_form_a_group_without_warm_ups() {
        let mut cold = run(Comm::Sim, 9, &[("a", &[50.0, 50.0])]);
        cold.warm_up = true;
        let lines = [
            free(),
            line_of(cold),
            line_of(run(Comm::Sim, 9, &[("a", &[1.0, 1.0])])),
            line_of(run(Comm::Sim, 9, &[("a", &[9.0])])),
            line_of(run(Comm::Sim, 9, &[("a", &[2.0, 2.0])])),
            line_of(run(Comm::Sim, 9, &[("a", &[7.0, 2.0])])),
        ];
        let groups = Groups::of(&lines);
        assert_eq!(groups.all.len(), 2);
        let two = &groups.all[0];
        assert_eq!((two.time_s.value, two.time_s.count, two.how()), (2.0, 3, "projected"));
        assert_eq!(two.typical.useful_s.sum, 4.0);
        let reference = groups.reference(two);
        assert_eq!(reference.setup.ranks, 1);
        let e = two.efficiency(reference, &groups.network);
        assert!((e.global() - 9.0 / 4.0).abs() < 1e-9);
    }

    #[test]
    fn noise_in_a_single_repetition_has_no_effect() {
        let quiet: &[(&str, &[f64])] = &[("a", &[1.0, 2.0, 3.0]), ("b", &[2.0, 2.0, 2.5])];
        let of = |disturbed: [&[(&str, &[f64])]; 3]| {
            let mut lines = vec![free()];
            lines.extend(disturbed.map(|useful| line_of(run(Comm::Sim, 9, useful))));
            Groups::of(&lines).all.remove(0)
        };
        let clean = of([quiet; 3]);
        // Every repetition is disturbed, each on another rank or in another phase.
        let noisy = of([
            &[("a", &[9.0, 2.0, 3.0]), ("b", &[2.0, 2.0, 2.5])],
            &[("a", &[1.0, 7.0, 3.0]), ("b", &[8.0, 2.0, 2.5])],
            &[("a", &[1.0, 2.0, 3.0]), ("b", &[2.0, 6.0, 2.5])],
        ]);
        assert!(noisy.by_rank);
        assert_eq!(noisy.typical.useful_s, clean.typical.useful_s);
        assert_eq!(noisy.typical.useful_s.lambda(3), 5.5 * 3.0 / 12.5);
        assert_eq!((noisy.time_s.value, noisy.path_s()), (5.5, 5.5));
        // The repetitions' own critical paths are all longer; the interval shows that and includes the value.
        assert_eq!((noisy.time_s.low, noisy.time_s.high), (5.5, 15.0));
    }

    #[test]
    fn without_times_by_rank_the_typical_run_is_a_measured_one() {
        let mut brief = run(Comm::Sim, 9, &[("a", &[2.0, 2.0])]);
        brief.phases[0].useful_s.by_rank.clear();
        let lines =
            [free(), line_of(brief.clone()), line_of(run(Comm::Sim, 9, &[("a", &[3.0, 2.0])]))];
        let group = Groups::of(&lines).all.remove(0);
        assert!(!group.by_rank && group.runs.contains(&group.typical));
        assert!(group.rank_times_caption().starts_with("Run of median time"));
    }

    #[test]
    fn message_matrices_come_from_warm_ups() {
        let mut warm = run(Comm::Sim, 9, &[("a", &[2.0, 2.0])]);
        (warm.warm_up, warm.message_matrix) = (true, vec![[0, 1, 1, 8]]);
        let groups = Groups::of(&[line_of(warm.clone()), line_of(warm)]);
        assert_eq!((groups.all.len(), groups.matrices.len()), (0, 1));
    }

    #[test]
    fn projections_are_compared_with_the_same_mesh_on_equally_many_ranks() {
        let mut crowd = run(Comm::Mpi, 9, &[("a", &[1.0, 1.0, 1.0, 1.0])]);
        crowd.oversubscribed = true;
        let lines = [
            free(),
            line_of(run(Comm::Sim, 9, &[("a", &[1.1, 1.0])])),
            line_of(run(Comm::Mpi, 9, &[("a", &[1.0, 1.0])])),
            line_of(run(Comm::Sim, 9, &[("a", &[1.0, 1.0, 1.0, 1.0])])),
            line_of(crowd),
        ];
        let groups = Groups::of(&lines);
        let pairs = groups.projections();
        assert_eq!(pairs.len(), 1);
        assert!((pairs[0].error() - 0.1).abs() < 1e-9);
        assert!((pairs[0].path_error() - 0.1).abs() < 1e-9);
    }
}
