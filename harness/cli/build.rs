//! Passes the commit to the program, for `harness --version`.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // HEAD names the branch, its ref or packed-refs the commit. `git rev-parse --git-path` resolves them in worktrees too,
    // where .git is a file.
    let head_ref = git(&["symbolic-ref", "--quiet", "HEAD"]);
    for name in ["HEAD", "packed-refs"].into_iter().chain(head_ref.as_deref()) {
        // Cargo would rebuild every time if a path did not exist.
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let version = env!("CARGO_PKG_VERSION");
    // Without git, as in an unpacked archive, the version stands alone.
    let described = git(&["describe", "--always", "--dirty", "--abbrev=12"]);
    let commit = described.map_or(String::new(), |commit| format!(" ({commit})"));
    println!("cargo::rustc-env=HARNESS_VERSION={version}{commit}");
}

/// Returns the first line that git prints, or `None` if it fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let line = String::from_utf8(output.stdout).ok()?.lines().next()?.to_owned();
    output.status.success().then_some(line)
}
