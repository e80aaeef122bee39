//! `harness bench --targets FILE`: a file of targets in, a table out, exit code.

use crate::cli_bench::{self, BenchArguments};
use harness::bench::BenchError;
use harness::bench::entry::{Judged, Line, Machine, Verdict, What};
use harness::bench::record;
use harness::bench::targets::{self, Targets, Wishes, page};
use harness::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_MISSING};
use std::path::{Path, PathBuf};

/// Name of the table in a report's directory.
const PAGE: &str = "targets.md";

/// Measures, or with `--show` looks at an existing record; prints the table; the exit code.
pub fn run(file: &Path, arguments: BenchArguments) -> u8 {
    let read = Targets::read(file).and_then(|mut targets| {
        targets.only(&arguments.only).map_err(|why| format!("{}: {why}", file.display()))?;
        Ok(targets)
    });
    match read {
        Ok(targets) if arguments.show => show(&targets, &arguments),
        Ok(targets) => measure(&targets, arguments),
        Err(why) => {
            eprintln!("harness: {why}");
            EXIT_INPUT
        }
    }
}

fn measure(targets: &Targets, arguments: BenchArguments) -> u8 {
    let programs = match cli_bench::programs(&arguments) {
        Ok(programs) => programs,
        Err(code) => return code,
    };
    let report = arguments.report.clone();
    let wishes = Wishes {
        repeats: arguments.repeat.map(usize::from),
        no_mpi: arguments.no_mpi,
        no_launcher: !arguments.launcher.is_found(),
    };
    let options = cli_bench::options(arguments, &programs);
    let mut say = cli_bench::teller();
    let outcome = match targets::measure(&options, targets, &wishes, &programs, &mut say) {
        Ok(outcome) => outcome,
        Err(error) => return cli_bench::refuse(&error),
    };
    let written = tell(targets, &outcome.rows, &outcome.lines, report.as_deref());
    println!("record: {}", options.record.display());
    if let Some(missing) = &outcome.missing {
        eprintln!("harness: {missing}");
    }
    match code(&outcome.rows) {
        _ if outcome.interrupted => cli_bench::refuse(&BenchError::Interrupted),
        EXIT_HOLDS if written.is_err() => EXIT_INPUT,
        EXIT_HOLDS if outcome.missing.is_some() => EXIT_MISSING,
        code => code,
    }
}

fn show(targets: &Targets, arguments: &BenchArguments) -> u8 {
    let path = cli_bench::record_path(arguments);
    let content = match record::read(&path) {
        Ok(content) => content,
        Err(error) => {
            eprintln!("harness: {}: {error}", path.display());
            return EXIT_INPUT;
        }
    };
    for (line, why) in &content.broken {
        eprintln!("harness: line {line} is passed over: {why}");
    }
    let rows = targets::judged(targets, &content.lines);
    match tell(targets, &rows, &content.lines, arguments.report.as_deref()) {
        Ok(()) => code(&rows),
        Err(()) => EXIT_INPUT.max(code(&rows)),
    }
}

/// Prints the table, and writes it into the report's directory if there is one.
fn tell(
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

/// Beside, synced, renamed.
fn write(path: &PathBuf, text: &str) -> std::io::Result<()> {
    let directory = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(directory)?;
    let mut beside = tempfile::NamedTempFile::new_in(directory)?;
    std::io::Write::write_all(&mut beside, text.as_bytes())?;
    beside.as_file().sync_all()?;
    beside.persist(path).map(drop).map_err(|error| error.error)
}

/// Where the last session ran.
fn machine(lines: &[Line]) -> String {
    let session = lines.iter().rev().find_map(|line| match &line.what {
        What::Session(session) => Some(&session.machine),
        _ => None,
    });
    let Some(Machine { cpu, cores, kernel, mpi, compiler, commit, memory_bytes }) = session else {
        return "a machine that the record does not describe".to_owned();
    };
    let gib = memory_bytes >> 30;
    format!("{cpu}, {cores} cores, {gib} GiB, {kernel}, {mpi}, {compiler}, commit {commit}")
}

/// 0 where nothing was missed or failed.
fn code(rows: &[Judged]) -> u8 {
    let bad = |row: &Judged| matches!(row.verdict, Verdict::Missed | Verdict::Failed);
    if rows.iter().any(bad) { EXIT_FAILED } else { EXIT_HOLDS }
}
