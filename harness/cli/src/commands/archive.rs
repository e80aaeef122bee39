//! `harness archive`: a report that others can replay.

use super::report::{read, records_in};
use super::values::Input;
use bench::experiments::entry::Entry;
use bench::experiments::record::now_utc;
use bench::replay::Expected;
use bench::study::Study;
use bench::study::package::{copy, package};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure};
use contract::files::{Staging, named, nearest_directory, write_atomically};
use report::archive::{About, EXPECTED, METADATA, Member, RECORD, STUDY, metadata, readme};
use run::engine::paths::Paths;
use std::fs;
use std::path::{Path, PathBuf};

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
    /// Title of the archive
    #[arg(long)]
    pub title: String,
    /// Whoever made it
    #[arg(long, value_name = "NAME")]
    pub author: String,
    /// Its licence: an identifier of the list of SPDX, such as CC-BY-4.0, or an address
    #[arg(long, value_name = "SPDX|URL")]
    pub licence: String,
}

/// Makes the archive; returns the exit code.
///
/// # Errors
/// If the record has no run, the study or a file of it cannot be read, or the directory cannot be made.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let Arguments { report, study, out, title, author, licence } = arguments;
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
    let expected = Expected::of(&lines)?;
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
    put(EXPECTED, expected.json())?;
    let of_study = place.join(STUDY);
    fs::create_dir(&of_study).map_err(|error| Failure::at(&of_study, error))?;
    let catalogue = Paths::find().catalogue;
    package(study, &catalogue, &of_study)?;
    let sources = catalogue.path().with_file_name("SOURCES.md");
    if sources.is_file() {
        copy(&sources, &of_study.join("SOURCES.md"))?;
    }
    let day = now_utc().chars().take("2026-01-31".len()).collect();
    let about =
        About { title: title.clone(), author: author.clone(), licence: licence.clone(), day };
    let page = if place.join("README.md").exists() { "REPLAY.md" } else { "README.md" };
    put(page, readme(&about, &lines, &expected))?;
    let mut members = Vec::new();
    list(place, "", &mut members)?;
    members.sort();
    let described = metadata(&about, &members, &lines);
    put(METADATA, serde_json::to_string_pretty(&described).expect("plain data") + "\n")?;
    staging.publish(|staged| fs::rename(staged, out)).map_err(wrong)?;
    let (values, files) = (expected.values.len(), members.len() + 1);
    println!("{}: {files} files, {values} values to be met by a replay", out.display());
    Ok(EXIT_HOLDS)
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

/// Lists the files below a directory, whose path begins with `prefix`.
fn list(directory: &Path, prefix: &str, members: &mut Vec<Member>) -> Result<(), Failure> {
    for entry in fs::read_dir(directory).map_err(|error| Failure::at(directory, error))? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        match entry.metadata()? {
            file if file.is_file() => members.push((name, file.len())),
            _ => list(&entry.path(), &format!("{name}/"), members)?,
        }
    }
    Ok(())
}
