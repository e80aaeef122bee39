//! `harness report`: draws figures and a page from records.

use crate::options::Input;
use bench::experiments::entry::{self, Line};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_MISSING, Failure, Result, exit_first};
use report::benchmark::numbers::{Checked, Number, check, included};
use report::benchmark::report;
use std::collections::HashSet;
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
        let (texts, is_outdated) = texts(main, &arguments.directory)?;
        let mut has_failed = is_outdated;
        for (path, text) in texts {
            let shown = path.display();
            let Checked { compared, by_hand, findings } = check(&text, &numbers);
            findings.iter().for_each(|finding| println!("{shown}, {finding}"));
            let number = findings.len();
            println!(
                "{shown}: {compared} numbers compared, {by_hand} of them by hand, with any result; {number} findings"
            );
            has_failed |= number > 0;
            all += compared;
        }
        code = if has_failed { EXIT_FAILED } else { code };
        if all == 0 {
            let why = "has no number that the record could have, so nothing was compared";
            eprintln!("harness: {} {why}", main.display());
            code = exit_first(code, EXIT_MISSING);
        }
    }
    Ok(code)
}

/// Reads a text and those that it includes, without figures of reports, and without what the report in `directory` has just written.
/// Also returns whether a figure is that of an earlier report, or a text is not found because no text defines its directory.
fn texts(main: &Path, directory: &Path) -> Result<(Vec<(PathBuf, String)>, bool)> {
    let own = ["numbers.tex", "models.tex"].map(|name| fs::read(directory.join(name)).ok());
    let (mut paths, mut all, mut next, mut is_old) = (vec![main.to_owned()], Vec::new(), 0, false);
    // A directory may be defined in another text than the one that uses it.
    let mut whole = String::new();
    while let Some(path) = paths.get(next).cloned() {
        next += 1;
        // Numbers and commands are the same in any encoding that LaTeX reads.
        let bytes = files::read(&path).map_err(|error| Failure::at(&path, error))?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let head = r"\providecommand{\figures}{figures}";
        let is_figure = text.lines().take(3).any(|line| line == head);
        is_old |= is_figure && is_outdated(&path, &text, directory)?;
        if is_figure || own.contains(&Some(bytes)) {
            continue;
        }
        whole += &(text.clone() + "\n");
        for name in included(&whole)[0].iter().filter(|name| !name.starts_with('\\')) {
            // As LaTeX does: relative to the main text, whichever includes it.
            let [named, tex] = ["", ".tex"].map(|end| main.with_file_name(format!("{name}{end}")));
            let file = if named.is_file() || name.ends_with(".tex") { named } else { tex };
            if !paths.contains(&file) {
                paths.push(file);
            }
        }
        all.push((path, text));
    }
    let [texts, pictures] = included(&whole);
    let unknown = texts.iter().filter(|name| name.starts_with('\\'));
    let why = "is not compared: no text defines its directory with \\newcommand";
    is_old |= unknown.inspect(|name| println!("{name} {why}")).count() > 0;
    for name in pictures.iter().flat_map(|name| ["", ".pdf", ".png"].map(|end| name.clone() + end))
    {
        let copy = main.with_file_name(name);
        let made = directory.join("figures").join(copy.file_name().unwrap_or_default());
        is_old |= differs(&copy, &made)?;
    }
    Ok((all, is_old))
}

/// Whether a file differs from that of the report, if both are there; prints it.
fn differs(copy: &Path, made: &Path) -> Result<bool> {
    let differs = copy.is_file() && made.is_file() && fs::read(copy)? != fs::read(made)?;
    if differs {
        println!("{}: differs from that of the report: copy it again", copy.display());
    }
    Ok(differs)
}

/// Whether a figure, unless it is a list of them, is none of the report's in `directory`, or files beside it, or below a list, differ from
/// those of the same name there; prints them.
fn is_outdated(figure: &Path, text: &str, directory: &Path) -> Result<bool> {
    let list = fs::read_to_string(directory.join("figures.tex"))?;
    let name = format!(r"{{\figures/{}}}", figure.file_name().unwrap_or_default().display());
    let mut is_outdated = !text.starts_with("% Made by") && !list.contains(&name);
    if is_outdated {
        println!("{}: the report has no figure of this name", figure.display());
    }
    let made = fs::read_dir(directory.join("figures"))?.flatten().map(|entry| entry.path());
    for made in made.chain([directory.join("figures.tex")]) {
        let is_read = made.extension().is_some_and(|of| of == "tex" || of == "csv");
        for of in ["", "figures"] {
            let copy = figure.with_file_name(of).join(made.file_name().unwrap_or_default());
            is_outdated |= is_read && differs(&copy, &made)?;
        }
    }
    Ok(is_outdated)
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
        all.push(read);
    }
    // The last machine and the last build count, whatever the names of the files.
    all.sort_by_key(|lines: &Vec<Line>| lines.last().map(|line| line.time_utc.clone()));
    Ok(all.into_iter().flatten().collect())
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

    const FIGURE: &str = "% Requires x\n\\providecommand{\\figures}{figures}\n";

    /// The texts of a paper that are read, beside a copy of a report's figures, one of which is another.
    fn read_of(paper: &str, changed: &str) -> (usize, bool) {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let put = |name: &str, text: &str| {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), text).unwrap();
        };
        put("report/figures.tex", r"% Made by \input{\figures/a.tex}");
        for name in ["a.tex", "a.csv", "b.pdf"] {
            put(&format!("report/figures/{name}"), FIGURE);
            put(&format!("of paper/{name}"), FIGURE);
        }
        put(&format!("of paper/{changed}"), &format!("{FIGURE}%"));
        put("report/models.tex", "98.76543");
        put("of paper/models.tex", "98.76543");
        put("of paper/old.tex", "98.76542");
        put("head.tex", r"\newcommand{\here}{of paper}");
        put("paper.tex", paper);
        let (texts, is_old) = texts(&at("paper.tex"), &at("report")).unwrap();
        (texts.len(), is_old)
    }

    #[test]
    fn figures_of_an_earlier_report_are_found_however_a_text_includes_them() {
        let by_path = r"\input{of paper/a}\input{head}";
        let by_macro = r"\input{\here/a}\input{head}";
        for paper in [by_path, by_macro] {
            assert_eq!(read_of(paper, "other"), (2, false));
            for changed in ["a.csv", "a.tex"] {
                assert_eq!(read_of(paper, changed), (2, true), "{paper} {changed}");
            }
        }
        for picture in
            [r"\includegraphics[width=1cm]{of paper/b}", r"\includegraphics{of paper/b.pdf}"]
        {
            assert_eq!(read_of(picture, "a.csv"), (1, false));
            assert_eq!(read_of(picture, "b.pdf"), (1, true), "{picture}");
        }
        // A copy of what the report has just written has nothing to compare; an older one has.
        assert_eq!(read_of(r"\input{of paper/models}", "other"), (1, false));
        assert_eq!(read_of(r"\input{of paper/old}", "other"), (2, false));
        // One that is not found is none that agrees.
        assert_eq!(read_of(r"\input{\there/a}", "other"), (1, true));
    }
}
