//! Where the programs are: given on the command line, or next to the harness, or on the machine.

use contract::catalogue::Catalogue;
use std::env;
use std::path::{Path, PathBuf};

/// What the command line may say about where programs are.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// `--mesher`.
    pub mesher: Option<PathBuf>,
    /// `--reference`.
    pub reference: Option<PathBuf>,
}

/// Paths of the programs. A path need not exist: whoever needs the program says that it is missing.
#[derive(Clone, Debug)]
pub struct Paths {
    /// The mesher under test.
    pub mesher: PathBuf,
    /// The program that the command line gave for it, whatever engine that is of.
    pub mesher_given: Option<PathBuf>,
    /// The reference.
    pub reference: PathBuf,
    /// OpenMPI's or another `mpirun`.
    pub mpirun: PathBuf,
    /// The Python that has the oracles' packages: `HARNESS_PYTHON` or the repository's `.venv`.
    pub python: PathBuf,
    /// The directory of the oracles' programs.
    pub oracles: PathBuf,
    /// The p4est engine: `HARNESS_P4EST`, or `engines/p4est-balance` of the harness's target directory or the
    /// repository's.
    pub p4est: PathBuf,
    /// The catalogue of cases.
    pub catalogue: Catalogue,
    /// The directory of engine descriptions.
    pub engines: PathBuf,
    /// The repository.
    pub root: PathBuf,
    /// The program itself, for the command that repeats a failure.
    pub harness: PathBuf,
}

impl Paths {
    /// Looks where programs are for a harness that was built at, or is run from, some place below the
    /// repository. `HARNESS_ROOT` names the repository for one that is neither.
    pub fn find(given: Given) -> Self {
        let harness = env::current_exe().unwrap_or_else(|_| PathBuf::from("harness"));
        let beside = harness.parent().unwrap_or(Path::new(".")).to_owned();
        let root = repository(&beside);
        let from_env = |name| env::var_os(name).map(PathBuf::from);
        let target = beside.parent().unwrap_or(Path::new("..")).to_owned();
        Self {
            mesher_given: given.mesher.clone(),
            mesher: given.mesher.unwrap_or_else(|| beside.join("mesher")),
            reference: given.reference.unwrap_or_else(|| beside.join("reference")),
            mpirun: on_path("mpirun").unwrap_or_else(|| PathBuf::from("mpirun")),
            python: from_env("HARNESS_PYTHON").unwrap_or_else(|| root.join(".venv/bin/python")),
            oracles: root.join("harness/oracles"),
            p4est: from_env("HARNESS_P4EST").unwrap_or_else(|| p4est_below(&target, &root)),
            catalogue: Catalogue::new(root.join("geometries/catalogue.toml")),
            engines: root.join("harness/engines"),
            root,
            harness,
        }
    }
}

/// The p4est engine in the harness's target directory or, for a harness that was copied, in the repository's.
fn p4est_below(target: &Path, root: &Path) -> PathBuf {
    let places = [target.to_owned(), root.join("target")];
    let mut found = places.map(|place| place.join("engines/p4est-balance")).into_iter();
    let first = found.next().unwrap_or_default();
    if first.is_file() { first } else { found.find(|engine| engine.is_file()).unwrap_or(first) }
}

/// The repository's root: the nearest directory above the harness, or above where it is run, that holds
/// the oracles.
fn repository(beside: &Path) -> PathBuf {
    if let Some(root) = env::var_os("HARNESS_ROOT") {
        return root.into();
    }
    let here = env::current_dir().unwrap_or_default();
    let above = beside.ancestors().chain(here.ancestors());
    let root = above.into_iter().find(|place| place.join("harness/oracles/protocol.py").is_file());
    root.map_or(here.clone(), Path::to_owned)
}

/// The first program of that name in the directories of `PATH`.
pub fn on_path(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|place| place.join(name)).find(|program| program.is_file())
}
