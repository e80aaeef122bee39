//! Interrupted runs end with exit code 130 and leave no files, at whichever point they are, on one rank and on several. A run whose mesh
//! is complete ends as if nothing had happened.
//!
//! No outcome depends on time: a run stops itself at a point (`STOP_AT`), and continues when its signals are pending.

use crate::process::{Finished, MESHER, Workspace, children, run, signal, start, wait_for_end};
use std::process::Command;

/// A mesh with all phases.
const CASE: &str = "spacing_min = 0.02\nroot_scale = 2.0\n
[generator]\nshape = \"sphere\"\nfacets = 1280\n";
const OUTPUT: [&str; 6] = ["case.toml", "--out", "mesh", "--json", "run.json", "--quiet"];
const SIGNALS: [&str; 10] =
    ["INT", "TERM", "HUP", "QUIT", "USR1", "USR2", "ALRM", "VTALRM", "PROF", "XCPU"];
/// Points after the phases: before the manifest, when the mesh is complete, before the report, and at the end.
const LAST: [&str; 4] = ["manifest", "complete", "report", "end"];

fn workspace() -> Workspace {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    workspace
}

/// The mesher with these options, which stops at a point.
fn stopping(workspace: &Workspace, point: &str, options: &[&str]) -> Command {
    let mut command = workspace.mesher(&[&OUTPUT[..], options].concat());
    command.env("STOP_AT", point);
    command
}

/// The names of the phases, in order.
fn phases(comm: &str) -> Vec<String> {
    let workspace = workspace();
    run(workspace.mesher(&[&OUTPUT[..], &["--comm", comm]].concat())).succeeds();
    let report = workspace.json("run.json");
    let phases = report["phases"].as_array().expect("phases");
    phases.iter().map(|phase| phase["name"].as_str().expect("a name").to_owned()).collect()
}

/// Asserts that a run left nothing, or a complete mesh. `before` are files that were there before.
#[track_caller]
fn assert_all_or_nothing(workspace: &Workspace, before: &[&str], finished: &Finished) {
    let left = left(workspace, before);
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

/// The files of a run, except those that were there before.
fn left(workspace: &Workspace, before: &[&str]) -> Vec<String> {
    let contents = workspace.contents();
    let names = contents.keys().map(|p| p.strip_prefix(workspace.path()).expect("a prefix"));
    let names = names.map(|name| name.display().to_string());
    names.filter(|name| !before.contains(&name.as_str())).collect()
}

#[test]
fn a_signal_at_any_point_leaves_no_files_or_a_complete_mesh() {
    let mut next = SIGNALS.iter().cycle();
    for (comm, rank) in [("solo", 0), ("sim:3:2", 2)] {
        let phases = phases(comm);
        assert!(phases.len() > 6, "{phases:?}");
        let points = phases.iter().map(|name| (name.as_str(), rank));
        for (i, (name, rank)) in points.chain(LAST.map(|name| (name, 0))).enumerate() {
            // Every third time a second signal, which ends the run in any case.
            let signals: Vec<&str> =
                next.by_ref().take(1 + usize::from(i % 3 == 0)).copied().collect();
            let workspace = workspace();
            let mut before = vec!["case.toml"];
            if i % 2 == 0 {
                std::fs::create_dir(workspace.path().join("mesh")).expect("a directory");
                before.push("mesh");
            }
            let mut run = start(stopping(&workspace, &format!("{name}:{rank}"), &["--comm", comm]));
            signal(&signals, run.stopped());
            let finished = run.finish();
            let what = format!("{comm} {name} {signals:?} {finished:?}");
            let was_complete = LAST[1..].contains(&name);
            let is_complete = workspace.path().join("mesh/mesh.json").exists();
            // Of several threads another one may take the signals: the mesh, or the whole run, may be complete in the meantime.
            let is_late = comm != "solo" && is_complete;
            assert!(is_late || is_complete == was_complete, "{what}");
            let has_ended = is_late && finished.code == Some(0);
            let goes_on = has_ended || is_complete && signals.len() == 1;
            assert_eq!(finished.code, Some(if goes_on { 0 } else { 130 }), "{what}");
            assert_eq!(finished.stderr.contains("mesher: interrupted"), !goes_on, "{what}");
            assert!(!goes_on || workspace.path().join("run.json").exists(), "{what}");
            assert_all_or_nothing(&workspace, &before, &finished);
        }
    }
}

/// A closed pipe and the limit on file sizes fail where a program writes; sent by another process, these signals change nothing.
#[test]
fn signals_of_writing_do_not_end_a_run() {
    let workspace = workspace();
    // A phase of two parts, of which only the first one stops.
    let mut run = start(stopping(&workspace, "leaks:0", &[]));
    signal(&["PIPE", "XFSZ"], run.stopped());
    run.finish().succeeds();
    assert!(workspace.path().join("run.json").exists());
}

#[test]
fn a_run_that_is_started_to_survive_a_hangup_survives_it() {
    let workspace = workspace();
    let script = format!("trap '' HUP; exec '{MESHER}' {}", OUTPUT.join(" "));
    let mut command = Command::new("sh");
    command.args(["-c", &script]).env("STOP_AT", "sides:0");
    let mut run = start(workspace.enter(command));
    signal(&["HUP"], run.stopped());
    run.finish().succeeds();
    assert!(workspace.path().join("run.json").exists());
}

/// The first signal at the end of a run does not change its outcome, but no other run begins.
#[test]
fn a_service_that_is_interrupted_at_the_end_of_a_run_begins_no_other() {
    let workspace = workspace();
    workspace.write("runs", format!("{OUTPUT:?}\n[\"case.toml\", \"--json\", \"other.json\"]\n"));
    let mut command = Command::new("sh");
    command.args(["-c", &format!("exec '{MESHER}' --serve < runs")]).env("STOP_AT", "end:0");
    let mut service = start(workspace.enter(command));
    signal(&["TERM"], service.stopped());
    let finished = service.finish();
    assert_eq!((finished.code, finished.stdout.as_str()), (Some(130), "0\n"), "{finished:?}");
    assert_eq!(finished.stderr, "mesher: interrupted\n");
    assert!(workspace.path().join("run.json").exists());
    assert!(!workspace.path().join("other.json").exists());
}

/// A job on MPI ranks of which one stops itself, and what is then sent to the launcher or to that rank.
fn job(
    ranks: usize,
    point: &str,
    options: &[&str],
    to_launcher: Option<bool>,
    signals: &[&str],
) -> (Workspace, Finished) {
    let workspace = workspace();
    let mut command = workspace.mpirun(ranks, &[&OUTPUT[..], options].concat());
    command.env("STOP_AT", point);
    let mut job = start(command);
    let stopped = job.stopped();
    let processes = children(job.id());
    if let Some(to_launcher) = to_launcher {
        signal(signals, if to_launcher { job.id() } else { stopped });
        // The launcher lets its ranks continue before it ends them. If it was killed, the kernel ends them when they continue; earlier,
        // they might complete the mesh.
        while to_launcher && !job.is_over() {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        signal(&[], stopped);
    }
    let finished = job.finish();
    wait_for_end(&processes);
    (workspace, finished)
}

/// A job is interrupted once or twice, or killed: its launcher, or one rank.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_job_that_is_interrupted_or_killed_leaves_no_files_and_no_ranks() {
    for (i, phase) in ["read", "refine", "sides", "grade", "leaves", "finish"].iter().enumerate() {
        for (to_launcher, signals) in [
            (true, &["INT", "TERM"][..1 + i % 2]),
            (false, &SIGNALS[i..=i]),
            (i % 2 == 0, &["KILL"]),
        ] {
            let (ranks, rank) = (2 + i % 2, i % 2);
            let point = format!("{phase}:{rank}");
            let (workspace, finished) = job(ranks, &point, &[], Some(to_launcher), signals);
            assert_ne!(finished.code, Some(0), "{point} {signals:?} {finished:?}");
            // A launcher lets a stopped rank continue before it ends it: the mesh may be completed in between.
            let is_complete = workspace.path().join("mesh/mesh.json").exists();
            assert!(to_launcher || !is_complete, "{point} {signals:?}");
            if is_complete {
                assert_all_or_nothing(&workspace, &["case.toml"], &finished);
                continue;
            }
            // The launcher kills ranks that have not ended within a second, and the MPI library ends those of a dead launcher: what is
            // left of them is no mesh without its manifest, and has its final name only if all went on to the commit. The rank that has a
            // signal handled removes its own files and the claim.
            let own = format!("leaves-{rank:05}.npy.draft");
            let is_handled = !to_launcher && signals != ["KILL"];
            for name in left(&workspace, &["case.toml", "mesh"]) {
                let is_own = name.ends_with(&own) || name.ends_with("mesh.json.draft");
                let is_of_leaves = to_launcher && name.starts_with("mesh/leaves-");
                let is_unfinished = name.ends_with(".draft") || is_of_leaves;
                let may_be_left = is_unfinished && !(is_handled && is_own);
                assert!(may_be_left, "{name} of {point} {to_launcher} {signals:?} {finished:?}");
            }
        }
    }
}

/// A rank that stops keeps the others waiting, in calls of MPI, up to its end.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_rank_that_keeps_the_others_waiting_is_named() {
    for (i, name) in
        ["grade", "leaves", "finish", "manifest", "complete", "report", "end"].iter().enumerate()
    {
        let rank = if *name == "manifest" { 0 } else { i % 3 };
        let point = format!("{name}:{rank}");
        let (workspace, finished) = job(3, &point, &["--stall-limit", "3"], None, &[]);
        assert_eq!(finished.code, Some(75), "{point}: {finished:?}");
        match *name {
            "end" => assert!(finished.stderr.contains("has not ended"), "{finished:?}"),
            _ => {
                // A rank that the machine does not run for seconds is named as well.
                let (_, named) = finished.stderr.split_once(", and rank ").expect("a name");
                let (named, _) = named.split_once(" does not answer").expect("a name");
                let is_named = named.split(", ").any(|other| other == rank.to_string());
                assert!(is_named && finished.stderr.contains("in phase "), "{point}: {finished:?}");
            }
        }
        if workspace.path().join("mesh/mesh.json").exists() {
            assert_all_or_nothing(&workspace, &["case.toml"], &finished);
            continue;
        }
        // The rank that ends the job removes the claim and the files of rank 0, and its own; which one it is, the launcher does not always
        // print. The launcher kills others that have not ended within a second, which a busy disk can take to remove a file: what is left
        // of them is no mesh without its manifest.
        let left = left(&workspace, &["case.toml", "mesh"]);
        let of_others = ["mesh/leaves-00001.npy", "mesh/leaves-00002.npy"];
        let is_of_others =
            |name: &String| of_others.contains(&name.strip_suffix(".draft").unwrap_or(name));
        assert!(left.iter().all(is_of_others), "{left:?} of {point}: {finished:?}");
    }
}

/// The limit changes neither the mesh nor the counters.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_job_within_its_limit_is_as_without_one() {
    let workspace = workspace();
    let report = |options: &[&str]| {
        let args = ["case.toml", "--quiet", "--json", "run.json"];
        run(workspace.mpirun(3, &[&args[..], options].concat())).succeeds();
        let report = workspace.json("run.json");
        (report["digest"].clone(), report["counters"].clone())
    };
    assert_eq!(report(&["--stall-limit", "600"]), report(&[]));
}
