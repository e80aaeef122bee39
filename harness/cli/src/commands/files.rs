//! Writing files.

use super::values::Output;
use contract::failure::Failure;
use contract::failure::{EXIT_INPUT, exit_first};
use contract::files::{named, write_atomically};
use std::path::Path;
use std::{env, fs, io};

/// Writes a file and creates its missing parent directories.
///
/// # Errors
/// The file's name and the reason.
pub fn put(path: &Path, text: &str) -> io::Result<()> {
    let make = || {
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory)?;
        }
        write_atomically(path, |out| out.write_all(text.as_bytes()))
    };
    make().map_err(|error| named(path, &error))
}

/// A file for a form of a report, if it was asked for, and the form.
pub type Form<'a> = (&'a Option<Output>, &'a dyn Fn() -> String);

/// Writes the forms that were asked for, and appends Markdown to the summary page of a GitHub action; returns the exit code of the
/// report.
///
/// # Errors
/// If a file cannot be written, with the exit code that comes first.
pub fn put_forms(code: u8, forms: &[Form], summary: Option<&str>) -> Result<u8, Failure> {
    let write = || -> io::Result<()> {
        for (file, form) in forms {
            file.as_ref().map_or(Ok(()), |file| put(file, &form()))?;
        }
        let page = env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty());
        if let (Some(page), Some(text)) = (page, summary) {
            let mut file = fs::OpenOptions::new().create(true).append(true).open(page)?;
            io::Write::write_all(&mut file, text.as_bytes())?;
        }
        Ok(())
    };
    write().map(|()| code).map_err(|error| Failure {
        code: exit_first(code, EXIT_INPUT),
        why: format!("a report could not be written: {error}"),
    })
}
