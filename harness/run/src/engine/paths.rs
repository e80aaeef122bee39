//! Paths of programs and data on this machine, and those of the command line.

use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser, ValueParserFactory};
use contract::catalogue::Catalogue;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::{env, io};

/// A file or a directory that the command writes or reads. It is checked when the command line is parsed, before any work: what is written
/// can be written, and is nothing that the command reads. Files of a directory are inputs when they are opened.
#[derive(Clone, Debug)]
pub struct Place<const WRITTEN: bool>(PathBuf);

/// A file that the command writes.
pub type Output = Place<true>;
/// A file or a directory that the command reads.
pub type Input = Place<false>;

impl<const WRITTEN: bool> Place<WRITTEN> {
    /// Checks a path.
    ///
    /// # Errors
    /// If it cannot be written, or is read and written.
    pub fn new(path: PathBuf) -> io::Result<Self> {
        match WRITTEN {
            true => files::name_output(&path).and_then(|()| files::check_writable(&path))?,
            false => files::register_input(&path)?,
        }
        Ok(Self(path))
    }
}

impl<const WRITTEN: bool> Deref for Place<WRITTEN> {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl<const WRITTEN: bool> ValueParserFactory for Place<WRITTEN> {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        PathBufValueParser::new().try_map(Self::new).into()
    }
}

/// Paths of programs and data. A path need not exist: the code that needs the file reports that it is missing.
#[derive(Clone, Debug)]
pub struct Paths {
    /// The program `mpirun`.
    pub mpirun: PathBuf,
    /// A Python with the oracles' packages: `HARNESS_PYTHON`, that of the repository's `.venv`, or one beside the harness.
    pub python: PathBuf,
    /// The p4est program: `HARNESS_P4EST`, or `engines/p4est-balance` in the target directory of the harness or of the
    /// repository.
    pub p4est: PathBuf,
    /// The checker of `reference/proof`: `HARNESS_PROVEN`, or in the target directory of the harness or of the repository.
    pub proven_checker: PathBuf,
    /// The catalogue of cases.
    pub catalogue: Catalogue,
    /// The repository, with the engine files and the oracles' scripts.
    pub root: PathBuf,
    /// The harness itself.
    pub harness: PathBuf,
}

impl Paths {
    /// Finds the repository above the running harness or above the current directory, and everything else relative to
    /// it. `HARNESS_ROOT` overrides the search.
    pub fn find() -> Self {
        let harness = env::current_exe().unwrap_or_else(|_| PathBuf::from("harness"));
        let directory = harness.parent().unwrap_or(Path::new(".")).to_owned();
        let root = repository(&directory);
        let from_env = |name| env::var_os(name).map(PathBuf::from);
        let or_else = |first: PathBuf, second: PathBuf| {
            if !first.is_file() && second.is_file() { second } else { first }
        };
        // In the target directory of the harness or, for a harness that was copied elsewhere, in that of the repository.
        let target = directory.parent().unwrap_or(Path::new("..")).to_owned();
        let built = |name| or_else(target.join(name), root.join("target").join(name));
        let python = or_else(root.join(".venv/bin/python"), directory.join("python"));
        Self {
            mpirun: on_path("mpirun").unwrap_or_else(|| PathBuf::from("mpirun")),
            python: from_env("HARNESS_PYTHON").unwrap_or(python),
            p4est: from_env("HARNESS_P4EST").unwrap_or_else(|| built("engines/p4est-balance")),
            proven_checker: from_env("HARNESS_PROVEN").unwrap_or_else(|| built("proof/check")),
            catalogue: Catalogue { path: root.join("geometries/catalogue.toml") },
            root,
            harness,
        }
    }

    /// Returns why the proven checker cannot be used, if it cannot.
    pub fn lacks_checker(&self) -> Option<String> {
        let checker = &self.proven_checker;
        (!checker.is_file())
            .then(|| format!("{} is missing: ci/prove proves and builds it", checker.display()))
    }
}

/// The root of the repository: the nearest directory above the harness, or above the current directory, that contains
/// the oracles.
fn repository(directory: &Path) -> PathBuf {
    if let Some(root) = env::var_os("HARNESS_ROOT") {
        return root.into();
    }
    let here = env::current_dir().unwrap_or_default();
    let above = directory.ancestors().chain(here.ancestors());
    // A wheel has what the programs read in a folder of its own.
    let mut places = above.flat_map(|place| [place.to_owned(), place.join("share/octree")]);
    places.find(|place| place.join("harness/oracles/protocol.py").is_file()).unwrap_or(here)
}

/// The first program of that name in the directories of `PATH`.
pub fn on_path(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|place| place.join(name)).find(|program| program.is_file())
}
