//! `harness picture` with a scripted mesher, whose mesh is always the base tree of a cube.

use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use contract::testing::base_tree;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use tempfile::TempDir;

/// Copies the mesh, and keeps its arguments.
const MESHER: &str = r#"#!/bin/sh
here="$(dirname "$0")"
echo "$@" >> "$here/calls"
while [ $# -gt 0 ]; do
    case "$1" in
    --out) cp -r "$here/mesh" "$2" ;;
    esac
    shift
done
"#;

const CASE: &str = "spacing_min = 0.25\n[generator]\nshape = \"cube\"\nfacets = 48\n\
                    [root]\norigin = [-2.0, -2.0, -2.0]\nedge = 4.0\n";

struct Fixture(TempDir);

impl Fixture {
    fn new() -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fs::write(fixture.path("case.toml"), CASE).unwrap();
        let case = Case::read(&fixture.path("case.toml")).unwrap();
        let words = base_tree(&case.facets_lattice, |_| case.level_surface);
        let (half, rest) = words.split_at(words.len() / 2);
        let empty = case.manifest(Tree::Base, "test".to_owned());
        let set = LeafSet::new(empty, Vec::new()).with_parts(vec![half.to_vec(), rest.to_vec()]);
        fs::create_dir(fixture.path("mesh")).unwrap();
        set.write(&fixture.path("mesh")).unwrap();
        let mesher = fixture.path("mesher");
        fs::write(&mesher, MESHER).unwrap();
        fs::set_permissions(&mesher, fs::Permissions::from_mode(0o755)).unwrap();
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Exit code, and standard output and error, of `harness picture`.
    fn picture(&self, arguments: &str) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        // The programs may lie outside of the repository.
        command.env("HARNESS_ROOT", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        command.arg("picture").args(arguments.split(' '));
        if !arguments.starts_with("mesh ") {
            command.args(["--mesher", "mesher"]);
        }
        let output = command.current_dir(self.0.path()).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8(text).unwrap())
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }
}

#[test]
fn a_case_is_meshed_on_ranks_and_drawn_with_its_geometry() {
    let fixture = Fixture::new();
    let (code, text) = fixture.picture("case.toml --out a.svg --colour rank --ranks 3 --ungraded");
    assert_eq!(code, 0, "{text}");
    let calls = fixture.read("calls");
    assert!(calls.contains("sim:3") && calls.contains("--ungraded"), "{calls}");
    let svg = fixture.read("a.svg");
    assert!(svg.contains(">rank<") && svg.contains(">geometry<"), "{svg}");
}

#[test]
fn a_mesh_on_disk_is_drawn_without_geometry_unless_its_case_is_given() {
    let fixture = Fixture::new();
    let (code, text) = fixture.picture("mesh --out a.svg --slice z=0.1 --side crossing");
    assert!(code == 0 && text.contains("name its case with --case"), "{text}");
    assert!(!fixture.read("a.svg").contains("geometry"));
    let (code, text) = fixture.picture("mesh --out a.svg --case case.toml --zoom 2");
    assert!(code == 0 && !text.contains("--case"), "{text}");
    assert!(fixture.read("a.svg").contains(">geometry<"));
}

#[test]
fn a_picture_of_a_box_is_a_slice_through_it() {
    let fixture = Fixture::new();
    let (code, text) = fixture.picture("case.toml --out a.svg --clip 0,0,0.5,1,1,0.75");
    assert!(code == 0 && text.contains("z = 0.625"), "{text}");
}

#[test]
fn impossible_requests_are_one_sentence_and_leave_no_file() {
    let fixture = Fixture::new();
    fs::write(fixture.path("other.toml"), CASE.replace("0.25", "0.5")).unwrap();
    let requests = [
        ("mesh --out a.vtu", 2, "must end in .svg"),
        ("mesh --out no/a.svg", 2, "no is not a directory"),
        ("mesh --out a.svg --ranks 2", 2, "is meshed already"),
        ("mesh --out a.svg --ungraded", 2, "is meshed already"),
        (
            "mesh --out a.svg --case x.stl",
            2,
            "x.stl is neither the name of a case nor a case file: give CASE.toml",
        ),
        ("mesh --out a.svg --slice z=9", 2, "--slice z=9"),
        ("mesh --out a.svg --slice z=0 --level-max 0", 2, "no leaf of the selection"),
        ("mesh --out a.svg --slice z=0 --clip -1,-1,0.3,1,1,0.9", 2, "no leaf of the selection"),
        // Beyond the box in the same leaves.
        ("mesh --out a.svg --slice z=1.7 --clip 0,0,1.1,1,1,1.3", 2, "no leaf of the selection"),
        ("mesh --out a.svg --case other.toml", 2, "the mesh is not of the case other"),
        ("mesh --out a.svg --zoom 0", 2, "from 1 to 1000000"),
        ("mesh --out a.svg --zoom -3", 2, "unexpected argument '-3' found; see --help"),
        ("nowhere.toml --out a.svg", 2, "nowhere.toml"),
        ("case.toml --out a.svg --case case.toml", 2, "is not a leaf-set directory"),
    ];
    for (arguments, expected, why) in requests {
        let (code, text) = fixture.picture(arguments);
        assert!(code == expected && text.contains(why), "{arguments}: {code} {text}");
        let created = |name: &str| fixture.path(name).exists();
        assert!(!["a.svg", "a.vtu"].into_iter().any(created), "{arguments}");
    }
}

/// A FIFO without a reader keeps the picture from being written.
#[test]
fn an_interrupted_picture_is_not_written() {
    let fixture = Fixture::new();
    let [temporary, fifo] = ["tmp", "a.svg"].map(|name| fixture.path(name));
    fs::create_dir(&temporary).unwrap();
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    command.args(["picture", "mesh", "--out", "a.svg"]).current_dir(fixture.0.path());
    let child = command.env("TMPDIR", &temporary).stderr(Stdio::piped()).spawn().unwrap();
    // This directory is made once signals are handled.
    while fs::read_dir(&temporary).unwrap().next().is_none() {
        sleep(Duration::from_millis(1));
    }
    let interrupt = ["-INT".to_owned(), child.id().to_string()];
    assert!(Command::new("kill").args(interrupt).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "harness: interrupted\n");
}
