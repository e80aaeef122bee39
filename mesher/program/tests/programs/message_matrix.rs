//! `--message-matrix`: included on request only, and equal for simulated and real ranks; and the time of a message.

use crate::process::{Workspace, run};
use serde_json::Value;

const CASE: &str = "spacing_min = 0.05\nroot_scale = 2.0\n
[generator]\nshape = \"torus\"\nfacets = 640\n";

fn matrix(report: &Value) -> Vec<[u64; 4]> {
    serde_json::from_value(report["message_matrix"].clone()).expect("entries of four numbers")
}

#[test]
fn the_matrix_is_included_on_request_and_does_not_exceed_the_traffic() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--comm", "sim:4", "--json", "run.json"];
    run(workspace.mesher(&args)).succeeds();
    let without = workspace.json("run.json");
    assert_eq!(without.get("message_matrix"), None);
    run(workspace.mesher(&[&args[..], &["--message-matrix"]].concat())).succeeds();
    let with = workspace.json("run.json");
    assert_eq!(with["counters"], without["counters"], "gathering the matrix must not be counted");
    let entries = matrix(&with);
    assert!(
        entries.windows(2).all(|w| w[0][..2] < w[1][..2]),
        "entries must be sorted by sender and receiver"
    );
    assert!(entries.iter().all(|e| e[0] != e[1] && e[0] < 4 && e[1] < 4 && e[3] >= 8 * e[2]));
    for (rank, bytes) in with["counters"]["message_bytes"].as_array().unwrap().iter().enumerate() {
        let row: u64 = entries.iter().filter(|e| e[0] == rank as u64).map(|e| e[3]).sum();
        assert!(0 < row && row < bytes.as_u64().unwrap(), "rank {rank}: {row} of {bytes}");
    }
}

#[test]
fn a_single_rank_has_an_empty_matrix_and_the_option_needs_a_report() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--comm", "solo", "--message-matrix"];
    run(workspace.mesher(&args)).refuses(2, &["--json"]);
    run(workspace.mesher(&[&args[..], &["--json", "run.json"]].concat())).succeeds();
    assert!(matrix(&workspace.json("run.json")).is_empty());
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn real_ranks_send_the_same_messages_as_simulated_ones() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let args = ["case.toml", "--quiet", "--message-matrix", "--json"];
    run(workspace.mesher(&[&args[..], &["sim.json", "--comm", "sim:3"]].concat())).succeeds();
    run(workspace.mpirun(3, &[&args[..], &["mpi.json"]].concat())).succeeds();
    assert_eq!(matrix(&workspace.json("mpi.json")), matrix(&workspace.json("sim.json")));
    // With a limit, other functions of MPI are called, with the same messages.
    let limited = ["limited.json", "--stall-limit", "80"];
    run(workspace.mpirun(3, &[&args[..], &limited].concat())).succeeds();
    let [limited, free] = ["limited.json", "mpi.json"].map(|name| workspace.json(name));
    for same in ["message_matrix", "digest", "counters"] {
        assert_eq!(limited[same], free[same], "{same}");
    }
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn large_messages_take_longer_than_small_ones() {
    let workspace = Workspace::new();
    let pingpong = env!("CARGO_BIN_EXE_pingpong");
    let measured = run(workspace.mpirun_of(2, pingpong, &[]));
    assert_eq!(measured.code, Some(0), "{measured:?}");
    let report: Value = serde_json::from_str(&measured.stdout).expect("JSON");
    assert_eq!(report["schema"], "octree-pingpong/1");
    let points = report["points"].as_array().expect("a list");
    let of = |name: &str| points.iter().filter_map(|p| p[name].as_f64()).collect::<Vec<_>>();
    assert_eq!(of("bytes"), [0.0, 8.0, 1024.0, 65536.0, 1048576.0, 8388608.0]);
    let times = of("time_s");
    // Memory is copied at 1 MB/s at least and 1 TB/s at most.
    assert!((8e-6..8.0).contains(&times[5]) && times[5] > times[1] && times[1] > 0.0, "{times:?}");
    let alone = run(workspace.mpirun_of(1, pingpong, &[]));
    assert_eq!((alone.code, alone.stdout.as_str()), (Some(2), ""), "{alone:?}");
    assert!(alone.stderr.contains("start it on two ranks"), "{alone:?}");
}
