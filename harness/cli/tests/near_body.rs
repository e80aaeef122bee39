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
    let files = ["-o", "a.stl", "-o", "a.vtp", "--json", "a.json"];
    let (code, output, error) = near_body(place.path(), &[&["mesh"], &files[..]].concat());
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.contains("24 faces of area 24.0, closed"), "{output}");
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
    // The same mesh as a tree, whose ranks nobody knows.
    fs::create_dir(place.path().join("tree")).unwrap();
    let export = |file: &str, options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(["export", if file.starts_with("tree/") { "mesh" } else { "tree" }, file]);
        let output = command.args(options).current_dir(place.path()).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    assert_eq!(export("tree/mesh.vtkhdf", &[]).0, 0);
    let mut manifest = contract::leafset::read_manifest(&place.path().join("mesh")).unwrap();
    (manifest.parts, manifest.hyper_tree_grid) = (Vec::new(), Some("mesh.vtkhdf".to_owned()));
    manifest.write(&place.path().join("tree")).unwrap();
    let (code, of_tree, error) = near_body(place.path(), &["tree", "--case", "case.toml"]);
    assert_eq!((code, error.as_str()), (0, ""));
    let ranks = of_tree.lines().last().unwrap();
    assert_eq!(ranks, "the ranks of the cells are unknown");
    assert!(output.starts_with(of_tree.strip_suffix(&format!("{ranks}\n")).unwrap()), "{of_tree}");
    for (file, options) in
        [("a.vtu", ["--rank", "0"]), ("case/constant/polyMesh", ["--processors", "ranks"])]
    {
        let (code, error) = export(file, &options);
        assert!(code == 2 && error.contains("the ranks of this mesh are unknown"), "{error}");
    }
    assert_eq!(export("a.vtu", &[]).0, 0);
    let vtu = fs::read(place.path().join("a.vtu")).unwrap();
    let header = String::from_utf8_lossy(&vtu[..4096]);
    assert!(header.contains("\"side\"") && !header.contains("\"rank\""), "{header}");
    let refused = |arguments: &[&str], why: &str| {
        let (code, output, error) = near_body(place.path(), arguments);
        assert_eq!((code, output.as_str(), error.lines().count()), (2, "", 1), "{error}");
        assert!(error.contains(why), "{error}");
    };
    refused(&["mesh", "--side", "inside"], "no selected cell borders a crossing cell");
    refused(&["absent"], "mesh.json");
    refused(&["mesh", "-o", "absent/a.stl"], "absent/a.stl");
    refused(&["mesh", "--case", "absent.toml"], "absent.toml");
    let other = fs::read_to_string(place.path().join("case.toml")).unwrap().replace("8.0", "4.0");
    fs::write(place.path().join("other.toml"), other).unwrap();
    let roots = "a root of edge 8 at (0, 0, 0) and surface level 0, the case a root of edge 4 at";
    refused(&["mesh", "--case", "other.toml"], roots);
    // The geometry was replaced after the mesh was made.
    let manifest = place.path().join("mesh/mesh.json");
    let stated = fs::read_to_string(&manifest).unwrap();
    let geometry = format!(r#"{{"geometry": {{"facets": 7, "digest": "{}"}},"#, "0".repeat(32));
    fs::write(&manifest, stated.replacen('{', &geometry, 1)).unwrap();
    refused(&["mesh", "--case", "case.toml"], "7 facets of the digest 000");
    fs::write(&manifest, stated.replacen("\"digest\":\"", "\"digest\":\"0", 1)).unwrap();
    refused(&["mesh"], "a digest is 32 lower-case hex digits");
    let digest = stated.split("\"digest\":\"").nth(1).unwrap()[..32].to_owned();
    fs::write(&manifest, stated.replace(&digest, &"1".repeat(32))).unwrap();
    refused(&["mesh"], "and its manifest states 1111");
}
