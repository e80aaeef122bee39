//! Builds of revisions and of the working tree.
//!
//! Each revision has a directory of its own, with its files in `tree` and the results of its build in `build`. Both are
//! kept whole, because a program may need libraries or data beside it, and are used where they were built. What all builds
//! may share, such as compiled dependencies, goes to `shared`. The repository, its index and its working tree stay unchanged.
//!
//! Invariant: a directory that contains the file `built` has the result of the build command in that file.

use super::{GateError, GateOptions};
use run::engine::description::Build;
use run::engine::failure::{End, Failure};
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
    make(build, &Places { tree, place, label: "the working tree" }, options)
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
    let label = &revision[..12.min(revision.len())];
    let places = Places { tree: place.join("tree"), place, label };
    let (program, done) = (places.program(build, options)?, places.place.join("built"));
    let command = build.command.join("\n");
    if program.is_file() && fs::read_to_string(&done).is_ok_and(|with| with == command) {
        return Ok(program);
    }
    unpack(revision, &options.repository, &places.tree)?;
    let program = make(build, &places, options)?;
    fs::write(&done, command).map_err(|error| wrong(&done, &error))?;
    Ok(program)
}

/// The directories of a build.
struct Places<'a> {
    /// The files of the revision.
    tree: PathBuf,
    /// The directory of the build.
    place: PathBuf,
    /// The revision, for messages.
    label: &'a str,
}

impl Places<'_> {
    fn values(&self, options: &GateOptions) -> Result<Values<'static>, GateError> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        Ok(Values::from([
            ("target", text(&absolute(&self.place.join("build"))?)),
            ("shared", text(&absolute(&options.cache().join("shared"))?)),
            ("root", text(&self.tree)),
        ]))
    }

    /// Returns the path of the program, which need not exist yet.
    fn program(&self, build: &Build, options: &GateOptions) -> Result<PathBuf, GateError> {
        Ok(PathBuf::from(fill(&build.program, &self.values(options)?)))
    }
}

/// Returns the absolute path of a directory, after creating it if it is missing.
fn absolute(path: &Path) -> Result<PathBuf, GateError> {
    fs::create_dir_all(path).map_err(|error| wrong(path, &error))?;
    fs::canonicalize(path).map_err(|error| wrong(path, &error))
}

fn wrong(path: &Path, error: &std::io::Error) -> GateError {
    GateError::Input(format!("{}: {error}", path.display()))
}

/// Builds and returns the program.
fn make(build: &Build, places: &Places, options: &GateOptions) -> Result<PathBuf, GateError> {
    let (values, label) = (places.values(options)?, places.label);
    let words: Vec<String> = build.command.iter().map(|word| fill(word, &values)).collect();
    crate::announce(&format!("harness gate: building {label}"));
    let (program, arguments) =
        words.split_first().ok_or_else(|| GateError::Input("an empty build command".into()))?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(&places.tree);
    let watch = Watch::new("build", LIMIT, &places.place);
    process::run(&mut command, &watch)
        .map_err(|failure| build_error(label, &failure, &places.place))?;
    let program = places.program(build, options)?;
    match program.is_file() {
        true => Ok(program),
        false => {
            let program = program.display();
            let why = format!(
                "{label}: the build succeeded, but {program} is missing: check [build] program"
            );
            Err(GateError::Input(why))
        }
    }
}

fn build_error(label: &str, failure: &Failure, logs: &Path) -> GateError {
    match failure.end {
        End::Missing(_) => GateError::Missing(failure.to_string()),
        _ => {
            let log = logs.join("build.stderr");
            GateError::Input(format!("{label}: {failure} (full output: {})", log.display()))
        }
    }
}

/// The full name of a revision.
pub(super) fn revision_of(named: &str, repository: &Path) -> Result<String, String> {
    let mut git = Command::new("git");
    git.arg("-C").arg(repository).args(["rev-parse", "--verify", "--quiet", "--end-of-options"]);
    let output =
        git.arg(format!("{named}^{{commit}}")).output().map_err(|error| format!("git: {error}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned()),
        false => Err(format!("{named} is not a revision in {}", repository.display())),
    }
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
pub fn top_level(directory: &Path) -> PathBuf {
    let mut git = Command::new("git");
    git.arg("-C").arg(directory).args(["rev-parse", "--show-toplevel"]);
    match git.output() {
        Ok(output) if output.status.success() => {
            PathBuf::from(String::from_utf8_lossy(&output.stdout).trim_end())
        }
        _ => directory.to_owned(),
    }
}
