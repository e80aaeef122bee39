//! Writes a shrunk case as a directory for a bug report.

use super::Shrunk;
use super::reduce::size;
use contract::plain::StlForm;
use run::engine::layout::Ranks;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The files of the directory.
const FILES: [&str; 3] = ["case.toml", "body.stl", "README.md"];

/// The first file that writing into a directory would replace: of the case itself, perhaps.
pub fn replaced(directory: &Path) -> Option<PathBuf> {
    FILES.iter().map(|name| directory.join(name)).find(|path| path.exists())
}

/// Writes `case.toml`, `body.stl` and `README.md` into a directory; returns the text of the README. `options` choose the program in the
/// command that repeats the failure.
///
/// # Errors
/// If a file cannot be written.
pub fn write(shrunk: &Shrunk, options: &[&str], directory: &Path) -> io::Result<String> {
    fs::create_dir_all(directory)?;
    let case = shrunk.trial.case.write(directory, StlForm::Any)?;
    let minimal =
        if shrunk.minimal { "nothing more can be removed" } else { "the budget is exhausted" };
    let text = format!(
        "{}\n\nShrunk from {} facets in {} trials ({minimal}) to: {}.\n\nTo repeat the failure:\n\n    {}\n",
        shrunk.fault,
        shrunk.facets_before,
        shrunk.trials,
        size(&shrunk.trial),
        repeat(shrunk, options, &case)
    );
    fs::write(directory.join("README.md"), format!("# A case that fails\n\n{text}"))?;
    Ok(text)
}

/// A shell command that tests whether the case still fails the check.
fn repeat(shrunk: &Shrunk, options: &[&str], case: &Path) -> String {
    let case = case.display().to_string();
    let words = ["harness", "shrink", &case, "--test-only", "--check", &shrunk.fault.check];
    // Arguments of a process contain no NUL, the one character that a shell cannot quote.
    let line = shlex::try_join(words.into_iter().chain(options.iter().copied()));
    let line = line.expect("no argument contains NUL");
    match shrunk.trial.ranks {
        Ranks::Serial => line,
        Ranks::Mpi(ranks) => format!("{line} --ranks {ranks} --mpi"),
        Ranks::Simulated { ranks, seed } => format!("{line} --ranks {ranks} --seed {seed}"),
    }
}
