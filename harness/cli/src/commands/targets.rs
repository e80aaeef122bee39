//! `harness targets`: measures the rows of a table of targets and prints which are met.

use super::session::{SessionArguments, progress, refuse, require};
use super::values::Input;
use bench::experiments::entry::{Entry, Judged, Line, Machine, Verdict};
use bench::experiments::session::BenchError;
use bench::targets::{self, Overrides, Targets};
use clap::Args;
use report::targets as page;
use run::engine::programs::Programs;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_MISSING, exit_first};
use std::path::{Path, PathBuf};

/// Name of the table in a report's directory.
const PAGE: &str = "targets.md";

/// `harness targets`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The table of targets, TOML
    pub file: Input,
    /// Only these rows
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Judge the rows by an existing record without measuring
    #[arg(long)]
    pub show: bool,
    /// Options of the session.
    #[command(flatten)]
    pub session: SessionArguments,
}

/// Measures, or reads an existing record with `--show`, and prints the table; returns the exit code.
pub fn run(arguments: Arguments) -> u8 {
    let code = match read(&arguments) {
        Ok(targets) if arguments.show => show(&targets, &arguments),
        Ok(targets) => measure(&targets, &arguments),
        Err(why) => {
            eprintln!("harness: {why}");
            Ok(EXIT_INPUT)
        }
    };
    arguments.session.write_report(code.unwrap_or_else(|code| code))
}

/// Reads the table, restricted to the rows of `--only`.
fn read(arguments: &Arguments) -> Result<Targets, String> {
    let mut targets = Targets::read(&arguments.file)?;
    let file = arguments.file.display();
    targets.only(&arguments.only).map_err(|why| format!("{file}: {why}"))?;
    Ok(targets)
}

fn measure(targets: &Targets, arguments: &Arguments) -> Result<u8, u8> {
    let session = &arguments.session;
    session.prepare()?;
    let programs = Programs::find(session.programs.given()).map_err(|why| {
        eprintln!("harness: {why}");
        EXIT_INPUT
    })?;
    require(programs.mesher.program())?;
    let overrides = Overrides {
        repeats: session.repeat.map(usize::from),
        no_mpi: session.no_mpi,
        no_launcher: !session.launcher.is_found(),
    };
    // The runs are those that rows need, not those of an experiment.
    let options = session.options(Vec::new());
    let outcome = targets::measure(&options, targets, &overrides, &programs, &mut progress())
        .map_err(|error| refuse(&error))?;
    let written = publish(targets, &outcome.rows, &outcome.lines, session.report.as_deref());
    println!("record: {}", options.record.display());
    if let Some(missing) = &outcome.missing {
        eprintln!("harness: {missing}");
    }
    Ok(match code(&outcome.rows) {
        _ if outcome.interrupted => refuse(&BenchError::Interrupted),
        EXIT_HOLDS if written.is_err() => EXIT_INPUT,
        EXIT_HOLDS if outcome.missing.is_some() => EXIT_MISSING,
        code => code,
    })
}

fn show(targets: &Targets, arguments: &Arguments) -> Result<u8, u8> {
    let content = arguments.session.read_record()?;
    let rows = targets::judged(targets, &content.lines);
    Ok(match publish(targets, &rows, &content.lines, arguments.session.report.as_deref()) {
        Ok(()) => code(&rows),
        Err(()) => exit_first(EXIT_INPUT, code(&rows)),
    })
}

/// Prints the table, and writes it into the report's directory if one is given.
fn publish(
    targets: &Targets,
    rows: &[Judged],
    lines: &[Line],
    report: Option<&Path>,
) -> Result<(), ()> {
    print!("{}", page::text(targets, rows));
    let Some(directory) = report else { return Ok(()) };
    let path = directory.join(PAGE);
    match write(&path, &page::markdown(targets, rows, &machine(lines))) {
        Ok(()) => println!("table: {}", path.display()),
        Err(error) => {
            eprintln!("harness: {}: {error}", path.display());
            return Err(());
        }
    }
    Ok(())
}

/// Replaces the file atomically: a synced temporary file in the same directory is renamed.
fn write(path: &PathBuf, text: &str) -> std::io::Result<()> {
    let directory = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(directory)?;
    let mut temporary = tempfile::NamedTempFile::new_in(directory)?;
    std::io::Write::write_all(&mut temporary, text.as_bytes())?;
    temporary.as_file().sync_all()?;
    temporary.persist(path).map(drop).map_err(|error| error.error)
}

/// Describes the machine of the last session.
fn machine(lines: &[Line]) -> String {
    let session = lines.iter().rev().find_map(|line| match &line.entry {
        Entry::Session(session) => Some(&session.machine),
        _ => None,
    });
    let Some(Machine { cpu, cores, kernel, mpi, compiler, commit, memory_bytes }) = session else {
        return "a machine that the record does not describe".to_owned();
    };
    let gib = memory_bytes >> 30;
    format!("{cpu}, {cores} cores, {gib} GiB, {kernel}, {mpi}, {compiler}, commit {commit}")
}

/// Returns the exit code: 1 if a row was missed or failed, 3 if none has a value.
fn code(rows: &[Judged]) -> u8 {
    let bad = |row: &Judged| matches!(row.verdict, Verdict::Missed | Verdict::Failed);
    match rows {
        _ if rows.iter().any(bad) => EXIT_FAILED,
        _ if rows.iter().all(|row| row.measured.is_none()) => {
            eprintln!("harness: no row was measured");
            EXIT_MISSING
        }
        _ => EXIT_HOLDS,
    }
}
