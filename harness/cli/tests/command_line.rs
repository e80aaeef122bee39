//! The command line itself: version, completions and plain output.

use contract::leafset::LeafSet;
use serde_json::json;
use std::path::Path;
use std::process::{Command, Output};

const COMMANDS: [&str; 15] = [
    "verify",
    "selftest",
    "gate",
    "bench",
    "report",
    "track",
    "shrink",
    "audit",
    "leak",
    "picture",
    "export",
    "import",
    "diff",
    "why",
    "completions",
];

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
fn completions_contain_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let script = printed(&["completions", shell]);
        let missing: Vec<_> = COMMANDS.iter().filter(|name| !script.contains(*name)).collect();
        assert!(missing.is_empty(), "{shell}: {missing:?}");
    }
    assert_eq!(harness(&["completions", "abacus"]).status.code(), Some(2));
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
        assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0, "{fault}");
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
    std::fs::create_dir(to).unwrap();
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
    let nowhere = place.path().to_str().unwrap();
    for wrong in [&[&least[..], "9,0,0"][..], &[&least, "1,2"], &[&least], &[nowhere, "0,0,0"]] {
        let output = harness(&[&["why"], wrong].concat());
        assert_eq!(output.status.code(), Some(2), "{wrong:?}: {output:?}");
    }
}

#[test]
fn a_closed_pipe_ends_the_printing_and_not_the_command() {
    let script =
        format!("set -o pipefail; {} completions bash | true", env!("CARGO_BIN_EXE_harness"));
    for _ in 0..5 {
        let ended = Command::new("bash").args(["-c", &script]).output().unwrap();
        assert_eq!((ended.status.code(), ended.stderr), (Some(0), Vec::new()));
    }
}

#[test]
fn output_that_cannot_be_written_is_an_exit_code() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let ended = command.args(["completions", "bash"]).stdout(full()).output().unwrap();
    assert_eq!(ended.status.code(), Some(4));
    let message = String::from_utf8(ended.stderr).unwrap();
    assert!(message.contains("standard output cannot be written"), "{message}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    let ended = command.args(["track", "missing.jsonl"]).stderr(full()).status().unwrap();
    assert_eq!(ended.code(), Some(2));
}

#[test]
fn what_cannot_be_meant_is_invalid_input() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("f.json");
    std::fs::write(&file, "no record").unwrap();
    let file = file.to_str().unwrap();
    for (arguments, why) in [
        (&["track", "missing.jsonl"][..], "missing.jsonl is missing"),
        (&["track", file, "--alpha", "7"], "a number from 0.000001 to 1"),
        (&["track", file, "--alpha", "nan"], "a number from 0.000001 to 1"),
        (&["gate", "--baseline", file], "neither a program that can be executed nor"),
        (&["gate", "--candidate", file], "neither a program that can be executed nor"),
        (&["gate", "--budget", "nan"], "a whole number of seconds"),
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
    let file = |directory: &str| {
        let path = place.path().join(directory).join("mine.toml");
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "[run]\nserial = ['mine', '{case}', '{out}']\n").unwrap();
        path.to_string_lossy().into_owned()
    };
    let both = format!("{},{}", file("a"), file("b"));
    let refused = |arguments: &[&str]| {
        let output = harness(arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(refused(&["bench", "--engine", &both]).contains("two programs of one name"));
    let replaced = refused(&["bench", "--engine", &both, "--mesher", "other"]);
    assert!(replaced.contains("name one"), "{replaced}");
}
