//! `harness targets` as a user runs it, on a mesher that a script plays.

use crate::play::Play;
use std::fs;
use std::os::unix::fs::PermissionsExt;

/// 1000 cells in 2 s; fails on three ranks; writes the mesh that is right.
const MESHER: &str = r#"#!/bin/sh
here=$(dirname "$0")
while [ $# -gt 0 ]; do
    case "$1" in
    --out) cp -r "$here/right" "$2" ;;
    --json) json="$2" ;;
    --comm) [ "$2" != sim:3:1 ] || { echo "mesher: no three" >&2; exit 70; } ;;
    esac
    shift
done
[ -z "$json" ] || printf '{"facets": 40, "cells": 1000, "digest": "00", "time_wall_s": 2.0, "peak_rss_bytes": [4096]}' > "$json"
"#;

const TARGETS: &str = r#"
mesh.body.case = "case.toml"
[run]
one = { mesh = "body", comm = "solo", repeats = 2 }
disk = { mesh = "body", comm = "solo", audit = true }
three = { mesh = "body", comm = "sim", ranks = 3 }
two = { mesh = "body", ranks = 2 }
[[row]]
name = "failing"
run = "three"
measure = "lambda_cpu"
[[row]]
name = "rate"
run = "one"
measure = "cells_per_second_per_core"
at_least = 500
[[row]]
name = "audit"
run = "disk"
measure = "audit_holds"
at_least = 1
[[row]]
name = "mpi"
run = "two"
measure = "seconds"
at_most = 9
"#;

fn play() -> Play {
    let play = Play::new();
    play.write("mesher", MESHER);
    fs::set_permissions(play.path("mesher"), fs::Permissions::from_mode(0o755)).unwrap();
    play.write("targets.toml", TARGETS);
    play
}

const TARGETS_COMMAND: &str = "targets targets.toml --mesher ./mesher --network 1e-6,1e10";

#[test]
fn met_targets_are_a_success_and_the_record_says_so_again() {
    let play = play();
    let only = "--only rate,audit --record out/r.jsonl";
    let done = play.harness(&format!("{TARGETS_COMMAND} {only}"));
    assert_eq!(done.code, 0, "{}", done.printed);
    assert!(done.printed.contains("2 met, 0 missed"), "{}", done.printed);
    // The audited mesh went when it had been read.
    let left: Vec<_> =
        fs::read_dir(play.path("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["r.jsonl"]);
    let again = play.harness(&format!("{TARGETS_COMMAND} {only} --show"));
    assert_eq!(again.code, 0, "{}", again.printed);
    assert!(done.printed.contains(again.printed.trim()), "{}", again.printed);
    let record = fs::read_to_string(play.path("out/r.jsonl")).unwrap();
    assert_eq!(record.matches(r#""kind":"target""#).count(), 2);
    assert_eq!(record.matches(r#""verdict":"met""#).count(), 2);
}

#[test]
fn a_missed_target_fails_and_a_failed_run_costs_its_row_only() {
    let play = play();
    let done = play.harness(&format!("{TARGETS_COMMAND} --no-mpi --report out"));
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(
        done.printed
            .contains("FAILED: run three failed: mesher ended with code 70: mesher: no three"),
        "{}",
        done.printed
    );
    assert!(done.printed.contains("2 met, 0 missed, 1 failed, 1 left out"), "{}", done.printed);
    let page = fs::read_to_string(play.path("out/targets.md")).unwrap();
    assert!(
        page.contains("| rate | at least 0.00 M cells/s |") && page.contains("| met |"),
        "{page}"
    );
    play.write("targets.toml", &TARGETS.replace("at_least = 500", "at_least = 501"));
    let done = play.harness(&format!("{TARGETS_COMMAND} --only rate --record r.jsonl"));
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(done.printed.contains("MISSED"), "{}", done.printed);
}

#[test]
fn what_is_missing_and_what_is_wrong_have_codes_of_their_own() {
    let play = play();
    let done = play.harness(&format!(
        "{TARGETS_COMMAND} --only mpi,rate --record r.jsonl --launcher nonesuch/{{ranks}}"
    ));
    assert_eq!(done.code, 3, "{}", done.printed);
    assert!(done.printed.contains("left out: the launcher is missing"), "{}", done.printed);
    let wished =
        play.harness(&format!("{TARGETS_COMMAND} --only mpi,rate --record r.jsonl --no-mpi"));
    assert_eq!(wished.code, 0, "{}", wished.printed);
    assert_eq!(play.harness(&format!("{TARGETS_COMMAND} --only luck")).code, 2);
    play.write("targets.toml", &TARGETS.replace("seconds", "minutes"));
    let done = play.harness(TARGETS_COMMAND);
    assert_eq!(done.code, 2, "{}", done.printed);
    assert!(
        done.printed.contains("targets.toml") && done.printed.contains("unknown variant"),
        "{}",
        done.printed
    );
}
