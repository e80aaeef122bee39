//! A directory with a case and scripted programs.

use contract::leafset::LeafSet;
use serde_json::json;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A correct program: copies the requested tree and writes a run report that describes it.
pub const HOLDS: &str = r#"
here=$(dirname "$0"); tree=final; shift
while [ $# -gt 0 ]; do
    case "$1" in
    --out) out="$2"; shift ;;
    --json) json="$2"; shift ;;
    --ungraded) tree=base ;;
    esac
    shift
done
from="$here/$tree"
[ -z "$out" ] || cp -r "$from" "$out"
ranks="$FAKE_RANKS"
[ -z "$json" ] || printf '{"cells": 1, "digest": "%s", "ranks": %s, "time_wall_s": 0.005, "peak_rss_bytes": [9000000]}' \
    "$(cat "$here/$tree.digest")" "${ranks:-1}" > "$json"
"#;

/// A mesher that rejects every case.
pub const REFUSES: &str = "echo 'spacing_min is negative' >&2; exit 2";

/// A mesher that writes the status of two ranks and then hangs in a child process.
pub const HANGS: &str = r#"
here=$(dirname "$0")
while [ "$1" != --status ]; do shift; done
echo 'layer 7' > "$2/rank-00000.txt"; echo 'layer 7' > "$2/rank-00001.txt"
sleep 600 & echo $! > "$here/sleeper"; wait
"#;

const CASE: &str = "spacing_min = 100.0\nkeep = \"all\"\n[root]\norigin = [-32.0, -32.0, -32.0]\nedge = 64.0\n\
                    [generator]\nshape = \"cube\"\nfacets = 12\n";

/// Meshes of one leaf, the root: crossing, which is correct, or outside, which is wrong.
const WORDS: [(&str, u64); 3] = [("final", 2), ("base", 2), ("other", 0)];

/// How a run of the harness ended.
pub struct Outcome {
    /// Its exit code.
    pub code: i32,
    /// Its standard output and standard error.
    pub printed: String,
}

/// Makes a script that is a mesher stay, and run the lines of its standard input.
const SERVE: &str = r#"if [ "$1" = --serve ]; then
    while read -r line; do eval "set -- $(echo "$line" | tr '[],' '   ')"; "$0" "$@"; echo $?; done
    exit
fi"#;

/// The directory, removed on drop.
pub struct Fixture(TempDir);

impl Fixture {
    /// Writes correct programs. MPI, oracles and, unless a test writes it, p4est are missing.
    pub fn new() -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fs::create_dir(fixture.path("tmp")).unwrap();
        fixture.write("case.toml", CASE);
        for (name, word) in WORDS {
            fixture.write_tree(name, word);
        }
        fixture.script("mesher", HOLDS);
        fixture.script("reference", HOLDS);
        fixture
    }

    /// Returns a path below the directory.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Returns the text of a file.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Writes a file and creates its parent directories.
    pub fn write(&self, name: &str, text: &str) {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        fs::write(self.path(name), text).unwrap();
    }

    /// Replaces a program by a script.
    pub fn script(&self, program: &str, script: &str) {
        self.write(program, &format!("#!/bin/sh\n{SERVE}\n{script}\n"));
        fs::set_permissions(self.path(program), fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Writes an `mpirun` that starts one process for all ranks.
    pub fn script_mpirun(&self) {
        self.script("bin/mpirun", "export FAKE_RANKS=$2; shift 2; exec \"$@\"");
    }

    /// Links the tools that the scripts use into `bin`, for a `PATH` without anything else.
    pub fn link_tools(&self) {
        fs::create_dir_all(self.path("bin")).unwrap();
        for tool in ["dirname", "cp", "cat"] {
            std::os::unix::fs::symlink(format!("/usr/bin/{tool}"), self.path("bin").join(tool))
                .unwrap();
        }
    }

    /// Writes a catalogue of one case, `jet`, with a missing geometry.
    pub fn catalogue_with_absent_geometry(&self) {
        let catalogue = "[[case]]\nname = \"jet\"\nfile = \"jet.toml\"\nsize = \"small\"\n";
        self.write("root/geometries/catalogue.toml", catalogue);
        let case = "geometry = \"fetched/jet.stl\"\nspacing_min = 1.0\n";
        self.write("root/geometries/jet.toml", case);
    }

    fn write_tree(&self, name: &str, word: u64) {
        let digests = vec!["0".repeat(32); 512];
        let tree = if name == "base" { "base" } else { "final" };
        let manifest = json!({
            "schema": "octree-leaf-set/1", "program": "fixture", "tree": tree,
            "root": {"origin": [-32.0, -32.0, -32.0], "edge": 64.0},
            "level_surface": 0, "layer_cells_min": 4, "keep": "all", "keep_crossing": true, "boxes": [],
            "leaves": 0, "leaves_by_level": vec![0; 20],
            "leaves_by_side": {"outside": 0, "inside": 0, "crossing": 0},
            "components_ambiguous": {"count": 0, "example": null},
            "digest": digests[0], "octant_digests": digests, "parts": [],
        });
        let empty = LeafSet::new(serde_json::from_value(manifest).unwrap(), vec![]);
        let tree = empty.with_parts(vec![vec![word]]);
        fs::create_dir(self.path(name)).unwrap();
        tree.write(&self.path(name)).unwrap();
        self.write(&format!("{name}.digest"), &tree.manifest.digest.to_string());
    }

    /// Verifies the case on 2 and 3 ranks.
    pub fn verify(&self, options: &[&str]) -> Outcome {
        let case = self.path("case.toml");
        let ours = ["verify", case.to_str().unwrap(), "--ranks", "2,3", "--partitioners", "morton"];
        self.harness(&[&ours[..], &["--level-bases", "auto"], options].concat())
    }

    /// Runs the harness in the directory.
    pub fn harness(&self, arguments: &[&str]) -> Outcome {
        self.harness_on(&format!("{}:/usr/bin:/bin", self.path("bin").display()), arguments)
    }

    /// Runs the harness in the directory with this `PATH`.
    pub fn harness_on(&self, path: &str, arguments: &[&str]) -> Outcome {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(arguments).current_dir(self.0.path());
        if arguments.contains(&"verify") {
            command
                .arg("--mesher")
                .arg(self.path("mesher"))
                .arg("--reference")
                .arg(self.path("reference"));
        }
        command
            .env("PATH", path)
            .env("TMPDIR", self.path("tmp"))
            .env("HARNESS_ROOT", self.path("root"));
        let p4est = Some(self.path("p4est")).filter(|program| program.is_file());
        command.env("HARNESS_P4EST", p4est.unwrap_or("/nowhere/p4est".into()));
        let checker = Some(self.path("proof")).filter(|program| program.is_file());
        command.envs(checker.map(|program| ("HARNESS_PROVEN", program)));
        command.env("HARNESS_PYTHON", "/nowhere/python");
        command.env("GITHUB_STEP_SUMMARY", self.path("summary.md"));
        let output = command.output().unwrap();
        let printed =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        Outcome { code: output.status.code().unwrap_or(-1), printed }
    }

    /// Returns the remaining temporary files.
    pub fn temporary_files(&self) -> Vec<PathBuf> {
        entries(&self.path("tmp"))
    }
}

fn entries(directory: &Path) -> Vec<PathBuf> {
    fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect()
}
