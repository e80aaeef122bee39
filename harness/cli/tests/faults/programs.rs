//! The commands that faults are injected into, their input, and the files that they write.

use crate::place::{Files, HANGS, Place};
use crate::tools::{HARNESS, mpirun, program};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// A command.
pub struct Program {
    /// Its name in the table.
    pub name: &'static str,
    /// Its arguments, after the program.
    arguments: String,
    kind: Kind,
    /// What it writes: files, which it replaces, and directories, which do not exist before.
    pub outputs: &'static [&'static str],
    /// Outputs that differ from run to run, as they contain times.
    pub varying: &'static [&'static str],
    /// Exit code without a fault.
    pub code: i32,
    /// Documented exit codes of a run that cannot read or write a file.
    pub refusals: &'static [i32],
    /// Whether it may lose an old output that it is replacing, or keeps the files of a case that fails.
    pub leaves: Leaves,
    /// What every line on its standard error begins with; none if a table on the standard output states what failed.
    pub prefix: Option<&'static str>,
}

/// What may be there after a failure, besides output that is as before or complete.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Leaves {
    /// Nothing.
    Nothing,
    /// Neither the old nor the new output: they have several files.
    NoOutput,
    /// Complete files below the output, such as those of a case that fails.
    Files,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mesher,
    /// The mesher on MPI ranks, of which this one has the fault.
    Rank(usize),
    Reference,
    Harness,
}

/// Facets of a tetrahedron.
const FACETS: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
const ROOT: &str = "[root]\norigin = [-1.5, -1.5, -1.5]\nedge = 4.0\n";
/// Time for a run of one process, and for a job of MPI, on a busy machine.
const LIMIT: Duration = HANGS;
const LIMIT_MPI: Duration = HANGS;

/// A binary STL file with the first facets of the tetrahedron.
fn stl(facets: usize) -> Vec<u8> {
    let corner = |i: usize| [1, 2, 3].map(|axis| if i == axis { 1.0f32 } else { 0.0 });
    let mut bytes = [vec![0; 80], (facets as u32).to_le_bytes().to_vec()].concat();
    for facet in &FACETS[..facets] {
        bytes.extend([0; 12]);
        bytes.extend(facet.iter().flat_map(|&i| corner(i)).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A place with the input of all programs: cases, meshes, a history, and old output.
///
/// # Panics
/// If the mesher makes no mesh.
pub fn inputs(mesher: &Path) -> Place {
    let place = Place::new();
    place.write("body.stl", stl(4));
    place.write("open.stl", stl(3));
    for (case, body, spacing) in [("case.toml", "body.stl", 0.3), ("open.toml", "open.stl", 0.1)] {
        let text =
            format!("geometry = \"{body}\"\nspacing_min = {spacing}\nkeep = \"all\"\n{ROOT}");
        place.write(case, text);
    }
    place.write(
        "gate.toml",
        "[[case]]\nname = \"case.toml\"\nlayers = [\"counters\"]\nranks = [2]\n",
    );
    let record = |digit: &str, value: f64| {
        let commit = digit.repeat(40);
        format!(
            "{{\"schema\":\"octree-track/1\",\"commit\":\"{commit}\",\"metrics\":{{\"case/x\":{value}}}}}\n"
        )
    };
    place.write("history.jsonl", [record("a", 1.0), record("b", 2.0)].concat());
    let of = "{\"named\":\"m\",\"revision\":null,\"program\":\"\"}";
    let numbers = "{\"case\":{\"digest\":null,\"exact\":{\"x\":3},\"counted\":{}}}";
    let record = format!(
        "{{\"schema\":\"octree-measures/1\",\"of\":{of},\"machine\":\"\",\"cases\":{numbers}}}"
    );
    place.write("record.json", record);
    let mut command = Command::new(mesher);
    command.args("case.toml --out mesh --write words,htg --comm sim:2:1 --quiet".split(' '));
    let made = place.run(command, LIMIT);
    assert_eq!(made.code, Some(0), "{made:?}");
    let mut command = Command::new(HARNESS);
    command.args(["export", "mesh", "forest.p8est"]);
    assert_eq!(place.run(command, LIMIT).code, Some(0));
    place
}

impl Program {
    /// The command, run under these arguments of the injector.
    pub fn command(&self, injector: &Path, arguments: &[&str], place: &Place) -> Command {
        let tested = match self.kind {
            Kind::Mesher | Kind::Rank(_) => program("mesher").expect("it was built"),
            Kind::Reference => program("reference").expect("it was built"),
            Kind::Harness => PathBuf::from(HARNESS),
        };
        let mut command = match self.kind {
            Kind::Rank(rank) => {
                let mut command = mpirun(2);
                command.arg(injector).env("INJECT_RANK", rank.to_string());
                command
            }
            _ => {
                let mut command = Command::new(injector);
                // MPI keeps files of its own in the temporary directory.
                command.env("TMPDIR", place.path().join(crate::place::TMP));
                command
            }
        };
        command.args(arguments).arg(tested).args(self.arguments.split(' '));
        command
    }

    /// The time in which a run ends.
    pub fn limit(&self) -> Duration {
        if self.is_parallel() { LIMIT_MPI } else { LIMIT }
    }

    /// Whether it is a job of MPI.
    pub fn is_parallel(&self) -> bool {
        matches!(self.kind, Kind::Rank(_))
    }

    /// The input, with old output in place of the files that it replaces.
    pub fn before(&self, inputs: &Files) -> Files {
        let mut files = inputs.clone();
        // An export replaces no surface.
        let is_replaced = |name: &&&str| name.contains('.') && !name.ends_with(".stl");
        for name in self.outputs.iter().filter(is_replaced) {
            files.entry(name.into()).or_insert_with(|| Some(b"old\n".to_vec()));
        }
        files
    }

    /// The output that a path belongs to.
    pub fn output_of(&self, path: &Path) -> Option<&'static str> {
        self.outputs.iter().copied().find(|output| path.starts_with(output))
    }
}

fn new(
    name: &'static str,
    kind: Kind,
    arguments: impl Into<String>,
    outputs: &'static [&'static str],
) -> Program {
    let (prefix, refusals): (_, &[i32]) = match kind {
        Kind::Mesher | Kind::Rank(_) => ("mesher: ", &[2, 4]),
        Kind::Reference => ("error: ", &[2, 4]),
        Kind::Harness => ("harness: ", &[2]),
    };
    let arguments = arguments.into();
    let prefix = Some(prefix);
    Program {
        name,
        arguments,
        kind,
        outputs,
        varying: &[],
        code: 0,
        refusals,
        prefix,
        leaves: Leaves::Nothing,
    }
}

/// All programs. `with_mpi` adds those that run on MPI ranks.
pub fn all(with_mpi: bool) -> Vec<Program> {
    use Kind::{Harness, Mesher, Rank, Reference};
    let mesh = "case.toml --out out --json run.json --write words,htg --quiet";
    let [mesher, reference] = ["mesher", "reference"]
        .map(|name| program(name).expect("it was built").display().to_string());
    let verify = format!(
        "verify case.toml --no-mpi --no-oracles --no-p4est --out report --mesher {mesher} --reference {reference}"
    );
    let gate = format!(
        "gate --rules gate.toml --layers counters --record r.json --junit g.xml --json g.json --markdown g.md --baseline {mesher} --mesher {mesher}"
    );
    let track = "track history.jsonl --add record.json --repository";
    let repository = env!("CARGO_MANIFEST_DIR");
    let mut all = vec![
        Program { varying: &["run.json"], ..new("mesher", Mesher, mesh, &["out", "run.json"]) },
        Program {
            varying: &["run.json"],
            ..new(
                "reference",
                Reference,
                "case.toml --out out --json run.json",
                &["out", "run.json"],
            )
        },
        new("export .vtu", Harness, "export mesh a.vtu", &["a.vtu"]),
        new("export .vtkhdf", Harness, "export mesh a.vtkhdf", &["a.vtkhdf"]),
        new("export .p8est", Harness, "export mesh a.p8est", &["a.p8est"]),
        new(
            "export polyMesh",
            Harness,
            "export mesh foam/constant/polyMesh",
            &["foam/constant/polyMesh"],
        ),
        new("import .vtkhdf", Harness, "import mesh/mesh.vtkhdf --sides side --out out", &["out"]),
        new(
            "import .p8est",
            Harness,
            "import forest.p8est --root=-1.5,-1.5,-1.5,4 --out out",
            &["out"],
        ),
        Program {
            varying: &["report"],
            leaves: Leaves::Files,
            refusals: &[1, 2, 3],
            prefix: None,
            ..new("verify", Harness, verify, &["report"])
        },
        new(
            "track",
            Harness,
            format!("{track} {repository} --page t.html --junit t.xml --json t.json"),
            &["history.jsonl", "t.html", "t.xml", "t.json"],
        ),
        Program {
            varying: &["r.json", "g.xml", "g.json", "g.md"],
            refusals: &[1, 2, 3],
            prefix: None,
            ..new("gate --record", Harness, gate, &["r.json", "g.xml", "g.json", "g.md"])
        },
        Program {
            code: 1,
            refusals: &[1, 2, 3],
            ..new(
                "leak",
                Harness,
                format!("leak open.toml --from 0.3,0.2,0.2 --json l.json --mesher {mesher}"),
                &["l.json"],
            )
        },
        new("picture .svg", Harness, "picture mesh --case case.toml --out p.svg", &["p.svg"]),
        new("export .vtp", Harness, "export mesh n.vtp", &["n.vtp"]),
        new("export .stl", Harness, "export mesh n.stl", &["n.stl"]),
        Program {
            varying: &["a.json"],
            refusals: &[1, 2],
            prefix: None,
            ..new("audit", Harness, "audit mesh --json a.json", &["a.json"])
        },
        new("diff", Harness, "diff mesh mesh", &[]),
    ];
    if with_mpi {
        for (name, rank) in [("mesher, rank 0 of 2", 0), ("mesher, rank 1 of 2", 1)] {
            let job = new(name, Rank(rank), mesh, &["out", "run.json"]);
            all.push(Program { varying: &["run.json"], ..job });
        }
    }
    all
}
