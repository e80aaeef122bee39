//! Load balance by counters, which repeat exactly: repartitioning balances the leaves on any number of ranks, no split is counted twice
//! or missed, and no counter changes unnoticed.

use crate::process::{Workspace, run};
use serde_json::Value;

/// A torus, and an extent box next to it whose layers reach into other ranks' parts; `{n}` cells per layer.
const CASE: &str =
    "spacing_min = 0.012\nroot_scale = 4.0\nlayer_cells_min = {n}\nkeep_crossing = {c}\n
[generator]\nshape = \"torus\"\nfacets = 6400\n
[[box]]\nmin = [1.5, 0.1, -0.3]\nmax = [1.9, 0.9, 1.1]\nspacing = 0.02\n";

/// A counter, by rank.
fn counter(report: &Value, name: &str) -> Vec<u64> {
    serde_json::from_value(report["counters"][name].clone()).expect("a number per rank")
}

fn sum(report: &Value, name: &str) -> u64 {
    counter(report, name).iter().sum()
}

fn lambda(all: &[u64]) -> f64 {
    let (most, sum) = (all.iter().max().unwrap(), all.iter().sum::<u64>());
    *most as f64 * all.len() as f64 / sum as f64
}

fn mesh(workspace: &Workspace, args: &[&str]) -> Value {
    run(workspace.mesher(&[&["case.toml", "--quiet", "--json", "run.json"], args].concat()))
        .succeeds();
    let report = workspace.json("run.json");
    check_times(&report);
    report
}

/// The time in calls is part of that of a phase, the CPU time of a rank part of its wall time, and the slowest rank's phases
/// are the run.
fn check_times(report: &Value) {
    let phases = report["phases"].as_array().expect("phases");
    let of = |phase: &Value, name: &str| -> Vec<f64> {
        serde_json::from_value(phase[name].clone()).expect("a time by rank")
    };
    let mut totals = vec![0.0; of(&phases[0], "time_wall_s").len()];
    for phase in phases {
        let [wall, cpu, comm_wall, comm_cpu] =
            ["time_wall_s", "time_cpu_s", "time_comm_wall_s", "time_comm_cpu_s"]
                .map(|name| of(phase, name));
        for (rank, total) in totals.iter_mut().enumerate() {
            *total += wall[rank];
            let parts = [
                (comm_wall[rank], wall[rank]),
                (comm_cpu[rank], cpu[rank]),
                (cpu[rank], wall[rank]),
            ];
            // The clocks are read one after the other.
            let fits =
                |(part, whole): (f64, f64)| (0.0..20.0).contains(&part) && part < whole + 0.005;
            assert!(parts.into_iter().all(fits) && wall[rank] > 1e-9, "rank {rank}: {phase}");
        }
    }
    let slowest = totals.into_iter().fold(0.0, f64::max);
    assert!((report["time_wall_s"].as_f64().unwrap() - slowest).abs() < 1e-9, "{report}");
    let peak: u64 =
        serde_json::from_value::<Vec<u64>>(report["peak_rss_bytes"].clone()).unwrap().iter().sum();
    assert!((1 << 20..1 << 34).contains(&peak), "{peak} bytes");
}

/// In the base mesh, which is coarser, the first seed lies in a leaf that the wall of the cavity crosses.
#[test]
fn the_papers_partition_makes_the_same_mesh_around_seeds() {
    let workspace = Workspace::new();
    let case = "spacing_min = 0.07\nlayer_cells_min = 2\nkeep_crossing = false\nroot_scale = 2.1\n
seeds = [[0.01, 0.02, 0.03], [0.9, -0.9, 0.9]]\n[generator]\nshape = \"box_in_box\"\nfacets = 96\n";
    workspace.write("case.toml", case);
    let solo = mesh(&workspace, &["--comm", "solo"]);
    for depth in ["2", "3", "4"] {
        let paper = ["--comm", "sim:3", "--preset", "paper", "--level-base", depth];
        assert_eq!(mesh(&workspace, &paper)["digest"], solo["digest"]);
    }
}

#[test]
fn repartitioning_balances_the_leaves() {
    for (n, crossing) in [("1", "false"), ("4", "true")] {
        let workspace = Workspace::new();
        workspace.write("case.toml", CASE.replace("{n}", n).replace("{c}", crossing));
        let solo = mesh(&workspace, &["--comm", "solo"]);
        for ranks in [2, 7, 40] {
            let comm = format!("sim:{ranks}");
            let balanced = mesh(&workspace, &["--comm", &comm]);
            assert_eq!(balanced["digest"], solo["digest"]);
            let leaves = counter(&balanced, "leaves");
            let heaviest = *counter(&balanced, "base_leaf_cells_max").iter().max().unwrap();
            let mean = leaves.iter().sum::<u64>() / ranks;
            // The tolerated imbalance is a twentieth. A partition boundary lies between octants, so either end of a part may be
            // off by one. Crossing leaves that are left out are estimated by their number before gradation.
            let bound = mean + mean / 20 + 2 * heaviest + mean / 50;
            assert!(leaves.iter().all(|&l| l <= bound), "{ranks} ranks: {leaves:?}, {heaviest}");
            assert!(heaviest < mean / 2, "{ranks} ranks: octants of {heaviest} in {mean}");
            let kept = mesh(&workspace, &["--comm", &comm, "--weights", "area"]);
            assert_eq!(kept["digest"], solo["digest"]);
            let (new, old) = (lambda(&leaves), lambda(&counter(&kept, "leaves")));
            // A partition that is balanced well enough does not change.
            assert!(new < old || old < 1.05, "{ranks} ranks: lambda {new} is not below {old}");
            assert!(
                ranks == 2 || old > 1.1,
                "{ranks} ranks: lambda {old} leaves no room for improvement"
            );
        }
    }
}

#[test]
fn splits_of_gradation_are_counted_once() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE.replace("{n}", "3").replace("{c}", "true"));
    let solo = mesh(&workspace, &["--comm", "solo"]);
    let split = sum(&solo, "octants_split_graded");
    // Each split replaces one leaf by eight, beginning with the leaves of the base tree, some of which are deleted.
    let base = mesh(&workspace, &["--comm", "solo", "--ungraded"]);
    assert!(
        split * 7 < sum(&solo, "leaves") && split * 7 + sum(&base, "leaves") > sum(&solo, "leaves")
    );
    for weights in ["unit", "area", "rebalance"] {
        for comm in ["sim:3", "sim:13", "sim:64"] {
            let ranks = mesh(&workspace, &["--comm", comm, "--weights", weights]);
            assert_eq!(sum(&ranks, "octants_split_graded"), split, "{weights} {comm}");
        }
    }
}

/// Runs whose counters are recorded: the case by its layers and crossing leaves, and options. Without METIS, whose arithmetic may depend
/// on the machine.
const RECORDED: [(&str, &str, &str); 11] = [
    ("1", "false", "--comm solo"),
    ("4", "true", "--comm solo"),
    ("2", "true", "--comm sim:2 --ungraded"),
    ("1", "false", "--comm sim:3"),
    ("3", "true", "--comm sim:5"),
    ("3", "true", "--comm sim:5 --weights area"),
    ("2", "false", "--comm sim:6 --weights unit"),
    ("2", "false", "--comm sim:4 --weights unit --level-base 3"),
    ("2", "true", "--comm sim:7 --weights area --level-base 4"),
    ("1", "true", "--comm sim:24 --level-base 0"),
    ("4", "true", "--comm sim:40"),
];

/// The numbers of a run that repeat exactly: one line for each counter, and one for the messages of each phase, by rank.
fn numbers(report: &Value) -> String {
    let mut lines = format!("digest {}\nlevel_base {}\n", report["digest"], report["level_base"]);
    let mut line = |name: &str, by_rank: &Value| lines += &format!("{name} {by_rank}\n");
    let counters = report["counters"].as_object().expect("counters");
    counters.iter().for_each(|(name, by_rank)| line(name, by_rank));
    for phase in report["phases"].as_array().expect("phases") {
        for number in ["messages", "message_bytes"] {
            line(&format!("{} {number}", phase["name"]), &phase[number]);
        }
    }
    lines
}

/// The work of a rank alone is that among the others.
#[test]
fn ranks_that_are_timed_alone_do_the_same_work() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE.replace("{n}", "3").replace("{c}", "false"));
    for args in ["", " --weights unit", " --partitioner metis", " --ungraded", " --check"] {
        let of_ranks = |options: &str| {
            let args = format!("--comm sim:9:4{args}{options}");
            mesh(&workspace, &args.split(' ').collect::<Vec<_>>())
        };
        let (among, alone) = (of_ranks(""), of_ranks(" --time-alone"));
        assert_eq!(numbers(&alone), numbers(&among), "{args}");
    }
    workspace.write("case.toml", CASE.replace("{n}", "1").replace("{c}", "true"));
    let refused = run(workspace.mesher(&["case.toml", "--comm", "solo", "--time-alone"]));
    let why = "mesher: --time-alone is for simulated ranks: add --comm sim:RANKS\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), why));
}

/// A change of estimates, boundaries or messages leaves the mesh as it is, and shows here. If it is intended, UPDATE_COUNTERS=1 writes
/// the new numbers.
#[test]
fn the_counters_of_recorded_runs_are_the_same() {
    let recorded = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/programs/balance.counters");
    let workspace = Workspace::new();
    let mut got = String::new();
    for (n, crossing, args) in RECORDED {
        workspace.write("case.toml", CASE.replace("{n}", n).replace("{c}", crossing));
        let report = mesh(&workspace, &args.split(' ').collect::<Vec<_>>());
        got += &format!("{n} {crossing} {args}\n{}\n", numbers(&report));
    }
    if std::env::var_os("UPDATE_COUNTERS").is_some() {
        std::fs::write(recorded, &got).expect("the source tree is writable");
    }
    let want = std::fs::read_to_string(recorded).expect("recorded counters");
    let difference = got.lines().zip(want.lines()).find(|(got, want)| got != want);
    assert!(
        got == want,
        "first difference: {difference:?}; UPDATE_COUNTERS=1 writes the new numbers"
    );
}
