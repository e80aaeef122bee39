//! The run report: the JSON file in which a program describes its run.
//!
//! `cells` is required. Everything else may be missing, and then
//! - `digest` is that of the mesh, if the run wrote one;
//! - it is unknown how many ranks and facets there were;
//! - `peak_rss_bytes` is what was sampled from outside, or empty, and the time is that of the process;
//! - phases and counters are empty, and so is every list that is missing from a phase.
//!
//! An engine without a run report is described by the manifest of its mesh, which has cells and digest only.

use serde::{Deserialize, Deserializer};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A run report. Lists have one entry per rank.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RunReport {
    /// Cells of the final mesh, or leaves of the base tree.
    pub cells: u64,
    /// The digest of the mesh: 32 hexadecimal digits.
    pub digest: Option<String>,
    /// Number of ranks; `None` if it is not reported.
    pub ranks: Option<usize>,
    /// Number of facets; `None` if it is not reported.
    pub facets: Option<u64>,
    /// The facets as the program read them.
    pub geometry: Option<Geometry>,
    /// The partitioner that was used; `None` if it is not reported, or for a single rank.
    pub partitioner: Option<String>,
    /// Wall time by the program's own clock, in seconds; `None` if it is not reported.
    pub time_wall_s: Option<f64>,
    /// Peak resident memory, per rank or of the whole program.
    #[serde(default, deserialize_with = "one_or_many")]
    pub peak_rss_bytes: Vec<u64>,
    /// Phases in the order in which they ran.
    #[serde(default)]
    pub phases: Vec<PhaseReport>,
    /// Counters by name.
    #[serde(default)]
    pub counters: BTreeMap<String, Vec<u64>>,
}

/// The facets of a run.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Geometry {
    /// Their digest.
    pub digest: String,
}

/// A phase of a run.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct PhaseReport {
    /// The program's name for it.
    pub name: String,
    /// Wall time, in seconds.
    pub time_wall_s: Vec<f64>,
    /// CPU time, in seconds.
    pub time_cpu_s: Vec<f64>,
    /// Wall time in calls to other ranks, in seconds.
    pub time_comm_wall_s: Vec<f64>,
    /// CPU time in calls to other ranks, in seconds.
    pub time_comm_cpu_s: Vec<f64>,
    /// Messages sent.
    pub messages: Vec<u64>,
    /// Bytes sent.
    pub message_bytes: Vec<u64>,
}

/// Reads a value or a list of values.
///
/// # Errors
/// If it is neither.
pub fn one_or_many<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    input: D,
) -> Result<Vec<T>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a value of the right type or a list of them was expected")]
    enum OneOrMany<T> {
        One(T),
        Many(Vec<T>),
    }
    Ok(match OneOrMany::deserialize(input)? {
        OneOrMany::One(value) => vec![value],
        OneOrMany::Many(values) => values,
    })
}

/// Longest time that is believed, in seconds: 30 years.
pub const SECONDS_MAX: f64 = 1e9;

/// How far the clock of a program may be from that of the harness, and from those of its phases.
pub const CLOCKS_S: f64 = 0.01;

impl RunReport {
    /// Reads a run report.
    ///
    /// # Errors
    /// One sentence, if the file cannot be read or does not have the fields that are required.
    pub fn read(path: &Path) -> Result<Self, String> {
        let wrong = |why: String| format!("the run report {} is unusable: {why}", path.display());
        let text = contract::files::read_text(path).map_err(|error| wrong(error.to_string()))?;
        let mut report: Self = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        report.fault().map_or(Ok(()), |why| Err(wrong(why)))?;
        // A clock that is too coarse for the run shows nothing.
        report.time_wall_s = report.time_wall_s.filter(|time| *time > 0.0);
        Ok(report)
    }

    /// What cannot be true of any run, in one sentence: a time that no clock shows, or numbers of ranks whose sum exceeds 64 bits.
    fn fault(&self) -> Option<String> {
        let mut times = vec![self.time_wall_s.as_slice()];
        let mut numbers = vec![("peak_rss_bytes", &self.peak_rss_bytes)];
        numbers.extend(self.counters.iter().map(|(name, of)| (name.as_str(), of)));
        let mut names = BTreeSet::new();
        for phase in &self.phases {
            if !names.insert(&phase.name) {
                return Some(format!("the phase {} has two entries: add them up", phase.name));
            }
            times.extend([&*phase.time_wall_s, &phase.time_cpu_s]);
            times.extend([&*phase.time_comm_wall_s, &phase.time_comm_cpu_s]);
            numbers.push(("messages", &phase.messages));
            numbers.push(("message_bytes", &phase.message_bytes));
        }
        let is_possible = |time: &&f64| (0.0..=SECONDS_MAX).contains(*time);
        if let Some(time) = times.concat().iter().find(|time| !is_possible(time)) {
            return Some(format!("a time of {time:e} s is not possible"));
        }
        let sum = |of: &[u64]| of.iter().try_fold(0u64, |sum, n| sum.checked_add(*n));
        let (name, _) = numbers.into_iter().find(|(_, of)| sum(of).is_none())?;
        Some(format!("the sum of {name} over all ranks exceeds 64 bits"))
    }

    /// Peak memory of all ranks together.
    pub fn peak_rss_bytes_total(&self) -> u64 {
        self.peak_rss_bytes.iter().sum()
    }
}

impl PhaseReport {
    /// CPU time outside calls to other ranks, per rank, in seconds. The resolution of the clocks may make a
    /// difference negative; it is then 0.
    pub fn time_useful_s(&self) -> Vec<f64> {
        let comm = self.time_comm_cpu_s.iter().copied().chain(std::iter::repeat(0.0));
        self.time_cpu_s.iter().zip(comm).map(|(all, comm)| (all - comm).max(0.0)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> RunReport {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn reports_of_mesher_and_reference_are_read() {
        let mesher = parse(
            r#"{"schema": "octree-mesher-run/1", "cells": 8, "digest": "00", "ranks": 2, "time_wall_s": 0.5,
                "peak_rss_bytes": [3, 4], "counters": {"leaves": [3, 5]},
                "phases": [{"name": "read", "time_cpu_s": [2.0, 1.0], "time_comm_cpu_s": [0.5, 1.5]}]}"#,
        );
        assert_eq!((mesher.ranks, mesher.peak_rss_bytes_total()), (Some(2), 7));
        assert_eq!(mesher.counters["leaves"], [3, 5]);
        assert_eq!(mesher.phases[0].time_useful_s(), [1.5, 0.0]);
        let reference =
            parse(r#"{"cells": 8, "digest": "00", "time_wall_s": 0.5, "peak_rss_bytes": 9}"#);
        assert_eq!((reference.ranks, reference.peak_rss_bytes_total()), (None, 9));
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let phase = |of: &str| format!(r#""phases": [{{"name": "read", {of}}}]"#);
        for (of, why) in [
            (r#""time_wall_s": -1.0"#.to_owned(), "a time of -1e0 s"),
            (r#""time_wall_s": 1e300"#.to_owned(), "a time of 1e300 s"),
            (phase(r#""time_cpu_s": [1.0, -2.0]"#), "a time of -2e0 s"),
            (r#""phases": [{"name": "a"}, {"name": "a"}]"#.to_owned(), "a has two entries"),
            (phase(r#""messages": [9223372036854775808, 9223372036854775808]"#), "sum of messages"),
            (r#""peak_rss_bytes": [18446744073709551615, 1]"#.to_owned(), "sum of peak_rss_bytes"),
            (r#""counters": {"rays": [18446744073709551615, 1]}"#.to_owned(), "sum of rays over"),
        ] {
            let fault = parse(&format!(r#"{{"cells": 8, {of}}}"#)).fault().unwrap();
            assert!(fault.contains(why), "{of}: {fault}");
        }
        let wrong = r#"{"cells": 8, "peak_rss_bytes": [-3]}"#;
        let error = serde_json::from_str::<RunReport>(wrong).unwrap_err().to_string();
        assert!(error.contains("a value of the right type or a list of them"), "{error}");
    }

    #[test]
    fn only_cells_are_required() {
        let least = parse(r#"{"cells": 8}"#);
        assert_eq!((least.ranks, least.time_wall_s, least.phases.len()), (None, None, 0));
        assert!(least.digest.is_none());
        assert!(least.peak_rss_bytes.is_empty() && least.counters.is_empty());
        let error = serde_json::from_str::<RunReport>(r#"{"digest": "00"}"#).unwrap_err();
        assert!(error.to_string().contains("cells"), "{error}");
    }
}
