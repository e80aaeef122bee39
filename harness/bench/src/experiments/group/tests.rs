use super::*;
use crate::experiments::entry::{Machine, Session};
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
        ..ASSUMED
    }))
}

fn of_machine(session: &str, cpu: &str) -> Line {
    let machine = Machine { cpu: cpu.into(), ..Machine::default() };
    let (command, lacks) = (Vec::new(), BTreeMap::new());
    let entry = Session { command, machine, nodes: String::new(), load_average: 0.0, lacks };
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
        .map(|g| (g.setup.engine.as_str(), g.setup.case.as_str(), g.time_s.value, g.time_s.count))
        .collect();
    let expected = [
        ("mesher", "cube", 0.131, 2),
        ("mesher [2]", "cube", 0.605, 1),
        ("mesher [3]", "cube", 0.5, 1),
        ("mesher", "cube [2]", 0.7, 1),
    ];
    assert_eq!(found, expected);
    assert_eq!(groups.notes.len(), 2);
    assert!(groups.notes[0].contains("[2]: slow"), "{:?}", groups.notes);
}

/// A later session runs an edited case on another machine, where four ranks fail.
#[test]
fn a_run_without_a_result_is_of_the_machine_and_the_case_of_its_session() {
    let of = |session: &str, ranks: usize, experiment: &str| {
        let mut run = run(Comm::Sim, 9, &[("a", &vec![1.0; ranks])]);
        run.setup.experiment = experiment.into();
        run.inputs = format!("rules of {session}");
        Line { session: session.into(), ..line_of(run) }
    };
    let mut failed = of("2", 4, "strong");
    let setup = failed.run().unwrap().setup.clone();
    failed.entry = Entry::Failure(NoResult { setup, why: "killed".into() });
    let lines = [
        of_machine("1", "slow"),
        of("1", 1, "strong"),
        of("1", 4, "strong"),
        of_machine("2", "fast"),
        failed,
        of("2", 1, "strong"),
        of("2", 1, TARGETS),
    ];
    let groups = Groups::of(&lines);
    let names: Vec<_> = groups.all.iter().map(|g| (&*g.setup.engine, &*g.setup.case)).collect();
    let second = ("mesher [2]", "cube [2]");
    // A mesh of targets that has the name of a case.
    assert_eq!(names, [("mesher", "cube"), ("mesher", "cube"), second, ("mesher [2]", "cube")]);
    assert_eq!(groups.global_efficiency(&groups.all[2]).value, 1.0);
    let [missing] = &groups.missing[..] else { panic!("{:?}", groups.missing) };
    assert!(missing.starts_with("a run is missing, mesher [2] cube [2] strong"), "{missing}");
}

#[test]
fn a_repetition_that_fails_is_named_unless_the_run_is_repeated_later() {
    let ran = || line_of(run(Comm::Mpi, 9, &[("a", &[1.0])]));
    let setup = ran().run().unwrap().setup.clone();
    let failed = line(Entry::Failure(NoResult { setup, why: "killed".into() }));
    let missing = |lines: &[Line]| Groups::of(lines).missing;
    let [why] = &missing(&[ran(), failed.clone()])[..] else { panic!("a run is missing") };
    assert!(why.starts_with("a run is missing, mesher cube strong") && why.ends_with(": killed"));
    assert_eq!(missing(&[ran(), failed, ran()]), [""; 0]);
}

/// The names of nodes are new in every session of a cloud, so they do not make series.
#[test]
fn runs_of_several_nodes_are_pooled_and_the_nodes_counted() {
    let on = |session: &str, nodes: &str| {
        let mut line = of_machine(session, "cpu");
        if let Entry::Session(of) = &mut line.entry {
            of.nodes = nodes.into();
        }
        line
    };
    let of = |session: &str| {
        let line = line_of(run(Comm::Solo, 9, &[("a", &[1.0])]));
        Line { session: session.into(), ..line }
    };
    let groups = Groups::of(&[on("1", "a"), of("1"), on("2", "b"), of("2"), on("3", "a")]);
    assert_eq!((groups.all.len(), groups.all[0].runs.len()), (1, 2));
    let [note] = &groups.notes[..] else { panic!("{:?}", groups.notes) };
    assert_eq!(note, "runs on 2 lists of nodes are taken for one machine's");
    assert!(Groups::of(&[on("1", "a"), of("1"), on("3", "a")]).notes.is_empty());
}

#[test]
fn a_run_of_other_facets_or_cells_is_left_out_even_without_digests() {
    let of = |change: fn(&mut Run)| {
        let mut run = run(Comm::Solo, 9, &[("a", &[1.0])]);
        run.digest.clear();
        change(&mut run);
        line_of(run)
    };
    let with = |change: fn(&mut Run), lacks: &[&str]| {
        let lacks = [("mesher".to_owned(), lacks.iter().map(|of| (*of).to_owned()).collect())];
        let session =
            Entry::Session(Box::new(Session { lacks: lacks.into(), ..Session::default() }));
        let groups = Groups::of(&[line(session), of(|_| ()), of(change)]);
        (groups.all[0].runs.len(), groups.missing.len(), groups.notes.len())
    };
    let (kept, left_out) = ((2, 0, 0), (1, 1, 1));
    assert_eq!(with(|_| (), &[]), kept);
    assert_eq!(with(|run| run.cells = 18, &[]), left_out);
    assert_eq!(with(|run| run.facets = 13, &[]), left_out);
    assert_eq!(with(|run| run.facets = 0, &[]), kept, "one that does not report them");
    assert_eq!(with(|run| run.cells = 18, &[EQUAL_RUNS]), kept);
    assert_eq!(with(|run| run.facets = 13, &[EQUAL_RUNS]), left_out);
    // Another program has a mesh of its own, of the same facets.
    let other = |facets: u64| {
        let mut run = run(Comm::Solo, 18, &[("a", &[1.0])]);
        (run.setup.engine, run.digest, run.facets) = ("p4est".into(), String::new(), facets);
        let groups = Groups::of(&[of(|_| ()), line_of(run)]);
        (groups.all.len(), groups.missing)
    };
    assert_eq!([other(12), other(0)], [(2, vec![]), (2, vec![])]);
    let (count, missing) = other(13);
    assert!(count == 1 && missing[0].contains("the number of facets 13"), "{missing:?}");
}

#[test]
fn a_mesh_of_targets_that_has_the_name_of_a_case_is_another_mesh() {
    let of = |experiment: &str, ranks: usize, facets: u64| {
        let mut run = run(Comm::Sim, 9, &[("a", &vec![1.0; ranks])]);
        (run.setup.experiment, run.facets) = (experiment.into(), facets);
        line_of(run)
    };
    let groups = Groups::of(&[of(TARGETS, 1, 80), of("strong", 2, 12)]);
    assert_eq!((groups.all.len(), groups.notes.len()), (2, 0), "{:?}", groups.notes);
    assert_eq!(groups.reference(&groups.all[1]).setup.ranks, 2);
}

#[test]
fn a_program_without_any_run_on_a_case_is_named() {
    let (why, of) = ("keep = outside".to_owned(), run(Comm::Mpi, 1, &[("a", &[1.0])]));
    let setup = Setup { engine: "other".into(), ..of.setup.clone() };
    let left = |setup: &Setup| NoResult { setup: setup.clone(), why: why.clone() };
    let lines = [&setup, &setup, &of.setup].map(|s| line(Entry::LeftOut(left(s))));
    let groups = Groups::of(&[&lines[..], &[line_of(of)]].concat());
    assert_eq!(groups.notes, ["other has no run on cube: keep = outside"]);
}

/// A later session without runs, or with another network, changes nothing of an earlier one.
#[test]
fn a_session_has_its_own_network() {
    let of = |session: &str, entry: Entry| Line { session: session.into(), ..line(entry) };
    let network = |latency_s: f64, measured: bool| {
        let given = !measured;
        Entry::Network(Network { latency_s, bandwidth_bytes_per_s: 1e30, measured, given })
    };
    let mut sim = run(Comm::Sim, 9, &[("a", &[1.0, 1.0])]);
    sim.phases[0].messages = Spread::of(&[1.0, 1.0]);
    let ran = || Entry::Run(Box::new(sim.clone()));
    let mut lines = vec![
        of_machine("1", "cpu"),
        of("1", network(1.0, true)),
        of("1", ran()),
        of_machine("2", "cpu"),
        of("2", network(9.0, false)),
    ];
    let found = |lines: &[Line]| -> Vec<(f64, usize)> {
        Groups::of(lines).all.iter().map(|of| (of.time_s.value, of.runs.len())).collect()
    };
    assert_eq!(found(&lines), [(2.0, 1)]);
    lines.push(of("2", ran()));
    assert_eq!(found(&lines), [(2.0, 1), (10.0, 1)], "a network that was given is another series");
    lines.extend([of_machine("3", "cpu"), of("3", network(2.0, true)), of("3", ran())]);
    assert_eq!(found(&lines), [(3.0, 2), (10.0, 1)], "all repetitions with the last network");
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

/// Two sessions on two machines, each with its network; and one run that has another mesh.
#[test]
fn a_projection_has_the_network_of_its_machine_and_a_run_with_another_mesh_is_left_out() {
    let slow = Network { latency_s: 1.0, bandwidth_bytes_per_s: 1e30, measured: true, ..ASSUMED };
    let of_machine = |session: &str, entry: Entry| Line { session: session.into(), ..line(entry) };
    let session = |cpu: &str| {
        let machine = Machine { cpu: cpu.into(), ..Machine::default() };
        let (command, nodes) = (Vec::new(), String::new());
        let lacks = BTreeMap::new();
        Entry::Session(Box::new(Session { command, machine, nodes, load_average: 0.0, lacks }))
    };
    let mut sim = run(Comm::Sim, 9, &[("a", &[1.0, 1.0])]);
    sim.phases[0].messages = Spread::of(&[3.0, 3.0]);
    let other = Run { digest: "other".into(), ..sim.clone() };
    let of = |run: &Run| Entry::Run(Box::new(run.clone()));
    let lines = [
        of_machine("1", session("fast")),
        of_machine("1", free().entry),
        of_machine("1", of(&sim)),
        of_machine("1", of(&other)),
        of_machine("2", session("slow")),
        of_machine("2", Entry::Network(slow)),
        of_machine("2", of(&sim)),
    ];
    let groups = Groups::of(&lines);
    let times: Vec<(f64, usize)> =
        groups.all.iter().map(|group| (group.time_s.value, group.runs.len())).collect();
    assert_eq!(times, [(1.0, 1), (4.0, 1)]);
    let [why] = &groups.missing[..] else { panic!("{:?}", groups.missing) };
    assert!(why.contains(": its mesh has the digest other"), "{why}");
}

#[test]
fn impossible_numbers_of_a_line_are_noticed() {
    let is_possible = |change: fn(&mut Run)| {
        let mut run = run(Comm::Mpi, 9, &[("a", &[1.0, 2.0])]);
        change(&mut run);
        line_of(run).is_possible()
    };
    assert!(is_possible(|_| ()));
    let faults: [fn(&mut Run); 17] = [
        |run| run.phases[0].messages.sum = -1e6,
        |run| run.counters = [("a".to_owned(), Spread { max: -1.0, ..Spread::default() })].into(),
        |run| run.peak_rss_bytes.sum = 1.0,
        |run| run.time_launch_s = -1.0,
        |run| run.useful_s.max *= 100.0,
        // Less than the mean; more than both phases on their slowest ranks.
        |run| run.useful_s = Spread { sum: 3.0, max: 0.1, ..Spread::default() },
        |run| run.useful_s = Spread::of(&[0.0, 3.0]),
        |run| run.phases[0].useful_s = Spread::of(&[0.0, 0.0]),
        |run| run.time_wall_s = 0.0,
        |run| run.time_wall_s = 1e308,
        |run| run.time_launch_s = run.time_wall_s / 2.0,
        |run| run.time_wall_s = run.phases[0].wall_s.max / 2.0,
        |run| run.phases[0].useful_s.by_rank[1] = -1.0,
        |run| run.useful_s.max = f64::NAN,
        |run| run.setup.ranks = 0,
        |run| run.setup.ranks = 3,
        |run| run.cells = 0,
    ];
    assert!(!faults.into_iter().any(is_possible));
    // Nothing could be projected from it.
    let mut idle = run(Comm::Sim, 9, &[("a", &[0.0, 0.0])]);
    (idle.time_wall_s, idle.time_launch_s) = (1.0, 1.0);
    assert!(!line_of(idle.clone()).is_possible());
    idle.setup.comm = Comm::Mpi;
    assert!(line_of(idle).is_possible());
    let network =
        Network { latency_s: -1.0, bandwidth_bytes_per_s: 1.0, measured: true, ..ASSUMED };
    assert!(!line(Entry::Network(network)).is_possible());
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
    let e = two.efficiency(reference).unwrap();
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
    assert_eq!(noisy.time_s.value, 5.5);
    // The repetitions' own critical paths are all longer; the interval shows that and includes the value.
    assert_eq!((noisy.time_s.low, noisy.time_s.high), (5.5, 15.0));
}

#[test]
fn without_times_by_rank_the_typical_run_is_a_measured_one() {
    let mut brief = run(Comm::Sim, 9, &[("a", &[2.0, 2.0])]);
    brief.phases[0].useful_s.by_rank.clear();
    let lines = [free(), line_of(brief.clone()), line_of(run(Comm::Sim, 9, &[("a", &[3.0, 2.0])]))];
    let group = Groups::of(&lines).all.remove(0);
    assert!(!group.by_rank && group.runs.contains(&group.typical));
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
    let [sim, measured] = pairs[0].map(|group| group.time_s.value);
    assert!((sim / measured - 1.1).abs() < 1e-9);
}

#[test]
fn the_time_of_efficiencies_is_the_median_of_an_even_number_of_runs() {
    let of = |time_s: f64| {
        let mut run = run(Comm::Mpi, 9, &[("a", &[1.0, 1.0])]);
        run.time_wall_s = time_s;
        line_of(run)
    };
    let groups = Groups::of(&[of(2.0), of(4.0)]);
    assert_eq!(groups.all[0].time_s.value, 3.0);
    assert_eq!(groups.efficiency(&groups.all[0]).unwrap().parallel(), 1.0 / 3.0);
}

/// Their useful time is the wall time, to which no CPU time of a disturbed run is near.
#[test]
fn runs_without_phases_have_a_cpu_time_and_a_speedup_and_no_factors() {
    let of = |time_s: f64| {
        let mut run = run(Comm::Solo, 9, &[("a", &[time_s])]);
        (run.phases, run.time_cpu_s) = (Vec::new(), 2.0);
        line_of(run)
    };
    let groups = Groups::of(&[of(2.0), of(2.4), of(3.0), of(4.0)]);
    let group = &groups.all[0];
    assert_eq!((groups.efficiency(group), group.imbalance()), (None, None));
    assert_eq!((groups.global_efficiency(group).value, group.time_s.value), (1.0, 2.7));
    assert_eq!(group.cpu_s().unwrap().value, 2.0);
    // On two ranks, of which one computes longer: as older records have it, with useful times.
    let mut two = run(Comm::Mpi, 9, &[("a", &[2.0, 2.0])]);
    two.phases.clear();
    let groups = Groups::of(&[of(3.0), line_of(two.clone())]);
    let group = &groups.all[1];
    assert_eq!((groups.efficiency(group), group.imbalance()), (None, None));
    assert_eq!((groups.speedup(group).value, groups.global_efficiency(group).value), (1.5, 0.75));
    assert_eq!(group.cpu_s().unwrap().value, 4.0);
    two.time_cpu_s = 0.1;
    assert_eq!(Groups::of(&[line_of(two)]).all[0].cpu_s(), None, "that of a launcher");
}

/// It would depend on the other series of a study.
#[test]
fn a_projected_time_has_no_measured_base() {
    let of = |comm: Comm, ranks: usize, experiment: &str| {
        let mut run = run(comm, 9, &[("a", &vec![8.0; ranks])]);
        run.setup.experiment = experiment.into();
        line_of(run)
    };
    let weights = [4, 8].map(|ranks| of(Comm::Sim, ranks, "weights"));
    let groups = Groups::of(&[&weights[..], &[of(Comm::Solo, 1, "layers")]].concat());
    let base = groups.reference(&groups.all[1]);
    assert_eq!(base.how_on(), "projected on 4 ranks");
}

#[test]
fn two_series_of_a_case_have_bases_of_their_own() {
    let of = |ranks: usize, cells: u64, size: f64| {
        let mut run = run(Comm::Sim, cells, &[("a", &vec![size; ranks])]);
        run.setup.experiment = "weak".into();
        run.setup.series_cells = Some(size);
        line_of(run)
    };
    let groups = Groups::of(&[of(1, 10, 10.0), of(2, 20, 10.0), of(1, 40, 40.0), of(2, 80, 40.0)]);
    for group in &groups.all {
        assert_eq!(groups.reference(group).setup.series_cells, group.setup.series_cells);
        assert_eq!(groups.efficiency(group).unwrap().global(), 1.0);
    }
}

#[test]
fn a_speedup_is_over_one_rank_and_a_measured_one_has_no_projected_base() {
    let of = |comm: Comm, times: &[f64]| line_of(run(comm, 9, &[("a", times)]));
    let groups = Groups::of(&[free(), of(Comm::Sim, &[4.0; 2]), of(Comm::Sim, &[2.5; 4])]);
    let speedups: Vec<f64> = groups.all.iter().map(|g| groups.speedup(g).value).collect();
    assert_eq!(speedups, [2.0, 3.2]);
    assert_eq!([0, 1].map(|i| groups.has_reference(&groups.all[i])), [false, true]);
    let groups = Groups::of(&[free(), of(Comm::Sim, &[4.0]), of(Comm::Mpi, &[2.0; 2])]);
    assert!(!groups.has_reference(&groups.all[1]));
}

#[test]
fn efficiency_and_imbalance_have_the_intervals_of_the_repetitions() {
    let of = |times: &[f64]| line_of(run(Comm::Mpi, 9, &[("a", times)]));
    let two = [&[2.0, 2.0][..], &[4.0, 2.0], &[3.0, 1.0]].map(of);
    let with_base = |base: &[f64]| {
        let base = base.iter().map(|time| of(&[*time]));
        Groups::of(&base.chain(two.clone()).collect::<Vec<_>>())
    };
    let groups = with_base(&[4.0, 4.0, 4.0]);
    let two = &groups.all[1];
    let (efficiency, imbalance) = (groups.global_efficiency(two), two.imbalance().unwrap());
    let found = [efficiency, imbalance].map(|of| [of.low, of.value, of.high]);
    let expected = [[0.5, 4.0 / 6.0, 1.0], [1.0, 1.2, 1.5]];
    let off = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9, "{found:?}");
    // Three runs of each: 75 % each, and half in the worst case for both.
    assert_eq!(efficiency.coverage, 0.5);
    let wide = with_base(&[3.0, 4.0, 8.0]);
    let speedup = wide.speedup(&wide.all[1]);
    assert_eq!([speedup.low, speedup.value, speedup.high], [3.0 / 4.0, 4.0 / 3.0, 4.0]);
    // A base of one run has no interval.
    let narrow = with_base(&[4.0]);
    let speedup = narrow.speedup(&narrow.all[1]);
    assert_eq!((speedup.low, speedup.high, speedup.coverage), (speedup.value, speedup.value, 0.0));
}

#[test]
fn another_partition_on_fewer_ranks_is_no_base() {
    let of = |ranks: usize, weights: &str| {
        let mut run = run(Comm::Sim, 9, &[("a", &vec![8.0; ranks])]);
        run.setup.weights = weights.into();
        line_of(run)
    };
    let bases = |lines: &[Line]| -> Vec<usize> {
        let groups = Groups::of(lines);
        groups.all.iter().map(|group| groups.reference(group).setup.ranks).collect()
    };
    let two = [of(2, "area"), of(4, "unit"), of(8, "area")];
    assert_eq!(bases(&two), [2, 4, 2]);
    assert_eq!(bases(&[&two[..], &[of(1, "")]].concat()), [1; 4]);
}

/// Two sizes of a series may give one mesh.
#[test]
fn a_serial_run_is_its_own_base_beside_one_of_another_series() {
    let of = |cells: f64, time_s: f64| {
        let mut run = run(Comm::Solo, 9, &[("a", &[time_s])]);
        run.setup.series_cells = Some(cells);
        line_of(run)
    };
    let groups = Groups::of(&[of(4e5, 1.0), of(4.02e5, 0.8)]);
    assert_eq!(groups.all.len(), 2);
    assert!(groups.all.iter().all(|group| groups.speedup(group).value == 1.0));
}
