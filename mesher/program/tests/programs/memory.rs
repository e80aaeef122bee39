//! Plans, runs that would not fit into memory, and runs that run out of it all the same.

use crate::process::{MESHER, Workspace, refused, run};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixDatagram;
use std::process::Command;

/// Exit code of too little memory.
const MEMORY: i32 = 71;

const BODY: &str = "root_scale = 4.0\n[generator]\nshape = \"sphere\"\nfacets = 1280\n";

/// A case with a box over the whole root.
fn boxed(spacing_min: f64, spacing: f64) -> String {
    format!(
        "spacing_min = {spacing_min}\n{BODY}[[box]]\nmin = [-9, -9, -9]\nmax = [9, 9, 9]\nspacing = {spacing}\n"
    )
}

/// A command of the mesher whose processes may have `kib` KiB of address space each.
fn limited(kib: u64, args: &[&str]) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {kib}; exec \"$0\" \"$@\""), MESHER]).args(args);
    command
}

#[test]
fn a_box_of_level_19_over_the_whole_root_is_refused() {
    let workspace = Workspace::new();
    workspace.write("case.toml", boxed(0.1, 8e-6));
    let words = ["1.4e17 cells", "multiply all spacings", "--force"];
    refused(&workspace, &["case.toml"], MEMORY, &words);
    refused(&workspace, &["case.toml", "--quiet"], MEMORY, &words);
}

#[test]
fn the_plan_of_a_case_with_few_cells_is_its_mesh() {
    let workspace = Workspace::new();
    workspace.write("case.toml", format!("spacing_min = 0.03\n{BODY}"));
    for comm in crate::process::COMMS {
        let planned = run(workspace.mesher(&["case.toml", comm, "--plan", "--json", "plan.json"]));
        planned.succeeds();
        assert!(planned.stdout.contains("peak memory"), "{planned:?}");
        run(workspace.mesher(&["case.toml", comm, "--quiet", "--json", "run.json"])).succeeds();
        let (plan, report) = (workspace.json("plan.json"), workspace.json("run.json"));
        assert_eq!(plan["schema"], "octree-mesher-plan/2");
        assert_eq!(plan["pilots"][0]["spacing_factor"], 1.0);
        assert_eq!(plan["cells"], report["cells"]);
        let of = |report: &serde_json::Value, name: &str| {
            report[name].as_array().expect("a list by rank").len()
        };
        assert_eq!(of(&plan, "memory_peak_bytes"), of(&report, "peak_rss_bytes"));
        assert_eq!(plan["fits"], true);
    }
    // From one cell on, of which the file of the tree is nearly all header.
    for spacing in ["9", "0.2", "0.03"] {
        workspace.write("case.toml", format!("spacing_min = {spacing}\n{BODY}"));
        let args = ["case.toml", "--write", "htg", "--out", spacing, "--quiet"];
        let plan = ["--plan", "--json", "plan.json"];
        run(workspace.mesher(&[&args[..], &plan].concat())).succeeds();
        assert!(!workspace.path().join(spacing).exists(), "a plan must write no mesh");
        run(workspace.mesher(&args)).succeeds();
        let planned = workspace.json("plan.json")["tree_bytes"].as_f64().expect("a number");
        let file = workspace.path().join(spacing).join("mesh.vtkhdf");
        let bytes = file.metadata().expect("the tree is written").len() as f64;
        assert!((0.5..2.0).contains(&(planned / bytes)), "{planned} for {bytes} at {spacing}");
    }
}

#[test]
fn what_a_refusal_recommends_fits() {
    let workspace = Workspace::new();
    workspace.write("case.toml", boxed(0.1, 0.0016));
    let limit = 40_000;
    let args = ["case.toml", "--out", "mesh"];
    let refused = run(workspace.enter(limited(limit, &args)));
    refused.refuses(MEMORY, &["address space", "multiply all spacings"]);
    assert!(!workspace.path().join("mesh").exists());
    let args = ["case.toml", "--plan", "--quiet", "--json", "plan.json"];
    run(workspace.enter(limited(limit, &args))).refuses(MEMORY, &["multiply all spacings"]);
    let plan = workspace.json("plan.json");
    assert_eq!(
        (&plan["fits"], &plan["tightest"]["limit"]),
        (&false.into(), &"address space or data".into())
    );
    let factor = plan["spacing_factor_fits"].as_f64().expect("a spacing fits");
    workspace.write("fits.toml", boxed(0.1 * factor, 0.0016 * factor));
    run(workspace.enter(limited(limit, &["fits.toml", "--quiet"]))).succeeds();
}

/// Whether a run succeeded or ran out of memory, of which it leaves no file.
#[track_caller]
fn ran_out(workspace: &Workspace, command: Command, of: &str) -> bool {
    let is_launched = command.get_program() == "mpirun";
    let before = workspace.contents();
    let finished = run(workspace.as_mpi(command));
    if finished.code == Some(0) {
        for written in ["mesh", "run.json"] {
            assert!(workspace.path().join(written).exists(), "{of}: {finished:?}");
        }
        std::fs::remove_dir_all(workspace.path().join("mesh")).expect("a mesh");
        std::fs::remove_file(workspace.path().join("run.json")).expect("a report");
        return false;
    }
    if is_launched {
        finished.refuses_any_under_launcher(MEMORY, "memory");
    } else {
        finished.refuses(MEMORY, &["memory ran out", "--plan"]);
    }
    let after = workspace.contents();
    assert!(before.keys().eq(after.keys()), "{of} left files: {:?}", after.keys());
    true
}

const OUTPUT: [&str; 6] = ["--quiet", "--force", "--out", "mesh", "--json", "run.json"];

/// Just what the program takes itself, in KiB.
fn first_limit(workspace: &Workspace) -> u64 {
    let args = ["case.toml", "--plan", "--quiet"];
    let starts = |kib: &u64| run(workspace.enter(limited(*kib, &args))).code == Some(MEMORY);
    (4..64).map(|i| i * 1000).find(starts).expect("a limit between start and plan")
}

#[test]
fn a_run_without_enough_memory_ends_with_a_sentence_and_no_files() {
    let workspace = Workspace::new();
    workspace.write("case.toml", format!("spacing_min = 0.006\n{BODY}"));
    let first = first_limit(&workspace);
    let limits = (0..40).map(|i| first + i * 500);
    let ran_out = |kib: &u64| {
        let args = [&["case.toml"], &OUTPUT[..]].concat();
        ran_out(&workspace, limited(*kib, &args), &format!("a limit of {kib} KiB"))
    };
    let failed = limits.take_while(ran_out).count();
    assert!((3..40).contains(&failed), "{failed} limits were too low");
}

/// Each simulated rank has a thread with a stack of its own.
#[test]
fn too_little_memory_for_the_threads_of_simulated_ranks_is_no_bug() {
    let workspace = Workspace::new();
    workspace.write("case.toml", format!("spacing_min = 0.1\n{BODY}"));
    let with =
        |comm| limited(1_000_000, &["case.toml", "--quiet", "--out", "mesh", "--comm", comm]);
    let words = ["simulated rank ", "simulate fewer ranks", "ulimit -v"];
    run(workspace.enter(with("sim:500"))).refuses(MEMORY, &words);
    assert!(!workspace.path().join("mesh").exists());
    run(workspace.enter(with("sim:5"))).succeeds();
}

/// A launcher puts lines of its own between two writes of a rank.
#[test]
fn a_sentence_is_one_write() {
    let workspace = Workspace::new();
    workspace.write("case.toml", format!("spacing_min = 0.006\n{BODY}"));
    let args = [&["case.toml"], &OUTPUT[..]].concat();
    let without_memory = workspace.enter(limited(first_limit(&workspace), &args));
    for mut command in [workspace.mesher(&["absent.toml"]), without_memory] {
        let (ours, theirs) = UnixDatagram::pair().expect("a pair of sockets");
        command.stderr(OwnedFd::from(theirs));
        assert!(!command.status().expect("a mesher").success());
        drop(command);
        let mut line = [0; 512];
        let length = ours.recv(&mut line).expect("a sentence");
        let line = String::from_utf8_lossy(&line[..length]);
        assert!(line.starts_with("mesher: ") && line.ends_with('\n'), "{line:?}");
    }
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_rank_without_enough_memory_ends_all_ranks() {
    let workspace = Workspace::new();
    let body = BODY.replace("1280", "5242880");
    workspace.write("case.toml", format!("spacing_min = 0.5\n{body}"));
    // Rank 0 generates the facets; 300 MB are too little to start MPI.
    for kib in [300_000, 500_000, 550_000, 600_000] {
        let mut command = Command::new("mpirun");
        let args = [&["case.toml"], &OUTPUT[..]].concat();
        let limited = limited(kib, &args);
        command.args(["-n", "3"]).arg(limited.get_program()).args(limited.get_args());
        assert!(
            ran_out(&workspace, command, &format!("a limit of {kib} KiB")),
            "{kib} KiB suffice"
        );
    }
}
