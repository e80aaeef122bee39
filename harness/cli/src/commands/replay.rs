//! `harness replay`: repeats the runs of an archive.

use super::bench::programs;
use super::programs::ProgramArguments;
use super::report::read;
use super::values::Input;
use bench::experiments::entry::{Line, Session};
use bench::replay::{Expected, Found, Replayed, Row, Value, Verdict};
use bench::study::{self, SessionOptions, Study, package};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING, Failure};
use report::archive::{EXPECTED, RECORD, STUDY};
use report::table::Table;
use run::engine::description::is_own;
use run::engine::paths::Paths;
use run::engine::runner::Engine;
use std::path::PathBuf;
use std::time::Instant;

/// `harness replay`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The archive: a directory that `harness archive` made
    pub archive: Input,
    /// Time that the runs may take, by the clock of the archive's machine; the number of repetitions follows from it
    #[arg(long, value_name = "MINUTES", default_value_t = 60, value_parser = clap::value_parser!(u16).range(1..))]
    pub minutes: u16,
    /// File of JSON lines to append the runs to [default: none remain]
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    #[command(flatten)]
    session: SessionOptions,
    #[command(flatten)]
    programs: ProgramArguments,
}

/// Repeats the runs and prints expected values beside measured ones; returns the exit code.
///
/// # Errors
/// If the archive cannot be read, a program is missing, or the time does not suffice for one repetition.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let Arguments { archive, record, session, .. } = arguments;
    let expected = Expected::of(&read(&[archive.join(RECORD)])?)?;
    let path = archive.join(EXPECTED);
    let text = files::read_text(&path).map_err(|error| Failure::at(&path, error))?;
    if text != expected.json() {
        let why = "does not follow from the record: it was changed, or is of another version of the harness. The record's values are compared";
        eprintln!("harness: {} {why}", path.display());
    }
    let mut study = Study::read(&archive.join(STUDY).join(package::STUDY))?;
    let fitting = expected.repeats_within(f64::from(arguments.minutes) * 60.0)?;
    let session = SessionOptions { repeat: session.repeat.or(fitting), ..session.clone() };
    leave_out_missing(&mut study)?;
    let programs = programs(arguments.programs.given(), &mut study)?;
    let place = tempfile::tempdir()?;
    let temporary = place.path().join("replay.jsonl");
    let record = record.as_deref().unwrap_or(&temporary);
    let start = Instant::now();
    let progress = |what: &str| eprintln!("[{:>5} s] {what}", start.elapsed().as_secs());
    let outcome = study::measure(&session, record, &study, &programs, &progress)?;
    if outcome.interrupted {
        return Ok(EXIT_INTERRUPTED);
    }
    if let Some(missing) = &outcome.missing {
        eprintln!("harness: {missing}");
    }
    let replayed = expected.compare(&outcome.lines);
    let session = outcome.lines.iter().find_map(Line::session);
    print!("{}", table(&replayed, session).text());
    let commit = session.map_or("", |session| &session.machine.commit);
    if commit != expected.commit {
        println!(
            "the archive is of commit {}, and this repository is at {commit}: counts may differ",
            expected.commit
        );
    }
    Ok(code(&replayed))
}

/// Removes the programs of others that are not installed here, and says so.
fn leave_out_missing(study: &mut Study) -> Result<(), Failure> {
    let paths = Paths::find();
    for name in study.engines().iter().filter(|name| !is_own(name)) {
        let found = Engine::find(name, None, &paths);
        if found.as_ref().is_ok_and(|engine| engine.program().is_file()) {
            continue;
        }
        eprintln!("harness: {name} is not installed here: its runs are left out");
        study.series.iter_mut().for_each(|series| series.engines.retain(|other| other != name));
    }
    study.series.retain(|series| !series.engines.is_empty());
    match study.series.is_empty() && study.row.is_empty() {
        true => Err(Failure::missing("no program of the archive is installed here")),
        false => Ok(()),
    }
}

/// A row per run with the number of exact values that are equal, and one for each other value.
fn table(replayed: &Replayed, session: Option<&Session>) -> Table {
    let shown = |found: &Found| match found {
        Found::Exact(text) => text.clone(),
        Found::Ratio { value, .. } | Found::Time(value) => format!("{value:.4}"),
    };
    let row = |row: &Row| {
        let (band, how) = match (&row.expected.found, &row.measured) {
            (Found::Exact(_), _) => ("exact".to_owned(), ""),
            (Found::Ratio { low, high, .. }, Some(Found::Ratio { how, .. })) => {
                (format!("{low:.3} to {high:.3}"), how.as_str())
            }
            (Found::Ratio { low, high, .. }, _) => (format!("{low:.3} to {high:.3}"), ""),
            (Found::Time(_), _) => ("not compared".to_owned(), ""),
        };
        let verdict = match row.verdict {
            Verdict::Equal => "equal",
            Verdict::Differs => "DIFFERS",
            Verdict::Inside => "inside",
            Verdict::Outside => "OUTSIDE",
            Verdict::Missing => "missing",
            Verdict::NotCompared => how,
        };
        let (expected, measured) = (shown(&row.expected.found), row.measured.as_ref().map(shown));
        let Value { run, quantity, .. } = &row.expected;
        [run, quantity, &expected, &band, &measured.unwrap_or_default(), verdict]
            .map(|field: &str| field.to_owned())
            .to_vec()
    };
    let mut rows = Vec::new();
    for of_run in replayed.0.chunk_by(|a, b| a.expected.run == b.expected.run) {
        let equal = of_run.iter().filter(|row| row.verdict == Verdict::Equal).count();
        let count = equal.to_string();
        let all = [&of_run[0].expected.run, "digests and counts", &count, "exact", &count, "equal"];
        rows.extend((equal > 0).then(|| all.map(str::to_owned).to_vec()));
        rows.extend(of_run.iter().filter(|r| r.verdict != Verdict::Equal).map(row));
    }
    let count = |verdict| replayed.count(verdict);
    let mut notes = vec![format!(
        "exact: {} equal, {} differ; ratios: {} inside of their bands, {} outside; {} missing; {} not compared",
        count(Verdict::Equal),
        count(Verdict::Differs),
        count(Verdict::Inside),
        count(Verdict::Outside),
        count(Verdict::Missing),
        count(Verdict::NotCompared)
    )];
    let busy = session.filter(|s| s.load_average > 0.5 * s.machine.cores as f64);
    notes.extend(busy.map(|s| {
        let Session { load_average, machine, .. } = s;
        format!(
            "the load was {load_average} on {} cores when it began: ratios need an idle machine",
            machine.cores
        )
    }));
    let columns = vec!["run", "quantity", "expected", "band", "measured", "verdict"];
    Table { columns, rows, notes, ..Table::default() }
}

fn code(replayed: &Replayed) -> u8 {
    match () {
        () if !replayed.holds() => EXIT_FAILED,
        () if !replayed.is_judged() || replayed.count(Verdict::Missing) > 0 => EXIT_MISSING,
        () => EXIT_HOLDS,
    }
}
