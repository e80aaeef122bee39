//! Jobs of real MPI ranks: the same mesh, and errors that end all ranks and are told once.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Place, has_mpi, run, start};
use serde_json::Value;
use std::process::Command;
use std::time::Duration;

const CASE: &str = "spacing_min = 0.05\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"torus\"\nfacets = 640\n
[[box]]\nmin = [0.2, 0.2, 0.2]\nmax = [0.6, 0.5, 0.4]\nspacing = 0.02\n";

fn json(place: &Place, name: &str) -> Value {
    let text = std::fs::read_to_string(place.path().join(name)).expect("a report was written");
    serde_json::from_str(&text).expect("the report is JSON")
}

#[test]
fn the_mesh_is_the_serial_one() {
    if !has_mpi() {
        return;
    }
    let place = Place::new();
    place.put("case.toml", CASE);
    run(place.mesher(&["case.toml", "--quiet", "--json", "serial.json"])).succeeds();
    let serial = json(&place, "serial.json");
    assert!(serial["cells"].as_u64() > Some(10_000));
    for (ranks, partitioner, level_base) in [
        (1, "metis", "auto"),
        (2, "metis", "3"),
        (3, "morton", "auto"),
        (5, "metis", "auto"),
        (6, "morton", "0"),
    ] {
        let args = ["case.toml", "--quiet", "--json", "run.json", "--out", "mesh"];
        let division = ["--partitioner", partitioner, "--level-base", level_base];
        run(place.mpirun(ranks, &[&args[..], &division].concat())).succeeds();
        let told = json(&place, "run.json");
        for same in ["cells", "digest", "cells_by_level", "cells_by_side", "components"] {
            assert_eq!(told[same], serial[same], "{same} on {ranks} ranks");
        }
        assert_eq!(told["ranks"], ranks);
        assert_eq!(json(&place, "mesh/mesh.json")["parts"].as_array().map(Vec::len), Some(ranks));
        std::fs::remove_dir_all(place.path().join("mesh")).expect("the mesh is there");
    }
}

#[test]
fn one_ranks_error_ends_all() {
    if !has_mpi() {
        return;
    }
    let place = Place::new();
    let nothing = [[[0.0f32; 3]; 3]; 40];
    let mut last_is_bad = nothing;
    last_is_bad[39][1][2] = f32::NAN;
    place.put("nan.stl", process::binary_stl(&last_is_bad));
    place.put("cut.stl", &process::binary_stl(&nothing)[..1000]);
    place.put("typo.toml", "spacing_mim = 0.5\n");
    place.put("case.toml", CASE);
    place.put("file", "kept");
    let spacing = "--spacing-min=0.5";
    for (args, code, words) in [
        // The facet is in the last rank's share.
        (&["nan.stl", spacing][..], 2, &["facet 39", "not finite"][..]),
        (&["cut.stl", spacing], 2, &["cut.stl", "promises 40 facets"]),
        (&["absent.stl", spacing], 2, &["absent.stl"]),
        (&["typo.toml"], 2, &["\"spacing_min\"?"]),
        (&["case.toml", "--keep", "everything"], 2, &["--keep"]),
        (&["case.toml", "--out", "file/mesh"], 4, &["file/mesh"]),
        (&["case.toml", "--out", "mesh", "--json", "file/run.json"], 4, &["file/run.json"]),
    ] {
        let before = place.contents();
        run(place.mpirun(3, args)).refuses_under_launcher(code, words);
        assert!(
            place.contents().keys().eq(before.keys()),
            "{args:?}: {:?}",
            place.contents().keys()
        );
    }
}

/// Each rank may write 100 blocks: all of them fail, and one of them says so.
#[test]
fn a_full_disk_ends_all() {
    if !has_mpi() {
        return;
    }
    let place = Place::new();
    place.put("case.toml", CASE);
    // The limit is set on the ranks alone: the launcher has files of its own. A shell ignores the signal
    // for its children; the write then fails.
    let limited = format!(
        "trap '' XFSZ; ulimit -f 100; exec '{}' case.toml --out mesh --quiet",
        process::MESHER
    );
    let command = place.mpirun_of(3, "sh", &["-c", &limited]);
    let before = place.contents();
    run(command).refuses_under_launcher(4, &["mesh"]);
    assert!(place.contents().keys().eq(before.keys()), "{:?}", place.contents().keys());
}

/// A launcher passes an interrupt on when it gets to it, and kills ranks that do not end within a second
/// or two: so a job may have finished, or have had no time to clean up. But what has its final name is
/// whole, and the manifest comes last.
#[test]
fn an_interrupted_job_leaves_nothing_half_written() {
    if !has_mpi() {
        return;
    }
    let place = Place::new();
    place.put("case.toml", CASE.replace("0.05", "0.002"));
    let mut job = start(place.mpirun(2, &["case.toml", "--out", "mesh", "--json", "run.json"]));
    while !place.path().join("mesh").exists() {
        assert!(!job.is_over(), "the job ended before it wrote");
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Command::new("kill").args(["-s", "INT", &job.id().to_string()]).status();
    assert!(sent.expect("kill is there").success());
    let told = job.finish();
    assert!(told.code != Some(0), "{told:?}");
    let whole = |name: &str| {
        let text = std::fs::read_to_string(place.path().join(name)).ok()?;
        Some(serde_json::from_str::<serde_json::Value>(&text).expect("what is there is whole"))
    };
    let reported = whole("run.json");
    let manifest = whole("mesh/mesh.json");
    assert!(reported.is_none() || manifest.is_some(), "the report comes after the mesh");
    for part in manifest.iter().flat_map(|m| m["parts"].as_array().expect("parts")) {
        let file = place.path().join("mesh").join(part["file"].as_str().expect("a name"));
        let bytes = std::fs::metadata(file).expect("the manifest comes last").len();
        assert!(bytes > 8 * part["leaves"].as_u64().expect("a number"), "{told:?}");
    }
}
