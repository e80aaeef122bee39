//! `harness near-body` as a command.

use contract::testing::{leaf_set, words_with_sides};
use contract::word::Side;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Exit code, standard output and standard error.
fn near_body(place: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let output = command.arg("near-body").args(arguments).current_dir(place).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_surface_is_measured_and_written_or_refused_in_one_sentence() {
    let place = tempfile::tempdir().unwrap();
    // A body of edge 2 in the middle of a root of edge 8.
    let is_body = |c: u32| (3..5).contains(&(c >> 16));
    let words = words_with_sides(
        |o| o.level < 3,
        |o| (!o.corner.iter().all(|&c| is_body(c))).then_some(Side::Outside),
    );
    leaf_set(vec![words]).create(&place.path().join("mesh")).unwrap();
    fs::write(place.path().join("case.toml"), {
        "spacing_min = 8.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n[generator]\nshape = \"sphere\"\nfacets = 20\n"
    })
    .unwrap();
    let files = ["--stl", "a.stl", "--vtp", "a.vtp", "--json", "a.json"];
    let (code, output, error) = near_body(place.path(), &[&["mesh"], &files[..]].concat());
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.contains("24 faces of area 24.000000, closed"), "{output}");
    assert_eq!(fs::metadata(place.path().join("a.stl")).unwrap().len(), 84 + 50 * 48);
    let json = fs::read_to_string(place.path().join("a.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&report["schema"], &report["faces"]),
        (&"octree-near-body/1".into(), &24.into()),
        "{json}"
    );
    let (code, output, _) = near_body(place.path(), &["mesh", "--case", "case.toml"]);
    assert!(code == 0 && output.contains("gap to the wall"), "{output}");
    let refused = |arguments: &[&str], why: &str| {
        let (code, output, error) = near_body(place.path(), arguments);
        assert_eq!((code, output.as_str(), error.lines().count()), (2, "", 1), "{error}");
        assert!(error.contains(why), "{error}");
    };
    refused(&["mesh", "--side", "inside"], "no selected cell borders a crossing cell");
    refused(&["absent"], "mesh.json");
    refused(&["mesh", "--stl", "absent/a.stl"], "absent/a.stl");
    refused(&["mesh", "--case", "absent.toml"], "absent.toml");
}
