//! Interrupted runs end at once with exit code 130 and leave no files, in whichever phase they are, on one rank and on several. A run
//! that was about to end is complete.

use crate::process::{Finished, Running, Workspace, run, start};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// A mesh that takes many seconds on a slow machine, in all phases.
const LONG: &str = "spacing_min = 0.0012\nlayer_cells_min = 6\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"sphere\"\nfacets = 5120\n";
/// One with four times as many cells, for several ranks, which must not have ended when they are interrupted.
const LONG_ON_RANKS: &str =
    "spacing_min = 0.0009\nlayer_cells_min = 6\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"sphere\"\nfacets = 5120\n";
/// One that takes a fraction of a second.
const SHORT: &str = "spacing_min = 0.01\nroot_scale = 2.0\n
[generator]\nshape = \"sphere\"\nfacets = 1280\n";
const OUTPUT: [&str; 5] = ["case.toml", "--out", "mesh", "--json", "run.json"];
const SIGNALS: [&str; 3] = ["INT", "TERM", "HUP"];

/// Time within which a process ends, on a busy machine. Phases of the long mesh take longer.
const AT_ONCE: Duration = Duration::from_secs(2);
/// OpenMPI's `mpirun` waits for a second between an interrupt and the signal to its ranks, and another process must get its turn.
const AT_ONCE_MPI: Duration = Duration::from_secs(4);

/// splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ z >> 31) % end
    }

    fn signal(&mut self) -> &'static str {
        SIGNALS[self.below(3) as usize]
    }
}

/// Sends a signal to a process, which may have ended.
fn signal(name: &str, id: u32) {
    let sent = Command::new("kill").args(["-s", name, &id.to_string()]).output();
    sent.expect("kill is installed");
}

/// Waits until the run has claimed its directory: from then on it handles signals.
fn wait_for_claim(run: &mut Running, workspace: &Workspace) {
    while !workspace.path().join("mesh/mesh.json.draft").exists() {
        if run.is_over() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Asserts that a run left nothing, or a complete mesh and its report. `allowed` are files that were there before.
#[track_caller]
fn assert_all_or_nothing(workspace: &Workspace, before: &[&str], finished: &Finished) {
    let contents = workspace.contents();
    let left: Vec<String> = contents
        .keys()
        .map(|p| p.strip_prefix(workspace.path()).expect("a prefix").display().to_string())
        .filter(|name| !before.contains(&name.as_str()))
        .collect();
    if !workspace.path().join("mesh/mesh.json").exists() {
        assert_eq!(left, [""; 0], "{finished:?}");
        return;
    }
    let manifest = workspace.json("mesh/mesh.json");
    let parts = manifest["parts"].as_array().expect("parts");
    for part in parts {
        let file = workspace.path().join("mesh").join(part["file"].as_str().expect("a name"));
        let bytes = std::fs::metadata(file).expect("the parts exist before the manifest").len();
        assert!(bytes > 8 * part["leaves"].as_u64().expect("a number"), "{finished:?}");
    }
    assert!(!left.iter().any(|name| name.ends_with(".draft")), "{left:?} {finished:?}");
    assert!(left.len() - parts.len() <= 3, "mesh, its manifest and the report: {left:?}");
}

/// A run of one process, interrupted once or twice at a random time within `window`.
fn interrupt(case: &str, comm: &str, window: Duration, random: &mut Random) {
    let workspace = Workspace::new();
    workspace.write("case.toml", case);
    let mut before = vec!["case.toml"];
    if random.below(2) == 0 {
        std::fs::create_dir(workspace.path().join("mesh")).expect("a directory");
        before.push("mesh");
    }
    let mut run = start(workspace.mesher(&[&OUTPUT[..], &["--quiet", "--comm", comm]].concat()));
    wait_for_claim(&mut run, &workspace);
    std::thread::sleep(Duration::from_micros(random.below(window.as_micros() as u64)));
    let since = Instant::now();
    let is_late = run.is_over();
    signal(random.signal(), run.id());
    if random.below(3) == 0 {
        signal(random.signal(), run.id());
    }
    let finished = run.finish();
    assert!(is_late || since.elapsed() < AT_ONCE || finished.code == Some(0), "{finished:?}");
    match finished.code {
        Some(0) => assert!(workspace.path().join("run.json").exists(), "{finished:?}"),
        // The second of two signals may find a complete mesh.
        Some(130) => assert!(finished.stderr.contains("mesher: interrupted"), "{finished:?}"),
        _ => panic!("{finished:?}"),
    }
    assert_all_or_nothing(&workspace, &before, &finished);
}

#[test]
fn an_interrupt_in_any_phase_leaves_no_files() {
    let mut random = Random(1);
    for _ in 0..6 {
        for comm in ["solo", "sim:3:2"] {
            interrupt(LONG, comm, Duration::from_secs(4), &mut random);
        }
    }
}

#[test]
fn an_interrupt_near_the_end_leaves_no_files_or_a_complete_mesh() {
    let mut random = Random(2);
    for _ in 0..100 {
        interrupt(SHORT, "solo", Duration::from_millis(250), &mut random);
    }
}

#[test]
fn a_run_that_is_started_to_survive_a_hangup_survives_it() {
    let workspace = Workspace::new();
    workspace.write("case.toml", SHORT);
    let script =
        format!("trap '' HUP; exec '{}' {} --quiet", crate::process::MESHER, OUTPUT.join(" "));
    let mut command = Command::new("sh");
    command.args(["-c", &script]);
    let mut run = start(workspace.enter(command));
    wait_for_claim(&mut run, &workspace);
    signal("HUP", run.id());
    run.finish().succeeds();
    assert!(workspace.path().join("run.json").exists());
}

/// The processes that a process has started.
fn children(id: u32) -> Vec<u32> {
    let text =
        std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
    text.split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// Whether a process runs; it may be a zombie.
fn is_alive(id: u32) -> bool {
    Path::new(&format!("/proc/{id}/exe")).read_link().is_ok()
}

/// A job on MPI ranks, interrupted once or twice at a random time: the launcher or one rank.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn an_interrupted_job_leaves_no_files_and_no_ranks() {
    let mut random = Random(3);
    for round in 0..12 {
        let workspace = Workspace::new();
        workspace.write("case.toml", LONG_ON_RANKS);
        let ranks = 2 + random.below(3) as usize;
        let mut job = start(workspace.mpirun(ranks, &[&OUTPUT[..], &["--quiet"]].concat()));
        wait_for_claim(&mut job, &workspace);
        std::thread::sleep(Duration::from_micros(random.below(2_000_000)));
        let processes = children(job.id());
        let is_of_rank = round % 4 == 3;
        let target = processes.last().copied().filter(|_| is_of_rank).unwrap_or(job.id());
        let since = Instant::now();
        let signals: Vec<_> = (0..1 + round % 2).map(|_| random.signal()).collect();
        let is_late = job.is_over();
        signals.iter().for_each(|name| signal(name, target));
        let finished = job.finish();
        let what = format!("round {round}, {ranks} ranks, {signals:?}: {finished:?}");
        assert!(is_late || since.elapsed() < AT_ONCE_MPI, "{:?} {what}", since.elapsed());
        assert!(is_late || finished.code != Some(0), "{what}");
        let since = Instant::now();
        while processes.iter().any(|&id| is_alive(id)) {
            assert!(since.elapsed() < AT_ONCE_MPI, "a rank runs on: {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_all_or_nothing(&workspace, &["case.toml"], &finished);
    }
}

/// Whoever gives up a job, whoever is killed.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_job_whose_launcher_or_rank_is_killed_leaves_no_mesh() {
    for victim in 0..3 {
        let workspace = Workspace::new();
        workspace.write("case.toml", LONG_ON_RANKS);
        let mut job = start(workspace.mpirun(3, &["case.toml", "--out", "mesh", "--quiet"]));
        wait_for_claim(&mut job, &workspace);
        std::thread::sleep(Duration::from_millis(500));
        let processes = children(job.id());
        signal("KILL", if victim == 0 { job.id() } else { processes[victim - 1] });
        let finished = job.finish();
        let since = Instant::now();
        while processes.iter().any(|&id| is_alive(id)) {
            assert!(since.elapsed() < AT_ONCE_MPI, "a rank runs on: {finished:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_all_or_nothing(&workspace, &["case.toml"], &finished);
    }
}

/// A rank that is stopped keeps the others waiting, in calls of MPI.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_rank_that_keeps_the_others_waiting_is_named() {
    let mut random = Random(4);
    for round in 0..6 {
        let workspace = Workspace::new();
        workspace.write("case.toml", LONG_ON_RANKS);
        let ranks = 2 + round % 3;
        let limit = ["--stall-limit", "2", "--quiet"];
        let mut job = start(workspace.mpirun(ranks, &[&OUTPUT[..], &limit].concat()));
        wait_for_claim(&mut job, &workspace);
        std::thread::sleep(Duration::from_micros(200_000 + random.below(1_000_000)));
        let processes = children(job.id());
        let stopped = random.below(processes.len() as u64) as usize;
        signal("STOP", processes[stopped]);
        let finished = job.finish();
        signal("CONT", processes[stopped]);
        let what = format!("round {round}, {ranks} ranks, rank {stopped} stopped: {finished:?}");
        assert_eq!(finished.code, Some(75), "{what}");
        let named = format!("rank {stopped} does not answer");
        assert!(finished.stderr.contains(&named) && finished.stderr.contains("phase "), "{what}");
        while processes.iter().any(|&id| is_alive(id)) {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_all_or_nothing(&workspace, &["case.toml"], &finished);
    }
}

/// The limit changes neither the mesh nor the counters.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_job_within_its_limit_is_as_without_one() {
    let workspace = Workspace::new();
    workspace.write("case.toml", SHORT);
    let report = |options: &[&str]| {
        let args = ["case.toml", "--quiet", "--json", "run.json"];
        run(workspace.mpirun(3, &[&args[..], options].concat())).succeeds();
        let report = workspace.json("run.json");
        (report["digest"].clone(), report["counters"].clone())
    };
    assert_eq!(report(&["--stall-limit", "60"]), report(&[]));
}

#[test]
fn a_time_limit_ends_a_run() {
    let workspace = Workspace::new();
    workspace.write("case.toml", LONG);
    let mut command = Command::new("timeout");
    command.args(["--preserve-status", "0.8", crate::process::MESHER]).args(OUTPUT);
    let finished = run(workspace.enter(command));
    finished.refuses(130, &["interrupted"]);
    assert_all_or_nothing(&workspace, &["case.toml"], &finished);
}
