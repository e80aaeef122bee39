//! `harness archive`: a report that others can replay.

use super::report::{read, records_in};
use super::values::Input;
use bench::experiments::entry::{Entry, Line};
use bench::order::distinct;
use bench::replay::{TOLERANCE, expected};
use bench::study::Study;
use bench::study::package::{copy, package};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure};
use contract::files::{Staging, named, nearest_directory, write_atomically};
use run::engine::paths::Paths;
use std::fs;
use std::path::{Path, PathBuf};

/// All records.
pub(super) const RECORD: &str = "record.jsonl";
/// Directory of the study, its cases and geometries.
pub(super) const STUDY: &str = "study";

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
}

/// Makes the archive; returns the exit code.
///
/// # Errors
/// If the record has no run, the study or a file of it cannot be read, or the directory cannot be made.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let Arguments { report, study, out } = arguments;
    if out.exists() {
        return Err(Failure::input(format!("{} exists: name another directory", out.display())));
    }
    let inside = nearest_directory(out).canonicalize()?.starts_with(report.canonicalize()?);
    if inside {
        let why = format!("{} is in the report: name a directory beside it", out.display());
        return Err(Failure::input(why));
    }
    let records = records_in(report)?;
    let lines = read(&records)?;
    let values = expected(&lines)?.len();
    let of_study = Study::read(study)?;
    let other = lines.iter().find_map(|line| match &line.entry {
        Entry::Run(run) => Some(&run.setup.case).filter(|case| !of_study.has_case(case)),
        _ => None,
    });
    if let Some(case) = other {
        let why = format!(
            "the record has runs on {case}, and the study has no such case: give the study that made it"
        );
        return Err(Failure::input(why));
    }
    let wrong = |error| named(out, &error);
    let staging = Staging::beside(out).map_err(wrong)?;
    let place = staging.path();
    copy_tree(report, place, &|path| records.iter().all(|record| record != path))?;
    let text = lines.iter().map(|line| serde_json::to_string(line).expect("plain data") + "\n");
    let put = |name: &str, text: String| {
        let path = place.join(name);
        write_atomically(&path, |out| out.write_all(text.as_bytes()))
            .map_err(|error| Failure::at(&path, error))
    };
    put(RECORD, text.collect())?;
    let of_study = place.join(STUDY);
    fs::create_dir(&of_study).map_err(|error| Failure::at(&of_study, error))?;
    let catalogue = Paths::find().catalogue;
    package(study, &catalogue, &of_study)?;
    let sources = catalogue.path().with_file_name("SOURCES.md");
    if sources.is_file() {
        copy(&sources, &of_study.join("SOURCES.md"))?;
    }
    let page = if place.join("README.md").exists() { "REPLAY.md" } else { "README.md" };
    put(page, readme(&lines))?;
    staging.publish(|staged| fs::rename(staged, out)).map_err(wrong)?;
    println!("{}: {values} values to be met by a replay", out.display());
    Ok(EXIT_HOLDS)
}

/// The page for whoever opens the archive.
fn readme(lines: &[Line]) -> String {
    let machines = distinct(lines.iter().filter_map(Line::session).map(|s| &s.machine));
    let commits = machines.iter().map(|machine| machine.commit.trim_end_matches("-dirty"));
    let commits = distinct(commits).join(" or ");
    let machines: Vec<String> = machines.iter().map(ToString::to_string).collect();
    format!(
        "# Benchmarks that can be repeated\n\nMeasured on {}.\n\nTo repeat them, in a clone of the programs' repository at commit {commits}:\n\n\
         ```\nharness replay THIS_DIRECTORY\n```\n\n\
         It prints the values of `record.jsonl` beside measured ones: digests, cells and counters must be equal; ratios (speedup, efficiency, \
         load imbalance, bytes per cell) lie within the interval of their repetitions and {:.0} % beyond it; times are those of a machine, and \
         are not compared. `study/` has the study with its cases and geometries.\n",
        machines.join(", and on "),
        TOLERANCE * 100.0,
    )
}

/// Copies the files of a directory and of those in it that are `wanted`. Links to directories, which may lead in a circle, are refused.
fn copy_tree(from: &Path, to: &Path, wanted: &dyn Fn(&PathBuf) -> bool) -> Result<(), Failure> {
    for entry in fs::read_dir(from).map_err(|error| Failure::at(from, error))? {
        let entry = entry?;
        let (path, copied) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            fs::create_dir(&copied).map_err(|error| Failure::at(&copied, error))?;
            copy_tree(&path, &copied, wanted)?;
        } else if wanted(&path) {
            copy(&path, &copied)?;
        }
    }
    Ok(())
}
