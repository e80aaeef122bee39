//! The program as a process: version, plain output and exit codes; and signals, which end every command, whatever it does, with
//! exit code 130, so that no process and no temporary file remains.

use contract::leafset::LeafSet;
use contract::testing::{leaf_set, words_of};
use serde_json::json;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;
use tempfile::TempDir;

/// A case whose diagnosis is printed at once.
const CUBE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../geometries/cube-small.toml");

fn harness(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_harness")).args(arguments).output().unwrap()
}

fn printed(arguments: &[&str]) -> String {
    let output = harness(arguments);
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_version_names_the_commit_if_git_is_available() {
    let version = printed(&["--version"]);
    let plain = format!("harness {}", env!("CARGO_PKG_VERSION"));
    assert!(version.starts_with(&plain), "{version}");
    let described = Command::new("git").args(["rev-parse", "--short=12", "HEAD"]).output();
    if described.is_ok_and(|output| output.status.success()) {
        let commit = version.trim().strip_prefix(&format!("{plain} (")).unwrap();
        let commit = commit.strip_suffix(')').unwrap().trim_end_matches("-dirty");
        let hash = commit.rsplit("-g").next().unwrap();
        assert!(hash.len() >= 12 && hash.chars().all(|c| c.is_ascii_hexdigit()), "{version}");
    }
}

#[test]
fn output_to_a_file_has_no_colours() {
    for output in [harness(&["--help"]), harness(&["verify", "--ranks", "0"])] {
        assert!(![output.stdout, output.stderr].concat().contains(&0x1b));
    }
}

/// A bug and exhausted memory end the harness with one message, and without temporary files.
#[test]
fn a_fault_of_the_harness_has_an_exit_code_and_one_message() {
    for (fault, code, words) in [
        ("panic", 70, &["panicked at", "a fault that was asked for", "harness: this is a bug"][..]),
        ("thread", 70, &["panicked at", "a fault that was asked for", "harness: this is a bug"]),
        ("memory", 71, &["harness: memory ran out at a request for 4611686018427387904 bytes"]),
    ] {
        let place = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(["planted", "--fault", fault]);
        command.env("TMPDIR", place.path()).env("RUST_BACKTRACE", "0");
        let output = command.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{fault}: {stderr}");
        assert!(words.iter().all(|word| stderr.matches(word).count() == 1), "{stderr}");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0, "{fault}");
    }
}

/// Writes a mesh of these words in which nothing requires refinement.
fn write_mesh(words: Vec<u64>, to: &Path) {
    let digests = vec!["0".repeat(32); 512];
    let manifest = json!({
        "schema": "octree-leaf-set/1", "program": "test", "tree": "final",
        "root": {"origin": [-1.0, -1.0, -1.0], "edge": 2.0},
        "level_surface": 0, "layer_cells_min": 1, "keep": "all", "keep_crossing": true, "boxes": [],
        "leaves": 0, "leaves_by_level": vec![0; 20],
        "leaves_by_side": {"outside": 0, "inside": 0, "crossing": 0},
        "components_ambiguous": {"count": 0, "example": null},
        "digest": digests[0], "octant_digests": digests, "parts": [],
    });
    let empty = LeafSet::new(serde_json::from_value(manifest).unwrap(), vec![]);
    fs::create_dir(to).unwrap();
    empty.with_parts(vec![words]).write(to).unwrap();
}

#[test]
fn why_answers_for_a_directory() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
    let least = path("least");
    write_mesh(vec![0], Path::new(&least));
    let answer = printed(&["why", &least, "-0.5,0,0.25"]);
    assert!(answer.contains("lies in the outside leaf octant root (level 0)"), "{answer}");
    let audit = harness(&["audit", &least, "--timeout", "9"]);
    let message = String::from_utf8(audit.stderr).unwrap();
    assert!(message.contains("has a manifest") && audit.status.code() == Some(2), "{message}");
    let nowhere = place.path().to_str().unwrap();
    for wrong in [&[&least[..], "9,0,0"][..], &[&least, "1,2"], &[&least], &[nowhere, "0,0,0"]] {
        let output = harness(&[&["why"], wrong].concat());
        assert_eq!(output.status.code(), Some(2), "{wrong:?}: {output:?}");
    }
}

#[test]
fn a_closed_pipe_ends_the_printing_and_not_the_command() {
    let script =
        format!("set -o pipefail; {} geometry {CUBE} | true", env!("CARGO_BIN_EXE_harness"));
    for _ in 0..5 {
        let ended = Command::new("bash").args(["-c", &script]).output().unwrap();
        assert_eq!((ended.status.code(), ended.stderr), (Some(0), Vec::new()));
    }
}

#[test]
fn output_that_cannot_be_written_is_an_exit_code() {
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let ended = command.args(["geometry", CUBE]).stdout(full()).output().unwrap();
    assert_eq!(ended.status.code(), Some(4));
    let message = String::from_utf8(ended.stderr).unwrap();
    assert!(message.contains("standard output cannot be written"), "{message}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let ended = command.args(["track", "missing.jsonl"]).stderr(full()).status().unwrap();
    assert_eq!(ended.code(), Some(2));
    // A finding comes first.
    let open = concat!(env!("CARGO_MANIFEST_DIR"), "/../../geometries/cube_open.stl");
    let ended = harness(&["geometry", open, "--json", "/dev/full"]);
    let message = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(1) && message.contains("/dev/full"), "{message}");
}

#[test]
fn what_cannot_be_meant_is_invalid_input() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("f.json");
    fs::write(&file, "no record").unwrap();
    let fifo = place.path().join("fifo.toml");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let [directory, file, fifo] = [place.path(), &file, &fifo].map(|path| path.to_str().unwrap());
    for (arguments, why) in [
        (&["track", "missing.jsonl"][..], "missing.jsonl is missing"),
        (&["track", file, "--alpha", "7"], "a number from 0.000001 to 1"),
        (&["track", file, "--alpha", "nan"], "a number from 0.000001 to 1"),
        (&["track", file, "--link", "https://host/{commit}"], "--page <FILE>"),
        (&["track", file, "--repository", "."], "--add <FILE>"),
        (&["gate", "--baseline", file], "neither a program that can be executed nor"),
        (&["gate", "--candidate", file], "neither a program that can be executed nor"),
        (&["gate", "--budget", "nan"], "a whole number of seconds"),
        (&["bench", "--network", "2e-6,10GB,1e10"], "as in 2e-6,1e10"),
        (&["bench", "--network", "2e-6,inf"], "as in 2e-6,1e10"),
        (&["bench", "--show", "--network", "1e-6,1e9"], "cannot be used with"),
        (&["bench", "--show", "--timeout", "9"], "cannot be used with"),
        (&["bench", "--show", "--mesher", file], "cannot be used with"),
        (&["shrink", file, "--test-only", "--out", "x"], "cannot be used with"),
        (&["verify", "cube", "--size", "large"], "cannot be used with"),
        (&["verify", "cube", "--no-mpi", "--engine", fifo], "give a file\n"),
        (&["why", directory, "0,0,0", "--engine", "x"], "is meshed already"),
        (&["why", directory, "0,0,0", "--mesher", file], "is meshed already"),
        (&["why", directory, "0,0,0", "--timeout", "600"], "is meshed already"),
    ] {
        let output = harness(arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && message.contains(why),
            "{arguments:?}: {message}"
        );
    }
}

#[test]
fn programs_of_one_name_are_not_compared() {
    let place = tempfile::tempdir().unwrap();
    let file = |name: &str| {
        let path = place.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "[run]\nserial = ['mine', '{case}', '{out}']\n").unwrap();
        path.to_string_lossy().into_owned()
    };
    let both = format!("{},{}", file("a/mine.toml"), file("b/mine.toml"));
    let punctuated = format!("{},{}", file("x+y.toml"), file("x-y.toml"));
    let refused = |arguments: &[&str]| {
        let output = harness(arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    for two in [&both, &punctuated] {
        let refused = refused(&["bench", "--engine", two]);
        assert!(refused.contains("two programs of one name but for punctuation"), "{refused}");
    }
    let replaced = refused(&["bench", "--engine", &both, "--mesher", "other"]);
    assert!(replaced.contains("name one"), "{replaced}");
}

/// Work for minutes.
const CASE: &str =
    "spacing_min = 0.001\nroot_scale = 2.0\n[generator]\nshape = \"sphere\"\nfacets = 8000000\n";
/// A mesher that neither meshes nor ends, and starts another process.
const STUBBORN: &str = "#!/bin/sh\ntrap '' TERM INT HUP\necho $$ >> \"$PLACE/ids\"\nsleep 600 &\necho $! >> \"$PLACE/ids\"\nwhile :; do sleep 1; done\n";

struct Fixture(TempDir);

impl Fixture {
    fn new() -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        fs::create_dir(fixture.path().join("temporary")).unwrap();
        fs::write(fixture.path().join("case.toml"), CASE).unwrap();
        fixture.program("mesher", STUBBORN);
        fixture
    }

    fn program(&self, name: &str, text: &str) {
        let path = self.path().join(name);
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn start(&self, arguments: &[&str]) -> Child {
        self.start_until("never", arguments)
    }

    /// A command that stops itself at a point.
    fn start_until(&self, point: &str, arguments: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        command.args(arguments).current_dir(self.path());
        command.env("TMPDIR", self.path().join("temporary")).env("PLACE", self.path());
        command.env("STOP_AT", point);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// The processes that the mesher noted.
    fn ids(&self) -> Vec<String> {
        let text = fs::read_to_string(self.path().join("ids")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    fn interrupt(&self, mut run: Child, signals: &[&str]) {
        for name in signals.iter().chain(&["CONT"]) {
            let id = run.id().to_string();
            assert!(Command::new("kill").args(["-s", name, &id]).status().unwrap().success());
        }
        let end = run.wait().unwrap();
        assert_eq!(end.code(), Some(130), "{signals:?}");
        let left: Vec<_> = fs::read_dir(self.path().join("temporary")).unwrap().collect();
        assert!(left.is_empty(), "{signals:?}: {left:?}");
        for id in self.ids() {
            assert!(fs::read_link(format!("/proc/{id}/exe")).is_err(), "process {id} is left");
        }
    }
}

/// Before that, a signal ends a process without exit code.
fn wait_until_signals_are_handled(run: &Child) {
    // SIGHUP, SIGINT, SIGUSR1, SIGUSR2, SIGALRM, SIGTERM, SIGIO
    let all =
        [1, 2, 10, 12, 14, 15, 29].into_iter().fold(0, |all, number| all | 1_u64 << (number - 1));
    let handled = || {
        let status = fs::read_to_string(format!("/proc/{}/status", run.id())).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(mask.trim(), 16).unwrap()
    };
    while handled() & all != all {
        sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_command_that_computes_ends_at_once() {
    for signals in [&["INT"][..], &["USR1"], &["ALRM"], &["IO"], &["INT", "INT"], &["TERM", "USR2"]]
    {
        let fixture = Fixture::new();
        let run = fixture.start(&["geometry", "case.toml"]);
        wait_until_signals_are_handled(&run);
        fixture.interrupt(run, signals);
    }
}

#[test]
fn a_command_that_waits_for_a_stubborn_program_ends_with_it() {
    for signals in [&["INT"][..], &["TERM"], &["HUP"], &["INT", "INT"], &["TERM", "HUP", "INT"]] {
        let fixture = Fixture::new();
        fs::write(fixture.path().join("case.toml"), CASE.replace("8000000", "80")).unwrap();
        let why = ["why", "case.toml", "0,0,0", "--mesher", "./mesher"];
        let programs = ["--mesher", "./mesher", "--reference", "./mesher", "--junit", "all.xml"];
        let verify = [&["verify", "case.toml"][..], &programs].concat();
        let shrink = ["shrink", "case.toml", "--mesher", "./mesher", "--reference", "./mesher"];
        for arguments in [&why[..], &verify, &shrink] {
            let before = fixture.ids().len();
            let mut run = fixture.start(arguments);
            while fixture.ids().len() < before + 2 && run.try_wait().unwrap().is_none() {
                sleep(Duration::from_millis(5));
            }
            if let Some(end) = run.try_wait().unwrap() {
                panic!("{arguments:?}: {end:?}");
            }
            fixture.interrupt(run, signals);
            let is_reported = fixture.path().join("all.xml").exists();
            assert!(is_reported || arguments[0] != "verify" || signals.len() > 1, "{signals:?}");
        }
    }
}

/// A network that is assumed instead would change the projections of the record.
#[test]
fn an_interrupted_ping_pong_leaves_no_network_in_the_record() {
    let fixture = Fixture::new();
    fs::write(fixture.path().join("case.toml"), CASE.replace("8000000", "80")).unwrap();
    fixture.program("pingpong", "");
    // It is asked for its version first.
    fixture.program("launcher", "#!/bin/sh\ntest $1 = --version || exec ./mesher\n");
    let series = "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\nsim = [2]\n";
    fs::write(fixture.path().join("study.toml"), series).unwrap();
    let launcher = ["--launcher", "./launcher {ranks}", "--mesher", "./mesher"];
    let bench = ["bench", "study.toml", "--record", "record.jsonl"];
    let mut run = fixture.start(&[&bench[..], &launcher].concat());
    while fixture.ids().len() < 2 {
        assert!(run.try_wait().unwrap().is_none(), "it ended before the ping-pong");
        sleep(Duration::from_millis(5));
    }
    fixture.interrupt(run, &["INT"]);
    let record = fs::read_to_string(fixture.path().join("record.jsonl")).unwrap();
    assert!(record.contains("session") && !record.contains("network"), "{record}");
}

#[test]
fn without_runs_on_mpi_the_network_is_not_measured() {
    let fixture = Fixture::new();
    fs::write(fixture.path().join("case.toml"), CASE.replace("8000000", "80")).unwrap();
    fixture.program("mesher", "#!/bin/sh\nexit 1\n");
    fixture.program("pingpong", "");
    fixture.program("launcher", "#!/bin/sh\ntest $1 = --version || touch \"$PLACE/launched\"\n");
    let series = "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\nsim = [2]\n";
    fs::write(fixture.path().join("study.toml"), series).unwrap();
    let bench = ["bench", "study.toml", "--record", "record.jsonl", "--mesher", "./mesher"];
    for (options, is_launched) in [(&["--no-mpi"][..], false), (&[], true)] {
        let launcher = ["--launcher", "./launcher {ranks}"];
        let mut run = fixture.start(&[&bench[..], &launcher, options].concat());
        assert_eq!(run.wait().unwrap().code(), Some(1), "{options:?}");
        assert_eq!(fixture.path().join("launched").exists(), is_launched, "{options:?}");
    }
}

#[test]
fn interrupted_output_has_neither_its_names_nor_a_staging_directory() {
    let fixture = Fixture::new();
    leaf_set(vec![words_of(|o| o.level < 5)]).create(&fixture.path().join("mesh")).unwrap();
    let out = fixture.path().join("out");
    fs::create_dir(&out).unwrap();
    let arguments = ["export", "mesh", "out/case/constant/polyMesh"];
    // A second signal ends the command before it has cleaned up by itself.
    for signals in [&["INT"][..], &["TERM", "INT"]] {
        let mut run = fixture.start_until("staged", &arguments);
        let stat = format!("/proc/{}/stat", run.id());
        while !fs::read_to_string(&stat).unwrap().contains(") T ") {
            assert!(run.try_wait().unwrap().is_none(), "{arguments:?} ended before its interrupt");
            sleep(Duration::from_millis(2));
        }
        assert!(fs::read_dir(&out).unwrap().next().is_some(), "{arguments:?}");
        fixture.interrupt(run, signals);
        let left: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(left.is_empty(), "{arguments:?} {signals:?}: {left:?}");
    }
}

/// A program that starts processes in sessions of their own, loses them, and fails.
const DETACHING: &str = "#!/bin/sh\nsetsid sh -c 'setsid sleep 600 & echo $! >> \"$PLACE/ids\"; echo $$ >> \"$PLACE/ids\"; wait' &\nuntil test -s \"$PLACE/ids\"; do sleep 0.01; done\nexit 1\n";

#[test]
fn processes_that_an_engine_detaches_are_ended() {
    let fixture = Fixture::new();
    fixture.program("detaching", DETACHING);
    fs::write(fixture.path().join("case.toml"), CASE.replace("8000000", "80")).unwrap();
    let why = ["why", "case.toml", "0,0,0", "--mesher", "./detaching"];
    assert!(!fixture.start(&why).wait().unwrap().success());
    for id in fixture.ids() {
        assert!(!Path::new("/proc").join(&id).exists(), "process {id} is left");
    }
}

#[test]
fn a_command_that_ends_leaves_no_temporary_directory() {
    let fixture = Fixture::new();
    let mut run = fixture.start(&["audit", "absent"]);
    assert_eq!(run.wait().unwrap().code(), Some(2));
    assert_eq!(fs::read_dir(fixture.path().join("temporary")).unwrap().count(), 0);
}
