//! The record: a file of [JSON lines](crate::jsonl) to which every result is appended immediately.

use super::entry::{Entry, Line, SCHEMA};
use crate::jsonl;
use jiff::Timestamp;
use std::io;
use std::path::Path;

impl Line {
    /// A line of a session, as of now.
    pub fn new(session: &str, entry: Entry) -> Self {
        let (schema, session) = (SCHEMA.to_owned(), session.to_owned());
        Self { schema, session, time_utc: now_utc(), entry }
    }
}

/// The lines of a record in chronological order, and the numbers (from 1) of invalid ones, with the reason.
pub type Content = (Vec<Line>, Vec<(usize, String)>);

/// Reads a record.
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> io::Result<Content> {
    let (mut lines, mut broken) = Content::default();
    for jsonl::Line { number, content: line, .. } in jsonl::read::<Line>(path)? {
        match line {
            Ok(Line { entry: Entry::Former, .. }) => {}
            Ok(line) => match line.fault() {
                None => lines.push(line),
                Some(why) => broken.push((number, why)),
            },
            Err(why) => broken.push((number, why)),
        }
    }
    Ok((lines, broken))
}

/// Returns the current time, as `2026-01-31T12:00:00Z`.
pub fn now_utc() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

#[cfg(test)]
mod tests {
    use super::super::entry::Network;
    use super::*;

    fn network(latency_s: f64) -> Entry {
        Entry::Network(Network { latency_s, bandwidth_bytes_per_s: 1e9, measured: false })
    }

    fn append(path: &Path, latency_s: f64) {
        jsonl::append(path, &Line::new("s", network(latency_s))).unwrap();
    }

    #[test]
    fn an_interrupted_line_does_not_damage_others() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        append(&path, 1.0);
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str(&text.clone()[..20]);
        std::fs::write(&path, &text).unwrap();
        let (lines, broken) = read(&path).unwrap();
        assert_eq!((lines.len(), broken.len(), broken[0].0), (1, 1, 2));
        append(&path, 2.0);
        let (lines, broken) = read(&path).unwrap();
        assert_eq!((lines.len(), broken.len()), (2, 0));
    }

    #[test]
    fn a_line_of_another_schema_is_reported() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        append(&path, 1.0);
        let text = std::fs::read_to_string(&path).unwrap().replace("bench/1", "bench/9");
        std::fs::write(&path, text).unwrap();
        assert!(read(&path).unwrap().1[0].1.contains("octree-bench/9"));
    }

    #[test]
    fn times_are_utc_without_fractions_of_a_second() {
        let now = now_utc();
        let read: Timestamp = now.parse().unwrap();
        assert_eq!((read.to_string(), read.subsec_nanosecond()), (now, 0));
        assert!(read.duration_until(Timestamp::now()).as_secs() < 60);
    }
}
