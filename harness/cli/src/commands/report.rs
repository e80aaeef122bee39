//! `harness report`: draws figures and a page from records.

use crate::options::Input;
use bench::experiments::entry::{self, Line};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_MISSING, Failure, Result, exit_first};
use report::benchmark::numbers::{Checked, Number, check, included};
use report::benchmark::report;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

/// `harness report`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Directory for the report; its files *.jsonl are the records unless --record names some
    pub directory: PathBuf,
    /// A record of `harness bench`; may be repeated
    #[arg(long, value_name = "FILE")]
    pub record: Vec<PathBuf>,
    /// Compare the numbers of this LaTeX text, and of those that it includes, with the record, but for lines that end in `% not a
    /// result`; exit code 1 if one is not there or differs. May be repeated
    #[arg(long, value_name = "FILE")]
    pub check: Vec<Input>,
}

/// Writes the report; returns the exit code.
///
/// # Errors
/// As [`write()`], or if a text cannot be read.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let numbers = write(&arguments.directory, &arguments.record)?;
    Failure::unless(!numbers.is_empty(), "no repetition succeeded; the page lists the reasons")?;
    let mut code = EXIT_HOLDS;
    for main in &arguments.check {
        let mut all = 0;
        for (path, text) in texts(main, &arguments.directory)? {
            let shown = path.display();
            let Checked { compared, by_hand, findings } = check(&text, &numbers);
            findings.iter().for_each(|finding| println!("{shown}, {finding}"));
            let number = findings.len();
            println!(
                "{shown}: {compared} numbers compared, {by_hand} of them by hand, with any result; {number} findings"
            );
            code = if number > 0 { EXIT_FAILED } else { code };
            all += compared;
        }
        if all == 0 {
            let why = "has no number that the record could have, so nothing was compared";
            eprintln!("harness: {} {why}", main.display());
            code = exit_first(code, EXIT_MISSING);
        }
    }
    Ok(code)
}

/// Reads a text and those that it includes, without figures of reports, and without what the report in `directory` has just written.
fn texts(main: &Path, directory: &Path) -> Result<Vec<(PathBuf, String)>> {
    let own = ["numbers.tex", "models.tex"].map(|name| fs::read(directory.join(name)).ok());
    let (mut paths, mut all, mut next) = (vec![main.to_owned()], Vec::new(), 0);
    while let Some(path) = paths.get(next).cloned() {
        next += 1;
        // Numbers and commands are the same in any encoding that LaTeX reads.
        let bytes = files::read(&path).map_err(|error| Failure::at(&path, error))?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let head = r"\providecommand{\figures}{figures}";
        let is_figure = text.lines().take(3).any(|line| line == head);
        if is_figure || own.contains(&Some(bytes)) {
            continue;
        }
        for name in included(&text) {
            // As LaTeX does: relative to the main text, whichever includes it.
            let [named, tex] = ["", ".tex"].map(|end| main.with_file_name(format!("{name}{end}")));
            let file = if named.is_file() || name.ends_with(".tex") { named } else { tex };
            if !paths.contains(&file) {
                paths.push(file);
            }
        }
        all.push((path, text));
    }
    Ok(all)
}

/// Reads records, writes the report into `directory` and prints a summary; returns the results.
///
/// # Errors
/// One sentence, if a record cannot be read, or the report cannot be written.
pub fn write(directory: &Path, given: &[PathBuf]) -> Result<Vec<Number>> {
    let records = if given.is_empty() { records_in(directory)? } else { given.to_vec() };
    let lines = read(&records)?;
    let place = given.first().map_or(directory, PathBuf::as_path).display();
    let why = format!("no results to report: {place} has none; harness bench makes them");
    Failure::unless(!lines.is_empty(), why)?;
    let written = report(directory, &lines)?;
    written.notes.iter().for_each(|note| println!("{note}"));
    written.broken.iter().for_each(|(rule, why)| println!("rule {rule} broken: {why}"));
    if !cfg!(feature = "figures") {
        println!("PNG and PDF are left out: the harness was built without its feature figures");
    }
    println!("{} figures; the page is {}", written.figures, written.page.display());
    Ok(written.numbers)
}

/// Reads records, and says which lines it cannot read. A line that is there twice, as in a copy of a record, is one result.
pub(super) fn read(records: &[PathBuf]) -> Result<Vec<Line>> {
    let (mut all, mut known) = (Vec::new(), HashSet::new());
    for path in records {
        let shown = path.display();
        let (mut read, broken) = entry::read(path).map_err(|error| Failure::at(path, error))?;
        for (line, why) in broken {
            eprintln!("harness: {shown}, line {line} is skipped: {why}");
        }
        let count = read.len();
        read.retain(|line| known.insert(format!("{line:?}")));
        let repeated = count - read.len();
        if repeated > 0 {
            eprintln!("harness: {shown}: {repeated} lines repeat earlier ones and are skipped");
        }
        all.extend(read);
    }
    // The first machine and build keep their names, and the last ones count, whatever file their sessions are in.
    let mut begun: HashMap<String, String> = HashMap::new();
    for Line { session, time_utc, .. } in &all {
        let first = begun.entry(session.clone()).or_insert_with(|| time_utc.clone());
        *first = first.clone().min(time_utc.clone());
    }
    all.sort_by_cached_key(|line: &Line| begun[&line.session].clone());
    Ok(all)
}

/// The records in a directory; other files of JSON lines, such as a history, are none.
pub(super) fn records_in(directory: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(directory).map_err(|error| Failure::at(directory, error))?;
    let has_schema = |text: Vec<u8>| text.windows(13).any(|part| part == b"octree-bench/");
    let mut found = Vec::new();
    for path in entries.flatten().map(|entry| entry.path()) {
        let is_of_lines = path.extension().is_some_and(|ending| ending == "jsonl");
        let read = || files::read_log(&path).map_err(|error| Failure::at(&path, error));
        if is_of_lines && has_schema(read()?) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of texts of a paper that are read, beside copies of files of a report; 0 if one cannot be read.
    fn read_of(paper: &str) -> usize {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let put = |name: &str, text: &str| {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), text).unwrap();
        };
        put("report/models.tex", "98.76543");
        put("of paper/models.tex", "98.76543");
        put("of paper/old.tex", "98.76542");
        put("of paper/a.tex", "% Requires x\n\\providecommand{\\figures}{figures}\n");
        put("paper.tex", paper);
        texts(&at("paper.tex"), &at("report")).map_or(0, |texts| texts.len())
    }

    /// A machine that measures again, while another one does, keeps its name.
    #[test]
    fn sessions_are_in_the_order_in_which_they_began_whatever_file_has_them() {
        let place = tempfile::tempdir().unwrap();
        let line = |(session, hour): &(&str, u8)| {
            format!(
                r#"{{"schema": "octree-bench/1", "session": "{session}", "time_utc": "2026-01-31T{hour:02}:00:00Z", "kind": "left_out", "why": "",
                "setup": {{"experiment": "strong", "engine": "mesher", "case": "a", "spacing_min": 1.0, "layer_cells_min": 1, "ranks": 1, "comm": "solo",
                "partitioner": "", "weights": ""}}}}"#
            )
            .replace('\n', " ")
                + "\n"
        };
        let record = |name: &str, of: &[(&str, u8)]| {
            let path = place.path().join(name);
            fs::write(&path, of.iter().map(line).collect::<String>()).unwrap();
            path
        };
        let records = [
            record("a", &[("first", 8), ("third", 10), ("third", 13)]),
            record("b", &[("second", 9), ("second", 12)]),
        ];
        let sessions: Vec<String> =
            read(&records).unwrap().into_iter().map(|line| line.session).collect();
        assert_eq!(sessions, ["first", "second", "second", "third", "third"]);
    }

    #[test]
    fn included_texts_are_read_but_for_files_of_a_report() {
        assert_eq!(read_of(r"\input{of paper/a}\input{\figures/a}"), 1);
        // A copy of what the report has just written has nothing to compare; an older one has.
        assert_eq!(read_of(r"\input{of paper/models}"), 1);
        assert_eq!(read_of(r"\input{of paper/old}"), 2);
        // A directory that is a macro is not looked up.
        assert_eq!(read_of(r"\input{\there/a}"), 0);
    }
}
