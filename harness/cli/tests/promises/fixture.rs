//! A foreign mesher: a script that writes leaf words without a manifest, right or with a planted defect.
//!
//! The case is a cube of edge 3.4 in the middle of a root of edge 32, with cells of edge 1 and layers of three cells. The right
//! mesh has cells of edge 1 from 12 to 20 along every axis, around them cells of edge 2 from 4 to 28, and cells of edge 4
//! elsewhere.

use contract::npy;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::word::{self, Leaf, Side};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

/// Copies the mesh that the file `now` names; three names stand for a mesh that depends on something.
const ENGINE: &str = r#"#!/bin/sh
here=$(dirname "$0"); mesh=$(cat "$here/now")
case "$mesh" in
repetition) mesh=right; [ ! -e "$here/seen" ] || mesh=layers; touch "$here/seen" ;;
ranks) mesh=right; [ "$FAKE_RANKS" != 3 ] || mesh=layers ;;
partitioner) mesh=right; [ "$3" != metis ] || mesh=layers ;;
esac
mkdir -p "$2" && cp "$here/$mesh.npy" "$2/leaves-00000.npy"
"#;

const RUN: &str = r#"
[run]
serial = ["{here}/engine", "{case}", "{out}"]
parallel = ["{launcher}", "{here}/engine", "{case}", "{out}"]
partitioner = ["{partitioner}"]
"#;

const CASE: &str = "geometry = \"body.stl\"\nspacing_min = 1.0\nlayer_cells_min = 3\nkeep = \"all\"\n\
                    [root]\norigin = [0.0, 0.0, 0.0]\nedge = 32.0\n\
                    [[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [3.0, 3.0, 3.0]\nspacing = 4.0\n";

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
    /// Writes the case, the engine and all meshes.
    pub fn new() -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fixture.write("case.toml", CASE);
        fixture.write("body.stl", &cube(14.3, 17.7));
        fixture.write("gate.toml", "[[case]]\nname = \"case.toml\"\nlayers = [\"correctness\"]\n");
        fixture.script("engine", ENGINE);
        fixture.script("bin/mpirun", "#!/bin/sh\nexport FAKE_RANKS=$2; shift 2; exec \"$@\"\n");
        let right = words(&[]);
        let merged = |octants: &[[u32; 4]]| words(octants);
        let meshes = [
            ("right", right.clone()),
            ("complete", right[1..].to_vec()),
            ("surface", merged(&[[14, 14, 14, 2]])),
            ("boxes", merged(&[[0, 0, 0, 8]])),
            ("sides", [&[right[0] | Side::Inside as u64], &right[1..]].concat()),
            ("corner", merged(&[[8, 8, 8, 4]])),
            ("edge", merged(&[[8, 8, 12, 4]])),
            ("face", merged(&[[8, 12, 12, 4]])),
            ("layers", merged(&[[4, 4, 4, 4]])),
            ("layer-at-surface", merged(&[[12, 12, 12, 2]])),
        ];
        for (name, words) in meshes {
            npy::write(&fixture.path(&format!("{name}.npy")), &words).unwrap();
        }
        fixture
    }

    /// Lets the engine write this mesh, and promise this.
    pub fn engine(&self, mesh: &str, promises: &str) {
        let _ = fs::remove_file(self.path("seen"));
        self.write("now", mesh);
        self.write("foreign.toml", &format!("{RUN}[promises]\n{promises}\n"));
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

    fn script(&self, name: &str, text: &str) {
        self.write(name, text);
        fs::set_permissions(self.path(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Runs the harness in the directory.
    pub fn harness(&self, arguments: &str) -> Outcome {
        self.harness_with(&arguments.split(' ').collect::<Vec<_>>())
    }

    /// The same with arguments that may contain blanks.
    pub fn harness_with(&self, arguments: &[&str]) -> Outcome {
        let path = format!("{}:/usr/bin:/bin", self.path("bin").display());
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(arguments).current_dir(self.0.path());
        command.env("PATH", path).env("HARNESS_ROOT", self.0.path());
        command.env_remove("GITHUB_STEP_SUMMARY");
        let output = command.output().unwrap();
        let printed =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        Outcome { code: output.status.code().unwrap_or(-1), printed }
    }

    /// Verifies the engine on the case, without MPI unless the options select ranks.
    pub fn verify(&self, options: &str) -> Outcome {
        // The reference is not run for an engine that does not promise the definition, but it must exist.
        let common = "verify case.toml --engine foreign.toml --reference ./engine";
        self.harness(&format!("{common} --no-oracles --no-p4est {options}"))
    }
}

/// The leaf words of the right mesh with some octants merged into leaves. An octant is given by corner and edge.
fn words(merged: &[[u32; 4]]) -> Vec<u64> {
    const UNIT: u32 = CELLS_PER_EDGE / 32;
    let split = |octant: &Octant| {
        let ([x, y, z], edge) = (octant.corner.map(|c| c / UNIT), octant.edge() / UNIT);
        let within = |low, high| [x, y, z].iter().all(|&c| low <= c && c + edge <= high);
        let needed = edge > 4 || edge == 4 && within(4, 28) || edge == 2 && within(12, 20);
        needed && !merged.contains(&[x, y, z, edge])
    };
    let (mut words, mut stack) = (Vec::new(), vec![Octant::ROOT]);
    while let Some(octant) = stack.pop() {
        match split(&octant) {
            true => stack.extend((0..8).map(|digit| octant.child(digit))),
            // A mesh without sides: the code of every leaf is 0.
            false => words.push(word::encode(&Leaf { octant, side: Side::Outside })),
        }
    }
    words.sort_unstable();
    words
}

/// An STL file of a cube between two corners.
fn cube(low: f64, high: f64) -> String {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { high } else { low });
    let mut text = "solid cube\n".to_owned();
    for [a, b, c, d] in
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    {
        for facet in [[a, b, c], [a, c, d]] {
            text.push_str("facet normal 0 0 0\nouter loop\n");
            for [x, y, z] in facet.map(corner) {
                text.push_str(&format!("vertex {x} {y} {z}\n"));
            }
            text.push_str("endloop\nendfacet\n");
        }
    }
    text + "endsolid cube\n"
}
