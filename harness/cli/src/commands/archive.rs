//! `harness archive`: a report that others can replay; `harness replay`: repeats its runs.

use super::bench::{execute, print_without};
use super::report::{read, records_in};
use crate::options::Input;
use crate::output::put;
use bench::experiments::entry::{Line, Session};
use bench::replay::{Expected, Found, Replayed, Row, Value, Verdict};
use bench::study::package::{self, copy, package, require_made};
use bench::study::{SessionOptions, Study};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING, Failure, Result};
use contract::files::{Staging, nearest_directory};
use report::archive::{About, EXPECTED, METADATA, RECORD, STUDY, metadata, readme};
use report::pretty;
use report::table::Table;
use run::engine::description::is_own;
use run::engine::paths::Paths;
use run::engine::runner::{Engine, Given};
use std::fs;
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// `harness archive`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The report: a directory with a record, as `harness bench --report` makes it
    pub report: Input,
    /// The study that was executed
    pub study: Input,
    /// Directory to make, which must not exist
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    about: About,
}

/// Makes the archive, and prints which runs of the study it lacks; returns the exit code.
///
/// # Errors
/// If the record has no run, the study or a file of it cannot be read, or the directory cannot be made.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let Arguments { report, study, out, about } = arguments;
    let shown = out.display();
    Failure::unless(!out.exists(), format!("{shown} exists: name another directory"))?;
    let is_inside = nearest_directory(out).canonicalize()?.starts_with(report.canonicalize()?);
    let why = format!("{shown} is in the report: name a directory beside it");
    Failure::unless(!is_inside, why)?;
    let records = records_in(report)?;
    let lines = read(&records)?;
    let mut expected = Expected::of(&lines)?;
    let paths = Paths::find();
    let asked = Study::read(study)?;
    expected.missing.extend(require_made(&asked, &lines, &paths)?);
    let wrong = |error| Failure::at(out, error);
    let staging = Staging::beside(out).map_err(wrong)?;
    let place = staging.path();
    for name in list(report)? {
        let (from, to) = (report.join(&name), place.join(&name));
        if !records.contains(&from) && !name.starts_with("figures/") {
            to.parent().map_or(Ok(()), fs::create_dir_all)?;
            copy(&from, &to)?;
        }
    }
    let text = lines.iter().map(|line| serde_json::to_string(line).expect("plain data") + "\n");
    let put = |name: &str, text: String| put(&place.join(name), &text);
    put(RECORD, text.collect())?;
    // Those in the report may be of an earlier record.
    report::benchmark::report(place, &lines)?.notes.iter().for_each(|note| println!("{note}"));
    put(EXPECTED, pretty(&expected))?;
    let of_study = place.join(STUDY);
    fs::create_dir(&of_study).map_err(|error| Failure::at(&of_study, error))?;
    package(study, &paths, &of_study)?;
    let sources = paths.catalogue.path.with_file_name("SOURCES.md");
    if sources.is_file() {
        copy(&sources, &of_study.join("SOURCES.md"))?;
    }
    let page = if place.join("README.md").exists() { "REPLAY.md" } else { "README.md" };
    put(page, readme(about, &lines, &expected))?;
    let sized = |name: String| Ok((name.clone(), fs::metadata(place.join(name))?.len()));
    let members = list(place)?.into_iter().map(sized).collect::<Result<Vec<_>>>()?;
    put(METADATA, pretty(&metadata(about, &members, &lines)))?;
    staging.publish(|staged| fs::rename(staged, out)).map_err(wrong)?;
    let is_compared = |value: &&Value| !matches!(value.found, Found::Time(_));
    let (values, files) = (expected.values.iter().filter(is_compared).count(), members.len() + 1);
    println!("{}: {files} files, {values} values to be met by a replay", out.display());
    expected.missing.iter().for_each(|why| println!("{why}"));
    let engines = asked.engines().into_iter().filter(|name| name.ends_with(".toml"));
    let why = "what the scripts beside it import is not in the archive, unless a command names it";
    engines.for_each(|name| println!("{name}: {why}"));
    Ok(if expected.missing.is_empty() { EXIT_HOLDS } else { EXIT_MISSING })
}

/// The paths of the files in a directory and those in it. A link to a directory, which may lead in a circle, counts as a file.
fn list(directory: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in WalkDir::new(directory).min_depth(1) {
        let entry = entry.map_err(|error| Failure::at(directory, error.into()))?;
        let name = entry.path().strip_prefix(directory).expect("it is below");
        names.extend((!entry.file_type().is_dir()).then(|| name.to_string_lossy().into_owned()));
    }
    names.sort();
    Ok(names)
}

/// `harness replay`.
#[derive(Args, Debug)]
pub struct ReplayArguments {
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
    programs: Given,
}

/// Repeats the runs and prints expected values beside measured ones; returns the exit code.
///
/// # Errors
/// If the archive cannot be read, a program is missing, or the time does not suffice for one repetition.
pub fn replay(arguments: &ReplayArguments) -> Result<u8> {
    let ReplayArguments { archive, record, session, .. } = arguments;
    let lines = read(&[archive.join(RECORD)])?;
    let mut expected = Expected::of(&lines)?;
    let path = archive.join(EXPECTED);
    let text = files::read_text(&path).map_err(|error| Failure::at(&path, error))?;
    if text != pretty(&expected) {
        let why = "does not follow from the record: it was changed, or is of another version of the harness. The record's values are compared";
        eprintln!("harness: {} {why}", path.display());
    }
    let mut study = Study::read(&archive.join(STUDY).join(package::STUDY))?;
    expected.missing.extend(require_made(&study, &lines, &Paths::find())?);
    expected.missing.iter().for_each(|why| eprintln!("harness: not in the archive: {why}"));
    study.repeated = Some(expected.runs_within(f64::from(arguments.minutes) * 60.0)?);
    // A network that was given is no property of a machine. The last one is that of the values.
    let last = lines.iter().filter_map(Line::network).next_back().map(|(_, network)| network);
    let network = session.network.or(last.filter(|network| !network.measured));
    let session = SessionOptions { network, ..session.clone() };
    leave_out_missing(&mut study)?;
    let place = tempfile::tempdir()?;
    let temporary = place.path().join("replay.jsonl");
    let record = record.as_deref().unwrap_or(&temporary);
    let is_in_archive =
        fs::canonicalize(nearest_directory(record))?.starts_with(fs::canonicalize(&**archive)?);
    Failure::unless(!is_in_archive, "--record is in the archive: give a file elsewhere")?;
    let outcome = execute(&session, record, &mut study, &arguments.programs)?;
    if outcome.interrupted {
        return Ok(EXIT_INTERRUPTED);
    }
    let replayed = expected.compare(&outcome.lines);
    let session = outcome.lines.iter().find_map(Line::session);
    print!("{}", table(&replayed, session).text());
    let has_failed = print_without(&outcome.lines);
    let commit = session.map_or("", |session| &session.machine.commit);
    if commit != expected.commit {
        println!(
            "the archive is of commit {}, and this repository is at {commit}: counts may differ",
            expected.commit
        );
    }
    Ok(if has_failed { EXIT_FAILED } else { code(&replayed, expected.missing.is_empty()) })
}

/// Removes the programs of others that cannot be run here, and prints why.
fn leave_out_missing(study: &mut Study) -> Result<()> {
    let paths = Paths::find();
    for name in study.engines().iter().filter(|name| !is_own(name)) {
        let engine = Engine::find(name, None, &paths).and_then(|engine| engine.require());
        if let Err(Failure { why, .. }) = engine {
            eprintln!("harness: the runs of {name} are left out: {why}");
            study.series.iter_mut().for_each(|series| series.engines.retain(|other| other != name));
        }
    }
    let why = Failure::missing("no program of the archive is installed here");
    if study.engines().is_empty() { Err(why) } else { Ok(()) }
}

/// A row per run with the number of exact values that are equal, and one for each other value.
fn table(replayed: &Replayed, session: Option<&Session>) -> Table {
    let shown = |found: &Found| match found {
        Found::Exact(text) => text.clone(),
        Found::Ratio { value, .. } | Found::Time(value) => format!("{value:.4}"),
    };
    let band = |found: &Found| match found {
        Found::Exact(_) => "exact".to_owned(),
        Found::Ratio { low, high, .. } => format!("{low:.3} to {high:.3}"),
        Found::Time(_) => "not compared".to_owned(),
    };
    let row = |row: &Row| {
        let Value { run, quantity, found } = &row.expected;
        let verdict = match (row.verdict(), &row.measured) {
            (Verdict::NotCompared, Some(Found::Ratio { how, .. })) => how.clone(),
            (Verdict::NotCompared, _) => String::new(),
            (bad @ (Verdict::Differs | Verdict::Outside), _) => format!("{bad:?}").to_uppercase(),
            (other, _) => format!("{other:?}").to_lowercase(),
        };
        let measured = row.measured.as_ref().map(shown).unwrap_or_default();
        vec![run.clone(), quantity.clone(), shown(found), band(found), measured, verdict]
    };
    let mut rows = Vec::new();
    for of_run in replayed.0.chunk_by(|a, b| a.expected.run == b.expected.run) {
        let equal = of_run.iter().filter(|row| row.verdict() == Verdict::Equal).count();
        let count = equal.to_string();
        let all = [&of_run[0].expected.run, "digests and counts", &count, "exact", &count, "equal"];
        rows.extend((equal > 0).then(|| all.map(str::to_owned).to_vec()));
        rows.extend(of_run.iter().filter(|r| r.verdict() != Verdict::Equal).map(row));
    }
    use Verdict::{Differs, Equal, Inside, Missing, NotCompared, Outside};
    let [equal, differ, inside, outside, missing, left_out] =
        [Equal, Differs, Inside, Outside, Missing, NotCompared].map(|v| replayed.count(v));
    let mut notes = vec![format!(
        "exact: {equal} equal, {differ} differ; ratios: {inside} inside of their bands, {outside} outside; {missing} missing; \
         {left_out} not compared"
    )];
    notes.extend(session.and_then(Session::disturbed));
    let columns = vec!["run", "quantity", "expected", "band", "measured", "verdict"];
    Table { columns, rows, notes, ..Table::default() }
}

fn code(of: &Replayed, is_whole: bool) -> u8 {
    match () {
        () if !of.holds() => EXIT_FAILED,
        () if !is_whole || !of.is_judged() || of.count(Verdict::Missing) > 0 => EXIT_MISSING,
        () => EXIT_HOLDS,
    }
}
