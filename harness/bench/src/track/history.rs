//! The history: a file of JSON lines, one record per commit, kept in the repository or on a separate branch.
//!
//! Invariant: lines are only ever appended. If a commit has several records, the last value of each metric counts, and the last time and
//! subject. Records are in the order in which their commits were made, so that a commit may be measured later than its successors.
//!
//! Times, memory and instructions of different machines are different series: those of the second machine have the suffix ` [2]`; a record without a machine is of the first. So are
//! numbers of different geometries under one case name: the second is the case `CASE [2]`.
//!
//! A record with `accepted` states that the user has accepted the values from that commit on.
//!
//! A record: `{"schema": "octree-track/1", "commit": "full name", "time": "2026-01-31T12:00:00Z" (of the commit),
//! "subject": "first line of its message", "machine": "its processor, ...", "geometries": {"CASE": "digest of its facets"},
//! "metrics": {"CASE/METRIC": number}, "accepted": true (absent
//! if false)}`.

use super::{has_gain, plain, unit};
use crate::gate::measures::{CaseMeasures, LayerName, Measures};
use crate::gate::numbers::MEMORY;
use crate::gate::report::{GateFinding, GateReport};
use crate::gate::time::{CPU, WALL};
use crate::git;
use crate::jsonl::{self, Line};
use crate::order::Origins;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// Version of a line.
pub const SCHEMA: &str = "octree-track/1";

/// Greatest number of a metric, of whose squares sums are finite.
const VALUE_MAX: f64 = 1e100;

/// One commit's numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: String,
    /// Full hash of the commit.
    pub commit: String,
    /// When it was committed. A record that was written by hand may not say.
    pub time: Option<Timestamp>,
    /// First line of its message.
    #[serde(default)]
    pub subject: String,
    /// The machine; empty if it is unknown, as in old records.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub machine: String,
    /// Digests of the facets by case; old records have none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub geometries: BTreeMap<String, String>,
    /// Numbers by `CASE/METRIC`.
    pub metrics: BTreeMap<String, f64>,
    /// Whether the changes at this commit are accepted.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accepted: bool,
}

impl Record {
    /// Returns a record without metrics.
    pub fn new(commit: String) -> Self {
        Self { schema: SCHEMA.to_owned(), commit, ..Self::default() }
    }

    /// Returns a record with the time and subject of a commit.
    ///
    /// # Errors
    /// One sentence, if git does not find the commit.
    fn of_commit(named: &str, repository: &Path) -> Result<Self, String> {
        let format = "--format=%H%n%cI%n%s";
        let text = git(repository, &["log", "-1", format, "--end-of-options", named]);
        let place = repository.display();
        let text = text.ok_or_else(|| format!("git knows no commit {named} in {place}"))?;
        let mut lines = text.lines().map(str::to_owned);
        let mut next = || lines.next().unwrap_or_default();
        let (commit, time, subject) = (next(), next(), next());
        let time = time.parse().map_err(|why| format!("the time of {named}: {why}"))?;
        Ok(Self { time: Some(time), subject, ..Self::new(commit) })
    }

    /// Checks that the metrics can be analysed.
    ///
    /// # Errors
    /// One sentence, if they cannot.
    pub fn check(&self) -> Result<(), String> {
        let beyond = self.metrics.iter().find(|(_, value)| value.abs() > VALUE_MAX);
        let Some((name, value)) = beyond else { return Ok(()) };
        Err(format!("{name} is {value:e}, and at most {VALUE_MAX:e} is possible"))
    }

    /// Returns a record of a record or report of `harness gate`: of the commit `named`, else of the revision that was measured, else of HEAD.
    ///
    /// # Errors
    /// One sentence, if it is neither, of another commit, or of a working tree with changes and no commit is named.
    pub fn of_gate(text: &[u8], named: Option<&str>, repository: &Path) -> Result<Self, String> {
        let of = Measures::parse(text)?.of;
        let status = ["status", "--porcelain", "--untracked-files=no"];
        let is_changed = || git(repository, &status).is_some_and(|files| !files.is_empty());
        if named.is_none() && of.revision.is_none() && (of.is_built() || is_changed()) {
            let why = "a working tree with changes was measured, which is no commit: measure again after committing, or give --commit";
            return Err(why.to_owned());
        }
        let revision = of.revision;
        let commit = named.or(revision.as_deref()).unwrap_or("HEAD");
        let record = Self::of_commit(commit, repository)?;
        match revision.filter(|revision| *revision != record.commit) {
            Some(other) => Err(format!("revision {other} was measured: leave out --commit")),
            None => record.with(text),
        }
    }

    /// Returns the record with the machine, geometries and metrics of a record or report of `harness gate`. Only reports contain times, which are worth tracking on a
    /// dedicated machine only.
    ///
    /// # Errors
    /// One sentence, if it is neither.
    pub fn with(mut self, text: &[u8]) -> Result<Self, String> {
        let Measures { machine, cases, .. } = Measures::parse(text)?;
        self.machine = machine;
        for (case, measures) in cases {
            let CaseMeasures { exact, memory, counted, geometry, .. } = measures;
            self.geometries.extend(geometry.map(|digest| (case.clone(), digest)));
            let named = |(metric, value)| (format!("{case}/{metric}"), value as f64);
            self.metrics.extend(exact.into_iter().chain(memory).chain(counted).map(named));
        }
        let Ok(report) = serde_json::from_slice::<GateReport>(text) else { return Ok(self) };
        let times = report.layers.iter().filter(|layer| layer.name == LayerName::Time);
        for GateFinding { case, metric, candidate, .. } in times.flat_map(|layer| &layer.findings) {
            let metric = metric.replace(CPU, "seconds").replace(WALL, "wall_seconds");
            self.metrics.extend(candidate.map(|seconds| (format!("{case}/{metric}"), seconds)));
        }
        Ok(self)
    }
}

/// A history as read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// One record per commit.
    pub records: Vec<Record>,
    /// What the user should know: an unfinished last line, several machines.
    pub warnings: Vec<String>,
}

/// Reads a history; a missing file is an empty history.
///
/// # Errors
/// One sentence with the number of the invalid line.
pub fn read(path: &Path) -> Result<History, String> {
    let wrong = |why: String| format!("{}: {why}", path.display());
    let lines = match jsonl::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        other => other.map_err(|error| wrong(error.to_string()))?,
    };
    merged(lines).map_err(wrong)
}

/// Returns one record for every commit.
fn merged(lines: Vec<Line<Record>>) -> Result<History, String> {
    let mut history = History::default();
    let (mut machines, mut geometries) = (Origins::default(), Origins::default());
    for Line { number, is_finished, content } in lines {
        let wrong = |why: String| format!("line {number}: {why}");
        let mut record = match content {
            Ok(record) => record,
            Err(why) if !is_finished => {
                history.warnings.push(wrong(format!("unfinished, and left out: {why}")));
                continue;
            }
            Err(why) => return Err(wrong(why)),
        };
        record.check().map_err(wrong)?;
        if record.schema != SCHEMA {
            return Err(wrong(format!("schema {:?}, not {SCHEMA:?}", record.schema)));
        }
        let machine = &record.machine;
        let suffix = if machine.is_empty() { String::new() } else { machines.suffix("", machine) };
        let mut of_geometry = record.geometries.clone();
        of_geometry.iter_mut().for_each(|(case, of)| *of = geometries.suffix(case, of));
        let named = |(mut name, value): (String, f64)| {
            // The others depend on the program and the case alone.
            let of_machine = [MEMORY, "memory", "time", "instructions", "allocations"];
            let is_measured = has_gain(&name) || unit(&name) == "s";
            if is_measured || of_machine.iter().any(|of| plain(&name).contains(of)) {
                name += &suffix;
            }
            let is_of = |case: &str| name.strip_prefix(case).is_some_and(|of| of.starts_with('/'));
            if let Some((case, suffix)) = of_geometry.iter().find(|(case, _)| is_of(case)) {
                name.insert_str(case.len(), suffix);
            }
            (name, value)
        };
        record.metrics = record.metrics.into_iter().map(named).collect();
        match history.records.iter_mut().find(|same| same.commit == record.commit) {
            Some(same) => {
                same.metrics.extend(record.metrics);
                same.accepted |= record.accepted;
                same.time = record.time.or(same.time);
                let subject = Some(record.subject).filter(|subject| !subject.is_empty());
                subject.into_iter().for_each(|subject| same.subject = subject);
            }
            None => history.records.push(record),
        }
    }
    // A commit whose time no line has follows the one before it.
    let mut before = None;
    for record in &mut history.records {
        record.time = record.time.or(before);
        before = record.time;
    }
    history.records.sort_by_key(|record| record.time);
    history.warnings.extend(machines.described().into_iter().chain(geometries.described()));
    Ok(history)
}

/// Accepts the changes of all metrics at a commit of the history, given by its hash or the beginning of it.
///
/// # Errors
/// One sentence, if the history does not have exactly one such commit, or cannot be written.
pub fn accept(path: &Path, commit: &str) -> Result<(), String> {
    let wrong = |why: &str| format!("{}: {why}", path.display());
    let records = read(path)?.records;
    let matching = records.iter().filter(|record| record.commit.starts_with(commit));
    let [record] = matching.collect::<Vec<_>>()[..] else {
        let why = "give the whole hash of the first commit with the new values";
        return Err(wrong(&format!("has not exactly one commit that begins with {commit}: {why}")));
    };
    let record = Record { metrics: BTreeMap::new(), accepted: true, ..record.clone() };
    jsonl::append(path, &record).map_err(|error| wrong(&error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::measures::Measured;
    use crate::jsonl::append;
    use std::fs;
    use std::process::Command;

    fn record(commit: &str, metrics: &[(&str, f64)]) -> Record {
        let metrics = metrics.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        Record { metrics, ..Record::new(commit.into()) }
    }

    #[test]
    fn the_last_record_of_a_commit_counts() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("deep/history.jsonl");
        assert_eq!(read(&path).unwrap(), History::default());
        for one in [
            record("a", &[("x", 1.0)]),
            record("b", &[("x", 2.5)]),
            record("a", &[("x", 3.0), ("y", 4.0)]),
        ] {
            append(&path, &one).unwrap();
        }
        let expected = [record("a", &[("x", 3.0), ("y", 4.0)]), record("b", &[("x", 2.5)])];
        assert_eq!(read(&path).unwrap().records, expected);
    }

    #[test]
    fn a_commit_that_is_measured_later_has_its_place() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for (commit, time) in [
            ("c", "2026-03-01T12:00:00+02:00"),
            ("a", "2026-01-01T00:00:00Z"),
            ("b", "2026-03-01T11:30:00+02:00"),
            ("e", "2026-03-01T12:00:00+01:00"),
        ] {
            let time = Some(time.parse().unwrap());
            append(&path, &Record { time, ..record(commit, &[("x", 1.0)]) }).unwrap();
        }
        // By hand, without a time.
        let line = serde_json::json!({"schema": SCHEMA, "commit": "f", "metrics": {}});
        append(&path, &line).unwrap();
        // A number of one's own, appended before the record of its commit.
        append(&path, &serde_json::json!({"schema": SCHEMA, "commit": "d", "metrics": {"y": 1.0}}))
            .unwrap();
        let time = Some("2026-02-01T00:00:00Z".parse().unwrap());
        append(&path, &Record { time, subject: "later".into(), ..record("d", &[]) }).unwrap();
        let records = read(&path).unwrap().records;
        let commits: Vec<&str> = records.iter().map(|record| record.commit.as_str()).collect();
        assert_eq!(commits, ["a", "d", "b", "c", "e", "f"]);
        assert_eq!((records[1].subject.as_str(), records[1].metrics["y"]), ("later", 1.0));
        let line = serde_json::to_string(&record("f", &[])).unwrap();
        fs::write(&path, line.replace("null", "\"noon\"") + "\n").unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains("line 1: "), "{error}");
        fs::write(&path, "").unwrap();
        append(&path, &record("g", &[("x", 1e308)])).unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains("line 1: x is 1e308"), "{error}");
    }

    #[test]
    fn other_facets_under_the_name_of_a_case_are_another_series() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for (commit, digest) in [("a", ""), ("b", "x"), ("c", "y"), ("d", "x")] {
            let geometries = [("c".to_owned(), digest.to_owned())].into_iter();
            let geometries = geometries.filter(|(_, digest)| !digest.is_empty()).collect();
            let metrics = [("c/cells", 1.0), ("c2/cells", 2.0), ("c/seconds", 3.0)];
            let of_machine = Record { machine: commit.into(), ..record(commit, &metrics) };
            append(&path, &Record { geometries, ..of_machine }).unwrap();
        }
        let history = read(&path).unwrap();
        let names: Vec<Vec<&str>> = history
            .records
            .iter()
            .map(|r| r.metrics.keys().map(String::as_str).collect())
            .collect();
        assert_eq!(names[0], ["c/cells", "c/seconds", "c2/cells"]);
        assert_eq!(names[1], ["c/cells", "c/seconds [2]", "c2/cells"]);
        assert_eq!(names[2], ["c [2]/cells", "c [2]/seconds [3]", "c2/cells"]);
        assert_eq!(names[3], ["c/cells", "c/seconds [4]", "c2/cells"]);
        assert!(history.warnings.iter().any(|why| why.contains("c [1]: x; [2]: y")));
    }

    #[test]
    fn a_commit_is_accepted_by_the_beginning_of_its_hash() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for commit in ["abc1", "abc2", "abd3"] {
            append(&path, &record(commit, &[("x", 1.0)])).unwrap();
        }
        accept(&path, "abc2").unwrap();
        let accepted: Vec<bool> = read(&path).unwrap().records.iter().map(|r| r.accepted).collect();
        assert_eq!(accepted, [false, true, false]);
        assert_eq!(read(&path).unwrap().records[1].metrics["x"], 1.0);
        for commit in ["abc", "f00"] {
            let why = accept(&path, commit).unwrap_err();
            assert!(why.contains(&format!("not exactly one commit that begins with {commit}")));
        }
    }

    /// Cut anywhere, a history keeps all its lines but the last, and the next record follows them.
    #[test]
    fn a_torn_last_line_costs_that_line() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for commit in ["a", "b"] {
            append(&path, &record(commit, &[("x", 1.0)])).unwrap();
        }
        let whole = fs::read(&path).unwrap();
        let first = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for length in first + 1..whole.len() - 1 {
            fs::write(&path, &whole[..length]).unwrap();
            let torn = read(&path).unwrap();
            assert_eq!((torn.records.len(), torn.warnings.len()), (1, 1), "{length}");
            assert!(torn.warnings[0].starts_with("line 2: unfinished"), "{:?}", torn.warnings);
            append(&path, &record("c", &[("x", 2.0)])).unwrap();
            let mended = read(&path).unwrap();
            assert_eq!((mended.records.len(), mended.warnings), (2, vec![]), "{length}");
        }
        // A byte that is no UTF-8 is as torn as any other.
        fs::write(&path, [&whole[..first], b"{\"schema\": \"\xff"].concat()).unwrap();
        assert_eq!(read(&path).unwrap().records.len(), 1);
    }

    #[test]
    fn times_of_another_machine_are_a_series_of_their_own_and_counters_are_not() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for (commit, machine, seconds) in
            [("a", "fast", 0.13), ("b", "slow", 0.605), ("b", "fast", 0.14)]
        {
            let one = record(commit, &[("uav/seconds", seconds), ("uav/rays", 6.0)]);
            append(&path, &Record { machine: machine.into(), ..one }).unwrap();
        }
        let History { records, warnings } = read(&path).unwrap();
        assert_eq!(
            records[0].metrics,
            record("a", &[("uav/rays", 6.0), ("uav/seconds", 0.13)]).metrics
        );
        let both = [("uav/rays", 6.0), ("uav/seconds", 0.14), ("uav/seconds [2]", 0.605)];
        assert_eq!(records[1].metrics, record("b", &both).metrics);
        assert!(warnings[0].contains("[2]: slow"), "{warnings:?}");
    }

    #[test]
    fn concurrent_records_are_all_kept() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let path = &path;
                scope.spawn(move || {
                    for i in 0..50 {
                        append(path, &record(&format!("{thread}-{i}"), &[("x", 1.0)])).unwrap();
                    }
                });
            }
        });
        assert_eq!(read(&path).unwrap().records.len(), 200);
    }

    #[test]
    fn an_invalid_line_is_reported_by_number() {
        let line = serde_json::to_string(&record("a", &[])).unwrap();
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        let parse = |text: &str| {
            fs::write(&path, text).unwrap();
            read(&path).unwrap_err()
        };
        assert!(parse(&format!("{line}\n\nx\n")).contains(": line 3"));
        let other = line.replace("track/1", "track/2");
        assert!(parse(&other).contains("track/2"));
    }

    #[test]
    fn a_history_without_machines_goes_on_when_they_are_recorded() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for (commit, machine) in [("a", ""), ("b", "x"), ("c", "y")] {
            let of_machine = record(commit, &[("a/time", 1.0)]);
            append(&path, &Record { machine: machine.into(), ..of_machine }).unwrap();
        }
        let History { records, warnings } = read(&path).unwrap();
        let names = records.iter().flat_map(|record| record.metrics.keys());
        assert!(names.eq(["a/time", "a/time", "a/time [2]"]));
        assert_eq!(warnings.len(), 1);
    }

    #[test]
    fn measures_of_a_gate_become_metrics_by_case() {
        let mut measures = Measures::of_program(Measured::default());
        let case = measures.cases.entry("cube".into()).or_default();
        case.exact.insert("rays".into(), 6);
        case.counted.insert("instructions".into(), 7);
        let place = tempfile::tempdir().unwrap();
        let here = place.path();
        fs::write(here.join("source"), "old").unwrap();
        let add = "git init --quiet && git add source";
        let commit = "git -c user.name=a -c user.email=a@b commit --quiet --message m";
        let script = format!("{add} && {commit}");
        let made = Command::new("sh").args(["-c", &script]).current_dir(here).status();
        assert!(made.unwrap().success());
        let of = |measures: &Measures, named| {
            Record::of_gate(&serde_json::to_vec(measures).unwrap(), named, here)
        };
        let one = of(&measures, None).unwrap();
        assert_eq!(
            one.metrics,
            [("cube/instructions".into(), 7.0), ("cube/rays".into(), 6.0)].into()
        );
        assert_eq!(one.commit, Record::of_commit("HEAD", here).unwrap().commit);
        // Nobody knows of which commit a program is that was measured beside changes.
        fs::write(here.join("source"), "new").unwrap();
        assert!(of(&measures, None).unwrap_err().contains("give --commit"));
        assert_eq!(of(&measures, Some("HEAD")).as_ref(), Ok(&one));
        fs::write(here.join("source"), "old").unwrap();
        // The revision that was measured counts, and no other.
        measures.of.revision = Some(one.commit.clone());
        assert_eq!(of(&measures, Some("HEAD")), Ok(one));
        measures.of.revision = Some("0".repeat(40));
        assert!(of(&measures, None).unwrap_err().contains("git knows no commit 000"));
        assert!(of(&measures, Some("HEAD")).unwrap_err().contains("was measured"));
        assert!(Record::of_gate(b"{}", None, here).is_err());
        // A working tree with changes is no commit, unless the user says so.
        measures.of = Measured { named: ".".into(), ..Measured::default() };
        assert!(of(&measures, None).unwrap_err().contains("give --commit"));
        assert!(of(&measures, Some("HEAD")).is_ok());
    }
}
