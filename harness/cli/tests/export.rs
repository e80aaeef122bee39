//! `harness export` as a command. `harness/oracles/test_vtk.py` reads its files back.

use contract::testing::{leaf_set, words_of, words_with_sides};
use contract::word::Side;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A mesh at `mesh` in a temporary directory: 49 leaves in one part and 99 in the other; 4 inside leaves of level 1, 16
/// crossing ones of level 2 and 128 outside ones of level 3, where x < 2 in a root of edge 8.
fn mesh() -> TempDir {
    let split = |o: &contract::octant::Octant| o.level == 0 || o.level < 3 && o.corner[0] == 0;
    let words = words_with_sides(split, |o| Some(Side::ALL[usize::from(o.level) % 3]));
    let (first, second) = words.split_at(words.len() / 3);
    let place = tempfile::tempdir().unwrap();
    let set = leaf_set(vec![first.to_vec(), second.to_vec()]);
    set.create(&place.path().join("mesh")).unwrap();
    place
}

/// Exit code and output of an export of that mesh to a file beside it.
fn export(place: &TempDir, file: &str, options: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let command = command.current_dir(place.path()).args(["export", "mesh", file]).args(options);
    // The programs may lie outside of the repository.
    let command = command.env("HARNESS_ROOT", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn names(place: &Path) -> Vec<String> {
    let name = |entry: fs::DirEntry| entry.file_name().into_string().unwrap();
    let mut names: Vec<_> = fs::read_dir(place).unwrap().map(|e| name(e.unwrap())).collect();
    names.sort();
    names
}

#[test]
fn a_file_is_reproducible_and_replaces_an_older_one() {
    let place = mesh();
    fs::write(place.path().join("mesh.vtu"), "old").unwrap();
    let contents = [1, 2].map(|_| {
        let (code, output, error) = export(&place, "mesh.vtu", &[]);
        assert_eq!((code, error.as_str()), (0, ""));
        assert!(output.starts_with("mesh.vtu: 148 cells, "), "{output}");
        fs::read(place.path().join("mesh.vtu")).unwrap()
    });
    assert!(contents[0] == contents[1]);
    assert_eq!(names(place.path()), ["mesh", "mesh.vtu"]);
}

#[test]
fn conditions_of_a_selection_must_all_hold() {
    let place = mesh();
    for (options, cells) in [
        (&["--slice", "x=0.3"][..], 64),
        (&["--slice", "z=8"], 2 + 4 + 16),
        (&["--clip", "4,0,0,8,8,8"], 4),
        (&["--clip", "9,9,1.5,3.5,-9,1.2"], 4 + 2),
        (&["--level-max", "2"], 4 + 16),
        (&["--side", "outside"], 128),
        (&["--rank", "0"], 49),
        (&["--rank", "1"], 99),
        (&["--slice", "x=0.3", "--clip", "0,0,0,2,1,1"], 1),
    ] {
        let (code, output, error) = export(&place, "part.vtu", options);
        assert_eq!((code, error.as_str()), (0, ""), "{options:?}");
        assert!(output.starts_with(&format!("part.vtu: {cells} cells, ")), "{options:?}: {output}");
    }
}

#[test]
fn an_export_that_cannot_be_made_is_one_sentence_and_leaves_no_file() {
    let place = mesh();
    fs::create_dir(place.path().join("mesh/b")).unwrap();
    fs::write(place.path().join("mesh/b/mesh.json"), "{}").unwrap();
    for (file, options, expected) in [
        (
            "mesh.png",
            &[][..],
            "mesh.png: no format has such a name: choose one that ends in .vtu, .p8est",
        ),
        ("mesh/all.vtkhdf", &[], "mesh/all.vtkhdf: it would be a part of the mesh"),
        ("mesh/b/mesh.vtkhdf", &[], "mesh/b/mesh.vtkhdf: it would be a part of the mesh"),
        ("none/mesh.vtu", &[], "none/mesh.vtu: none is not a directory: create it"),
        ("part.vtu", &["--side", "outside", "--level-max", "2"], "no leaf satisfies"),
        ("part.vtkhdf", &["--side", "outside", "--level-max", "2"], "no leaf satisfies"),
        ("part.vtu", &["--clip", "9,9,9,10,10,10"], "no leaf satisfies"),
        ("part.vtu", &["--slice", "y=-1"], "the mesh extends from y=0 to y=8"),
        ("part.vtu", &["--rank", "2"], "--rank 2: the mesh has 2 ranks, from 0 on"),
        ("part.vtu", &["--regions", "all"], "--case and --regions have no effect on .vtu"),
        ("part.vtu", &["--case", "cube-small"], "--case and --regions have no effect on .vtu"),
        ("polyMesh", &[], "one that ends in .vtu, .p8est, /polyMesh"),
        ("front.stl", &["--case", "cube-small"], "--case and --regions have no effect on .stl"),
        ("front.stl", &["--side", "crossing"], "no selected cell borders a crossing cell"),
        ("front.vtp", &["--case", "cube-small"], "--case and --regions have no effect on .vtp"),
        ("case/constant/polyMesh", &["--case", "absent.toml"], "absent.toml"),
        (
            "case/constant/polyMesh",
            &["--case", "cube-small"],
            "has another root (corner [0.0, 0.0, 0.0], edge 8): give the case",
        ),
        ("case/constant/polyMesh", &["--side", "inside", "--level-max", "0"], "no leaf satisfies"),
        ("case/constant/polyMesh", &["--case", "cube-small"], "not of the case cube-small"),
    ] {
        let (code, output, error) = export(&place, file, options);
        assert_eq!((code, output.as_str(), error.matches('\n').count()), (2, "", 1), "{error}");
        assert!(error.contains(expected), "{error}");
        assert_eq!(names(place.path()), ["mesh"]);
    }
    assert_eq!(export(&place, "part.vtu", &["--level-max", "20"]).0, 2);
}

#[test]
fn a_poly_mesh_is_a_directory_of_a_case() {
    let place = mesh();
    let (code, output, error) = export(&place, "case/constant/polyMesh", &[]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.starts_with("case/constant/polyMesh: 148 cells, "), "{output}");
    assert!(output.contains("faces of each patch: xMin "), "{output}");
    assert!(output.contains("the geometry crosses cells"), "{output}");
    let files = ["boundary", "cellLevel", "faces", "neighbour", "owner", "points", "rank", "side"];
    assert_eq!(names(&place.path().join("case/constant/polyMesh")), files);
    assert_eq!(names(place.path()), ["case", "mesh"]);
    // None of the cells that are left crosses.
    let (code, output, _) = export(&place, "inner/polyMesh", &["--level-max", "1"]);
    assert!(code == 0 && !output.contains("crosses"), "{output}");
}

#[test]
fn an_interrupted_export_leaves_no_file() {
    let place = tempfile::tempdir().unwrap();
    // Several pieces, so that the first is written before the last is encoded.
    let words = words_with_sides(|o| o.level < 7, |_| Some(Side::Outside));
    leaf_set(vec![words]).create(&place.path().join("mesh")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    command.current_dir(place.path()).args(["export", "mesh", "all.vtu"]);
    let child = command.stderr(Stdio::piped()).spawn().unwrap();
    while names(place.path()).len() == 1 {
        std::thread::yield_now();
    }
    let interrupt = ["-INT".to_owned(), child.id().to_string()];
    assert!(Command::new("kill").args(interrupt).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "harness: interrupted\n");
    assert_eq!(names(place.path()), ["mesh"]);
}

/// The tree of a mesh is a mesh itself: it is exported, audited and imported without VTK, and damage is one sentence.
#[test]
fn a_tree_is_read_back_without_python_and_damage_is_found() {
    let place = mesh();
    let harness = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.current_dir(place.path()).args(arguments).env("HARNESS_PYTHON", "/nowhere/python");
        let output = command.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    };
    let (code, output, error) = export(&place, "mesh.vtkhdf", &[]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.starts_with("mesh.vtkhdf: 148 cells, "), "{output}");
    let import = ["import", "mesh.vtkhdf", "--sides", "side", "--out", "again"];
    let (code, output, error) = harness(&import);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.contains("148 cells, sides known"), "{output}");
    assert_eq!(harness(&["diff", "mesh", "again"]).0, 0);

    // A directory with the tree alone is compared like one with leaf words.
    fs::create_dir(place.path().join("tree")).unwrap();
    fs::copy(place.path().join("mesh.vtkhdf"), place.path().join("tree/mesh.vtkhdf")).unwrap();
    let mut manifest = contract::manifest::Manifest::read(&place.path().join("mesh")).unwrap();
    (manifest.parts, manifest.hyper_tree_grid) = (Vec::new(), Some("mesh.vtkhdf".to_owned()));
    let write = |manifest: &contract::manifest::Manifest| {
        fs::write(place.path().join("tree/mesh.json"), serde_json::to_vec(manifest).unwrap())
            .unwrap();
    };
    write(&manifest);
    // Its ranks are unknown.
    let (code, _, error) = harness(&["export", "tree", "tree.vtu", "--rank", "0"]);
    assert!(code == 2 && error.contains("that has only a tree are unknown"), "{error}");
    assert_eq!(harness(&["export", "tree", "tree.vtu"]).0, 0);
    let vtu = fs::read(place.path().join("tree.vtu")).unwrap();
    let header = String::from_utf8_lossy(&vtu[..4096]);
    assert!(header.contains("\"side\"") && !header.contains("\"rank\""), "{header}");
    fs::remove_file(place.path().join("tree.vtu")).unwrap();
    let (code, output, _) = harness(&["diff", "mesh", "tree"]);
    assert_eq!(code, 0, "{output}");
    assert!(output.ends_with("the leaves are the same (148 compared)\n"), "{output}");
    leaf_set(vec![words_of(|o| o.level < 2)]).create(&place.path().join("other")).unwrap();
    let of_words = harness(&["diff", "mesh", "other"]);
    let of_tree = harness(&["diff", "tree", "other"]);
    assert_eq!((of_words.0, of_tree.0), (1, 1));
    let differences = |output: &str| output.split_once("B other\n").unwrap().1.to_owned();
    assert_eq!(differences(&of_tree.1), differences(&of_words.1));
    manifest.leaves += 1;
    write(&manifest);
    assert_eq!(harness(&["audit", "tree"]).0, 1);

    let (code, output, error) = harness(&["audit", "mesh.vtkhdf", "--sides", "side"]);
    assert_eq!(error, "");
    assert!(code < 2 && output.contains("manifest   holds, 148 examined"), "{output}");
    assert_eq!(harness(&import).0, 2, "a directory is not overwritten");

    let file = place.path().join("mesh.vtkhdf");
    let whole = fs::read(&file).unwrap();
    let mut flipped = whole.clone();
    flipped[60] ^= 4;
    for damaged in [&whole[..whole.len() - 1], &whole[..40], &flipped] {
        fs::write(&file, damaged).unwrap();
        for command in [&["audit", "mesh.vtkhdf"][..], &["import", "mesh.vtkhdf", "--out", "new"]] {
            let (code, output, error) = harness(command);
            assert_eq!((code, output.as_str(), error.matches('\n').count()), (2, "", 1), "{error}");
            assert!(error.contains("mesh.vtkhdf: is damaged: "), "{error}");
        }
    }
    assert_eq!(names(place.path()), ["again", "mesh", "mesh.vtkhdf", "other", "tree"]);
}

#[test]
fn the_surface_towards_the_body_is_polygons_or_triangles() {
    let place = tempfile::tempdir().unwrap();
    // A body of edge 2 in the middle of a root of edge 8.
    let is_body = |c: u32| (3..5).contains(&(c >> 16));
    let words = words_with_sides(
        |o| o.level < 3,
        |o| (!o.corner.iter().all(|&c| is_body(c))).then_some(Side::Outside),
    );
    leaf_set(vec![words]).create(&place.path().join("mesh")).unwrap();
    let case = "spacing_min = 8.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n[generator]\nshape = \"sphere\"\nfacets = 20\n";
    fs::write(place.path().join("case.toml"), case).unwrap();
    let (code, output, error) = export(&place, "front.stl", &[]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert_eq!(
        output,
        "front.stl: 24 faces, 2484 bytes (103.50 per face)\n  a surface of area 24.0, closed\n"
    );
    // Nothing shows that it is no body.
    let (code, output, error) = export(&place, "front.stl", &[]);
    assert_eq!((code, output.as_str()), (2, ""));
    assert_eq!(error, "harness: front.stl exists: remove it, or choose another name\n");
    assert_eq!(export(&place, "front.vtp", &[]).0, 0);
    let (code, output, _) = export(&place, "part.vtp", &["--clip", "0,0,0,8,8,4"]);
    assert!(
        code == 0 && output.contains("12 faces") && output.contains("open at 8 edges"),
        "{output}"
    );
    fs::write(place.path().join("other.toml"), case.replace("8.0", "4.0")).unwrap();
    // The geometry was replaced after the mesh was made.
    let manifest = place.path().join("mesh/mesh.json");
    let stated = fs::read_to_string(&manifest).unwrap();
    let geometry = format!(r#"{{"geometry": {{"facets": 7, "digest": "{}"}},"#, "0".repeat(32));
    let replaced = stated.replacen('{', &geometry, 1);
    let digest = stated.split("\"digest\":\"").nth(1).unwrap()[..32].to_owned();
    for (manifest_text, case, why) in [
        (stated.clone(), "other.toml", "has another root (corner"),
        (replaced, "case.toml", "another geometry"),
        (
            stated.replacen("\"digest\":\"", "\"digest\":\"0", 1),
            "case.toml",
            "a digest is 32 lower-case",
        ),
        (stated.replace(&digest, &"1".repeat(32)), "case.toml", "mesh: its leaves have the digest"),
    ] {
        fs::write(&manifest, manifest_text).unwrap();
        let (code, output, error) = export(&place, "case/constant/polyMesh", &["--case", case]);
        assert_eq!((code, output.as_str(), error.lines().count()), (2, "", 1), "{error}");
        assert!(error.contains(why), "{error}");
    }
}
