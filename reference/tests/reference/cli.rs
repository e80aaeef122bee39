//! The program as its users see it: exit codes, messages and files.
use crate::gaps::slotted_box;
use reference::lattice::Input;
use reference::leaves::{Geometry, Tally, hex};
use reference::{Keep, case_file, digest, mesh};
use serde_json::Value;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

const CASE: &str = "spacing_min = 0.125
layer_cells_min = 2
keep = \"all\"
[root]
origin = [-1.0, -1.1, -1.2]
edge = 2.25
[generator]
shape = \"sphere\"
facets = 80
[[box]]
min = [0.0, 0.0, 0.0]
max = [9.0, 0.5, 0.5]
spacing = 0.1
";

fn directory_with_case(text: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("case.toml"), text).unwrap();
    directory
}

fn reference(directory: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reference"));
    command.current_dir(directory).args(arguments).output().unwrap()
}

/// Runs the program, which must fail with `code`, and returns its error message, which must be one
/// line.
fn assert_fails(directory: &Path, arguments: &[&str], code: i32) -> String {
    let output = reference(directory, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(output.stdout.is_empty());
    let is_one_line = message.trim_end().lines().count() == 1;
    assert!(message.starts_with("error: ") && is_one_line, "{message}");
    message
}

fn manifest(directory: &Path) -> Value {
    serde_json::from_reader(File::open(directory.join("mesh.json")).unwrap()).unwrap()
}

fn words(directory: &Path) -> Vec<u64> {
    let bytes = fs::read(directory.join("leaves-00000.npy")).unwrap();
    let from = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let (header, words) = bytes.split_at(from);
    let shape = format!("'shape': ({},)", words.len() / 8);
    let text = str::from_utf8(&header[10..]).unwrap();
    assert!(header.starts_with(b"\x93NUMPY\x01\0"));
    assert!(text.contains("'descr': '<u8'") && text.contains(&shape), "{text}");
    assert_eq!(from % 64, 0, "the words are aligned, so that the file can be mapped to memory");
    words.chunks(8).map(|word| u64::from_le_bytes(word.try_into().unwrap())).collect()
}

#[test]
fn outputs_that_replace_each_other_or_the_case_are_refused() {
    let directory = directory_with_case(CASE);
    let message = assert_fails(directory.path(), &["case.toml", "--out", "case.toml"], 2);
    assert!(message.contains("this run also reads it"), "{message}");
    for json in ["new/mesh", "new/mesh/mesh.json"] {
        let arguments = ["case.toml", "--out", "new/mesh", "--json", json];
        let message = assert_fails(directory.path(), &arguments, 2);
        assert!(message.contains("this run also writes"), "{message}");
        assert!(!directory.path().join("new").exists());
    }
}

#[test]
fn a_run_writes_a_leaf_set_and_a_record() {
    let directory = directory_with_case(CASE);
    let path = directory.path();
    let output = reference(path, &["case.toml", "--out", "new/mesh", "--json", "run.json"]);
    assert_eq!(output.status.code(), Some(0));
    let out = path.join("new/mesh");
    let expected = mesh(&case_file::read(&path.join("case.toml")).unwrap()).unwrap();
    assert_eq!(words(&out), expected.words);
    let mut files: Vec<_> = fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["leaves-00000.npy", "mesh.json"]);

    let digest = hex(digest(&expected.words));
    let run: Value = serde_json::from_reader(File::open(path.join("run.json")).unwrap()).unwrap();
    assert_eq!(
        (&run["schema"], &run["digest"]),
        (&"octree-reference-run/1".into(), &digest.clone().into())
    );
    assert_eq!(run["cells"], expected.words.len());
    assert!(run["time_wall_s"].as_f64().unwrap() > 0.0);
    // The program itself takes some MiB.
    assert!((1 << 20..1 << 30).contains(&run["peak_rss_bytes"][0].as_u64().unwrap()));
    let summary = String::from_utf8(output.stdout).unwrap();
    assert!(summary.contains(&digest), "{summary}");
}

#[test]
fn the_manifest_agrees_with_the_leaves() {
    let directory = directory_with_case(CASE);
    assert!(reference(directory.path(), &["case.toml", "--out", "mesh"]).status.success());
    let out = directory.path().join("mesh");
    let (manifest, words) = (manifest(&out), words(&out));
    let tally = Tally::of(&words);
    let equal = |key: &str, value: Value| assert_eq!(manifest[key], value, "{key}");
    equal("schema", "octree-leaf-set/1".into());
    equal("program", concat!("reference ", env!("CARGO_PKG_VERSION")).into());
    equal("tree", "final".into());
    equal("root", serde_json::json!({"origin": [-1.0, -1.1, -1.2], "edge": 2.25}));
    equal("level_surface", 5.into());
    equal("layer_cells_min", 2.into());
    equal("keep", "all".into());
    equal("keep_crossing", true.into());
    // The distances 1.0, 1.1 and 1.2 of an edge of 2.25, in lattice units; the box is clamped to
    // the root.
    let boxes = serde_json::json!(
        [{"min": [59_652_324, 65_617_556, 71_582_788], "max": [134_217_728, 95_443_718, 101_408_950], "level": 5}]
    );
    equal("boxes", boxes);
    equal("seeds", serde_json::json!([]));
    equal("enclosed", "delete".into());
    let case = case_file::read(&directory.path().join("case.toml")).unwrap();
    let geometry = Geometry::of(&Input::new(&case).unwrap().facets);
    equal("geometry", serde_json::to_value(geometry).unwrap());
    equal("leaves", words.len().into());
    equal("leaves_by_level", tally.leaves_by_level.to_vec().into());
    let [outside, inside, crossing] = tally.leaves_by_side;
    assert!(outside > 0 && inside > 0 && crossing > 0);
    let sides = serde_json::json!({"outside": outside, "inside": inside, "crossing": crossing});
    equal("leaves_by_side", sides);
    let nothing = serde_json::json!({"count": 0, "leaves": 0, "example": null});
    let components = serde_json::json!({"outside": 1, "inside": 1, "enclosed": nothing});
    equal("components", components);
    equal("components_ambiguous", serde_json::json!({"count": 0, "example": null}));
    equal("digest", hex(tally.digest).into());
    let octants: Vec<String> = tally.octant_digests.iter().map(|&d| hex(d)).collect();
    assert_eq!(octants.len(), 512);
    equal("octant_digests", octants.into());
    let part = serde_json::json!(
        {"file": "leaves-00000.npy", "leaves": words.len(), "digest": hex(tally.digest)}
    );
    equal("parts", vec![part].into());
}

#[test]
fn ungraded_writes_the_base_tree() {
    let directory = directory_with_case(&CASE.replace("all", "outside"));
    assert!(
        reference(directory.path(), &["case.toml", "--ungraded", "--out", "base"]).status.success()
    );
    let out = directory.path().join("base");
    let case = case_file::read(&directory.path().join("case.toml")).unwrap();
    assert_eq!(
        (words(&out), case.keep),
        (reference::base_tree(&case).unwrap().words, Keep::Outside)
    );
    let manifest = manifest(&out);
    assert_eq!(manifest["tree"], "base");
    assert!(manifest["leaves_by_side"]["inside"].as_u64().unwrap() > 0, "nothing is deleted yet");
}

/// A leaf set without leaves is valid: here, internal flow without a body.
#[test]
fn a_mesh_may_be_empty() {
    let text = CASE.replace("all", "inside").replace("origin = [-1.0", "origin = [1.0");
    let directory = directory_with_case(&text);
    let output = reference(directory.path(), &["case.toml", "--out", "mesh"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(words(&directory.path().join("mesh")).is_empty());
}

#[test]
fn ambiguous_components_are_reported() {
    let facet = |a: &str, b: &str, c: &str| {
        format!("facet normal 0 0 1 outer loop vertex {a} vertex {b} vertex {c} endloop endfacet\n")
    };
    let sheet = facet("-8 -8 3.5", "16 -8 3.5", "16 16 3.5")
        + &facet("-8 -8 3.5", "16 16 3.5", "-8 16 3.5");
    let text = "geometry = \"sheet.stl\"\nspacing_min = 1\n[root]\norigin = [0, 0, 0]\nedge = 8\n";
    let directory = directory_with_case(text);
    fs::write(directory.path().join("sheet.stl"), format!("solid\n{sheet}endsolid\n")).unwrap();
    let output = reference(directory.path(), &["case.toml", "--out", "mesh"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(String::from_utf8(output.stderr).unwrap().contains("2 components disagree"));
    let ambiguous = serde_json::json!({"count": 2, "example": [2.0, 2.0, 6.0]});
    assert_eq!(manifest(&directory.path().join("mesh"))["components_ambiguous"], ambiguous);
}

/// The core of a spherical shell, in a root of 64 cells of edge 0.125.
#[test]
fn seeds_and_enclosed_components_are_reported() {
    let case = "spacing_min = 0.125\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n\
                [generator]\nshape = \"nested_spheres\"\nfacets = 400\nradius = 2\n";
    let directory = directory_with_case(case);
    let path = directory.path();
    let output = reference(path, &["case.toml", "--out", "mesh"]);
    assert_eq!(output.status.code(), Some(0));
    let components = &manifest(&path.join("mesh"))["components"];
    assert_eq!((&components["outside"], &components["inside"]), (&2.into(), &1.into()));
    let enclosed = &components["enclosed"];
    assert_eq!((&enclosed["count"], &enclosed["example"]), (&1.into(), &vec![-0.25; 3].into()));
    let message = String::from_utf8(output.stderr).unwrap();
    let leaves = &enclosed["leaves"];
    assert!(message.contains(&format!("deleted, 1 components and {leaves} leaves")), "{message}");

    let seeded = format!("seeds = [[0.25, 0, -4.0]]\nenclosed = \"keep\"\n{case}");
    fs::write(path.join("case.toml"), &seeded).unwrap();
    assert!(reference(path, &["case.toml", "--out", "seeded"]).status.success());
    let manifest = manifest(&path.join("seeded"));
    assert_eq!(manifest["seeds"], serde_json::json!([[71_303_168, 67_108_864, 0]]));
    assert_eq!(manifest["enclosed"], "keep");
    assert_eq!(manifest["components"]["outside"], 1);
    assert_eq!(manifest["components"]["inside"], 2);

    fs::write(path.join("case.toml"), seeded.replace("[[0.25", "[[9.0")).unwrap();
    let message = assert_fails(path, &["case.toml", "--out", "none"], 2);
    assert!(message.contains("seed 0 at [9.0, 0.0, -4.0] lies outside the root"), "{message}");
    assert!(!path.join("none").exists());
}

#[test]
fn invalid_input_exits_with_2_and_writes_nothing() {
    let directory = directory_with_case(&CASE.replace("0.125", "1e-9"));
    let path = directory.path();
    assert!(assert_fails(path, &["case.toml"], 2).contains("spacing_min"));
    assert!(assert_fails(path, &["nowhere.toml"], 2).contains("nowhere.toml"));
    fs::write(path.join("damaged.stl"), [0; 100]).unwrap();
    fs::write(path.join("damaged.toml"), "geometry = \"damaged.stl\"\nspacing_min = 1").unwrap();
    assert!(assert_fails(path, &["damaged.toml", "--out", "mesh"], 2).contains("damaged.stl"));
    assert!(!path.join("mesh").exists(), "nothing is written for a case that fails");
    for arguments in [&[][..], &["case.toml", "--unknown"], &["case.toml", "--out"]] {
        assert_eq!(reference(path, arguments).status.code(), Some(2), "{arguments:?}");
    }
    assert_eq!(reference(path, &["--help"]).status.code(), Some(0));
}

#[test]
fn output_that_cannot_be_written_exits_with_4() {
    let directory = directory_with_case(CASE);
    let path = directory.path();
    fs::create_dir(path.join("empty")).unwrap();
    assert!(
        reference(path, &["case.toml", "--out", "empty"]).status.success(),
        "an empty directory is accepted"
    );
    assert!(assert_fails(path, &["case.toml", "--out", "empty"], 2).contains("not empty"));
    fs::write(path.join("file"), "").unwrap();
    assert!(assert_fails(path, &["case.toml", "--out", "file"], 4).contains("file"));
    assert!(
        assert_fails(path, &["case.toml", "--out", "case.toml/mesh"], 4).contains("cannot write")
    );
    assert!(
        assert_fails(path, &["case.toml", "--json", "no/such/run.json"], 4).contains("run.json")
    );
}

#[test]
fn a_record_is_written_through_whatever_is_no_regular_file() {
    let directory = directory_with_case(CASE);
    let path = directory.path();
    std::os::unix::fs::symlink("record", path.join("link")).unwrap();
    assert!(reference(path, &["case.toml", "--json", "link"]).status.success());
    assert!(path.join("link").is_symlink() && path.join("record").is_file());
    let printed = reference(path, &["case.toml", "--json", "/dev/stdout"]).stdout;
    assert!(String::from_utf8(printed).unwrap().starts_with("{\n  \"schema\""));
    let made = Command::new("mknod").current_dir(path).args(["null", "c", "1", "3"]).status();
    if made.unwrap().success() && File::create(path.join("null")).is_ok() {
        assert!(reference(path, &["case.toml", "--json", "null"]).status.success());
        assert!(!path.join("null").is_file());
    }
}

#[test]
fn a_full_device_is_an_error_of_output() {
    let directory = directory_with_case(CASE);
    for (arguments, code) in
        [("case.toml > /dev/full", 4), ("--help > /dev/full", 4), ("absent.toml 2> /dev/full", 2)]
    {
        let script = format!("'{}' {arguments}", env!("CARGO_BIN_EXE_reference"));
        let run = Command::new("sh").args(["-c", &script]).current_dir(directory.path()).output();
        let run = run.unwrap();
        assert_eq!(run.status.code(), Some(code), "{arguments}: {run:?}");
        assert!(!String::from_utf8_lossy(&run.stderr).contains("panicked"), "{run:?}");
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let directory = directory_with_case(CASE);
    for argument in ["case.toml", "--help"] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_reference"));
        let run = command.current_dir(directory.path()).arg(argument).stdout(writer).output();
        let run = run.unwrap();
        assert_eq!((run.status.code(), run.stderr), (Some(0), Vec::new()), "{argument}");
    }
}

/// A box with a slit of three cells is closed at twice and at four times the spacing.
#[test]
fn a_warning_counts_a_region_that_leaks_once() {
    let facets = slotted_box([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 3.0, [0.0; 2]);
    let vertex = |[x, y, z]: &[i64; 3]| format!("vertex {x} {y} {z} ");
    let facet = |f: &[[i64; 3]; 3]| {
        let vertices: String = f.iter().map(vertex).collect();
        format!("facet normal 0 0 0 outer loop {vertices} endloop endfacet\n")
    };
    let facets: String = facets.iter().map(facet).collect();
    let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 134217728.0\n";
    let case = format!("geometry = \"box.stl\"\nspacing_min = 4194304.0\n{root}");
    let directory = directory_with_case(&case);
    fs::write(directory.path().join("box.stl"), format!("solid box\n{facets}endsolid box\n"))
        .unwrap();
    let run = reference(directory.path(), &["case.toml", "--out", "mesh"]);
    assert_eq!(manifest(&directory.path().join("mesh"))["leaks"].as_array().unwrap().len(), 2);
    let expected = "warning: 1 regions are closed at a spacing of 16777216 and open at 4194304, ";
    let warning = String::from_utf8(run.stderr).unwrap();
    assert!(warning.starts_with(expected) && warning.lines().count() == 1, "{warning}");
}

/// A run stops itself at a point, so that the outcome does not depend on time. A signal that finds the mesh complete is ignored.
#[test]
fn an_interrupt_at_any_point_leaves_no_files_or_a_complete_mesh() {
    for (point, signal) in [
        ("start", "INT"),
        ("start", "USR1"),
        ("write", "TERM"),
        ("write", "ALRM"),
        ("report", "HUP"),
    ] {
        let directory = directory_with_case(CASE);
        let path = directory.path();
        let mut command = Command::new(env!("CARGO_BIN_EXE_reference"));
        command.current_dir(path).args(["case.toml", "--out", "mesh", "--json", "run.json"]);
        command.env("STOP_AT", point).stderr(std::process::Stdio::piped());
        let mut run = command.spawn().unwrap();
        let stat = format!("/proc/{}/stat", run.id());
        while !fs::read_to_string(&stat).unwrap().contains(") T ") {
            assert!(run.try_wait().unwrap().is_none(), "the run ended before it stopped");
        }
        let second = reference(path, &["case.toml", "--out", "mesh"]);
        assert_eq!(second.status.code(), Some(2), "{second:?}");
        for name in [signal, "CONT"] {
            let id = run.id().to_string();
            assert!(Command::new("kill").args(["-s", name, &id]).status().unwrap().success());
        }
        let output = run.wait_with_output().unwrap();
        let is_complete = point == "report";
        assert_eq!(output.status.code(), Some(if is_complete { 0 } else { 130 }), "{output:?}");
        assert_eq!(output.stderr == b"error: interrupted\n", !is_complete, "{output:?}");
        let files = if is_complete { 3 } else { 1 };
        assert_eq!(fs::read_dir(path).unwrap().count(), files, "{point} {signal}");
    }
}
