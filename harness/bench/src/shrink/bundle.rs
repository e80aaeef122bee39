//! Writes a shrunk case as a directory for a bug report.

use super::Shrunk;
use super::probe::Probe;
use super::reduce::size;
use check::diff;
use contract::case::Case;
use contract::plain::StlForm;
use run::engine::layout::Ranks;
use std::fs;
use std::io;
use std::path::Path;

/// The options with which `harness shrink` repeats a failure.
#[derive(Clone, Debug)]
pub struct Repeat {
    /// Name or path of the engine description.
    pub engine: String,
    /// Path of the program, if given.
    pub program: Option<String>,
}

impl Repeat {
    /// Returns a shell command that tests whether the case still fails the check.
    pub fn line(&self, case: &Path, check: &str, ranks: Ranks) -> String {
        let case = case.display().to_string();
        let mut words = vec!["harness", "shrink", &case, "--test-only", "--check", check];
        words.extend(["--engine", &self.engine]);
        words.extend(self.program.iter().flat_map(|program| ["--mesher", program]));
        // Arguments of a process contain no NUL, the one character that a shell cannot quote.
        let line = shlex::try_join(words).expect("no argument contains NUL");
        match ranks {
            Ranks::Serial => line,
            Ranks::Mpi(ranks) => format!("{line} --ranks {ranks} --mpi"),
            Ranks::Simulated { ranks, seed } => format!("{line} --ranks {ranks} --seed {seed}"),
        }
    }
}

/// Writes `case.toml`, `body.stl` and `README.md` into a directory; returns the text of the README.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    shrunk: &Shrunk,
    probe: &Probe,
    repeat: &Repeat,
    directory: &Path,
) -> io::Result<String> {
    fs::create_dir_all(directory)?;
    let case = shrunk.trial.case.write(directory, StlForm::Any)?;
    let line = repeat.line(&case, &shrunk.failure.check, shrunk.trial.ranks);
    let minimal =
        if shrunk.minimal { "nothing more can be removed" } else { "the budget is exhausted" };
    let text = format!(
        "{}\n\nShrunk from {} facets in {} trials ({minimal}) to: {}.\n\nTo repeat the failure:\n\n    {line}\n{}",
        shrunk.failure,
        shrunk.facets_before,
        shrunk.trials,
        size(&shrunk.trial),
        divergence(shrunk, probe, &case)
    );
    fs::write(directory.join("README.md"), format!("# A case that fails\n\n{text}"))?;
    Ok(text)
}

/// Returns the first differing leaf and the rule that decides it, if there are two meshes.
fn divergence(shrunk: &Shrunk, probe: &Probe, case: &Path) -> String {
    let Some(truth) = probe.truth_name().filter(|_| shrunk.failure.check != "runs") else {
        return String::new();
    };
    let compared = probe.meshes(&shrunk.trial).and_then(|[engine, truth]| {
        let case = Case::read(case).ok();
        diff::diff(&engine, &truth, case.as_ref()).map_err(|error| error.to_string())
    });
    match compared {
        Ok(report) => {
            let indented = report.to_string().replace('\n', "\n    ");
            format!(
                "\nThe difference between the meshes, where A is the engine's and B that of {truth}:\n\n    {indented}\n"
            )
        }
        Err(why) => format!("\nThe meshes could not be compared: {why}\n"),
    }
}
