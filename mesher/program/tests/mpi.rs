//! Jobs on real MPI ranks: the mesh is the serial one, and an error ends all ranks and is printed once. Without
//! the feature `mpi` these tests are ignored; with it, a missing `mpirun` fails them. A program of its own, which `ci/mpich` builds for
//! another MPI.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Finished, Workspace, run};
use std::process::Command;

const CASE: &str = "spacing_min = 0.05\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"torus\"\nfacets = 640\n
[[box]]\nmin = [0.2, 0.2, 0.2]\nmax = [0.6, 0.5, 0.4]\nspacing = 0.02\n";

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn the_mesh_is_the_serial_one() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    run(workspace.mesher(&["case.toml", "--quiet", "--json", "serial.json"])).succeeds();
    let serial = workspace.json("serial.json");
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
        run(workspace.mpirun(ranks, &[&args[..], &division].concat())).succeeds();
        let report = workspace.json("run.json");
        for same in ["cells", "digest", "leaves_by_level", "leaves_by_side", "components"] {
            assert!(!serial[same].is_null(), "the report must have {same}");
            assert_eq!(report[same], serial[same], "{same} on {ranks} ranks");
        }
        assert_eq!(report["ranks"], ranks);
        assert_eq!(workspace.json("mesh/mesh.json")["parts"].as_array().map(Vec::len), Some(ranks));
        std::fs::remove_dir_all(workspace.path().join("mesh")).expect("the mesh exists");
    }
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn an_error_on_one_rank_ends_all_ranks() {
    let workspace = Workspace::new();
    let nothing = [[[0.0f32; 3]; 3]; 40];
    let mut last_is_bad = nothing;
    last_is_bad[39][1][2] = f32::NAN;
    workspace.write("nan.stl", crate::process::binary_stl(&last_is_bad));
    workspace.write("cut.stl", &crate::process::binary_stl(&nothing)[..1000]);
    workspace.write("typo.toml", "spacing_mim = 0.5\n");
    workspace.write("case.toml", CASE);
    workspace.write("file", "kept");
    let spacing = "--spacing-min=0.5";
    for (args, code, words) in [
        // This facet is in the last rank's slice.
        (&["nan.stl", spacing][..], 2, &["facet 39", "not finite"][..]),
        (&["cut.stl", spacing], 2, &["cut.stl", "promises 40 facets"]),
        (&["absent.stl", spacing], 2, &["absent.stl"]),
        (&["typo.toml"], 2, &["`spacing_min`"]),
        (&["case.toml", "--keep", "everything"], 2, &["--keep"]),
        (&["case.toml", "--out", "file/mesh"], 4, &["file/mesh"]),
        (&["case.toml", "--out", "mesh", "--json", "file/run.json"], 4, &["file/run.json"]),
    ] {
        let before = workspace.contents();
        run(workspace.mpirun(3, args)).refuses_under_launcher(code, words);
        assert!(
            workspace.contents().keys().eq(before.keys()),
            "{args:?}: {:?}",
            workspace.contents().keys()
        );
    }
}

/// Neither an error nor what ran before changes a run, its counters included.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_run_of_a_service_is_a_run_of_its_own() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let lines = [
        r#"["case.toml", "--json", "first.json", "--out", "first"]"#,
        r#"["absent.toml", "--json", "absent.json"]"#,
        r#"["case.toml", "--json", "metis.json", "--partitioner", "metis", "--out", "first"]"#,
        r#"["case.toml", "--stall-limit", "9"]"#,
        "case.toml",
        "",
        r#"["--version"]"#,
        r#"["case.toml", "--comm", "sim:4"]"#,
        // What an earlier run has read.
        r#"["torus.toml", "--json", "case.toml"]"#,
        r#"["torus.toml", "--json", "last.json", "--out", "last"]"#,
    ];
    workspace.write("torus.toml", CASE);
    let mut unreadable = Command::new("sh");
    unreadable.args(["-c", &format!("exec '{}' --serve < .", crate::process::MESHER)]);
    unreadable.current_dir(workspace.path());
    let ended = run(unreadable);
    assert!(
        ended.code == Some(2) && ended.stderr.starts_with("mesher: standard input: "),
        "{ended:?}"
    );
    workspace.write("lines", lines.join("\n"));
    for ranks in [1, 3] {
        let mpirun = workspace.mpirun(ranks, &["--serve"]);
        let words = [mpirun.get_program()].into_iter().chain(mpirun.get_args());
        let words: Vec<&str> = words.map(|word| word.to_str().expect("text")).collect();
        let mut command = Command::new("sh");
        command.args(["-c", &format!("exec {} < lines", words.join(" "))]);
        let served = run(workspace.as_mpi(command));
        assert_eq!(
            (served.code, served.stdout.as_str()),
            (Some(0), "0\n2\n2\n2\n2\n2\n2\n2\n0\n0\n"),
            "{served:?}"
        );
        for (word, count) in
            [("absent.toml", 1), ("first", 1), ("--stall-limit", 3), ("is no JSON", 2)]
        {
            let ours = |line: &&str| line.starts_with("mesher: ") && line.contains(word);
            assert_eq!(served.stderr.lines().filter(ours).count(), count, "{word}: {served:?}");
        }
        workspace.write("case.toml", CASE);
        let args = ["case.toml", "--quiet", "--json", "own.json", "--out", "own"];
        run(workspace.mpirun(ranks, &args)).succeeds();
        let own = workspace.json("own.json");
        for name in ["first", "last"] {
            let report = workspace.json(&format!("{name}.json"));
            for same in ["ranks", "cells", "digest", "counters", "leaves_by_level"] {
                assert!(!own[same].is_null(), "the report must have {same}");
                assert_eq!(report[same], own[same], "{same} of the {name} run on {ranks} ranks");
            }
            let manifest = |name: &str| workspace.json(&format!("{name}/mesh.json"));
            assert_eq!(manifest(name), manifest("own"));
        }
        for name in ["first", "last", "own"] {
            std::fs::remove_dir_all(workspace.path().join(name)).expect("the mesh exists");
        }
    }
}

/// Each rank may write 100 blocks: all of them fail, and one of them prints the error.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_full_disk_ends_all_ranks() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    // The limit applies to the ranks only, because the launcher writes files, too. The shell makes its children
    // ignore the signal, so that the write fails.
    let limited = format!(
        "trap '' XFSZ; ulimit -f 100; exec '{}' case.toml --out mesh --quiet",
        crate::process::MESHER
    );
    let command = workspace.mpirun_of(3, "sh", &["-c", &limited]);
    let before = workspace.contents();
    run(command).refuses_under_launcher(4, &["mesh"]);
    assert!(workspace.contents().keys().eq(before.keys()), "{:?}", workspace.contents().keys());
}

/// A job whose ranks are started with different words after the program's name.
fn different(workspace: &Workspace, words: [&[&str]; 2]) -> Finished {
    let first = [words[0], &[":", "-n", "2", crate::process::MESHER], words[1]].concat();
    run(workspace.mpirun(1, &first))
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn all_ranks_do_what_rank_0_was_asked_for_and_read_one_geometry() {
    let workspace = Workspace::new();
    workspace.write("a.toml", CASE);
    workspace.write("b.toml", CASE.replace("0.05", "0.1"));
    for folder in ["one", "two", "same"] {
        std::fs::create_dir(workspace.path().join(folder)).expect("a directory");
    }
    workspace.write("one/body.stl", crate::process::tetrahedron());
    workspace.write("same/body.stl", crate::process::tetrahedron());
    let mut other = crate::process::tetrahedron();
    // The same length, and another coordinate.
    *other.last_mut().expect("bytes") ^= 1;
    other[100] ^= 1;
    workspace.write("two/body.stl", other);
    for folder in ["one", "two", "same"] {
        let case = "geometry = \"body.stl\"\nspacing_min = 0.1\n";
        workspace.write(&format!("{folder}/body.toml"), case);
        workspace.write(&format!("{folder}/case.toml"), CASE);
    }
    workspace.write("two/case.toml", CASE.replace("0.05", "0.06"));
    let before = workspace.contents();
    let digest = |words: [&[&str]; 2]| {
        let first = [words[0], &["--quiet", "--json", "run.json"]].concat();
        different(&workspace, [&first, words[1]]).succeeds();
        let digest = workspace.json("run.json")["digest"].clone();
        std::fs::remove_file(workspace.path().join("run.json")).expect("a report");
        assert_eq!(workspace.contents(), before, "{words:?}");
        digest
    };
    let same = digest([&["a.toml"], &["a.toml"]]);
    assert_eq!(digest([&["a.toml"], &["b.toml", "--out", "x"]]), same);
    assert_eq!(digest([&["a.toml"], &["a.toml", "--ungraded", "--json", "y"]]), same);
    assert_eq!(digest([&["a.toml"], &["a.toml", "--nonsense"]]), same);
    assert_ne!(digest([&["b.toml"], &["a.toml"]]), same);
    different(&workspace, [&["a.toml", "--nonsense"], &["a.toml"]])
        .refuses_under_launcher(2, &["--nonsense"]);
    // The same words in different directories.
    let elsewhere = |folders: [&str; 2], case: &str| {
        let [one, two] = folders.map(|f| workspace.path().join(f).display().to_string());
        let words =
            ["-n", "1", "-wdir", &one, crate::process::MESHER, case, "--quiet", ":", "-n", "2"];
        let mut command = Command::new("mpirun");
        command.args(words).args(["-wdir", &two, crate::process::MESHER, case, "--quiet"]);
        run(workspace.as_mpi(command))
    };
    elsewhere(["one", "two"], "case.toml").succeeds();
    elsewhere(["one", "two"], "body.toml").refuses_under_launcher(2, &["rank 1", "body.stl"]);
    elsewhere(["one", "same"], "body.toml").succeeds();
    run(workspace.mpirun(2, &["a.toml", "--comm", "solo"])).refuses_any_under_launcher(2, "--comm");
}

#[test]
fn a_box_beyond_all_memory_is_refused_at_once() {
    let workspace = Workspace::new();
    // Level 19 of the whole root: (2^19)^3 cells.
    let case = "spacing_min = 1\n[root]\norigin = [-4, -4, -4]\nedge = 8\n[generator]\nshape = \"sphere\"\nfacets = 80\n
        [[box]]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\nspacing = 1\n
        [[box]]\nmin = [-9, -9, -9]\nmax = [9, 9, 9]\nspacing = 1.6e-5\n";
    workspace.write("case.toml", case);
    for comm in crate::process::COMMS {
        let args = ["case.toml", "--out", "mesh", comm];
        run(workspace.mesher(&args)).refuses(71, &["1.4e17 cells", "multiply all spacings"]);
        assert!(!workspace.path().join("mesh").exists());
    }
}
