//! `--message-matrix`: there when asked for, and what simulated and real ranks alike have sent.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Place, has_mpi, run};
use serde_json::Value;

const CASE: &str = "spacing_min = 0.05\nroot_scale = 2.0\n
[generator]\nshape = \"torus\"\nfacets = 640\n";

fn json(place: &Place, name: &str) -> Value {
    let text = std::fs::read_to_string(place.path().join(name)).expect("a report was written");
    serde_json::from_str(&text).expect("the report is JSON")
}

fn matrix(told: &Value) -> Vec<[u64; 4]> {
    serde_json::from_value(told["message_matrix"].clone()).expect("entries of four numbers")
}

#[test]
fn it_is_there_when_asked_for_and_part_of_all_that_was_sent() {
    let place = Place::new();
    place.put("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--comm", "sim:4", "--json", "run.json"];
    run(place.mesher(&args)).succeeds();
    let without = json(&place, "run.json");
    assert_eq!(without.get("message_matrix"), None);
    run(place.mesher(&[&args[..], &["--message-matrix"]].concat())).succeeds();
    let with = json(&place, "run.json");
    assert_eq!(with["counters"], without["counters"], "gathering it is not counted");
    let entries = matrix(&with);
    assert!(entries.windows(2).all(|w| w[0][..2] < w[1][..2]), "by sender and receiver");
    assert!(entries.iter().all(|e| e[0] != e[1] && e[0] < 4 && e[1] < 4 && e[3] >= 8 * e[2]));
    for (rank, bytes) in with["counters"]["message_bytes"].as_array().unwrap().iter().enumerate() {
        let row: u64 = entries.iter().filter(|e| e[0] == rank as u64).map(|e| e[3]).sum();
        assert!(0 < row && row < bytes.as_u64().unwrap(), "rank {rank}: {row} of {bytes}");
    }
}

#[test]
fn a_single_rank_has_an_empty_one_and_no_report_none() {
    let place = Place::new();
    place.put("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--comm", "solo", "--message-matrix"];
    run(place.mesher(&args)).refuses(2, &["--json"]);
    run(place.mesher(&[&args[..], &["--json", "run.json"]].concat())).succeeds();
    assert!(matrix(&json(&place, "run.json")).is_empty());
}

#[test]
fn real_ranks_send_what_simulated_ones_do() {
    if !has_mpi() {
        return;
    }
    let place = Place::new();
    place.put("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--message-matrix", "--json"];
    run(place.mesher(&[&args[..], &["sim.json", "--comm", "sim:3"]].concat())).succeeds();
    run(place.mpirun(3, &[&args[..], &["mpi.json"]].concat())).succeeds();
    assert_eq!(matrix(&json(&place, "mpi.json")), matrix(&json(&place, "sim.json")));
}
