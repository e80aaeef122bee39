//! `harness replay`: repeats the runs of an archive.

use super::archive::{EXPECTED, STUDY};
use super::bench::programs;
use super::programs::ProgramArguments;
use super::values::Input;
use bench::replay::{Expected, Found, Replayed, Row, Verdict};
use bench::study::{self, SessionOptions, Study, package};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING, Failure};
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
    let path = archive.join(EXPECTED);
    let text = files::read_text(&path).map_err(|error| Failure::at(&path, error))?;
    let expected = Expected::parse(&text).map_err(|why| Failure::input(why).of_file(&path))?;
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
    let replayed = expected.compare(&outcome.lines);
    print!("{}", table(&replayed).text());
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

fn table(replayed: &Replayed) -> Table {
    let shown = |found: &Found| match found {
        Found::Exact(text) => text.clone(),
        Found::Ratio { value, .. } | Found::Time(value) => format!("{value:.4}"),
    };
    let band = |row: &Row| match &row.expected.found {
        Found::Ratio { low, high, .. } => format!("{low:.3} to {high:.3}"),
        Found::Exact(_) => "exact".to_owned(),
        Found::Time(_) => "not compared".to_owned(),
    };
    let how = |found: &Found| match found {
        Found::Ratio { how, .. } => how.clone(),
        _ => String::new(),
    };
    let verdict = |row: &Row| match row.verdict {
        Verdict::Equal => "equal".to_owned(),
        Verdict::Differs => "DIFFERS".to_owned(),
        Verdict::Inside => "inside".to_owned(),
        Verdict::Outside => "OUTSIDE".to_owned(),
        Verdict::Missing => "missing".to_owned(),
        Verdict::NotCompared => row.measured.as_ref().map(how).unwrap_or_default(),
    };
    let table = Table::of(
        String::new(),
        &replayed.0,
        &[
            ("run", &|row| row.expected.run.clone()),
            ("quantity", &|row| row.expected.quantity.clone()),
            ("expected", &|row| shown(&row.expected.found)),
            ("band", &band),
            ("measured", &|row| row.measured.as_ref().map(shown).unwrap_or_default()),
            ("verdict", &verdict),
        ],
    );
    let count = |verdict| replayed.count(verdict);
    let note = format!(
        "exact: {} equal, {} differ; ratios: {} inside of their bands, {} outside; {} missing; {} not compared",
        count(Verdict::Equal),
        count(Verdict::Differs),
        count(Verdict::Inside),
        count(Verdict::Outside),
        count(Verdict::Missing),
        count(Verdict::NotCompared)
    );
    Table { notes: vec![note], ..table }
}

fn code(replayed: &Replayed) -> u8 {
    match () {
        () if !replayed.holds() => EXIT_FAILED,
        () if !replayed.is_judged() || replayed.count(Verdict::Missing) > 0 => EXIT_MISSING,
        () => EXIT_HOLDS,
    }
}
