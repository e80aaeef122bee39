//! Builds of revisions and of the working tree.
//!
//! Each revision has a directory of its own, with its files in `tree` and the results of its build in `build`. Both are
//! kept whole, because a program may need libraries or data beside it, and are used where they were built. What all builds
//! may share, such as compiled dependencies, goes to `shared`. The repository, its index and its working tree stay unchanged.
//!
//! Invariant: a directory that contains the file `built` has the result of the build command in that file.

use super::GateOptions;
use crate::git;
use contract::failure::Failure;
use run::engine::description::Build;
use run::engine::failure::End;
use run::engine::process::{self, Watch};
use run::engine::templates::{Values, fill};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Time after which a build is killed.
const LIMIT: Duration = Duration::from_secs(3600);

/// Returns the program of a revision, built unless an earlier gate has kept it, or for `.` that of the repository's working tree.
///
/// # Errors
/// If it does not build.
pub(super) fn program(
    build: &Build,
    named: &str,
    revision: &str,
    options: &GateOptions,
) -> Result<PathBuf, Failure> {
    let is_working_tree = named == ".";
    let place = if is_working_tree { "working-tree" } else { revision };
    let place = absolute(&options.cache().join(place))?;
    let tree = match is_working_tree {
        true => absolute(&options.repository)?,
        false => place.join("tree"),
    };
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let values = Values::from([
        ("target", text(&absolute(&place.join("build"))?)),
        ("shared", text(&absolute(&options.cache().join("shared"))?)),
        ("root", text(&tree)),
    ]);
    let program = PathBuf::from(fill(&build.program, &values));
    let words: Vec<String> = build.command.iter().map(|word| fill(word, &values)).collect();
    if is_working_tree {
        return make(&words, &tree, &place, "the working tree", program);
    }
    let (done, command) = (place.join("built"), build.command.join("\n"));
    if program.is_file() && fs::read_to_string(&done).is_ok_and(|with| with == command) {
        return Ok(program);
    }
    unpack(revision, &options.repository, &tree)?;
    let program = make(&words, &tree, &place, &revision[..12.min(revision.len())], program)?;
    fs::write(&done, command).map_err(|error| wrong(&done, &error))?;
    Ok(program)
}

/// Builds a program and returns it; `label` is the revision, for messages. The output of the build is kept in `place`.
fn make(
    words: &[String],
    tree: &Path,
    place: &Path,
    label: &str,
    program: PathBuf,
) -> Result<PathBuf, Failure> {
    crate::announce(&format!("harness gate: building {label}"));
    let (builder, arguments) =
        words.split_first().ok_or_else(|| Failure::input("an empty build command"))?;
    let mut command = Command::new(builder);
    command.args(arguments).current_dir(tree);
    let built = process::run(&mut command, &Watch::new("build", LIMIT, place));
    built.map_err(|failure| match failure.end {
        End::Missing(_) => Failure::missing(failure),
        _ => {
            let log = place.join("build.stderr");
            Failure::input(format!("{label}: {failure} (full output: {})", log.display()))
        }
    })?;
    match program.is_file() {
        true => Ok(program),
        false => Err(Failure::input(format!(
            "{label}: the build succeeded, but {} is missing: check [build] program",
            program.display()
        ))),
    }
}

/// Returns the absolute path of a directory, after creating it if it is missing.
fn absolute(path: &Path) -> Result<PathBuf, Failure> {
    fs::create_dir_all(path)
        .and_then(|()| fs::canonicalize(path))
        .map_err(|error| wrong(path, &error))
}

fn wrong(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(format!("{}: {error}", path.display()))
}

/// The full name of a revision.
pub(super) fn revision_of(named: &str, repository: &Path) -> Result<String, String> {
    let commit = format!("{named}^{{commit}}");
    git(repository, &["rev-parse", "--verify", "--quiet", "--end-of-options", &commit])
        .ok_or_else(|| format!("{named} is not a revision in {}", repository.display()))
}

/// Puts a revision's files into a directory.
fn unpack(revision: &str, repository: &Path, tree: &Path) -> Result<(), Failure> {
    fs::create_dir_all(tree).map_err(|error| wrong(tree, &error))?;
    let mut command = Command::new("sh");
    command.args(["-c", "git -C \"$0\" archive --format=tar \"$1\" | tar -xf - -C \"$2\""]);
    let output = command.arg(repository).arg(revision).arg(tree).output();
    let output = output.map_err(|error| wrong(tree, &error))?;
    match output.status.success() {
        true => Ok(()),
        false => {
            let error = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            Err(Failure::input(format!("{revision} cannot be unpacked: {error}")))
        }
    }
}

/// Returns the root directory of the repository that contains a directory; the directory itself without a repository.
pub(super) fn top_level(directory: &Path) -> PathBuf {
    let root = git(directory, &["rev-parse", "--show-toplevel"]);
    root.map_or_else(|| directory.to_owned(), PathBuf::from)
}
