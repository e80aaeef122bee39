//! Meshes of other programs, as commands import, audit and compare them; forests that p4est 2.2 wrote, and forests by `harness export`,
//! loaded and saved again by p4est.

use contract::leafset;
use contract::testing::{leaf_set, words_with_sides};
use contract::word::Side;
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

/// Exit code, and all that was printed.
fn printed_by(arguments: &[&str]) -> (i32, String) {
    let (code, output, error) = result(arguments);
    (code, output + &error)
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
    let (code, _, error) =
        result(&["diff", &forest, second.to_str().unwrap(), "--position", "centre"]);
    assert!(code == 2 && error.contains("the position of cells is for tables"), "{error}");
    // An existing mesh is not overwritten.
    let (code, _, error) = result(&arguments);
    assert!(code == 2 && error.contains("not empty"), "{error}");
}

#[test]
fn unknown_sides_do_not_become_known() {
    let place = tempfile::tempdir().unwrap();
    let [mesh, tree, front, forest, again] =
        ["mesh", "mesh.vtkhdf", "front.stl", "mesh.p8est", "again"]
            .map(|name| place.path().join(name).to_str().unwrap().to_owned());
    assert_eq!(result(&["import", &sample("unitcube.p8est"), "--out", &mesh]).0, 0);
    for arguments in [["export", &mesh, &tree], ["export", &mesh, &front]] {
        let (code, _, error) = result(&arguments);
        assert!(code == 2 && error.contains("sides of this mesh are unknown"), "{error}");
    }
    assert_eq!(result(&["export", &mesh, &forest]).0, 0);
    for sides in [&["--sides", "data"][..], &[]] {
        let import = [&["import", &forest, "--out", &again][..], sides].concat();
        let (code, output, error) = result(&import);
        assert!(code == 0 && output.contains("sides unknown"), "{output}{error}");
        assert_eq!(digest(Path::new(&mesh)), digest(Path::new(&again)));
        fs::remove_dir_all(&again).unwrap();
    }
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
    let (code, _, error) = result(&["audit", &sample("brick.p8est"), "--position", "centre"]);
    assert!(code == 2 && error.contains("the position of cells is for tables"), "{error}");
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
    assert!(output.contains("with --sides (in p4est: data)"), "{output}");
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
    assert!(
        refused(&[&sample("unitcube.p8est"), "--root", "0,0,0,-1"])
            .contains("edge that is positive")
    );
    assert!(
        refused(&[&sample("brick.csv"), "--root", "0,0,0,0"]).contains("edge that is positive")
    );
    // A manifest with this root could not be read.
    assert!(refused(&[&sample("unitcube.p8est"), "--root", "0,0,0,1e200"]).contains("to 1e100"));
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
    let audit = |mesh: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(["audit", mesh, "--proved", mesh, "--json", &json]);
        let output = command.env("HARNESS_PROVEN", &checker).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout) + &text(output.stderr))
    };
    let (code, printed) = audit(&mesh);
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
        let (code, printed) = audit(&mesh);
        assert!(code == expected && printed.contains(says), "{ends}: {code} {printed}");
        let record: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(&json).unwrap()).unwrap();
        assert_eq!(record["holds"], code == 0, "{ends}");
    }
    // Nothing is proven of a mesh without leaves, and a report that cannot be written hides no finding.
    let [words, empty] = ["words.npy", "empty"].map(path);
    contract::npy::write(Path::new(&words), &[]).unwrap();
    assert_eq!(result(&["import", &words, "--root", "0,0,0,8", "--out", &empty]).0, 0);
    fs::write(&checker, "#!/bin/sh\necho accepted; echo proven, given T0\n").unwrap();
    let (code, printed) = audit(&empty);
    let says = printed.contains("proof      nothing to check: the mesh has no leaves");
    assert!(code == 1 && says, "{code} {printed}");
    let (code, printed) = printed_by(&["audit", &empty, "--json", "/dev/full"]);
    assert!(code == 1 && printed.contains("a report could not be written: /dev/full"), "{printed}");
}

/// p4est's issue 238: two cubes that share an edge.
#[test]
fn the_balance_across_a_tree_edge_is_a_finding_and_that_of_faces_holds() {
    let [edge, repaired] = ["edge.p8est", "edge-repaired.p8est"].map(sample);
    let (code, printed) = printed_by(&["audit", &edge]);
    let finding = "tree 0, quadrant 9 (level 3 at 458752, 458752, 0) touches in an edge tree 1, quadrant 0 (level 0 at 0, 0, 0)";
    assert!(
        code == 1 && printed.contains(finding) && printed.contains("3 findings, 23"),
        "{printed}"
    );
    assert_eq!(printed_by(&["audit", &edge, "--balance", "edges"]).0, 1);
    assert_eq!(printed_by(&["audit", &edge, "--balance", "faces"]).0, 0);
    let (code, _, error) = result(&["audit", &edge, "--balance", "faces", "--position", "centre"]);
    assert!(code == 2 && error.contains("the position of cells is for tables"), "{error}");
    assert_eq!(printed_by(&["audit", &repaired]).0, 0);
    let (code, printed) = printed_by(&["diff", &edge, &repaired]);
    let finding = "A has tree 1, quadrant 0 (level 0 at 0, 0, 0), B has tree 1, quadrant 0 (level 2 at 0, 0, 0)";
    assert!(code == 1 && printed.contains(finding), "{printed}");
    assert_eq!(printed_by(&["diff", &edge, &edge]).0, 0);
}

/// p4est's issue 112: three squares around a corner that no list has.
#[test]
fn a_corner_that_no_list_has_is_remarked() {
    let squares = sample("unlisted.p4est");
    let (code, printed) = printed_by(&["audit", &squares, "--balance", "faces"]);
    assert!(code == 1 && printed.contains("touches in a face"), "{printed}");
    assert!(
        printed.contains("2 tree corners whose trees are no neighbours otherwise are in no list"),
        "{printed}"
    );
    let (code, printed) = printed_by(&["audit", &squares, "--balance", "edges"]);
    assert!(code == 2 && printed.contains("choose --balance faces or corners"), "{printed}");
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("mesh");
    let (code, printed) = printed_by(&["import", &squares, "--out", out.to_str().unwrap()]);
    assert!(
        code == 2 && printed.contains("two dimensions") && printed.lines().count() == 1,
        "{printed}"
    );
}

#[test]
fn a_connectivity_alone_is_audited() {
    let (code, printed) = printed_by(&["audit", &sample("edge-connectivity.p8est")]);
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
            let (code, printed) = printed_by(&["audit", path.to_str().unwrap()]);
            let is_refused = code == 2 && printed.lines().count() == 1;
            assert!(is_refused || printed.contains("without leaves"), "{end}: {printed}");
        }
    }
}

/// One tree without neighbours remains one mesh in its root, unless its balance alone is asked for.
#[test]
fn one_cube_is_a_mesh_or_a_forest() {
    let cube = sample("unitcube.p8est");
    assert!(printed_by(&["audit", &cube]).1.contains("distinct octants"));
    let (code, printed) = printed_by(&["audit", &cube, "--balance", "corners"]);
    assert!(code == 0 && printed.contains("connectivity holds"), "{printed}");
    let (code, printed) = printed_by(&["audit", &cube, "--balance", "faces", "--root", "0,0,0,1"]);
    assert!(code == 0 && printed.contains("distinct octants"), "{printed}");
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
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (code, printed) = printed_by(&["export", &text(&mesh), &text(&forest)]);
    assert_eq!(code, 0, "{printed}");
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
    let arguments = ["import", &text(&saved), "--sides", "data", "--out", &text(&back)];
    let (code, printed) = printed_by(&arguments);
    assert_eq!(code, 0, "{printed}");
    let (first, second) = (leafset::read(&mesh).unwrap(), leafset::read(&back).unwrap());
    assert_eq!(first.manifest.digest, second.manifest.digest);
    assert_eq!(second.words, words);
}
