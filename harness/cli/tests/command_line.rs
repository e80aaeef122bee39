//! The command line itself: version, completions, manual pages and plain output.

use std::process::{Command, Output};

const COMMANDS: [&str; 14] = [
    "verify",
    "selftest",
    "gate",
    "bench",
    "targets",
    "report",
    "track",
    "shrink",
    "audit",
    "export",
    "import",
    "diff",
    "completions",
    "man",
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
fn every_command_has_a_manual_page() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("man");
    assert!(printed(&["man", directory.to_str().unwrap()]).is_empty());
    for name in COMMANDS {
        let page = std::fs::read_to_string(directory.join(format!("harness-{name}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{page}");
    }
    assert!(printed(&["man"]).contains("Exit codes"));
    assert_eq!(harness(&["man", "/dev/null/man"]).status.code(), Some(2));
}

#[test]
fn output_to_a_file_has_no_colours() {
    for output in [harness(&["--help"]), harness(&["verify", "--ranks", "0"])] {
        assert!(![output.stdout, output.stderr].concat().contains(&0x1b));
    }
}
