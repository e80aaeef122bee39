//! Sets `MESHER_VERSION`: the crate's version, and the commit if the source is a git work tree.

use std::path::Path;
use std::process::Command;

fn main() {
    let version = env!("CARGO_PKG_VERSION");
    let commit = commit().map(|c| format!(" ({c})")).unwrap_or_default();
    println!("cargo::rustc-env=MESHER_VERSION={version}{commit}");
    println!("cargo::rerun-if-changed=build.rs");
}

/// The commit, with the suffix `-dirty` if the work tree has changes. None if git is missing, or if the work tree is not this
/// workspace's but one that contains a copy of it.
fn commit() -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?.canonicalize().ok()?;
    let top = git(&["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != root {
        return None;
    }
    // A commit or a checkout changes one of these files. A file that does not exist would make every build run this again.
    let branch = git(&["symbolic-ref", "-q", "HEAD"]);
    for name in ["HEAD", "packed-refs"].into_iter().chain(branch.as_deref()) {
        let path = git(&["rev-parse", "--path-format=absolute", "--git-path", name])?;
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    // Uncommitted changes of the mesher itself make the work tree dirty.
    println!("cargo::rerun-if-changed=..");
    git(&["describe", "--always", "--dirty", "--abbrev=12"])
}

/// The output of git, trimmed; none if git fails or prints nothing.
fn git(args: &[&str]) -> Option<String> {
    let output = Command::new("git").args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}
