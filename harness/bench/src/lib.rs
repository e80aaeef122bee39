//! Measurements of meshers and their analysis.
//!
//! - [`study`]: series of runs and targets, declared in a file; [`experiments`]: the runs, their record and its analysis;
//! - [`gate`](mod@gate): candidate against baseline; [`track`]: metrics by commit;
//! - [`shrink`](mod@shrink): the smallest case that still fails; [`replay`]: what a repetition elsewhere must give.

pub mod experiments;
pub mod gate;
pub mod jsonl;
pub mod order;
pub mod replay;
pub mod shrink;
pub mod study;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod track;

use contract::failure::Failure as Input;
use run::engine::failure::{End, Failure};
use run::engine::process::printed;
use run::engine::runner::Engine;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the name of a variant, as files have it.
fn name_of(variant: &impl serde::Serialize) -> String {
    let name = serde_json::to_value(variant).expect("a variant without data is a string");
    name.as_str().unwrap_or_default().to_owned()
}

/// Returns the first reason that applies.
fn refuse(reasons: &[(bool, &str)]) -> Result<(), String> {
    reasons.iter().find(|(applies, _)| *applies).map_or(Ok(()), |(_, why)| Err((*why).to_owned()))
}

/// Returns a command line for people, without the directories of programs and files.
pub fn shown(words: impl IntoIterator<Item = impl AsRef<OsStr>>) -> String {
    let word = |word: &OsStr| {
        let name = Path::new(word).file_name().filter(|_| Path::new(word).is_absolute());
        // A record may have zero bytes, which no argument of a process has.
        name.unwrap_or(word).to_string_lossy().replace('\0', "\u{fffd}")
    };
    let words: Vec<String> = words.into_iter().map(|of| word(of.as_ref())).collect();
    shlex::try_join(words.iter().map(String::as_str)).expect("zero bytes were replaced")
}

/// Returns what git prints in a directory; `None` if it fails.
fn git(directory: &Path, arguments: &[&str]) -> Option<String> {
    printed(Command::new("git").arg("-C").arg(directory).args(arguments))
}

/// Reads a TOML file.
fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, Input> {
    let text = contract::files::read_text(path).map_err(|error| Input::at(path, error))?;
    let read = toml::from_str(&text).map_err(|error| Input::about(path, error))?;
    geometries::refuse_surplus::<T>(&text).map_err(|why| Input::about(path, why))?;
    Ok(read)
}

/// Creates an empty directory for one run of an engine.
fn emptied(place: PathBuf, engine: &Engine) -> Result<PathBuf, Failure> {
    let _ = std::fs::remove_dir_all(&place);
    let created = std::fs::create_dir_all(&place);
    let why = |error| format!("has no directory {}: {error}", place.display());
    created.map_err(|error| Failure::new(engine.name(), End::Missing(why(error))))?;
    Ok(place)
}

/// Prints what a long command does on standard error. If that cannot be written, the command goes on.
fn announce(what: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{what}");
}
