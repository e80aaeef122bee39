//! `harness import` and `harness audit` on meshes of other programs, as commands.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

fn harness(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    command.args(arguments).env("HARNESS_PYTHON", "/nowhere/python").output().unwrap()
}

fn sample(name: &str) -> String {
    format!("{}/../contract/tests/samples/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Exit code, standard output and standard error.
fn result(arguments: &[&str]) -> (i32, String, String) {
    let output = harness(arguments);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn digest(mesh: &Path) -> String {
    let text = fs::read_to_string(mesh.join("mesh.json")).unwrap();
    serde_json::from_str::<serde_json::Value>(&text).unwrap()["digest"].as_str().unwrap().to_owned()
}

#[test]
fn a_mesh_is_imported_again_from_its_own_leaf_words() {
    let place = tempfile::tempdir().unwrap();
    let [first, second] = ["a", "b"].map(|name| place.path().join(name));
    let (code, output, error) =
        result(&["import", &sample("unitcube.p8est"), "--out", first.to_str().unwrap()]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(output.ends_with(": 106 cells, sides unknown\n"), "{output}");
    let words = first.join("leaves-00000.npy");
    let arguments =
        ["import", words.to_str().unwrap(), "--root", "0,0,0,1", "--out", second.to_str().unwrap()];
    assert_eq!(result(&arguments).0, 0);
    assert_eq!(digest(&first), digest(&second));
    // Meshes are compared in whatever form they have.
    let forest = sample("unitcube.p8est");
    let (code, output, error) = result(&["diff", &forest, second.to_str().unwrap()]);
    assert_eq!((code, error.as_str()), (0, ""), "{output}");
    assert!(output.contains("106 compared"), "{output}");
    let (code, output, _) = result(&["diff", &forest, &sample("brick.p8est"), "--ignore-root"]);
    assert!(code == 1 && output.contains("the leaves differ"), "{output}");
    // An existing mesh is not overwritten.
    let (code, _, error) = result(&arguments);
    assert!(code == 2 && error.contains("not empty"), "{error}");
}

#[test]
fn unknown_sides_do_not_become_known() {
    let place = tempfile::tempdir().unwrap();
    let [mesh, tree, forest, again] = ["mesh", "mesh.vtkhdf", "mesh.p8est", "again"]
        .map(|name| place.path().join(name).to_str().unwrap().to_owned());
    assert_eq!(result(&["import", &sample("unitcube.p8est"), "--out", &mesh]).0, 0);
    for arguments in [["export", &mesh, &tree], ["export", &mesh, "front.stl"]] {
        let (code, _, error) = result(&arguments);
        assert!(code == 2 && error.contains("sides of this mesh are unknown"), "{error}");
    }
    assert_eq!(result(&["export", &mesh, &forest]).0, 0);
    let (code, _, error) = result(&["import", &forest, "--sides", "data", "--out", &again]);
    assert_eq!(code, 2, "{error}");
    assert_eq!(result(&["import", &forest, "--out", &again]).0, 0);
    assert_eq!(digest(Path::new(&mesh)), digest(Path::new(&again)));
}

#[test]
fn foreign_meshes_are_audited_without_a_manifest() {
    let (code, output, error) = result(&["audit", &sample("unitcube.p8est")]);
    assert_eq!((code, error.as_str()), (0, ""), "{output}");
    assert!(
        output.contains("106 leaves")
            && output.contains("nothing to check: the sides of the leaves are unknown"),
        "{output}"
    );
    // A forest by itself is complete. As one mesh it fills a part of its root, of which nothing states that the rest is deleted.
    let (code, output, _) = result(&["audit", &sample("brick.p8est")]);
    assert!(code == 0 && output.contains("balance    holds, 108 examined"), "{output}");
    let (code, output, _) = result(&["audit", &sample("brick.p8est"), "--root", "0,0,0,4"]);
    assert!(code == 1 && output.contains("has a hole across a face"), "{output}");
}

#[test]
fn a_case_gives_root_and_requirements() {
    let place = tempfile::tempdir().unwrap();
    let case = place.path().join("case.toml");
    let text = "generator = { shape = \"cube\", facets = 48 }\nspacing_min = 0.25\nlayer_cells_min = 3\nkeep = \"all\"\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n";
    fs::write(&case, text).unwrap();
    let case = case.to_str().unwrap();
    let (code, output, error) = result(&["audit", &sample("unitcube.p8est"), "--case", case]);
    assert_eq!((code, error.as_str()), (1, ""), "{output}");
    assert!(
        output.lines().any(|line| line.starts_with("layer") && line.contains("finding")),
        "{output}"
    );
    assert!(
        output.lines().any(|line| line.starts_with("balance") && line.contains("holds")),
        "{output}"
    );
    // A file that states no inputs claims none that differ from those of the case.
    let mesh = place.path().join("mesh");
    let mesh = mesh.to_str().unwrap();
    let forest = sample("unitcube.p8est");
    assert_eq!(result(&["import", &forest, "--root", "-4,-4,-4,8", "--out", mesh]).0, 0);
    let (code, output, _) = result(&["audit", mesh, "--case", case]);
    assert!(code == 1 && output.contains("manifest   holds"), "{output}");
    let (code, output, _) = result(&["audit", mesh]);
    let lines = ["spacing    nothing to check: the inputs of the mesh are", "layer      nothing"];
    assert!(code == 0 && lines.iter().all(|line| output.contains(line)), "{output}");
    let stated = place.path().join("stated");
    let stated = stated.to_str().unwrap();
    assert_eq!(result(&["import", &forest, "--case", case, "--out", stated]).0, 0);
    let (code, output, _) = result(&["diff", mesh, stated]);
    assert!(code == 0 && output.contains("layer_cells_min: not stated in A; 3 in B"), "{output}");
    let (code, _, error) = result(&["why", mesh, "0,0,0"]);
    assert!(code == 2 && error.contains("states no inputs"), "{error}");
    let (code, _, error) = result(&["audit", &sample("unitcube.p8est"), "--case", "no-such-case"]);
    assert!(code == 2 && error.contains("no-such-case"), "{error}");
}

#[test]
fn unusable_input_is_one_sentence_with_the_file() {
    let place = tempfile::tempdir().unwrap();
    let (out, empty) = (place.path().join("out"), place.path().join("empty"));
    fs::create_dir(&empty).unwrap();
    let bare = place.path().join("bare");
    fs::create_dir(&bare).unwrap();
    fs::write(bare.join("leaves-00000.npy"), "").unwrap();
    let refused = |arguments: &[&str]| {
        let all: Vec<&str> =
            ["import", "--out", out.to_str().unwrap()].iter().chain(arguments).copied().collect();
        let (code, output, error) = result(&all);
        assert_eq!((code, output.as_str(), error.matches('\n').count()), (2, "", 1), "{error}");
        assert!(!out.exists());
        error
    };
    assert!(refused(&["/nowhere/mesh"]).contains("/nowhere/mesh: cannot be read"));
    assert!(refused(&[empty.to_str().unwrap()]).contains("--format"));
    assert!(refused(&[bare.to_str().unwrap()]).contains("--format leaf-words"));
    assert!(refused(&[&sample("unitcube.p8est"), "--root", "0,0,0,-1"]).contains("is not a cube"));
    assert!(refused(&[&sample("brick.csv"), "--format", "p4est"]).contains("p8est"));
}

#[test]
fn formats_that_are_read_in_python_need_it() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("mesh.vtu");
    fs::write(&file, "<VTKFile type=\"UnstructuredGrid\">").unwrap();
    let discretize = place.path().join("tree.json");
    fs::write(&discretize, "{}").unwrap();
    let foam = place.path().join("constant/polyMesh");
    fs::create_dir_all(&foam).unwrap();
    for list in ["points", "faces", "owner", "neighbour"] {
        fs::write(foam.join(list), "FoamFile {}").unwrap();
    }
    let foam = place.path().to_str().unwrap();
    for mesh in [file.to_str().unwrap(), discretize.to_str().unwrap(), foam] {
        let (code, _, error) = result(&["audit", mesh]);
        assert!(code == 3 && error.contains("/nowhere/python"), "{error}");
    }
}

#[test]
fn options_that_contradict_a_manifest_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let mesh = place.path().join("mesh");
    assert_eq!(
        result(&["import", &sample("unitcube.p8est"), "--out", mesh.to_str().unwrap()]).0,
        0
    );
    assert_eq!(result(&["audit", mesh.to_str().unwrap()]).0, 0);
    let (code, _, error) = result(&["audit", mesh.to_str().unwrap(), "--root", "0,0,0,1"]);
    assert!(code == 2 && error.contains("has a manifest"), "{error}");
}

/// What the proven checker says is a check like any other: printed, recorded and part of the exit code.
#[test]
fn a_proof_is_part_of_an_audit() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
    let [mesh, checker, json] = ["mesh", "checker", "audit.json"].map(path);
    assert_eq!(result(&["import", &sample("unitcube.p8est"), "--out", &mesh]).0, 0);
    let audit = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(["audit", &mesh, "--proved", &mesh, "--json", &json]);
        let output = command.env("HARNESS_PROVEN", &checker).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout) + &text(output.stderr))
    };
    let (code, printed) = audit();
    assert!(code == 3 && printed.contains("ci/prove"), "{printed}");
    for (ends, expected, says) in [
        ("echo accepted; echo proven, given T0", 0, "proven, given T0"),
        ("exit 0", 2, "ci/prove builds"),
        ("exit 1", 1, "rejects the mesh"),
        ("echo 'no base' >&2; exit 2", 2, "no base"),
        ("kill -9 $$", 2, "signal 9"),
    ] {
        fs::write(&checker, format!("#!/bin/sh\n{ends}\n")).unwrap();
        fs::set_permissions(&checker, fs::Permissions::from_mode(0o755)).unwrap();
        let (code, printed) = audit();
        assert!(code == expected && printed.contains(says), "{ends}: {code} {printed}");
        let record: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(&json).unwrap()).unwrap();
        assert_eq!(record["holds"], code != 1, "{ends}");
    }
}
