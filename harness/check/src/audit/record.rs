//! An audit as a record for programs, with what it took: schema `octree-audit/1`.
//!
//! CPU time and peak memory are those of the whole process, so they mean the audit only where the process
//! did nothing else, as in `harness audit`.

use super::AuditReport;
use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;

/// Name and version of the schema.
pub const SCHEMA: &str = "octree-audit/1";

/// What an audit said and took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AuditRecord {
    /// [`SCHEMA`].
    pub schema: String,
    /// Whether every check holds.
    pub holds: bool,
    /// Check by check.
    pub checks: Vec<CheckRecord>,
    /// Leaves read.
    pub leaves: u64,
    /// Distinct octants that they came down to.
    pub nodes: u64,
    /// Wall time for reading, merging, counting and building the tree.
    pub time_read_s: f64,
    /// Wall time for all.
    pub time_wall_s: f64,
    /// CPU time of the process so far.
    pub time_cpu_s: f64,
    /// Peak resident memory of the process; 0 where the system does not tell.
    pub peak_rss_bytes: u64,
}

/// A check's verdict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckRecord {
    /// Its name.
    pub name: String,
    /// Things looked at.
    pub examined: u64,
    /// Violations found.
    pub findings: u64,
}

impl AuditRecord {
    /// What a report says, with what this process has taken so far.
    pub fn of(report: &AuditReport) -> Self {
        let check = |c: &crate::checks::CheckResult| CheckRecord {
            name: c.name.to_owned(),
            examined: c.examined,
            findings: c.findings_total,
        };
        Self {
            schema: SCHEMA.to_owned(),
            holds: report.holds(),
            checks: report.checks.iter().map(check).collect(),
            leaves: report.leaves,
            nodes: report.nodes,
            time_read_s: report.time_read_s,
            time_wall_s: report.time_wall_s,
            time_cpu_s: ProcessTime::now().as_duration().as_secs_f64(),
            peak_rss_bytes: peak_rss_bytes(),
        }
    }

    /// Writes it beside `path` and renames it there.
    ///
    /// # Errors
    /// Where that is not possible.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let directory = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut beside = tempfile::NamedTempFile::new_in(directory)?;
        serde_json::to_writer_pretty(&mut beside, self)?;
        beside.as_file().sync_all()?;
        beside.persist(path).map(drop).map_err(|error| error.error)
    }

    /// Reads one.
    ///
    /// # Errors
    /// One sentence, where it is none.
    pub fn read(path: &Path) -> Result<Self, String> {
        let wrong = |why: String| format!("{}: {why}", path.display());
        let text = fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        let record: Self = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        match record.schema == SCHEMA {
            true => Ok(record),
            false => Err(wrong(format!("its schema is {}, not {SCHEMA}", record.schema))),
        }
    }
}

fn peak_rss_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::audit::{AuditOptions, audit};
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn verdicts_survive_the_journey() {
        let place = tempfile::tempdir().unwrap();
        let mut set = leaf_set(vec![words_of(|o| o.level == 0)]);
        for (lie, holds) in [(0, true), (1, false)] {
            set.manifest.leaves += lie;
            set.write(place.path()).unwrap();
            let record = AuditRecord::of(&audit(place.path(), &AuditOptions::default()));
            let path = place.path().join("audit.json");
            record.write(&path).unwrap();
            assert_eq!(AuditRecord::read(&path).unwrap(), record);
            assert_eq!((record.holds, record.leaves), (holds, 8));
            let manifest = record.checks.iter().find(|c| c.name == "manifest").unwrap();
            assert_eq!(manifest.findings > 0, !holds);
            fs::write(&path, "{}").unwrap();
            assert!(AuditRecord::read(&path).is_err());
        }
    }
}
