//! The two programs of a gate: given as files, or built from revisions of a repository or from its working tree.
//!
//! Each revision has a directory of its own, with its files in `tree` and the results of its build in `build`. Both are
//! kept whole, because a program may need libraries or data beside it, and are used where they were built. What all builds
//! may share, such as compiled dependencies, goes to `shared`. The repository, its index and its working tree stay unchanged.
//!
//! Invariant: a directory that contains the file `built` has the result of the build command in that file.

use super::GateOptions;
use super::measures::{CaseMeasures, Measured};
use crate::experiments::machine::digest_of_file;
use crate::git;
use contract::failure::Failure;
use run::engine::description::Build;
use run::engine::failure::{End, Failure as Ended};
use run::engine::process::{self, Watch};
use run::engine::runner::Engine;
use run::engine::templates::{Values, fill};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Time after which a build is killed.
const LIMIT: Duration = Duration::from_secs(3600);

/// The working tree, by name.
const WORKING_TREE: &str = ".";

/// A program under comparison.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The engine that runs it.
    pub engine: Engine,
    /// Its name in the report.
    pub measured: Measured,
    /// Its counters and memory by case, of which each layer takes its own.
    pub counted: RefCell<BTreeMap<String, Result<CaseMeasures, Ended>>>,
}

impl Subject {
    fn new(engine: Engine, named: String, revision: Option<String>) -> Self {
        let program = digest_of_file(engine.program());
        let measured = Measured { named, revision, program };
        Self { engine, measured, counted: RefCell::default() }
    }

    /// The candidate that the options name. By default it is the working tree, built in the same way, if the baseline
    /// is a revision, and else the engine's own program.
    ///
    /// # Errors
    /// If the program is missing or does not build.
    pub fn candidate(
        options: &GateOptions,
        engine: &Engine,
        baseline: Option<&Self>,
    ) -> Result<Self, Failure> {
        let is_built = baseline.is_some_and(|subject| subject.measured.revision.is_some());
        if let Some(named) = options.candidate.as_deref().or(is_built.then_some(WORKING_TREE)) {
            return Self::find(named, options, engine);
        }
        let named = engine.program().display().to_string();
        engine.require()?;
        Ok(Self::new(engine.clone(), named, None))
    }

    /// The program of this name: a file, or else a revision.
    ///
    /// # Errors
    /// If it is neither, or does not build.
    pub fn find(named: &str, options: &GateOptions, engine: &Engine) -> Result<Self, Failure> {
        let description = engine.description();
        if Path::new(named).is_file() {
            let is_data =
                Path::new(named).extension().is_some_and(|of| of == "json" || of == "toml");
            let mode = fs::metadata(named)?.permissions().mode();
            // One that another program interprets need not be executable.
            let is_started = description.run.serial.first().is_some_and(|word| word == "{program}");
            if is_data || is_started && mode & 0o111 == 0 {
                let why = "is neither a program that can be executed nor a revision";
                return Err(Failure::input(format!("{named} {why}")));
            }
            let program = fs::canonicalize(named)?;
            return Ok(Self::new(engine.with_program(program), named.to_owned(), None));
        }
        let build = description.build.as_ref().ok_or_else(|| {
            let name = &description.name;
            Failure::input(format!(
                "{named} is not a file, and {name} does not describe how to build a revision"
            ))
        })?;
        let repository = &options.repository;
        let head = if named == WORKING_TREE { "HEAD" } else { named };
        let commit = format!("{head}^{{commit}}");
        let arguments = ["rev-parse", "--verify", "--quiet", "--end-of-options", &commit];
        let revision = git(repository, &arguments).ok_or_else(|| {
            let repository = repository.display();
            Failure::input(format!("{named} is neither a file nor a revision in {repository}"))
        })?;
        let program = program(build, named, &revision, options)?;
        Ok(Self::new(engine.with_program(program), named.to_owned(), Some(revision)))
    }
}

/// Returns the program of a revision, built unless an earlier gate has kept it, or that of the repository's working tree.
fn program(
    build: &Build,
    named: &str,
    revision: &str,
    options: &GateOptions,
) -> Result<PathBuf, Failure> {
    let is_working_tree = named == WORKING_TREE;
    let cache = options.repository.join("target/gate");
    let place = cache.join(if is_working_tree { "working-tree" } else { revision });
    let tree = if is_working_tree { options.repository.clone() } else { place.join("tree") };
    let [place, tree, target, shared] =
        [&place, &tree, &place.join("build"), &cache.join("shared")].map(|path| absolute(path));
    let (place, tree) = (place?, tree?);
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let values = Values::from([
        ("target", text(target?)),
        ("shared", text(shared?)),
        ("root", text(tree.clone())),
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
    fs::write(&done, command).map_err(|error| Failure::at(&done, error))?;
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
    let created = fs::create_dir_all(path).and_then(|()| fs::canonicalize(path));
    created.map_err(|error| Failure::at(path, error))
}

/// Puts a revision's files into a directory.
fn unpack(revision: &str, repository: &Path, tree: &Path) -> Result<(), Failure> {
    let mut command = Command::new("sh");
    command.args(["-c", "git -C \"$0\" archive --format=tar \"$1\" | tar -xf - -C \"$2\""]);
    let output = command.arg(repository).arg(revision).arg(tree).output()?;
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
