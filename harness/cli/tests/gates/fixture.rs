//! A directory with a scripted engine, described by a TOML file like any other engine.

use contract::leafset::LeafSet;
use serde_json::json;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

/// A mesher whose mesh is wrong on three ranks or more if the body has vertices at 0.25 and at 0.5 and the cells are
/// smaller than 4, as if a halo had been dropped. Its counter `words` is the number of facets plus EXTRA.
const ENGINE: &str = r#"#!/bin/sh
here=$(dirname "$0")
case="$1"; ranks="$2"; shift 2
while [ $# -gt 0 ]; do
    case "$1" in
    --out) out="$2"; shift ;;
    --json) json="$2"; shift ;;
    esac
    shift
done
body="$(dirname "$case")/body.stl"
has() { LC_ALL=C grep -qaP "$1" "$body"; } # these bytes of an f32 number
mesh=right cells=1
if [ "$ranks" -ge 3 ] && has '\x00\x00\x80\x3e' && has '\x00\x00\x00\x3f' &&
    ! grep -qE '^spacing_min = ([4-9]|[1-9][0-9])' "$case"; then
    mesh=wrong cells=8
fi
[ -z "$out" ] || cp -r "$here/$mesh" "$out"
[ -z "$json" ] || printf '{"ranks": %s, "cells": %s, "digest": "%s", "counters": {"words": [%s, EXTRA]}}' \
    "$ranks" "$cells" "$(cat "$here/$mesh.digest")" $((($(wc -c <"$body") - 84) / 50)) > "$json"
"#;

const DESCRIPTION: &str = r#"
about = "a script"
program = "{here}/engine"
[run]
serial = ["{program}", "{case}", "1"]
simulated = ["{program}", "{case}", "{ranks}"]
out = ["--out", "{out}"]
json = ["--json", "{json}"]
"#;

const CASE: &str = "geometry = \"body.stl\"\nspacing_min = 1.0\nlayer_cells_min = 1\nkeep = \"all\"\n\
                    [root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";

/// How a run of the harness ended.
pub struct Outcome {
    /// Its exit code.
    pub code: i32,
    /// Its standard output and standard error.
    pub printed: String,
}

/// The directory, removed on drop.
pub struct Fixture(TempDir);

impl Fixture {
    /// Writes an engine and a case of 40 facets.
    pub fn new() -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fixture.write_tree("right", &[2]);
        let child = |digit: u64| digit << 61 | 1 << 2;
        fixture.write_tree("wrong", &(0..8).map(child).collect::<Vec<u64>>());
        fixture.engine("engine", 0);
        fixture.write("engine.toml", DESCRIPTION);
        fixture.write("harness/engines/reference.toml", DESCRIPTION);
        fixture.write("case.toml", CASE);
        let facet = |i: u32| {
            let x = f64::from(i) / 16.0;
            format!(
                "facet normal 0 0 0\nouter loop\nvertex {x} 0 0\nvertex {x} 1 0\nvertex {x} 0 1\nendloop\nendfacet\n"
            )
        };
        let facets: String = (0..40).map(facet).collect();
        fixture.write("body.stl", &format!("solid body\n{facets}endsolid body\n"));
        fixture.write(
            "gate.toml",
            "[[case]]\nname = \"case.toml\"\nlayers = [\"counters\"]\nranks = [2]\n",
        );
        fixture
    }

    /// Returns a path below the directory.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file and creates its parent directories.
    pub fn write(&self, name: &str, text: &str) {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        fs::write(self.path(name), text).unwrap();
    }

    /// Writes an engine that adds `words` to its counter.
    pub fn engine(&self, name: &str, words: u64) {
        self.program(name, &ENGINE.replace("EXTRA", &words.to_string()));
    }

    /// Writes a program.
    pub fn program(&self, name: &str, text: &str) {
        self.write(name, text);
        fs::set_permissions(self.path(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn write_tree(&self, name: &str, words: &[u64]) {
        let digests = vec!["0".repeat(32); 512];
        let manifest = json!({
            "schema": "octree-leaf-set/1", "program": "script", "tree": "final",
            "root": {"origin": [0.0, 0.0, 0.0], "edge": 8.0},
            "level_surface": 0, "layer_cells_min": 1, "keep": "all", "keep_crossing": true, "boxes": [],
            "leaves": 0, "leaves_by_level": vec![0; 20],
            "leaves_by_side": {"outside": 0, "inside": 0, "crossing": 0},
            "components_ambiguous": {"count": 0, "example": null},
            "digest": digests[0], "octant_digests": digests, "parts": [],
        });
        let empty = LeafSet::new(serde_json::from_value(manifest).unwrap(), vec![]);
        let tree = empty.with_parts(vec![words.to_vec()]);
        fs::create_dir(self.path(name)).unwrap();
        tree.write(&self.path(name)).unwrap();
        self.write(&format!("{name}.digest"), &tree.manifest.digest.to_string());
    }

    /// Runs the harness in the directory.
    pub fn harness(&self, arguments: &str) -> Outcome {
        self.harness_with(arguments, "HARNESS_ROOT", &self.path("").to_string_lossy())
    }

    /// Runs the harness in the directory, with a variable.
    pub fn harness_with(&self, arguments: &str, name: &str, value: &str) -> Outcome {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command
            .args(arguments.split(' '))
            .current_dir(self.0.path())
            .env("HARNESS_ROOT", self.0.path())
            .env("XDG_CACHE_HOME", self.path("cache"))
            .env(name, value);
        command.env_remove("GITHUB_STEP_SUMMARY");
        let output = command.output().unwrap();
        let printed =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        Outcome { code: output.status.code().unwrap_or(-1), printed }
    }
}
