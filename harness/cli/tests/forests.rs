//! Forests that p4est 2.2 wrote, as commands audit and compare them.

use std::fs;
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
