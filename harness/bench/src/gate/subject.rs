//! The two programs of a gate: given as files, or built from revisions of a repository or from its working tree.
//!
//! Each revision has two directories of its own: one for its files, and one in the repository's `target/gate` for the results of
//! its build. Both are kept whole, because a program may need libraries or data beside it, and are used where they were built. The
//! repository, its index and its working tree stay unchanged. The build command is always run: cargo and make know better than the
//! gate what a build depends on, and compile nothing twice.

use super::GateOptions;
use super::measures::{CaseMeasures, Measured, WORKING_TREE};
use crate::experiments::machine::digest_of;
use crate::git;
use contract::failure::{Failure, Result};
use run::engine::description::Build;
use run::engine::failure::Failure as Ended;
use run::engine::process::{self, Watch};
use run::engine::runner::Engine;
use run::engine::templates::{Values, fill};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use std::{env, fs};

/// Time after which a build is killed.
const LIMIT: Duration = Duration::from_secs(3600);

/// What a layer measures of a program on a case.
pub type Counted = Result<CaseMeasures, Ended>;

/// A program under comparison.
pub struct Subject {
    /// The engine that runs it.
    pub engine: Engine,
    /// Its name in the report.
    pub measured: Measured,
    /// Its counters and memory by case, of which each layer takes its own.
    pub counted: RefCell<BTreeMap<String, Counted>>,
}

impl Subject {
    fn new(engine: Engine, named: String, revision: Option<String>) -> Result<Self> {
        engine.require()?;
        let measured = Measured { named, revision, program: digest_of(engine.files()) };
        Ok(Self { engine, measured, counted: RefCell::default() })
    }

    /// The candidate that the options name. By default it is a program given for the engine; else the working tree, built in the same way, if
    /// the baseline is a revision; else the engine's own program.
    ///
    /// # Errors
    /// If the program is missing or does not build.
    pub fn candidate(options: &GateOptions, engine: &Engine, old: Option<&Self>) -> Result<Self> {
        let is_built = old.is_some_and(|subject| subject.measured.is_built());
        let own = engine.program.to_string_lossy();
        let default = if is_built && !engine.is_given { WORKING_TREE } else { &own };
        let named = options.candidate.as_deref().unwrap_or(default);
        if named == own {
            engine.require()?;
        }
        Self::find(named, options, engine)
    }

    /// The program of this name: a file, or else a revision.
    ///
    /// # Errors
    /// If it is neither, or does not build.
    pub fn find(named: &str, options: &GateOptions, engine: &Engine) -> Result<Self> {
        let description = &engine.description;
        if Path::new(named).is_file() {
            let mode = fs::metadata(named)?.permissions().mode();
            // One that another program interprets need not be executable.
            let is_started = description.run.serial.first().is_some_and(|word| word == "{program}");
            let why = format!("{named} is neither a program that can be executed nor a revision");
            Failure::unless(!is_started || mode & 0o111 != 0, why)?;
            // A link may lead to a program that behaves by its own name, as those of a virtual environment do.
            let program = std::path::absolute(named)?;
            return Self::new(engine.with_program(program)?, named.to_owned(), None);
        }
        let (name, repository) = (&description.name, &options.repository);
        let build = description.build.as_ref().ok_or_else(|| {
            format!("{named} is not a file, and {name} does not describe how to build a revision")
        })?;
        let head = if named == WORKING_TREE { "HEAD" } else { named };
        let commit = format!("{head}^{{commit}}");
        let arguments = ["rev-parse", "--verify", "--quiet", "--end-of-options", &commit];
        let shown = repository.display();
        let why = || format!("{named} is neither a file nor a revision in {shown}");
        let revision = git(repository, &arguments).ok_or_else(why)?;
        let built = (named != WORKING_TREE).then_some(revision.as_str());
        let status = ["status", "--porcelain", "--untracked-files=no"];
        let is_commit = built.is_some() || git(repository, &status).is_some_and(|of| of.is_empty());
        let program = program(build, built, repository)?;
        Self::new(engine.with_program(program)?, named.to_owned(), is_commit.then_some(revision))
    }
}

/// Builds and returns the program of a revision, or that of the repository's working tree.
fn program(build: &Build, revision: Option<&str>, repository: &Path) -> Result<PathBuf> {
    let repository =
        &fs::canonicalize(repository).map_err(|error| Failure::at(repository, error))?;
    let place = repository.join("target/gate").join(revision.unwrap_or("working-tree"));
    let tree = revision.map_or(repository.to_owned(), |name| sources(repository).join(name));
    let mut values = Values::default();
    for (name, path) in [("target", place.join("build")), ("root", tree)] {
        let made = fs::create_dir_all(&path).and_then(|()| fs::canonicalize(&path));
        let made = made.map_err(|error| Failure::at(&path, error))?;
        values.insert(name, made.to_string_lossy().into_owned());
    }
    let tree = Path::new(&values["root"]);
    let program = PathBuf::from(fill(&build.program, &values));
    if revision.is_none() && program.starts_with(&values["target"]) {
        // The files have changed: an earlier program must not be taken for theirs.
        let _ = fs::remove_file(&program);
    }
    let words: Vec<String> = build.command.iter().map(|word| fill(word, &values)).collect();
    let mut label = "the working tree";
    if let Some(revision) = revision {
        let mut archive = Command::new("sh");
        archive.args(["-c", "git -C \"$0\" archive --format=tar \"$1\" | tar -xf - -C \"$2\""]);
        archive.arg(repository).arg(revision).arg(tree);
        process::run(&mut archive, &Watch::new("git archive", LIMIT, &place))?;
        label = &revision[..12.min(revision.len())];
    }
    crate::announce(&format!("harness gate: building {label}"));
    let why = Failure::input("an empty build command");
    let (builder, arguments) = words.split_first().ok_or(why)?;
    let mut command = Command::new(builder);
    command.args(arguments).current_dir(tree);
    process::run(&mut command, &Watch::new("build", LIMIT, &place)).map_err(|failure| {
        let why = format!("{label}: {failure} (full output: {}/build.stderr)", place.display());
        Failure { why, ..failure.into() }
    })?;
    let why = format!("the build succeeded, but did not rebuild {}", program.display());
    Failure::unless(program.is_file(), format!("{label}: {why}: check [build]"))?;
    Ok(program)
}

/// Where the files of a repository's revisions are: not in the repository, as cargo also reads the settings of every directory above
/// (`.cargo/config.toml`), and then those of the working tree would apply to all revisions.
fn sources(repository: &Path) -> PathBuf {
    let given = env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let home = || Some(PathBuf::from(env::var_os("HOME")?).join(".cache"));
    let cache = given.or_else(home).filter(|at| at.is_absolute() && !at.starts_with(repository));
    let place = cache.unwrap_or_else(env::temp_dir).join("harness-gate");
    place.join(repository.strip_prefix("/").unwrap_or(repository))
}

/// Returns the root directory of the repository that contains a directory; the directory itself without a repository.
pub(super) fn top_level(directory: &Path) -> PathBuf {
    let root = git(directory, &["rev-parse", "--show-toplevel"]);
    root.map_or_else(|| directory.to_owned(), PathBuf::from)
}
