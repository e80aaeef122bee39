//! Builds of revisions and of the working tree.
//!
//! Each revision has a directory of its own, with its files in `tree` and the results of its build in `build`. Both are
//! kept whole, because a program may need libraries or data beside it, and are used where they were built. What all builds
//! may share, such as compiled dependencies, goes to `shared`. The repository, its index and its working tree stay unchanged.
//!
//! Invariant: a directory that contains the file `built` has the result of the build command in that file.

use super::{GateError, GateOptions};
use crate::git;
use run::engine::description::Build;
use run::engine::failure::End;
use run::engine::placeholders::{Values, fill};
use run::engine::process::{self, Watch};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Time after which a build is killed.
const LIMIT: Duration = Duration::from_secs(3600);

/// Returns the program of the repository's working tree, after building it.
///
/// # Errors
/// If it does not build.
pub(super) fn working_tree(build: &Build, options: &GateOptions) -> Result<PathBuf, GateError> {
    let place = absolute(&options.cache().join("working-tree"))?;
    let tree = absolute(&options.repository)?;
    Places::new(tree, place, options)?.make(build, "the working tree")
}

/// Returns the program of a revision, built unless an earlier gate has kept it.
///
/// # Errors
/// If it does not build.
pub(super) fn revision(
    build: &Build,
    revision: &str,
    options: &GateOptions,
) -> Result<PathBuf, GateError> {
    let place = absolute(&options.cache().join(revision))?;
    let done = place.join("built");
    let places = Places::new(place.join("tree"), place, options)?;
    let (program, command) = (places.program(build), build.command.join("\n"));
    if program.is_file() && fs::read_to_string(&done).is_ok_and(|with| with == command) {
        return Ok(program);
    }
    unpack(revision, &options.repository, &places.tree)?;
    let program = places.make(build, &revision[..12.min(revision.len())])?;
    fs::write(&done, command).map_err(|error| wrong(&done, &error))?;
    Ok(program)
}

/// The directories of a build.
struct Places {
    /// The files of the revision.
    tree: PathBuf,
    /// Where the output of the build is kept.
    logs: PathBuf,
    /// The values of placeholders in the description of the build.
    values: Values<'static>,
}

impl Places {
    fn new(tree: PathBuf, place: PathBuf, options: &GateOptions) -> Result<Self, GateError> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let values = Values::from([
            ("target", text(&absolute(&place.join("build"))?)),
            ("shared", text(&absolute(&options.cache().join("shared"))?)),
            ("root", text(&tree)),
        ]);
        Ok(Self { tree, logs: place, values })
    }

    /// Returns the path of the program, which need not exist yet.
    fn program(&self, build: &Build) -> PathBuf {
        PathBuf::from(fill(&build.program, &self.values))
    }

    /// Builds and returns the program; `label` is the revision, for messages.
    fn make(&self, build: &Build, label: &str) -> Result<PathBuf, GateError> {
        let words: Vec<String> =
            build.command.iter().map(|word| fill(word, &self.values)).collect();
        crate::announce(&format!("harness gate: building {label}"));
        let (program, arguments) =
            words.split_first().ok_or_else(|| GateError::Input("an empty build command".into()))?;
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&self.tree);
        let built = process::run(&mut command, &Watch::new("build", LIMIT, &self.logs));
        built.map_err(|failure| match failure.end {
            End::Missing(_) => GateError::Missing(failure.to_string()),
            _ => {
                let log = self.logs.join("build.stderr");
                GateError::Input(format!("{label}: {failure} (full output: {})", log.display()))
            }
        })?;
        let program = self.program(build);
        match program.is_file() {
            true => Ok(program),
            false => Err(GateError::Input(format!(
                "{label}: the build succeeded, but {} is missing: check [build] program",
                program.display()
            ))),
        }
    }
}

/// Returns the absolute path of a directory, after creating it if it is missing.
fn absolute(path: &Path) -> Result<PathBuf, GateError> {
    fs::create_dir_all(path)
        .and_then(|()| fs::canonicalize(path))
        .map_err(|error| wrong(path, &error))
}

fn wrong(path: &Path, error: &std::io::Error) -> GateError {
    GateError::Input(format!("{}: {error}", path.display()))
}

/// The full name of a revision.
pub(super) fn revision_of(named: &str, repository: &Path) -> Result<String, String> {
    let commit = format!("{named}^{{commit}}");
    git(repository, &["rev-parse", "--verify", "--quiet", "--end-of-options", &commit])
        .ok_or_else(|| format!("{named} is not a revision in {}", repository.display()))
}

/// Puts a revision's files into a directory.
fn unpack(revision: &str, repository: &Path, tree: &Path) -> Result<(), GateError> {
    fs::create_dir_all(tree).map_err(|error| wrong(tree, &error))?;
    let mut command = Command::new("sh");
    command.args(["-c", "git -C \"$0\" archive --format=tar \"$1\" | tar -xf - -C \"$2\""]);
    let output = command.arg(repository).arg(revision).arg(tree).output();
    let output = output.map_err(|error| wrong(tree, &error))?;
    match output.status.success() {
        true => Ok(()),
        false => {
            let error = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            Err(GateError::Input(format!("{revision} cannot be unpacked: {error}")))
        }
    }
}

/// Returns the root directory of the repository that contains a directory; the directory itself without a repository.
pub(super) fn top_level(directory: &Path) -> PathBuf {
    let root = git(directory, &["rev-parse", "--show-toplevel"]);
    root.map_or_else(|| directory.to_owned(), PathBuf::from)
}
