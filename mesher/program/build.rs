//! Sets `VERSION`: the crate's version, and the commit if the source is a git work tree. The crate of `harness` has the same script.

use std::path::Path;
use std::process::Command;

fn main() {
    let version = env!("CARGO_PKG_VERSION");
    let commit = commit().map(|c| format!(" ({c})")).unwrap_or_default();
    println!("cargo::rustc-env=VERSION={version}{commit}");
}

/// The commit, with the suffix `-dirty` if the work tree has changes. None if git is missing, or if the sources are no work tree.
fn commit() -> Option<String> {
    // A commit or a checkout appends to this file. Where git keeps none, every build runs this again.
    let log = git(&["rev-parse", "--path-format=absolute", "--git-path", "logs/HEAD"])?;
    println!("cargo::rerun-if-changed={log}");
    // Uncommitted changes of what the mesher or the harness is made of make the work tree dirty.
    println!("cargo::rerun-if-changed=..");
    for part in ["Cargo.toml", "Cargo.lock", "mesher", "geometries", "harness/vtkhdf"] {
        println!("cargo::rerun-if-changed=../../{part}");
    }
    git(&["describe", "--always", "--dirty", "--abbrev=12"])
}

/// The output of git, trimmed; none if git fails or prints nothing.
fn git(args: &[&str]) -> Option<String> {
    // A work tree that contains a copy of this workspace is another one.
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3)?;
    let output =
        Command::new("git").env("GIT_CEILING_DIRECTORIES", above).args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}
