//! The history: a file of JSON lines, one record per commit, kept in the repository or on a separate branch.
//!
//! Invariant: lines are only ever appended. If a commit has several records, the last value of each metric counts.
//!
//! A record with `accepted` states that the user has accepted the values from that commit on.
//!
//! A record: `{"schema": "octree-track/1", "commit": "full name", "time": "2026-01-31T12:00:00Z" (of the commit),
//! "subject": "first line of its message", "metrics": {"CASE/METRIC": number}, "accepted": true (absent if false)}`.

use crate::gate::measures::Measures;
use crate::gate::quantity::{CPU, WALL};
use crate::gate::report::{LayerName, Report};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Command;

/// Version of a line.
pub const SCHEMA: &str = "octree-track/1";

/// One commit's numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: String,
    /// Full hash of the commit.
    pub commit: String,
    /// When it was committed, ISO 8601.
    #[serde(default)]
    pub time: String,
    /// First line of its message.
    #[serde(default)]
    pub subject: String,
    /// Numbers by `CASE/METRIC`.
    pub metrics: BTreeMap<String, f64>,
    /// Whether the changes at this commit are accepted.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accepted: bool,
}

impl Record {
    /// Returns a record without metrics.
    pub fn new(commit: String) -> Self {
        let (time, subject) = (String::new(), String::new());
        let metrics = BTreeMap::new();
        Self { schema: SCHEMA.to_owned(), commit, time, subject, metrics, accepted: false }
    }

    /// Returns a record with the time and subject of a commit.
    ///
    /// # Errors
    /// One sentence, if git does not find the commit.
    pub fn of_commit(named: &str, repository: &Path) -> Result<Self, String> {
        let mut git = Command::new("git");
        git.arg("-C").arg(repository).args([
            "log",
            "-1",
            "--format=%H%n%cI%n%s",
            "--end-of-options",
            named,
        ]);
        let output = git.output().map_err(|error| format!("git: {error}"))?;
        if !output.status.success() {
            return Err(format!("git knows no commit {named} in {}", repository.display()));
        }
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let mut lines = text.lines().map(str::to_owned);
        let mut next = || lines.next().unwrap_or_default();
        let (commit, time, subject) = (next(), next(), next());
        Ok(Self { time, subject, ..Self::new(commit) })
    }

    /// Adds the metrics of a record or report of `harness gate`. Only reports contain times, which are worth tracking on a
    /// dedicated machine only.
    ///
    /// # Errors
    /// One sentence, if it is neither.
    pub fn add(&mut self, text: &[u8]) -> Result<(), String> {
        for (case, measures) in &Measures::parse(text)?.cases {
            for (metric, value) in measures.exact.iter().chain(&measures.counted) {
                self.metrics.insert(format!("{case}/{metric}"), *value as f64);
            }
        }
        if let Ok(report) = serde_json::from_slice::<Report>(text) {
            let times = report.layers.iter().filter(|layer| layer.name == LayerName::Time);
            for finding in times.flat_map(|layer| &layer.findings) {
                let name = match finding.metric.as_str() {
                    CPU => "seconds",
                    WALL => "wall_seconds",
                    _ => continue,
                };
                if let Some(seconds) = finding.candidate {
                    self.metrics.insert(format!("{}/{name}", finding.case), seconds);
                }
            }
        }
        Ok(())
    }
}

/// Reads a history; a missing file is an empty history.
///
/// # Errors
/// One sentence with the number of the invalid line.
pub fn read(path: &Path) -> Result<Vec<Record>, String> {
    let wrong = |why: String| format!("{}: {why}", path.display());
    let text = match contract::files::read_log(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
        other => other.map_err(|error| wrong(error.to_string()))?,
    };
    parse(&text).map_err(wrong)
}

fn parse(text: &str) -> Result<Vec<Record>, String> {
    let mut records: Vec<Record> = Vec::new();
    let mut index: HashMap<String, usize> = HashMap::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = |why: String| format!("line {}: {why}", i + 1);
        let record: Record =
            serde_json::from_str(line).map_err(|error| wrong(error.to_string()))?;
        if record.schema != SCHEMA {
            return Err(wrong(format!("schema {:?}, not {SCHEMA:?}", record.schema)));
        }
        match index.get(&record.commit) {
            Some(&same) => {
                records[same].metrics.extend(record.metrics);
                records[same].accepted |= record.accepted;
            }
            None => {
                index.insert(record.commit.clone(), records.len());
                records.push(record);
            }
        }
    }
    Ok(records)
}

/// Accepts the changes of all metrics at a commit of the history, given by its hash or the beginning of it.
///
/// # Errors
/// One sentence, if the history does not have exactly one such commit, or cannot be written.
pub fn accept(path: &Path, commit: &str) -> Result<(), String> {
    let wrong = |why: &str| format!("{}: {why}", path.display());
    let records = read(path)?;
    let matching: Vec<&Record> =
        records.iter().filter(|record| record.commit.starts_with(commit)).collect();
    let [record] = matching[..] else {
        let why = match matching.len() {
            0 => format!(
                "has no values of commit {commit}: accept the first commit with the new values"
            ),
            _ => format!("has several commits that begin with {commit}: give more of the hash"),
        };
        return Err(wrong(&why));
    };
    let record = Record { metrics: BTreeMap::new(), accepted: true, ..record.clone() };
    append(path, &record).map_err(|error| wrong(&error.to_string()))
}

/// Appends a record on a line of its own, under a lock that other processes respect. If the record cannot be written as a
/// whole, the file is left as it was.
///
/// # Errors
/// If the file cannot be written.
pub fn append(path: &Path, record: &Record) -> io::Result<()> {
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory)?;
    }
    // Strings and finite numbers only.
    let mut line = serde_json::to_string(record).expect("a record is representable in JSON");
    line.push('\n');
    let mut file = contract::files::append_log(path)?;
    file.lock()?;
    let length = file.metadata()?.len();
    if length > 0 {
        let mut last = [0];
        file.read_exact_at(&mut last, length - 1)?;
        if last != *b"\n" {
            line.insert(0, '\n');
        }
    }
    file.write_all(line.as_bytes()).and_then(|()| file.sync_data()).inspect_err(|_| {
        // Nobody else has appended since, because of the lock.
        let _ = file.set_len(length);
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::measures::Measured;

    fn record(commit: &str, metrics: &[(&str, f64)]) -> Record {
        let metrics = metrics.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        Record { metrics, ..Record::new(commit.into()) }
    }

    #[test]
    fn the_last_record_of_a_commit_counts() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("deep/history.jsonl");
        assert_eq!(read(&path).unwrap(), []);
        for one in [
            record("a", &[("x", 1.0)]),
            record("b", &[("x", 2.5)]),
            record("a", &[("x", 3.0), ("y", 4.0)]),
        ] {
            append(&path, &one).unwrap();
        }
        let expected = [record("a", &[("x", 3.0), ("y", 4.0)]), record("b", &[("x", 2.5)])];
        assert_eq!(read(&path).unwrap(), expected);
    }

    #[test]
    fn a_commit_is_accepted_by_the_beginning_of_its_hash() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        for commit in ["abc1", "abc2", "abd3"] {
            append(&path, &record(commit, &[("x", 1.0)])).unwrap();
        }
        accept(&path, "abc2").unwrap();
        let accepted: Vec<bool> = read(&path).unwrap().iter().map(|r| r.accepted).collect();
        assert_eq!(accepted, [false, true, false]);
        assert_eq!(read(&path).unwrap()[1].metrics["x"], 1.0);
        assert!(accept(&path, "abc").unwrap_err().contains("several"));
        assert!(accept(&path, "f00").unwrap_err().contains("no values of commit f00"));
    }

    #[test]
    fn a_record_after_an_unfinished_line_has_a_line_of_its_own() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("history.jsonl");
        append(&path, &record("a", &[("x", 1.0)])).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.trim_end()).unwrap();
        append(&path, &record("b", &[("x", 2.0)])).unwrap();
        assert_eq!(read(&path).unwrap().len(), 2);
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
        assert_eq!(read(&path).unwrap().len(), 200);
    }

    #[test]
    fn an_invalid_line_is_reported_by_number() {
        let line = serde_json::to_string(&record("a", &[])).unwrap();
        assert!(parse(&format!("{line}\n\nx")).unwrap_err().starts_with("line 3"));
        assert!(parse(&line.replace("track/1", "track/2")).unwrap_err().contains("track/2"));
    }

    #[test]
    fn measures_of_a_gate_become_metrics_by_case() {
        let mut measures = Measures::of_program(Measured::default());
        measures.case("cube").exact.insert("rays".into(), 6);
        measures.case("cube").counted.insert("instructions".into(), 7);
        let mut one = record("a", &[]);
        one.add(measures.json().as_bytes()).unwrap();
        assert_eq!(one, record("a", &[("cube/rays", 6.0), ("cube/instructions", 7.0)]));
        assert!(one.add(b"{}").is_err());
    }
}
