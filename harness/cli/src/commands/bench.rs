//! `harness bench`: executes a study, appends to the record, and prints tables and which targets are met.

use crate::output::{put, unwritten};
use bench::experiments::entry::{Entry, Line, NoResult, Setup, TARGETS};
use bench::experiments::group::Groups;
use bench::order::distinct;
use bench::study::judge::{Judged, Verdict};
use bench::study::{self, NO_MPI, Outcome, SessionOptions, Study};
use clap::Args;
use contract::failure::{
    EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING, Failure, Result, exit_first,
};
use report::benchmark::tables;
use report::table::{Table, escaped};
use run::engine::description::is_own;
use run::engine::paths::Paths;
use run::engine::runner::{Engine, Given, Programs};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Name of the table of targets in a report's directory.
const PAGE: &str = "targets.md";

/// `harness bench`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The study, TOML: series of runs, and targets [default: reports/small.toml of the repository]
    file: Option<PathBuf>,
    /// Only these rows and experiments
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Programs of every series instead of the study's: mesher, reference, names in harness/engines or engine files
    #[arg(long, value_name = "NAME|FILE", value_delimiter = ',')]
    engine: Vec<String>,
    /// Print the tables of an existing record without measuring
    #[arg(long, conflicts_with_all = ["engine", "repeat", "network", "no_mpi", "launcher", "timeout", "mesher", "reference"])]
    show: bool,
    #[command(flatten)]
    session: SessionOptions,
    /// File of JSON lines to append to [default: reports/out/bench.jsonl]
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Also write a report; the record is then DIR/record.jsonl unless --record is given
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    programs: Given,
}

/// Measures, or reads an existing record with `--show`, and prints; returns the exit code.
///
/// # Errors
/// If the study or the record is invalid, a program is missing, or a report cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let (mut study, report) = (read(arguments)?, arguments.report.as_deref());
    let in_report = report.map(|directory| directory.join("record.jsonl"));
    let record = arguments.record.clone().or(in_report);
    let record = record.unwrap_or_else(|| PathBuf::from("reports/out/bench.jsonl"));
    let code = match arguments.show {
        true => {
            let mut lines = super::report::read(&[record])?;
            // A record may be of --engine.
            study.series.iter_mut().for_each(|series| series.engines.clear());
            lines.retain(|line| study.unasked(line).is_none());
            publish(&study, &study::judged(&study, &lines), &lines, arguments)?
        }
        false => measure(arguments, study, &record)?,
    };
    if let Some(directory) = report {
        super::report::write(directory, arguments.record.as_slice()).map_err(unwritten(code))?;
    }
    Ok(code)
}

/// Reads the study, restricted to the names of `--only`.
fn read(arguments: &Arguments) -> Result<Study> {
    let default = || Paths::find().root.join("reports/small.toml");
    let file = arguments.file.clone().unwrap_or_else(default);
    let mut study = Study::read(&file)?;
    study.only(&arguments.only).map_err(|why| Failure::about(&file, why))?;
    if arguments.engine.is_empty() {
        return Ok(study);
    }
    let why =
        "--engine is for series, and rows are judged of our mesher: name experiments with --only";
    let has_series_alone = !study.series.is_empty() && study.row.is_empty();
    Failure::unless(has_series_alone, Failure::about(&file, why))?;
    for series in &mut study.series {
        series.engines = distinct(arguments.engine.clone());
    }
    Ok(study)
}

fn measure(arguments: &Arguments, mut study: Study, record: &Path) -> Result<u8> {
    if let Some(directory) = &arguments.report {
        // A report that could not be written is refused before the runs.
        fs::create_dir_all(directory).map_err(|error| Failure::at(directory, error))?;
        files::check_writable(&directory.join(PAGE))?;
    }
    let outcome = execute(&arguments.session, record, &mut study, &arguments.programs)?;
    if outcome.interrupted && !outcome.lines.iter().any(is_result) {
        // There is nothing to tabulate or to report.
        print_without(&outcome.lines);
        return Err(Failure::interrupted());
    }
    let code = publish(&study, &outcome.rows, &outcome.lines, arguments);
    println!("record: {}", record.display());
    if outcome.interrupted {
        eprintln!("harness: interrupted: the record contains all results so far");
        return Ok(EXIT_INTERRUPTED);
    }
    Ok(exit_first(code?, if outcome.missing.is_none() { EXIT_HOLDS } else { EXIT_MISSING }))
}

/// Executes a study, and prints its progress and what is missing.
pub(super) fn execute(
    options: &SessionOptions,
    record: &Path,
    study: &mut Study,
    given: &Given,
) -> Result<Outcome> {
    let programs = programs(given, study)?;
    let options = &SessionOptions { version: env!("VERSION"), ..options.clone() };
    let start = Instant::now();
    let progress = |what: &str| eprintln!("[{:>5} s] {what}", start.elapsed().as_secs());
    let outcome = study::measure(options, record, study, &programs, &progress)?;
    outcome.missing.iter().for_each(|missing| eprintln!("harness: {missing}"));
    Ok(outcome)
}

/// Finds the programs, and replaces the names in the series by those of the results.
fn programs(given: &Given, study: &mut Study) -> Result<Programs> {
    let names = study.engines();
    let is_one = names.len() <= 1 || given.mesher.is_none();
    Failure::unless(is_one, "--mesher replaces the program of one engine: name one")?;
    let mut foreign = names.iter().filter(|name| !is_own(name));
    let mut programs = Programs::find(foreign.next().map_or("mesher", String::as_str), given)?;
    for name in foreign {
        programs.others.push(Engine::find(name, None, &programs.paths)?);
    }
    let mut known = HashSet::new();
    let mut labels = names.iter().map(|name| programs.named(name).label());
    if let Some(label) = labels.find(|label| !known.insert(study::file::plain(label))) {
        return Err(Failure::input(format!(
            "two programs of one name but for punctuation, {label}: rename a file"
        )));
    }
    // Our mesher chooses the spacings, also for other engines.
    let also = names.iter().any(|name| name != "reference").then_some(&programs.mesher);
    let mut required = also.into_iter().chain(names.iter().map(|name| programs.named(name)));
    required.try_for_each(Engine::require)?;
    for name in study.series.iter_mut().flat_map(|series| &mut series.engines) {
        *name = programs.named(name).label();
    }
    Ok(programs)
}

/// Prints the tables of runs and targets, and writes that of the targets into the report's directory if one is given; returns the exit
/// code.
fn publish(study: &Study, rows: &[Judged], lines: &[Line], of: &Arguments) -> Result<u8> {
    if !study.series.is_empty() {
        print!("{}", tables::text(&Groups::of(lines)));
        print_without(lines);
    }
    let code = code(study, rows, lines);
    if study.row.is_empty() {
        return Ok(code);
    }
    let table = targets(rows, &of.only);
    print!("{}", table.text());
    if let Some(directory) = &of.report {
        // A later session may have no run for a row.
        let last = lines.iter().rfind(|line| line.setup().is_some()).or(lines.last());
        let is_last = |line: &&Line| last.is_some_and(|of| of.session == line.session);
        let session = lines.iter().filter(is_last).find_map(Line::session);
        let path = directory.join(PAGE);
        let unknown = || "a machine that the record does not describe".to_owned();
        let machine = session.map_or_else(unknown, |session| session.machine.to_string());
        put(&path, markdown(&table, &machine)).map_err(unwritten(code))?;
        println!("table: {}", path.display());
    }
    Ok(code)
}

/// Prints the runs that failed or were left out; returns whether one failed.
pub(super) fn print_without(lines: &[Line]) -> bool {
    let mut has_failed = false;
    for line in lines {
        let (what, NoResult { setup, why }) = match &line.entry {
            Entry::Failure(failed) => ("failed", failed),
            Entry::LeftOut(left) => ("left out", left),
            _ => continue,
        };
        println!("{what}: {setup}: {why}");
        has_failed |= what == "failed";
    }
    has_failed
}

/// The table of targets, with the counts of the verdicts below it.
fn targets(rows: &[Judged], only: &[String]) -> Table {
    use Verdict::{Failed, ForComparison, LeftOut, Met, Missed};
    let count = |verdict: Verdict| {
        let count = rows.iter().filter(|row| row.verdict() == verdict).count();
        format!("{count} {}", verdict.words())
    };
    let mut counts = [Met, Missed, Failed, LeftOut, ForComparison].map(count).join(", ");
    if !only.is_empty() {
        counts += &format!("; of the study only {} (--only)", only.join(", "));
    }
    let columns = vec!["row", "target", "measured", "how", "verdict"];
    let rows = rows.iter().map(|row| row.fields().to_vec()).collect();
    Table { columns, rows, notes: vec![counts], ..Table::default() }
}

/// That table as a page, below a line about the machine and the counts.
fn markdown(table: &Table, machine: &str) -> String {
    let (machine, counts) = (escaped(machine), table.notes.concat());
    format!("# Targets\n\n{machine}\n\n{counts}\n\n{}", table.markdown())
}

fn is_result(line: &Line) -> bool {
    line.run().is_some_and(|run| !run.warm_up)
}

/// Returns the exit code: 1 if a run of a series or a row failed or a row was missed, 3 if nothing was measured, or nothing of a program
/// in an experiment on a case, or a target has no value, unless the user left its runs out.
fn code(study: &Study, rows: &[Judged], lines: &[Line]) -> u8 {
    let has_failed = lines.iter().zip(1..).any(|(line, after)| {
        let is_repeated = |later: &Line| is_result(later) && later.setup() == line.setup();
        matches!(line.entry, Entry::Failure(_)) && !lines[after..].iter().any(is_repeated)
    });
    fn of_series(setup: &Setup) -> [&str; 3] {
        [&setup.engine, &setup.experiment, &setup.case]
    }
    let results = lines.iter().filter(|line| is_result(line)).filter_map(Line::setup);
    let runs: HashSet<_> = results.map(of_series).collect();
    let left = lines.iter().filter(|line| matches!(line.entry, Entry::LeftOut(_)));
    // A row says itself that it was left out.
    let mut left = left.filter_map(Line::setup).map(of_series).filter(|of| of[1] != TARGETS);
    if rows.iter().any(Judged::is_bad) || !study.series.is_empty() && has_failed {
        return EXIT_FAILED;
    }
    let (without, has_series) = (left.find(|of| !runs.contains(of)), !study.series.is_empty());
    let is_open = |r: &Judged| {
        r.row.at_least.or(r.row.at_most).is_some() && r.measured.is_none() && r.why != NO_MPI
    };
    let why = match without {
        _ if !rows.is_empty() && rows.iter().all(|r| r.measured.is_none()) => "no row was measured",
        _ if rows.iter().any(is_open) => "a target has no value, and its row says why",
        _ if has_series && runs.is_empty() => "no series of the study has a run",
        Some(of) => &format!("nothing was measured of {}: the report says why", of.join(", ")),
        None => return EXIT_HOLDS,
    };
    eprintln!("harness: {why}");
    EXIT_MISSING
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Run};
    use bench::study::judge::unjudged;
    use bench::testing::{line, run, study as read};

    #[test]
    fn a_study_is_complete_if_every_program_has_a_run() {
        let series =
            "[[series]]\nexperiment = 'strong'\ncase = 'cube'\nengines = ['mesher', 'x']\n";
        let study = read(series).unwrap();
        let run_of = |engine: &str, warm_up| {
            let mut run = Run { warm_up, ..run(Comm::Solo, 1, &[("a", &[1.0])]) };
            run.setup.engine = engine.into();
            line(Entry::Run(Box::new(run)))
        };
        let [mesher, warm_up, other] =
            [("mesher", false), ("x", true), ("x", false)].map(|(name, warm)| run_of(name, warm));
        let (setup, why) = (warm_up.run().expect("a run").setup.clone(), "declined".to_owned());
        let left = line(Entry::LeftOut(NoResult { setup, why }));
        let all = [mesher, warm_up, left, other];
        assert_eq!(code(&study, &[], &all[..3]), EXIT_MISSING);
        assert_eq!(code(&study, &[], &all), EXIT_HOLDS);
        // What it does in one experiment does not make up for another one.
        let [mut weak, mut of_row] = [all[2].clone(), all[2].clone()];
        for (line, experiment) in [(&mut weak, "weak"), (&mut of_row, TARGETS)] {
            let Entry::LeftOut(left) = &mut line.entry else { panic!("{line:?}") };
            left.setup.experiment = experiment.into();
        }
        assert_eq!(code(&study, &[], &[&all[..], &[weak]].concat()), EXIT_MISSING);
        assert_eq!(code(&study, &[], &[&all[..], &[of_row]].concat()), EXIT_HOLDS);
        // Nor do series make up for rows of which none has a value.
        let rows = "[mesh.a]\ncase = 'cube'\n[run.a]\nmesh = 'a'\n[[row]]\nname = 'r'\nrun = 'a'\nmeasure = 'seconds'\n";
        let both = read(&format!("{series}{rows}")).unwrap();
        let left = unjudged(&both.row[0], false, "no launcher".into());
        assert_eq!(code(&both, &[left], &all), EXIT_MISSING);
        // Nor does a row with a value for a target without one, unless the user left it out.
        let target = read(&rows.replace("'seconds'", "'seconds'\nat_most = 9")).unwrap();
        let row = |why: &str| unjudged(&target.row[0], false, why.into());
        let met = Judged { measured: Some((1.0, "measured")), ..row("") };
        for (why, expected) in [("not in the record", EXIT_MISSING), (NO_MPI, EXIT_HOLDS)] {
            assert_eq!(code(&target, &[met.clone(), row(why)], &[]), expected, "{why}");
        }
    }

    #[test]
    fn every_verdict_is_shown_with_its_reason() {
        let study = read(
            "mesh.a.case = \"a\"\nrun.a.mesh = \"a\"\n[[row]]\nname = \"rate|1\"\nrun = \"a\"\n\
             measure = \"cells_per_second_per_core\"\nat_least = 100e6\nat_most = 3e8\n",
        )
        .unwrap();
        let row = &study.row[0];
        let missed =
            Judged { measured: Some((99.5e6, "measured")), ..unjudged(row, false, String::new()) };
        let failed = unjudged(row, true, "run a failed: <no memory>".into());
        let table = targets(&[missed, failed], &[]);
        let text = table.text();
        for part in [
            "at least 100.00 M cells/s, at most 300.00 M cells/s",
            "99.50 M cells/s  measured  MISSED",
            "FAILED: run a failed: <no memory>",
            "0 met, 1 missed, 1 failed, 0 left out, 0 for comparison",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        let of_one = markdown(&targets(&[], &["rate|1".into()]), "2 cores");
        assert!(of_one.contains("for comparison; of the study only rate"), "{of_one}");
        let markdown = markdown(&table, "2 cores");
        assert!(!markdown.contains("--only"), "{markdown}");
        let table: Vec<&str> = markdown.lines().filter(|l| l.starts_with('|')).collect();
        assert_eq!(table.len(), 4);
        assert!(table[1].starts_with("| --- | --- |"), "{markdown}");
        assert!(table[2].starts_with("| rate\\|1 |") && markdown.contains("&lt;no memory&gt;"));
    }
}
