//! `harness report`: draws figures and a page from records.

use bench::experiments::entry::{Entry, Line};
use bench::experiments::record;
use clap::Args;
use contract::failure::EXIT_HOLDS;
use contract::failure::Failure;
use report::benchmark::report;
use std::path::{Path, PathBuf};

/// `harness report`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Directory for the report; its files *.jsonl are the records unless --record names some
    pub directory: PathBuf,
    /// A record of `harness bench`; may be repeated
    #[arg(long, value_name = "FILE")]
    pub record: Vec<PathBuf>,
}

/// Writes the report; returns the exit code.
///
/// # Errors
/// As [`write`].
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    write(&arguments.directory, &arguments.record)?;
    Ok(EXIT_HOLDS)
}

/// Reads records, writes the report into `directory` and prints a summary.
///
/// # Errors
/// One sentence, if a record cannot be read, or the report cannot be written.
pub fn write(directory: &Path, given: &[PathBuf]) -> Result<(), String> {
    let records = if given.is_empty() { records_in(directory)? } else { given.to_vec() };
    let mut lines = Vec::new();
    for path in &records {
        let (read, broken) =
            record::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
        for (line, why) in broken {
            eprintln!("harness: {}, line {line} is skipped: {why}", path.display());
        }
        lines.extend(read);
    }
    if lines.is_empty() {
        let shown = directory.display();
        return Err(format!(
            "no results to report: {shown} has no record; make one with harness bench"
        ));
    }
    let written = report(directory, &lines).map_err(|error| error.to_string())?;
    let shows_nothing = |line: &Line| {
        matches!(line.entry, Entry::Session(_) | Entry::Failure(_) | Entry::LeftOut(_))
    };
    if lines.iter().all(shows_nothing) {
        return Err(format!("no run succeeded; {} lists the reasons", written.page.display()));
    }
    for (rule, why) in &written.broken {
        println!("rule {rule} broken: {why}");
    }
    if !cfg!(feature = "figures") {
        println!("PNG and PDF are left out: the harness was built without its feature figures");
    }
    println!("{} figures; the page is {}", written.figures, written.page.display());
    Ok(())
}

fn records_in(directory: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(directory)
        .map_err(|error| format!("{}: {error}", directory.display()))?;
    let is_record = |path: &PathBuf| path.extension().is_some_and(|e| e == "jsonl");
    let mut found: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(is_record).collect();
    found.sort();
    Ok(found)
}
