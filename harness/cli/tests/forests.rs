//! Forests that p4est 2.2 wrote, as commands audit and compare them, and forests by `harness export`, loaded and saved again by p4est.

use contract::leafset;
use contract::testing::{leaf_set, words_with_sides};
use contract::word::Side;
use std::fs;
use std::path::Path;
use std::process::Command;

fn sample(name: &str) -> String {
    format!("{}/../contract/tests/samples/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Exit code and what was printed.
fn result(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_harness")).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout) + &text(output.stderr))
}

/// p4est's issue 238: two cubes that share an edge.
#[test]
fn the_balance_across_a_tree_edge_is_a_finding_and_that_of_faces_holds() {
    let [edge, repaired] = ["edge.p8est", "edge-repaired.p8est"].map(sample);
    let (code, printed) = result(&["audit", &edge]);
    let finding = "tree 0, quadrant 9 (level 3 at 458752, 458752, 0) touches in an edge tree 1, quadrant 0 (level 0 at 0, 0, 0)";
    assert!(
        code == 1 && printed.contains(finding) && printed.contains("3 findings, 23"),
        "{printed}"
    );
    assert_eq!(result(&["audit", &edge, "--balance", "edges"]).0, 1);
    assert_eq!(result(&["audit", &edge, "--balance", "faces"]).0, 0);
    assert_eq!(result(&["audit", &repaired]).0, 0);
    let (code, printed) = result(&["diff", &edge, &repaired]);
    let finding = "A has tree 1, quadrant 0 (level 0 at 0, 0, 0), B has tree 1, quadrant 0 (level 2 at 0, 0, 0)";
    assert!(code == 1 && printed.contains(finding), "{printed}");
    assert_eq!(result(&["diff", &edge, &edge]).0, 0);
}

/// p4est's issue 112: three squares around a corner that no list has.
#[test]
fn a_corner_that_no_list_has_is_remarked() {
    let squares = sample("unlisted.p4est");
    let (code, printed) = result(&["audit", &squares, "--balance", "faces"]);
    assert!(code == 1 && printed.contains("touches in a face"), "{printed}");
    assert!(
        printed.contains("2 tree corners whose trees are no neighbours otherwise are in no list"),
        "{printed}"
    );
    let (code, printed) = result(&["audit", &squares, "--balance", "edges"]);
    assert!(code == 2 && printed.contains("choose --balance faces or corners"), "{printed}");
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("mesh");
    let (code, printed) = result(&["import", &squares, "--out", out.to_str().unwrap()]);
    assert!(
        code == 2 && printed.contains("two dimensions") && printed.lines().count() == 1,
        "{printed}"
    );
}

#[test]
fn a_connectivity_alone_is_audited() {
    let (code, printed) = result(&["audit", &sample("edge-connectivity.p8est")]);
    assert!(
        code == 0 && printed.contains("connectivity holds") && printed.contains("without leaves"),
        "{printed}"
    );
}

#[test]
fn a_file_that_ends_anywhere_is_refused_in_a_sentence() {
    let place = tempfile::tempdir().unwrap();
    for name in ["edge.p8est", "unlisted.p4est"] {
        let bytes = fs::read(sample(name)).unwrap();
        for end in (8..bytes.len()).step_by(23) {
            let path = place.path().join(format!("{end}{name}"));
            fs::write(&path, &bytes[..end]).unwrap();
            let (code, printed) = result(&["audit", path.to_str().unwrap()]);
            let is_refused = code == 2 && printed.lines().count() == 1;
            assert!(is_refused || printed.contains("without leaves"), "{end}: {printed}");
        }
    }
}

/// One tree without neighbours remains one mesh in its root, unless its balance alone is asked for.
#[test]
fn one_cube_is_a_mesh_or_a_forest() {
    let cube = sample("unitcube.p8est");
    assert!(result(&["audit", &cube]).1.contains("distinct octants"));
    let (code, printed) = result(&["audit", &cube, "--balance", "corners"]);
    assert!(code == 0 && printed.contains("connectivity holds"), "{printed}");
    let (code, printed) = result(&["audit", &cube, "--balance", "faces", "--root", "0,0,0,1"]);
    assert!(code == 0 && printed.contains("distinct octants"), "{printed}");
}

/// Runs `harness` and returns its standard output.
fn harness(arguments: &[&Path]) -> String {
    let run = Command::new(env!("CARGO_BIN_EXE_harness")).args(arguments).output().unwrap();
    assert!(run.status.success(), "{run:?}");
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn p4est_loads_a_forest_and_saves_the_same_file() {
    // The directory of all builds is two levels above the program.
    let target = Path::new(env!("CARGO_BIN_EXE_harness")).ancestors().nth(2).unwrap();
    let program = target.join("engines/p4est-load");
    if !program.is_file() {
        eprintln!("left out: {} is missing (ci/setup compiles it)", program.display());
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [mesh, forest, saved, back] =
        ["mesh", "mesh.p8est", "saved.p8est", "back"].map(|name| place.path().join(name));
    // A body in the middle: its inside is deleted, and one side has crossing leaves.
    let middle = |c: u32| (c >> 16).abs_diff(4) < 2;
    let words = words_with_sides(
        |o| o.level < 2 || o.level < 6 && o.corner.iter().all(|&c| middle(c)),
        |o| match o.corner.map(|c| c >> 15) {
            [x, y, z] if [x, y, z].iter().all(|c| (8..10).contains(c)) => None,
            [10, _, _] => Some(Side::Crossing),
            _ => Some(Side::Outside),
        },
    );
    leaf_set(vec![words.clone()]).create(&mesh).unwrap();
    harness(&[Path::new("export"), &mesh, &forest]);
    let loaded = Command::new(&program)
        .args([&forest, &saved])
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .output()
        .unwrap();
    assert!(loaded.status.success(), "{loaded:?}");
    let printed = String::from_utf8(loaded.stdout).unwrap();
    let numbers: Vec<usize> = printed.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert_eq!(numbers[0] - numbers[1], words.len(), "{printed}");
    assert!(numbers[1] > 0, "{printed}");
    assert_eq!(fs::read(&forest).unwrap(), fs::read(&saved).unwrap());
    let options = ["import", "--sides", "data", "--out"].map(Path::new);
    harness(&[options[0], &saved, options[1], options[2], options[3], &back]);
    let (first, second) = (leafset::read(&mesh).unwrap(), leafset::read(&back).unwrap());
    assert_eq!(first.manifest.digest, second.manifest.digest);
    assert_eq!(second.words, words);
}
