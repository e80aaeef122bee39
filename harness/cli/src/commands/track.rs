//! `harness track`: appends metrics to the history and reports change points.

use crate::options::{Input, Output, examples, number_in};
use crate::output::put_forms;
use bench::jsonl;
use bench::track::history::{self, History, Record};
use bench::track::{LEVEL_MIN, Series, VALUES_MIN, analyse};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Failure, Result};
use report::pretty;
use report::track::{COMMIT, junit, page, summary};
use std::path::{Path, PathBuf};

/// `harness track`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/track.md")))]
pub struct Arguments {
    /// The history: JSON lines, one record per commit
    history: PathBuf,
    /// Append the numbers of this record or JSON report of `harness gate`; may be repeated
    #[arg(long, value_name = "FILE")]
    add: Vec<Input>,
    /// The commit of the appended numbers [default: that of the file, or HEAD; none for a working tree with changes]
    #[arg(long, value_name = "REVISION", requires = "add")]
    commit: Option<String>,
    /// Accept the change of every metric at this commit of the history, or the nearest within two values and ten commits, so that it no
    /// longer fails; may be repeated
    #[arg(long, value_name = "COMMIT")]
    accept: Vec<String>,
    /// The repository that the commit is in [default: that of the current directory]
    #[arg(long, value_name = "DIR", requires = "add")]
    repository: Option<PathBuf>,
    /// Write the trend page
    #[arg(long, value_name = "FILE")]
    page: Option<Output>,
    /// Address of a commit for the links of the page, with {commit}, such as https://host/name/repository/commit/{commit}
    #[arg(long, value_name = "URL", requires = "page")]
    link: Option<String>,
    /// Write a test per metric as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<Output>,
    /// Write all series with their change points as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Exit code 1 (and a failed test) if a metric became worse within its last N values, and has not become as good again: at least 5, as
    /// with fewer most steps of a metric with noise are never seen, and rather 8
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(LEVEL_MIN as u64..))]
    fail_recent: Option<usize>,
    /// Rate of false discoveries: the probability of any false change point if nothing changed
    #[arg(long, default_value_t = 0.01, value_parser = number_in(1e-6..=1.0))]
    alpha: f64,
}

/// Appends, analyses, prints and writes; returns the exit code.
///
/// # Errors
/// If the history cannot be read or continued, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let (shown, link) = (arguments.history.display(), arguments.link.as_deref());
    let why = "--link has no {commit}, the place of a commit's hash";
    Failure::unless(link.is_none_or(|link| link.contains(COMMIT)), why)?;
    let why = format!("{shown} is missing: give a history, or the first numbers with --add");
    Failure::unless(!arguments.add.is_empty() || arguments.history.exists(), why)?;
    append(arguments)?;
    arguments.accept.iter().try_for_each(|commit| history::accept(&arguments.history, commit))?;
    let History { records, warnings } = history::read(&arguments.history)?;
    warnings.iter().for_each(|warning| eprintln!("harness: {shown}: {warning}"));
    let all = analyse(&records, arguments.alpha);
    println!("{} commits, {} metrics", records.len(), all.len());
    if all.is_empty() {
        let why = "no record has a metric, so nothing was compared";
        return Err(Failure::missing(format!("{shown}: {why}")));
    }
    let last_record = records.len() - 1;
    let ended = all.iter().filter(|s| s.points.last().is_none_or(|p| p.0 < last_record));
    ended.for_each(|series| println!("not in the last record: {}", series.name));
    print!("{}", summary(&all));
    let few = all.iter().filter(|series| series.points.len() < VALUES_MIN).count();
    if few > 0 {
        println!("in {few} metrics no step can be found yet: fewer than {VALUES_MIN} values");
    }
    for commit in &arguments.accept {
        let at = records.iter().position(|record| record.commit.starts_with(commit));
        if !all.iter().any(|series| at.is_some_and(|at| series.has_step_near(at))) {
            println!("accepted without effect: no metric has a step near {commit}");
        }
    }
    let recent = arguments.fail_recent.unwrap_or(0);
    let is_worse = |series: &&Series| series.worse_recently(recent).is_some();
    let worse: Vec<&str> = all.iter().filter(is_worse).map(|series| &*series.name).collect();
    if !worse.is_empty() {
        println!("FAILED: worse within the last {recent} values: {}", worse.join(", "));
    }
    put_forms(
        if worse.is_empty() { EXIT_HOLDS } else { EXIT_FAILED },
        &[
            (arguments.page.as_deref(), &|| page(&records, &all, link)),
            (arguments.junit.as_deref(), &|| junit(&all, recent)),
            (arguments.json.as_deref(), &|| pretty(&all)),
        ],
        None,
    )
}

fn append(arguments: &Arguments) -> Result<()> {
    // An unreadable history is refused before anything is appended to it.
    history::read(&arguments.history)?;
    let repository = arguments.repository.as_deref().unwrap_or(Path::new("."));
    let commit = arguments.commit.as_deref();
    // Each file has a machine and geometries of its own.
    let of_file = |file: &Input| {
        let text = contract::files::read(file).map_err(|error| Failure::at(file, error))?;
        let record = Record::of_gate(&text, commit, repository);
        let record = record.map_err(|why| Failure::about(file, why))?;
        let why = format!("{} has no metric, so nothing is appended", file.display());
        if record.metrics.is_empty() { Err(Failure::missing(why)) } else { Ok(record) }
    };
    let records = arguments.add.iter().map(of_file).collect::<Result<Vec<_>>>()?;
    // It would make the history unreadable.
    records.iter().try_for_each(Record::check).map_err(Failure::input)?;
    for record in &records {
        let appended = jsonl::append(&arguments.history, record);
        appended.map_err(|error| Failure::at(&arguments.history, error))?;
        println!("appended to commit {:.12}: {}", record.commit, record.subject);
    }
    Ok(())
}
