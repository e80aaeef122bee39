//! The two programs of a gate: given as files, or built from revisions and kept for later gates.
//!
//! The files of a revision are unpacked into a directory of their own, so that the repository, its index and its working
//! tree stay unchanged.

use super::measures::{Measured, Measures};
use super::{GateError, Options};
use run::engine::description::{Build, Values, fill};
use run::engine::failure::{End, Failure};
use run::engine::process::{self, Watch};
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Time after which a build is killed.
const BUILD_LIMIT: Duration = Duration::from_secs(3600);

/// A program under comparison.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The engine that runs it.
    pub engine: Engine,
    /// Its name in the report.
    pub measured: Measured,
}

/// The baseline of a comparison.
#[derive(Clone, Debug)]
pub enum Baseline {
    /// A program: it can be run, so times can be compared.
    Program(Box<Subject>),
    /// The recorded measurements of a program.
    Record(Measured, Measures),
    /// Nothing: the candidate is only recorded.
    None,
}

impl Baseline {
    /// Finds the baseline that the options name: a file, or else a revision.
    ///
    /// # Errors
    /// If it is neither, or does not build.
    pub fn find(
        options: &Options,
        engine: &Engine,
        programs: &Programs,
    ) -> Result<Self, GateError> {
        let Some(named) = &options.baseline else { return Ok(Self::None) };
        let path = Path::new(named);
        if path.is_file() {
            let start =
                fs::read(path).map_err(|error| GateError::Input(format!("{named}: {error}")))?;
            if start.first() == Some(&b'{') {
                let measures = Measures::parse(&start)
                    .map_err(|why| GateError::Input(format!("{named}: {why}")))?;
                let measured =
                    Measured { named: named.clone(), revision: measures.of.revision.clone() };
                return Ok(Self::Record(measured, measures));
            }
        }
        Ok(Self::Program(Box::new(Subject::find(named, options, engine, programs)?)))
    }

    /// Its name in the report.
    pub fn measured(&self) -> Option<Measured> {
        match self {
            Self::Program(subject) => Some(subject.measured.clone()),
            Self::Record(measured, _) => Some(measured.clone()),
            Self::None => None,
        }
    }
}

impl Subject {
    /// The candidate that the options name. By default it is the working tree, built in the same way, if the baseline
    /// is a revision, and else the engine's own program.
    ///
    /// # Errors
    /// If the program is missing or does not build.
    pub fn candidate(
        options: &Options,
        engine: &Engine,
        baseline: &Baseline,
        programs: &Programs,
    ) -> Result<Self, GateError> {
        let built =
            matches!(baseline, Baseline::Program(subject) if subject.measured.revision.is_some());
        let named = options.candidate.clone();
        match named.or(built.then(|| ".".to_owned())) {
            Some(named) => Self::find(&named, options, engine, programs),
            None => {
                let program = engine.program().to_owned();
                if !program.is_file() {
                    let program = program.display();
                    return Err(GateError::Missing(format!(
                        "{program} is missing: build it, or give its path"
                    )));
                }
                let revision = revision_of("HEAD", &programs.paths.root).ok();
                let measured = Measured { named: program.to_string_lossy().into_owned(), revision };
                Ok(Self { engine: engine.clone(), measured })
            }
        }
    }

    fn find(
        named: &str,
        options: &Options,
        engine: &Engine,
        programs: &Programs,
    ) -> Result<Self, GateError> {
        if Path::new(named).is_file() {
            let program =
                fs::canonicalize(named).map_err(|error| GateError::Input(error.to_string()))?;
            let measured = Measured { named: named.to_owned(), revision: None };
            return Ok(Self { engine: engine.with_program(program), measured });
        }
        let name = &engine.description().name;
        let build = engine.description().build.as_ref().ok_or_else(|| {
            GateError::Input(format!(
                "{named} is not a file, and {name} does not describe how to build a revision"
            ))
        })?;
        let head = if named == "." { "HEAD" } else { named };
        let revision = revision_of(head, &programs.paths.root).map_err(|why| {
            GateError::Input(format!("{named} is neither a file nor a revision: {why}"))
        })?;
        let root = &programs.paths.root;
        let program = match named {
            "." => make(build, root, "working-tree", options, false)?,
            _ => built(build, &revision, root, options)?,
        };
        let measured = Measured { named: named.to_owned(), revision: Some(revision) };
        Ok(Self { engine: engine.with_program(program), measured })
    }
}

/// The program of a revision, built unless an earlier gate has kept it.
fn built(
    build: &Build,
    revision: &str,
    repository: &Path,
    options: &Options,
) -> Result<PathBuf, GateError> {
    let kept = options.cache.join("programs").join(revision).join("program");
    if kept.is_file() {
        return Ok(kept);
    }
    let tree = options.cache.join("trees").join(revision);
    unpack(revision, repository, &tree)?;
    let made = make(build, &tree, revision, options, true);
    let _ = fs::remove_dir_all(&tree);
    made
}

/// The full name of a revision.
fn revision_of(named: &str, repository: &Path) -> Result<String, String> {
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
    let wrong = |error: std::io::Error| GateError::Input(format!("{}: {error}", tree.display()));
    fs::create_dir_all(tree).map_err(wrong)?;
    let archive = tree.with_extension("tar");
    let mut git = Command::new("git");
    git.arg("-C")
        .arg(repository)
        .args(["archive", "--format=tar", "-o"])
        .arg(&archive)
        .arg(revision);
    let mut tar = Command::new("tar");
    tar.arg("-xf").arg(&archive).arg("-C").arg(tree);
    for mut command in [git, tar] {
        let output = command.output().map_err(wrong)?;
        if !output.status.success() {
            let error = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            return Err(GateError::Input(format!("{revision} cannot be unpacked: {error}")));
        }
    }
    fs::remove_file(&archive).map_err(wrong)
}

/// Builds the revision in a directory and copies its program, so that a later build cannot change it.
fn make(
    build: &Build,
    tree: &Path,
    name: &str,
    options: &Options,
    keep: bool,
) -> Result<PathBuf, GateError> {
    let wrong =
        |error: std::io::Error| GateError::Input(format!("{}: {error}", options.cache.display()));
    let place = options.cache.join("programs").join(name);
    fs::create_dir_all(&place).map_err(wrong)?;
    let cache = fs::canonicalize(&options.cache).map_err(wrong)?;
    // All builds share a directory, so that their common dependencies are compiled once.
    let target = cache.join("build").to_string_lossy().into_owned();
    let values = Values::from([("target", target), ("root", tree.to_string_lossy().into_owned())]);
    let words: Vec<String> = build.command.iter().map(|word| fill(word, &values)).collect();
    let label = if keep { &name[..12.min(name.len())] } else { name };
    eprintln!("harness gate: building {label}");
    let (program, arguments) =
        words.split_first().ok_or_else(|| GateError::Input("an empty build command".into()))?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(tree);
    let watch = Watch::new("build", BUILD_LIMIT, &place);
    process::run(&mut command, &watch).map_err(|failure| build_error(label, &failure, &place))?;
    // Copied under another name first, so that a program under its final name is complete.
    let (half, whole) = (place.join("program.new"), place.join("program"));
    fs::copy(fill(&build.program, &values), &half).map_err(wrong)?;
    fs::rename(&half, &whole).map_err(wrong)?;
    Ok(whole)
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
