//! Outputs: files, and printing that never panics, and shows control characters of other programs as signs. The macros here replace those of the standard library in the whole program: a closed pipe, as in
//! `harness ... | head`, ends the printing and not the command, and a full disk becomes an exit code.

use contract::failure::{EXIT_HOLDS, EXIT_OUTPUT, Failure, Result, exit_first};
use contract::files::write_atomically;
use files::{message, plain};
use std::env;
use std::fmt::Arguments;
use std::fs::{OpenOptions, create_dir_all};
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::sync::OnceLock;

/// The first error of standard output, except that of a closed pipe.
static FAILURE: OnceLock<io::Error> = OnceLock::new();

macro_rules! print {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

macro_rules! println {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}

macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::write_error(format_args!($($text)*)) };
}

/// Writes to standard output, unless an input could not be read because it is an output: then no answer is true.
pub fn write(text: Arguments) {
    if files::clash().is_some() {
        return;
    }
    note(stdout().lock().write_all(plain(&text).as_bytes()));
}

/// Writes a message to standard error, at most a screen. If that fails, there is no place left to report it.
pub fn write_error(text: Arguments) {
    let _ = writeln!(stderr().lock(), "{}", message(&text));
}

fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = FAILURE.set(error);
    }
}

/// The exit code of a command that returned `code`: [`EXIT_OUTPUT`] if the command succeeded, but its output was lost.
pub fn finish(code: u8) -> u8 {
    note(stdout().flush());
    let Some(error) = FAILURE.get() else { return code };
    eprintln!("harness: standard output cannot be written: {error}");
    if code == EXIT_HOLDS { EXIT_OUTPUT } else { code }
}

/// Writes a file and creates its missing parent directories.
///
/// # Errors
/// The file's name and the reason.
pub fn put(path: &Path, content: impl AsRef<[u8]>) -> Result<()> {
    let make = || {
        path.parent().map_or(Ok(()), create_dir_all)?;
        write_atomically(path, |out| out.write_all(content.as_ref()))
    };
    make().map_err(|error| Failure::at(path, error))
}

/// The failure to write a report of a command that would return `code`: its code is the first of both.
pub fn unwritten(code: u8) -> impl Fn(Failure) -> Failure {
    move |Failure { code: other, why }| Failure {
        code: exit_first(code, other),
        why: format!("a report could not be written: {why}"),
    }
}

/// A file for a form of a report, if one was asked for, and the form.
pub type Form<'a> = (Option<&'a Path>, &'a dyn Fn() -> String);

/// Writes the forms that were asked for, and appends Markdown to the summary page of a GitHub action; returns the exit code of the
/// report.
///
/// # Errors
/// If a file cannot be written, with the exit code that comes first.
pub fn put_forms(code: u8, forms: &[Form], summary: Option<&str>) -> Result<u8> {
    let write = || -> Result<()> {
        for (file, form) in forms {
            file.map_or(Ok(()), |file| put(file, form()))?;
        }
        let page = env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty());
        if let (Some(page), Some(text)) = (page, summary) {
            let opened = OpenOptions::new().create(true).append(true).open(&page);
            let written = opened.and_then(|mut file| file.write_all(text.as_bytes()));
            written.map_err(|error| Failure::at(Path::new(&page), error))?;
        }
        Ok(())
    };
    write().map(|()| code).map_err(unwritten(code))
}
