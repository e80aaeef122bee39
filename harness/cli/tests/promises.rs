//! Promises of a foreign mesher: every one is shown to fail on a defect that breaks it, and nothing else is checked.
//!
//! The mesher is a script that writes leaf words without a manifest, right or with a planted defect.
//!
//! The case is a cube of edge 3.4 in the middle of a root of edge 32, with cells of edge 1 and layers of three cells. The right
//! mesh has cells of edge 1 from 12 to 20 along every axis, around them cells of edge 2 from 4 to 28, and cells of edge 4
//! elsewhere.

use contract::npy;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::word::{self, Side};
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
struct Outcome {
    /// Its exit code.
    code: i32,
    /// Its standard output and standard error.
    printed: String,
}

/// The directory, removed on drop.
struct Fixture(TempDir);

impl Fixture {
    /// Writes the case, the engine and all meshes.
    fn new() -> Self {
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
    fn engine(&self, mesh: &str, promises: &str) {
        let _ = fs::remove_file(self.path("seen"));
        self.write("now", mesh);
        self.write("foreign.toml", &format!("{RUN}[promises]\n{promises}\n"));
    }

    /// Returns a path below the directory.
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file and creates its parent directories.
    fn write(&self, name: &str, text: &str) {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        fs::write(self.path(name), text).unwrap();
    }

    fn script(&self, name: &str, text: &str) {
        self.write(name, text);
        fs::set_permissions(self.path(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Runs the harness in the directory.
    fn harness(&self, arguments: &str) -> Outcome {
        self.harness_with(&arguments.split(' ').collect::<Vec<_>>())
    }

    /// The same with arguments that may contain blanks.
    fn harness_with(&self, arguments: &[&str]) -> Outcome {
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
    fn verify(&self, options: &str) -> Outcome {
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
            false => words.push(word::encode(octant, Side::Outside)),
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

/// A defect of the mesh, a promise that it breaks, and the check that must report it.
const BROKEN: [(&str, &str, &str); 9] = [
    ("complete", "complete = true", "complete"),
    ("surface", "surface = { tolerance_cells = 0.0 }", "surface"),
    ("boxes", "boxes = true", "boxes"),
    ("sides", "sides = { band_cells = 6.0 }", "sides"),
    ("corner", "balance = 'corner'", "balance"),
    ("edge", "balance = 'edge'", "balance"),
    ("face", "balance = 'face'", "balance"),
    ("layers", "layers = true", "layer"),
    ("layer-at-surface", "layers = true", "layer"),
];

/// Everything that the right mesh keeps.
const ALL: &str = "complete = true\nsurface = { tolerance_cells = 0.0 }\nboxes = true\n\
                   sides = { band_cells = 6.0 }\nbalance = 'corner'\nlayers = true\ndeterministic = true\n\
                   independent_of = ['ranks', 'partitioner']";

fn failed(outcome: &Outcome, check: &str) -> bool {
    outcome.code == 1 && outcome.printed.contains(check)
}

#[test]
fn a_mesh_that_keeps_every_promise_passes_every_command() {
    let fixture = Fixture::new();
    fixture.engine("right", ALL);
    let verified = fixture.verify("--ranks 2,3 --out out --keep --require mpi,checks");
    assert_eq!(verified.code, 0, "{}", verified.printed);
    assert!(verified.printed.contains("0 fail, 0 left out"), "{}", verified.printed);
    // Two partitioners on two rank counts; the base level cannot be chosen.
    for layout in ["ranks-2-metis", "ranks-3-morton"] {
        assert!(fixture.path("out/case").join(layout).is_dir(), "{layout}");
    }
    let mesh = "out/case/serial/mesh";
    for command in [
        format!("audit {mesh} --promises foreign.toml --case case.toml --require-checks"),
        "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine --require-layers".to_owned(),
        "shrink case.toml --engine foreign.toml --test-only".to_owned(),
    ] {
        let outcome = fixture.harness(&command);
        assert_eq!(outcome.code, 0, "{command}: {}", outcome.printed);
    }
}

#[test]
fn every_broken_promise_is_reported_by_verify_audit_gate_and_shrink() {
    let fixture = Fixture::new();
    for (mesh, promise, check) in BROKEN {
        fixture.engine(mesh, promise);
        let verified = fixture.verify("--no-mpi --out out");
        assert!(failed(&verified, &format!("serial: {check}: ")), "{mesh}: {}", verified.printed);
        assert!(verified.printed.contains(" 1 fail, "), "{mesh}: {}", verified.printed);
        let audit = "audit out/case/serial/mesh --promises foreign.toml --case case.toml";
        let audited = fixture.harness(audit);
        assert!(failed(&audited, "finding"), "{mesh}: {}", audited.printed);
        let gate = "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine";
        let gated = fixture.harness(gate);
        assert!(failed(&gated, &format!("serial: {check}")), "{mesh}: {}", gated.printed);
        let shrink = "shrink case.toml --engine foreign.toml --test-only";
        let probed = fixture.harness(shrink);
        assert!(failed(&probed, &format!("{check}: serial: ")), "{mesh}: {}", probed.printed);
    }
}

#[test]
fn what_is_not_promised_is_not_checked() {
    let fixture = Fixture::new();
    for (mesh, _, check) in BROKEN {
        let promise =
            if check == "balance" { "complete = true" } else { "balance = 'face'\nratio = 4" };
        fixture.engine(mesh, promise);
        let verified = fixture.verify("--no-mpi");
        assert_eq!(verified.code, 0, "{mesh}: {}", verified.printed);
    }
    // A corner or an edge is no face.
    for mesh in ["corner", "edge"] {
        fixture.engine(mesh, "balance = 'face'");
        assert_eq!(fixture.verify("--no-mpi").code, 0, "{mesh}");
    }
}

/// A check without an object does not hold.
#[test]
fn a_promise_about_nothing_is_not_kept() {
    let fixture = Fixture::new();
    let nothing = |promise: &str, why: &str| {
        fixture.engine("right", promise);
        let verified = fixture.verify("--no-mpi --require checks");
        assert_eq!(verified.code, 3, "{promise}: {}", verified.printed);
        assert!(verified.printed.contains(why), "{promise}: {}", verified.printed);
    };
    fixture.write(
        "case.toml",
        &CASE.replace("[0.0, 0.0, 0.0]\nmax = [3.0", "[40.0, 0.0, 0.0]\nmax = [43.0"),
    );
    nothing("boxes = true", "no leaf meets a box of the case");
    // A box in a hole.
    fixture.write("case.toml", CASE);
    npy::write(&fixture.path("right.npy"), &words(&[])[1..]).unwrap();
    nothing("boxes = true", "no leaf meets a box of the case");
    fixture.write("case.toml", &CASE.replace("keep = \"all\"", "keep_crossing = false"));
    // The deleted leaves of T0 at the surface are finer.
    npy::write(&fixture.path("right.npy"), &[word::encode(Octant::ROOT, Side::Outside)]).unwrap();
    nothing("balance = 'face'", "all leaves have level 0");
    let simulated = "simulated = [\"env\", \"RANKS={ranks}\", ";
    fixture.write("simulated.toml", &FOREST.replace("parallel = [\"{launcher}\", ", simulated));
    copying(&fixture, "unitcube");
    let verified = fixture.harness("verify case.toml --engine simulated.toml");
    let is_named = verified.printed.contains("has no command `parallel`");
    assert_eq!((verified.code, is_named), (3, true), "{}", verified.printed);
}

/// The mesh on each number of ranks is checked if it may be another one.
#[test]
fn promises_are_checked_on_every_number_of_ranks_that_is_timed() {
    let fixture = Fixture::new();
    fixture.engine("ranks", "layers = true");
    let series = "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\nengines = ['foreign.toml']\nmpi = [2, 3]\n";
    fixture.write("study.toml", series);
    let bench = "bench study.toml --record record.jsonl --mesher ./engine --repeat 1";
    let measured = fixture.harness(bench);
    assert_eq!(measured.code, 1, "{}", measured.printed);
    let record = fs::read_to_string(fixture.path("record.jsonl")).unwrap();
    let failed: Vec<&str> = record.lines().filter(|line| line.contains("\"failure\"")).collect();
    assert_eq!(failed.len(), 1, "{record}");
    assert!(failed[0].contains("breaks the promise layer"), "{record}");
    assert!(
        record.lines().filter(|line| line.contains("\"kind\":\"run\"")).count() == 2,
        "{record}"
    );
}

#[test]
fn a_mesh_that_depends_on_what_it_must_not_is_reported() {
    let fixture = Fixture::new();
    fixture.engine("repetition", "deterministic = true");
    let repeated = fixture.verify("--no-mpi");
    assert!(failed(&repeated, "deterministic: two serial runs differ"), "{}", repeated.printed);
    let command = format!(" --engine {} ", fixture.path("foreign.toml").display());
    assert!(repeated.printed.contains(&command), "{}", repeated.printed);
    for (of, subject) in [("ranks", "3 ranks"), ("partitioner", "metis")] {
        fixture.engine(of, &format!("independent_of = ['{of}', 'ranks']"));
        let verified = fixture.verify("--ranks 2,3");
        let reported = failed(&verified, "identical: first difference");
        assert!(reported && verified.printed.contains(subject), "{of}: {}", verified.printed);
    }
    // Ranks of an engine that does not promise to be independent of them have to keep the other promises only.
    fixture.engine("ranks", "balance = 'corner'");
    let verified = fixture.verify("--ranks 2,3");
    assert_eq!(verified.code, 0, "{}", verified.printed);
    fixture.engine("ranks", "layers = true");
    let verified = fixture.verify("--ranks 2,3");
    assert!(failed(&verified, "3 ranks: layer: "), "{}", verified.printed);
}

/// An engine that copies a forest of p4est, and whose run report, of rank 0 alone, has neither a digest nor a number of ranks.
const FOREST: &str = r#"
[run]
serial = ["sh", "{here}/copy", "{case}"]
parallel = ["{launcher}", "sh", "{here}/copy", "{case}"]
out = ["{out}.p8est"]
json = ["{json}"]
format = "p4est"
[promises]
complete = true
balance = "corner"
deterministic = true
independent_of = ["ranks"]
"#;

fn copying(fixture: &Fixture, sample: &str) {
    let samples = format!("{}/../contract/tests/samples", env!("CARGO_MANIFEST_DIR"));
    let cells =
        std::fs::read_to_string(format!("{samples}/{sample}.csv")).unwrap().lines().count() - 1;
    let script = format!(
        "echo run >> ${{0%/*}}/seen\nfor file; do case $file in *.p8est) cp {samples}/{sample}.p8est $file ;; \
         *.json) echo '{{\"cells\": {cells}}}' > $file ;; esac; done\n"
    );
    fixture.write("copy", &script);
}

#[test]
fn an_engine_in_a_format_of_its_own_needs_neither_digest_nor_ranks() {
    let fixture = Fixture::new();
    fixture.write("forest.toml", FOREST);
    copying(&fixture, "unitcube");
    let verify = "verify case.toml --engine forest.toml --ranks 2,3";
    let verified = fixture.harness(verify);
    assert_eq!(verified.code, 0, "{}", verified.printed);
    assert!(verified.printed.contains("0 fail, 0 left out"), "{}", verified.printed);
    assert!(verified.printed.contains("no run report states `ranks`"), "{}", verified.printed);
    // What it does not promise needs no oracle, and its time is the harness's.
    assert!(!verified.printed.contains("oracles"), "{}", verified.printed);
    let serial = verified.printed.lines().find(|line| line.contains(" serial ")).unwrap();
    assert_eq!(serial.split_whitespace().nth(8), Some("-"), "{serial}");
    // This forest is in another place than the case, and is not moved.
    copying(&fixture, "brick");
    let verified = fixture.harness(verify);
    assert!(failed(&verified, "wrote a mesh that cannot be imported: "), "{}", verified.printed);
    assert!(verified.printed.contains("states the root"), "{}", verified.printed);
    fixture.write("forest.toml", &FOREST.replace("[\"{out}.p8est\"]", "[\"{out}.json\"]"));
    let unwritten = fixture.harness(verify);
    assert!(failed(&unwritten, "wrote a mesh that cannot be imported: "), "{}", unwritten.printed);
    fixture.write("forest.toml", &FOREST.replace("[\"{out}.p8est\"]", "[\"-\", \"{out}.p8es\"]"));
    std::fs::remove_file(fixture.path("seen")).unwrap();
    fixture.write("case.toml", "spacing_min = 'fine'\n");
    let refused = fixture.harness(verify);
    assert_eq!((refused.code, fixture.path("seen").exists()), (2, false), "{}", refused.printed);
    let why = "case.toml: line 1, spacing_min: invalid type: string \"fine\", expected a number; for example spacing_min = 0.01";
    assert!(refused.printed.contains(why), "{}", refused.printed);
}

/// A run without a run report writes its mesh, also where its instructions are counted.
#[test]
fn instructions_are_counted_of_an_engine_in_a_format_of_its_own() {
    let fixture = Fixture::new();
    fixture.write("gate.toml", "[[case]]\nname = \"case.toml\"\nlayers = [\"instructions\"]\n");
    copying(&fixture, "unitcube");
    fixture.write("forest.toml", &FOREST.replace("json = [\"{json}\"]\n", ""));
    let gate = "gate --engine forest.toml --rules gate.toml";
    let counted = fixture.harness(gate);
    let is_left_out = counted.printed.contains("valgrind is not on the PATH");
    assert!(counted.code == 0 || is_left_out, "{}", counted.printed);
    // A failure of valgrind alone is called so.
    fixture.write("forest.toml", FOREST);
    fixture.script("bin/valgrind", "#!/bin/sh\necho out of order >&2\nexit 9\n");
    let failed = fixture.harness(gate);
    let why = "valgrind ended with code 9: out of order";
    assert!(failed.printed.contains(why), "{}", failed.printed);
}

/// Its name in results is the path, and the files of its runs lie with all others.
#[test]
fn an_engine_file_may_have_the_name_of_ours() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true");
    let engine = RUN.replace("{here}/engine", "{here}/../engine");
    fixture.write("own/mesher.toml", &format!("{engine}[promises]\ncomplete = true\n"));
    let absolute = fixture.path("own/mesher.toml");
    for name in ["own/mesher.toml", absolute.to_str().unwrap()] {
        let verify = format!("verify case.toml --engine {name} --reference ./engine --no-mpi");
        let outcome = fixture.harness(&verify);
        assert_eq!(outcome.code, 0, "{}", outcome.printed);
        assert_eq!(fs::read_dir(fixture.path("own")).unwrap().count(), 1, "{name}");
    }
}

/// As the interpreter of a virtual environment, which is a link to that of the system.
#[test]
fn a_program_that_is_a_link_is_started_under_its_own_name() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true");
    let by_name = ENGINE.replace("here=", "[ \"${0##*/}\" = alias ] || exit 9\nhere=");
    fixture.script("engine", &by_name);
    std::os::unix::fs::symlink("engine", fixture.path("alias")).unwrap();
    let outcome = fixture.verify("--no-mpi --mesher alias");
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
}

#[test]
fn promises_can_be_given_on_the_command_line() {
    let fixture = Fixture::new();
    fixture.engine("corner", "complete = true");
    assert_eq!(fixture.verify("--no-mpi --out out --keep").code, 0);
    let audit = |promises: &str| {
        let words =
            ["audit", "out/case/serial/mesh", "--case", "case.toml", "--promises", promises];
        fixture.harness_with(&words)
    };
    let outcome = audit("complete = true, balance = 'edge'");
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    let outcome = audit("balance = 'corner'");
    assert!(failed(&outcome, "finding"), "{}", outcome.printed);
    let outcome = audit("balance = corner");
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("for example"), "{}", outcome.printed);
}

#[test]
fn shrinking_keeps_the_named_check_and_no_other() {
    let fixture = Fixture::new();
    fixture
        .engine("corner", "surface = { tolerance_cells = 0.0 }\nbalance = 'corner'\nlayers = true");
    let passed = fixture.harness("shrink case.toml --engine foreign.toml --check surface");
    assert_eq!(passed.code, 0, "{}", passed.printed);
    assert!(passed.printed.contains("does not fail surface"), "{}", passed.printed);
    // The imbalance does not depend on the body, nor does a layer of one cell, which it is.
    for check in ["balance", "layer"] {
        let shrink =
            format!("shrink case.toml --engine foreign.toml --check {check} --out {check}");
        let outcome = fixture.harness(&shrink);
        assert!(failed(&outcome, &format!("{check}: serial: ")), "{}", outcome.printed);
        let case = std::fs::read_to_string(fixture.path(check).join("case.toml")).unwrap();
        assert!(case.contains("layer_cells_min = 1"), "{check}: {case}");
        let repeat =
            format!("shrink {check}/case.toml --engine foreign.toml --test-only --check {check}");
        assert_eq!(fixture.harness(&repeat).code, 1, "{check}");
    }
}

#[test]
fn a_case_that_the_engine_declines_is_left_out_by_every_command() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true\n[limits]\nlevel_max = 4");
    let why = "foreign.toml does not support level 5 (level_max in [limits])";
    let gate =
        "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine";
    let verify = "verify case.toml --engine foreign.toml --reference ./engine --no-oracles --no-p4est --no-mpi";
    fixture.write("mesh/empty", "");
    let audit = "audit mesh --promises foreign.toml --case case.toml";
    for (command, require) in
        [(gate, "--require-layers"), (verify, "--require checks"), (audit, "--require-checks")]
    {
        let outcome = fixture.harness(command);
        // Of the cases of the gate's rules, none was named.
        let code = if command == gate { [0, 3] } else { [3, 3] };
        assert!(code.contains(&outcome.code), "{command}: {}", outcome.printed);
        let green =
            ["all hold", "nothing got worse"].iter().any(|text| outcome.printed.contains(text));
        assert!(!green && outcome.printed.contains(why), "{command}: {}", outcome.printed);
        let required = fixture.harness(&format!("{command} {require}"));
        assert_eq!(required.code, 3, "{command} {require}: {}", required.printed);
    }
    for command in ["shrink case.toml", "why case.toml 1,1,1", "picture case.toml --out a.svg"] {
        let outcome = fixture.harness(&format!("{command} --engine foreign.toml"));
        assert_eq!((outcome.code, outcome.printed.contains(why)), (3, true), "{}", outcome.printed);
    }
}

#[test]
fn a_digest_is_a_claim_about_leaves() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true\ndeterministic = true");
    assert_eq!(fixture.verify("--no-mpi --out out --keep").code, 0);
    // From now on the first run writes another side under the same manifest.
    let copy = "cp -r \"$here/out/case/serial/mesh/.\" \"$2\"";
    let lie = "[ -e \"$here/seen\" ] || cp \"$here/sides.npy\" \"$2/leaves-00000.npy\"; touch \"$here/seen\"";
    fixture.script(
        "engine",
        &format!("#!/bin/sh\nhere=$(dirname \"$0\"); mkdir -p \"$2\"\n{copy}\n{lie}\n"),
    );
    let verified = fixture.verify("--no-mpi");
    assert!(failed(&verified, "serial: deterministic: first difference"), "{}", verified.printed);
}

#[test]
fn what_could_not_be_tried_is_not_green() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true");
    let engine = fs::read_to_string(fixture.path("foreign.toml")).unwrap();
    fixture.script("copy", "#!/bin/sh\ncp \"$0\" \"$2\"\n");
    for (engine, why) in [
        (
            engine
                .replace("engine\", \"{case}\", \"{out}", "copy\", \"{case}\", \"{out}.vtu")
                .replace("[run]", "[run]\nformat = 'vtk'"),
            "which needs Python at ",
        ),
        (engine.replace("{here}/engine", "{here}/case.toml"), "cannot be started: "),
    ] {
        fixture.write("foreign.toml", &engine);
        let outcome = fixture.verify("--no-mpi");
        let is_named = outcome.printed.contains(why);
        assert_eq!((outcome.code, is_named), (3, true), "{engine}{}", outcome.printed);
    }
}
