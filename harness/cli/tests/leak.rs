//! `harness leak` against a scripted mesher, whose base trees are those of a box with a square hole of width 2 in its lid.

use contract::case::Case;
use contract::testing::{base_tree, leaf_set};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Copies the base tree of the spacing in the case file.
const MESHER: &str = r#"#!/bin/sh
spacing=$(sed -n 's/^spacing_min = //p' "$1")
from="$(dirname "$0")/$spacing"
while [ $# -gt 0 ]; do
    case "$1" in
    --out) cp -r "$from" "$2" ;;
    --json) echo '{"cells": 1, "digest": "", "ranks": 1, "time_wall_s": 0.005, "peak_rss_bytes": [9000000]}' > "$2" ;;
    esac
    shift
done
"#;

const ROOT: &str = "[root]\norigin = [-8.1, -8.2, -8.3]\nedge = 16.0\n";
const SPACINGS: [&str; 6] = ["16.0", "8.0", "4.0", "2.0", "1.0", "0.5"];

const CORNERS: [[f64; 2]; 4] = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];

struct Fixture(TempDir);

impl Fixture {
    /// A box from -2 to 2 with a hole in the wall at the highest z, and its base trees.
    fn new() -> Self {
        Self::in_root(ROOT)
    }

    fn in_root(root: &str) -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fs::create_dir(fixture.path("tmp")).unwrap();
        let text = format!("geometry = \"box.stl\"\nspacing_min = 0.5\n{root}");
        fs::write(fixture.path("case.toml"), text).unwrap();
        let mut quads = Vec::new();
        for (axis, side) in [(0, -2.0), (0, 2.0), (1, -2.0), (1, 2.0), (2, -2.0)] {
            quads.push(CORNERS.map(|[u, v]| {
                let mut at = [side; 3];
                (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (u, v);
                at
            }));
        }
        for i in 0..4 {
            let lid = |i: usize, scale: f64| {
                let [x, y] = CORNERS[i % 4];
                [x * scale, y * scale, 2.0]
            };
            quads.push([lid(i, 1.0), lid(i + 1, 1.0), lid(i + 1, 0.5), lid(i, 0.5)]);
        }
        let mut stl = "solid box\n".to_owned();
        for [a, b, c, d] in quads {
            for facet in [[a, b, c], [a, c, d]] {
                let vertices = facet.map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
                stl += &format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n");
            }
        }
        fs::write(fixture.path("box.stl"), stl + "endsolid box\n").unwrap();
        let case = Case::read(&fixture.path("case.toml")).unwrap();
        for (level, spacing) in (0..).zip(SPACINGS) {
            let tree = fixture.path(spacing);
            fs::create_dir(&tree).unwrap();
            leaf_set(vec![base_tree(&case.facets_lattice, |_| level)]).write(&tree).unwrap();
        }
        let mesher = fixture.path("mesher");
        fs::write(&mesher, MESHER).unwrap();
        fs::set_permissions(&mesher, fs::Permissions::from_mode(0o755)).unwrap();
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Exit code, and standard output and error, of `harness leak case.toml`.
    fn leak(&self, arguments: &[&str]) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(["leak", "case.toml", "--mesher", "mesher"]).args(arguments);
        let output =
            command.current_dir(self.0.path()).env("TMPDIR", self.path("tmp")).output().unwrap();
        let text =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        assert_eq!(fs::read_dir(self.path("tmp")).unwrap().count(), 0, "temporary files remain");
        (output.status.code().unwrap(), text)
    }
}

#[test]
fn a_leak_is_described_in_text_and_json() {
    let fixture = Fixture::new();
    let (code, text) = fixture.leak(&["--from", "0,0,0", "--json", "leak.json"]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("LEAK") && text.contains("to        the far field"), "{text}");
    let json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(fixture.path("leak.json")).unwrap()).unwrap();
    let answer = &json["examined"][0];
    assert_eq!(
        (json["schema"].as_str(), answer["is_leak"].as_bool()),
        (Some("octree-leak/5"), Some(true))
    );
    let width = answer["passage"]["narrowest"]["width"].as_f64().unwrap();
    assert!((width / 2.0 - 1.0).abs() < 0.05, "{width}");
    let closes = answer["closes"]["spacing"].as_f64().unwrap();
    assert!((2.0 / 3.47..=4.0).contains(&closes), "{closes}");
    // A report that cannot be written hides no leak.
    let (code, text) = fixture.leak(&["--from", "0,0,0", "--json", "/dev/full"]);
    let why = "a report could not be written: /dev/full";
    assert!(code == 1 && text.contains("LEAK") && text.contains(why), "{code}: {text}");
}

#[test]
fn invalid_input_is_refused_in_one_sentence() {
    let fixture = Fixture::new();
    let refused = |arguments: &[&str], why: &str| {
        let (code, text) = fixture.leak(arguments);
        assert!(code == 2 && text.contains(why), "{code}: {text}");
    };
    refused(&[], "give a start with --from X,Y,Z");
    refused(&["--to", "0,0,0"], "the case has no seeds: give a start with --from X,Y,Z");
    refused(&["--from", "0,0"], "give finite numbers: X,Y,Z");
    refused(&["--from", "0,0,-2"], "the nearest centre of a free leaf is");
    refused(&["--from", "0,0,90"], "outside the root");
    refused(&["--from", "0,0,0", "--to", "0,-2,0"], "--to");
}

#[test]
fn a_missing_mesher_has_its_own_exit_code() {
    let fixture = Fixture::new();
    fs::remove_file(fixture.path("mesher")).unwrap();
    let (code, text) = fixture.leak(&["--from", "0,0,0"]);
    assert!(code == 3 && text.contains("mesher"), "{code}: {text}");
}

#[test]
fn a_spacing_that_closes_an_opening_suffices() {
    let fixture = Fixture::new();
    let text = format!("geometry = \"box.stl\"\nspacing_min = 2.0\n{ROOT}");
    fs::write(fixture.path("case.toml"), text).unwrap();
    let (code, text) = fixture.leak(&["--from", "0,0,0"]);
    assert!(code == 0 && text.contains("no leak at this spacing"), "{code}: {text}");
}

#[test]
fn without_a_start_the_regions_that_leaked_are_examined() {
    let fixture = Fixture::new();
    let manifest = fixture.path("0.5/mesh.json");
    let own = fs::read_to_string(&manifest).unwrap();
    let with =
        |key: &str| fs::write(&manifest, own.replacen('{', &format!("{{{key},"), 1)).unwrap();
    let leak =
        r#"{"spacing_coarse": 2.0, "spacing_fine": 0.5, "volume": 8.0, "point": [0.5, 0.5, 0.5]}"#;
    with(&format!(r#""leaks": [{leak}, {leak}]"#));
    let (code, text) = fixture.leak(&["--json", "leak.json"]);
    assert!(code == 1 && text.matches("LEAK: ").count() == 2, "{code}: {text}");
    assert!(text.contains("from      (0.5, 0.5, 0.5)"), "{text}");
    assert!(fixture.path("leak.json").exists());
    // One that is closed at four times the spacing, too, is examined once; what is closed only there is another one.
    let coarser = |at: &str| leak.replace("2.0", "4.0").replace("[0.5, 0.5, 0.5]", at);
    let (part, other) = (coarser("[1.0, 1.0, 1.0]"), coarser("[5.0, 5.0, 5.0]"));
    with(&format!(r#""leaks": [{leak}, {part}, {other}]"#));
    let (code, text) = fixture.leak(&[]);
    assert!(code == 1 && text.matches("from  ").count() == 2, "{code}: {text}");
    assert!(text.contains("(0.5, 0.5, 0.5)") && text.contains("(5, 5, 5)"), "{text}");
    // The scripted mesher gives no leaf an inside: nothing was closed, so nothing was examined.
    with(r#""leaks": []"#);
    let (code, text) = fixture.leak(&[]);
    assert!(
        code == 2 && text.contains("as where an opening is wider than four cells"),
        "{code}: {text}"
    );
}

/// The root cuts the box, which is closed at this spacing. The scripted mesher gives no leaf an inside, and a space that is cut is no reason to
/// conceal it.
#[test]
fn without_a_start_a_space_that_the_root_cuts_is_examined() {
    let root = &ROOT.replace("-8.1", "-1.4");
    let fixture = Fixture::in_root(root);
    let text = format!("geometry = \"box.stl\"\nspacing_min = 2.0\n{root}");
    fs::write(fixture.path("case.toml"), &text).unwrap();
    let manifest = fixture.path("2.0/mesh.json");
    let own = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, own.replacen('{', r#"{"leaks": [],"#, 1)).unwrap();
    let (code, printed) = fixture.leak(&["--json", "leak.json"]);
    assert!(code == 2 && printed.matches("meshed as flow").count() == 1, "{code}: {printed}");
    assert!(printed.contains("no leaf is inside by its rays"), "{printed}");
    let json = fs::read_to_string(fixture.path("leak.json")).unwrap();
    assert!(json.contains(r#""is_cut": true"#), "{json}");
    // Seeds decide what is flow, and nothing else is kept.
    fs::write(fixture.path("case.toml"), format!("seeds = [[5.0, 5.0, 5.0]]\n{text}")).unwrap();
    let (code, printed) = fixture.leak(&[]);
    assert!(code != 1 && !printed.contains("meshed as flow"), "{code}: {printed}");
}

/// The box is closed at both coarser spacings, with and without a seed in it.
#[test]
fn an_audit_with_the_case_finds_leaks_that_the_manifest_conceals() {
    let reference = Path::new(env!("CARGO_BIN_EXE_harness")).with_file_name("reference");
    if !reference.is_file() {
        eprintln!("skipped: the reference was not built");
        return;
    }
    let fixture = Fixture::new();
    for seeds in ["", "keep = \"outside\"\nseeds = [[5.0, 5.0, 5.0]]\n"] {
        let text = format!("geometry = \"box.stl\"\nspacing_min = 1.0\n{seeds}{ROOT}");
        fs::write(fixture.path("case.toml"), text).unwrap();
        let _ = fs::remove_dir_all(fixture.path("mesh"));
        let mut command = Command::new(&reference);
        command.args(["case.toml", "--out", "mesh"]).current_dir(fixture.0.path());
        assert!(command.output().unwrap().status.success());
        let audit = || {
            let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
            command.args(["audit", "mesh", "--case", "case.toml"]);
            let output = command.current_dir(fixture.0.path()).output().unwrap();
            (output.status.code(), String::from_utf8(output.stdout).unwrap())
        };
        let (code, text) = audit();
        assert_eq!(code, Some(0), "{text}");
        let path = fixture.path("mesh/mesh.json");
        let stated = fs::read_to_string(&path).unwrap();
        let mut manifest: serde_json::Value = serde_json::from_str(&stated).unwrap();
        let leaks = manifest["leaks"].as_array_mut().unwrap();
        assert!(!leaks.is_empty());
        leaks.pop();
        fs::write(&path, manifest.to_string()).unwrap();
        let (code, text) = audit();
        assert!(code == Some(1) && text.contains("leaks: ["), "{text}");
    }
}

/// What the mesher advises finds the opening of the box with a hole in its lid, for every kind of seed, and if the root cuts the box.
#[test]
fn the_command_of_a_warning_finds_the_opening() {
    let mesher = Path::new(env!("CARGO_BIN_EXE_harness")).with_file_name("mesher");
    if !mesher.is_file() {
        eprintln!("skipped: the mesher was not built");
        return;
    }
    let fixture = Fixture::new();
    let (in_box, far) = ("[0.1, 0.1, 0.1]", "[5.0, 5.0, 5.0]");
    let cut = &ROOT.replace("-8.1", "-1.4");
    for (keep, seeds, root) in [
        ("inside", in_box, ROOT),
        ("outside", in_box, ROOT),
        ("outside", far, ROOT),
        ("all", far, ROOT),
        ("outside", "", cut),
        ("inside", "", cut),
    ] {
        let text = format!(
            "geometry = \"box.stl\"\nspacing_min = 0.5\nkeep = \"{keep}\"\nseeds = [{seeds}]\n{root}"
        );
        fs::write(fixture.path("case.toml"), text).unwrap();
        let mut command = Command::new(&mesher);
        let output = command.arg("case.toml").current_dir(fixture.0.path()).output().unwrap();
        let warnings = String::from_utf8(output.stderr).unwrap();
        let advice = warnings.split('`').find(|part| part.starts_with("harness leak "));
        let advice = advice.unwrap_or_else(|| panic!("{keep}, {seeds}: {warnings}"));
        let arguments: Vec<&str> = advice.split(' ').skip(3).collect();
        for arguments in [&arguments[..], &[]] {
            let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
            command.args(["leak", "case.toml", "--mesher"]).arg(&mesher).args(arguments);
            command.args(["--json", "leak.json"]);
            let output = command.current_dir(fixture.0.path()).output().unwrap();
            let text = String::from_utf8_lossy(&output.stdout);
            let is_found = output.status.code() == Some(1) && text.matches("LEAK: ").count() == 1;
            assert!(is_found, "{keep}, {seeds}, {arguments:?}: {output:?}");
            let json = fs::read_to_string(fixture.path("leak.json")).unwrap();
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            let at = json["examined"][0]["passage"]["narrowest"]["at"][2].as_f64().unwrap();
            assert!((at - 2.0).abs() < 0.2, "{keep}, {seeds}, {arguments:?}: {text}");
        }
    }
}
