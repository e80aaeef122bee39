//! The result of an audit as JSON (schema `octree-audit/1`), with its time and memory.
//!
//! CPU time and peak memory are those of the process. They describe the audit only if the process did nothing
//! else, as in `harness audit`.

use super::AuditReport;
use contract::files::write_atomically;
use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;

/// Name and version of the schema.
pub const SCHEMA: &str = "octree-audit/1";

/// The result of an audit, with its time and memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AuditRecord {
    /// [`SCHEMA`].
    pub schema: String,
    /// Whether every check holds.
    pub holds: bool,
    /// The result of each check.
    pub checks: Vec<CheckRecord>,
    /// Number of leaves.
    pub leaves: u64,
    /// Number of distinct octants in their tree.
    pub nodes: u64,
    /// Wall time for reading, merging, counting and building the tree.
    pub time_read_s: f64,
    /// Wall time of the audit.
    pub time_wall_s: f64,
    /// CPU time of the process so far.
    pub time_cpu_s: f64,
    /// Peak resident memory of the process; 0 if the system does not report it.
    pub peak_rss_bytes: u64,
}

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckRecord {
    /// Its name.
    pub name: String,
    /// Number of objects examined.
    pub examined: u64,
    /// Number of violations.
    pub findings: u64,
    /// Why there was nothing to check.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nothing_to_check: Option<String>,
}

impl AuditRecord {
    /// The record of a report, with the time and memory of this process so far.
    pub fn of(report: &AuditReport) -> Self {
        let check = |c: &crate::checks::CheckResult| CheckRecord {
            name: c.name.to_owned(),
            examined: c.examined,
            findings: c.findings_total,
            nothing_to_check: c.nothing_to_check.clone(),
        };
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        Self {
            schema: SCHEMA.to_owned(),
            holds: report.holds(),
            checks: report.checks.iter().map(check).collect(),
            leaves: report.leaves,
            nodes: report.nodes,
            time_read_s: report.time_read_s,
            time_wall_s: report.time_wall_s,
            time_cpu_s: ProcessTime::now().as_duration().as_secs_f64(),
            peak_rss_bytes: peak_rss_bytes(&status),
        }
    }

    /// Writes the record.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        write_atomically(path, |out| Ok(serde_json::to_writer_pretty(out, self)?))
    }

    /// Reads a record.
    ///
    /// # Errors
    /// One sentence, if the file cannot be read or is not a record.
    pub fn read(path: &Path) -> Result<Self, String> {
        let wrong = |why: String| format!("{}: {why}", path.display());
        let text = contract::files::read_text(path).map_err(|error| wrong(error.to_string()))?;
        let record: Self = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        match record.schema == SCHEMA {
            true => Ok(record),
            false => Err(wrong(format!("its schema is {}, not {SCHEMA}", record.schema))),
        }
    }
}

/// The peak resident memory in the text of `/proc/self/status`.
fn peak_rss_bytes(status: &str) -> u64 {
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::audit::audit;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn the_peak_of_memory_is_read_in_kilobytes() {
        let status = "Name:\tharness\nVmPeak:\t   99 kB\nVmHWM:\t     3 kB\nVmRSS:\t     2 kB\n";
        assert_eq!([peak_rss_bytes(status), peak_rss_bytes("Name:\tharness\n")], [3072, 0]);
    }

    #[test]
    fn a_record_is_read_back_unchanged() {
        let place = tempfile::tempdir().unwrap();
        let mut set = leaf_set(vec![words_of(|o| o.level == 0)]);
        // What was read is not overwritten.
        for (extra_leaves, holds, [name, other]) in
            [(0, true, ["a.json", "b.json"]), (1, false, ["c.json", "d.json"])]
        {
            set.manifest.leaves += extra_leaves;
            set.write(place.path()).unwrap();
            let record = AuditRecord::of(&audit(place.path()));
            let path = place.path().join(name);
            record.write(&path).unwrap();
            assert_eq!(AuditRecord::read(&path).unwrap(), record);
            assert_eq!((record.holds, record.leaves), (holds, 8));
            let manifest = record.checks.iter().find(|c| c.name == "manifest").unwrap();
            assert_eq!(manifest.findings > 0, !holds);
            let path = place.path().join(other);
            AuditRecord { schema: "octree-audit/9".to_owned(), ..record }.write(&path).unwrap();
            let why = AuditRecord::read(&path).unwrap_err();
            let file = path.display();
            assert_eq!(why, format!("{file}: its schema is octree-audit/9, not octree-audit/1"));
            fs::write(&path, "{}").unwrap();
            assert!(AuditRecord::read(&path).is_err());
        }
    }
}
