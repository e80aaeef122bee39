//! The two programs of a gate: given as files, or built from revisions of a repository; see [`super::build`].

use super::GateOptions;
use super::build::{self, revision_of};
use super::measures::Measured;
use crate::experiments::machine::digest_of_file;
use contract::failure::Failure;
use run::engine::runner::Engine;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// A program under comparison.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The engine that runs it.
    pub engine: Engine,
    /// Its name in the report.
    pub measured: Measured,
}

impl Subject {
    fn new(engine: Engine, named: String, revision: Option<String>) -> Self {
        let program = digest_of_file(engine.program());
        Self { engine, measured: Measured { named, revision, program } }
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
        let built = baseline.is_some_and(|subject| subject.measured.revision.is_some());
        let named = options.candidate.clone();
        match named.or(built.then(|| ".".to_owned())) {
            Some(named) => Self::find(&named, options, engine),
            None => {
                let program = engine.program().to_owned();
                if !program.is_file() {
                    let program = program.display();
                    return Err(Failure::missing(format!(
                        "{program} is missing: build it, or give its path"
                    )));
                }
                let named = program.to_string_lossy().into_owned();
                Ok(Self::new(engine.clone(), named, None))
            }
        }
    }

    /// The baseline that the options name: a file, or else a revision.
    ///
    /// # Errors
    /// If it is neither, or does not build.
    pub fn baseline(options: &GateOptions, engine: &Engine) -> Result<Option<Self>, Failure> {
        let named = options.baseline.as_ref();
        named.map(|named| Self::find(named, options, engine)).transpose()
    }

    fn find(named: &str, options: &GateOptions, engine: &Engine) -> Result<Self, Failure> {
        if Path::new(named).is_file() {
            let is_data =
                Path::new(named).extension().is_some_and(|of| of == "json" || of == "toml");
            let mode = fs::metadata(named).map_or(0, |metadata| metadata.permissions().mode());
            // One that another program interprets need not be executable.
            let is_started =
                engine.description().run.serial.first().is_some_and(|word| word == "{program}");
            if is_data || is_started && mode & 0o111 == 0 {
                let why = "is neither a program that can be executed nor a revision";
                return Err(Failure::input(format!("{named} {why}")));
            }
            let program =
                fs::canonicalize(named).map_err(|error| Failure::input(error.to_string()))?;
            return Ok(Self::new(engine.with_program(program), named.to_owned(), None));
        }
        let name = &engine.description().name;
        let build = engine.description().build.as_ref().ok_or_else(|| {
            Failure::input(format!(
                "{named} is not a file, and {name} does not describe how to build a revision"
            ))
        })?;
        let head = if named == "." { "HEAD" } else { named };
        let revision = revision_of(head, &options.repository).map_err(|why| {
            Failure::input(format!("{named} is neither a file nor a revision: {why}"))
        })?;
        let program = build::program(build, named, &revision, options)?;
        Ok(Self::new(engine.with_program(program), named.to_owned(), Some(revision)))
    }
}
