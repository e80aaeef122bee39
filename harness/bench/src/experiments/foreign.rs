//! Tests of measuring an engine that is not ours.

use crate::experiments::entry::{Comm, Run, Setup};
use crate::experiments::execute::Runner;
use contract::octant::Octant;
use contract::word::{self, Leaf, Side};
use run::engine::launcher::Launcher;
use run::engine::programs::{Given, Programs};
use std::path::Path;
use std::time::Duration;

/// The measured run of a shell script.
fn scripted(script: &str, json: &str, comm: Comm) -> Result<Run, String> {
    let place = tempfile::tempdir().unwrap();
    run_in(place.path(), script, json, comm, false)
}

/// The run of a shell script in a directory with the case file `case.toml`; `more` continues the table [run].
fn run_in(
    place: &Path,
    script: &str,
    more: &str,
    comm: Comm,
    warm_up: bool,
) -> Result<Run, String> {
    std::fs::write(place.join("engine.sh"), script).unwrap();
    let words =
        "serial = ['sh', '{program}', '{case}']\nsimulated = ['sh', '{program}', '{case}']\n";
    let text = format!(
        "about = 'x'\nprogram = '{{here}}/engine.sh'\n[run]\n{words}out = ['{{out}}']\n{more}"
    );
    let file = place.join("scripted.toml");
    std::fs::write(&file, text).unwrap();
    let limit = Duration::from_secs(60);
    let file = file.to_str().unwrap();
    let programs = Programs::find_with_engine(file, Given::default()).unwrap();
    let launcher = Launcher::parse("mpirun -n {ranks}").unwrap();
    let runner = Runner { programs: &programs, launcher: &launcher, limit, place };
    let setup = crate::testing::run(comm, 1, &[("a", &[0.0, 0.0])]).setup;
    let ranks = if comm == Comm::Solo { 1 } else { 2 };
    let setup = Setup { engine: programs.engine.label(), ranks, ..setup };
    let case = place.join("case.toml");
    runner.run(&setup, &case, 0, warm_up).map_err(|why| format!("{why:?}"))
}

#[test]
fn a_mesh_that_breaks_a_promise_is_not_measured() {
    let place = tempfile::tempdir().unwrap();
    let case = "spacing_min = 2.0\nkeep = 'all'\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n\
                [generator]\nshape = 'cube'\nfacets = 12\n";
    std::fs::write(place.path().join("case.toml"), case).unwrap();
    // The root without its first octant has a hole.
    let octant = |digit| Leaf { octant: Octant::ROOT.child(digit), side: Side::Outside };
    let words: Vec<u64> = (1..8).map(|digit| word::encode(&octant(digit))).collect();
    contract::npy::write(&place.path().join("leaves.npy"), &words).unwrap();
    let script = "mkdir -p $2 && cp ${0%/*}/leaves.npy $2/leaves-00000.npy";
    let run = |promise: &str, warm_up| {
        let promises = format!("[promises]\n{promise} = true\n");
        run_in(place.path(), script, &promises, Comm::Solo, warm_up).map(|run| run.cells)
    };
    assert!(run("complete", true).unwrap_err().contains("breaks the promise complete"));
    // Only warm-ups are checked, and nothing but promises.
    assert_eq!((run("complete", false), run("deterministic", true)), (Ok(7), Ok(7)));
}

const REPORTS: &str = "json = ['{json}']\n";

#[test]
fn time_and_memory_are_measured_from_outside_if_they_are_not_reported() {
    let script = "sleep 0.05; echo '{\"cells\": 8, \"digest\": \"ab\"}' > $2";
    let run = scripted(script, REPORTS, Comm::Solo).unwrap();
    assert_eq!((run.setup.engine.as_str(), run.cells, run.digest.as_str()), ("scripted", 8, "ab"));
    assert!(run.time_wall_s >= 0.05 && run.time_wall_s == run.time_launch_s);
    assert!(run.peak_rss_bytes.sum > 1e5 && run.useful_s.sum > 0.0);
    assert!(run.command.starts_with("sh engine.sh case.toml"), "{}", run.command);
}

#[test]
fn reported_time_and_memory_take_precedence() {
    let report = r#"{"ranks": 2, "cells": 8, "digest": "ab", "time_wall_s": 7.5, "peak_rss_bytes": [3, 4],
        "phases": [{"name": "all", "time_cpu_s": [2.0, 1.0]}]}"#;
    let run = scripted(&format!("echo '{report}' > $2"), REPORTS, Comm::Sim).unwrap();
    assert_eq!((run.time_wall_s, run.peak_rss_bytes.sum), (7.5, 7.0));
    assert_eq!((run.useful_s.by_rank, run.phases[0].useful_s.max), (vec![2.0, 1.0], 2.0));
}

#[test]
fn a_report_of_rank_0_alone_is_none_of_the_efficiency_and_needs_no_digest() {
    let report =
        r#"{"cells": 8, "time_wall_s": 7.5, "phases": [{"name": "all", "time_cpu_s": [2.0]}]}"#;
    let run = scripted(&format!("echo '{report}' > $2"), REPORTS, Comm::Sim).unwrap();
    assert_eq!((run.useful_s.by_rank, run.digest.as_str()), (vec![7.5, 7.5], ""));
}

#[test]
fn a_run_without_the_required_output_is_a_failure() {
    let script = "echo '{\"ranks\": 2, \"cells\": 8, \"digest\": \"ab\"}' > $2";
    assert!(scripted(script, REPORTS, Comm::Sim).unwrap_err().contains("no phases"));
    assert!(scripted("mkdir $2", "", Comm::Solo).unwrap_err().contains("mesh.json"));
    assert!(
        scripted("echo no >&2; exit 3", REPORTS, Comm::Solo).unwrap_err().contains("code 3: no")
    );
}
