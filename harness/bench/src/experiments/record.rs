//! The record: a file of JSON lines to which every result is appended immediately.
//!
//! Invariants: a line is written with one call under an exclusive lock, so that concurrent sessions do not interleave.
//! An interruption or a full disk leaves at most one broken line, which the next writer terminates and readers report and
//! skip. Lines are never rewritten.

use super::entry::{Entry, Line, SCHEMA};
use contract::files::{append_log, read_log};
use jiff::Timestamp;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A record opened for appending.
#[derive(Debug)]
pub struct Record {
    file: File,
    path: PathBuf,
    session: String,
}

impl Record {
    /// Opens a record for a new session; creates the file and its directory if necessary.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        if let Some(directory) = path.parent() {
            std::fs::create_dir_all(directory)?;
        }
        let file = append_log(path)?;
        let session = format!("{}-{}", now_utc(), std::process::id());
        Ok(Self { file, path: path.to_owned(), session })
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a line, and returns it.
    ///
    /// # Errors
    /// If the line could not be written completely.
    pub fn append(&mut self, entry: Entry) -> io::Result<Line> {
        let line = Line {
            schema: SCHEMA.to_owned(),
            session: self.session.clone(),
            time_utc: now_utc(),
            entry,
        };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        self.file.lock()?;
        let written = self.append_locked(text);
        self.file.unlock()?;
        written.map(|()| line)
    }

    fn append_locked(&mut self, mut text: Vec<u8>) -> io::Result<()> {
        if !self.ends_with_line()? {
            text.insert(0, b'\n');
        }
        self.file.write_all(&text)?;
        self.file.sync_data()
    }

    /// Whether the file is empty or ends with a newline.
    fn ends_with_line(&mut self) -> io::Result<bool> {
        if self.file.seek(SeekFrom::End(0))? == 0 {
            return Ok(true);
        }
        self.file.seek(SeekFrom::End(-1))?;
        let mut last = [0];
        self.file.read_exact(&mut last)?;
        Ok(last[0] == b'\n')
    }
}

/// The content of a record.
#[derive(Clone, Debug, Default)]
pub struct Content {
    /// The lines in chronological order.
    pub lines: Vec<Line>,
    /// Numbers (from 1) of invalid lines, with the reason.
    pub broken: Vec<(usize, String)>,
}

/// Reads a record.
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> io::Result<Content> {
    let mut content = Content::default();
    for (i, text) in String::from_utf8_lossy(&read_log(path)?).lines().enumerate() {
        match serde_json::from_str::<Line>(text) {
            _ if text.trim().is_empty() => {}
            Ok(line) if line.schema == SCHEMA => content.lines.push(line),
            Ok(line) => content.broken.push((i + 1, format!("its schema is {}", line.schema))),
            Err(error) => content.broken.push((i + 1, error.to_string())),
        }
    }
    Ok(content)
}

/// Returns the current time, as `2026-01-31T12:00:00Z`.
fn now_utc() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

#[cfg(test)]
mod tests {
    use super::super::entry::Network;
    use super::*;

    fn network(latency_s: f64) -> Entry {
        Entry::Network(Network { latency_s, bandwidth_bytes_per_s: 1e9, measured: false })
    }

    #[test]
    fn concurrent_writers_do_not_interleave() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("deeper/record.jsonl");
        std::thread::scope(|scope| {
            for writer in 0..4 {
                let path = &path;
                scope.spawn(move || {
                    let mut record = Record::open(path).unwrap();
                    (0..50).for_each(|i| {
                        _ = record.append(network(f64::from(writer * 50 + i))).unwrap()
                    });
                });
            }
        });
        let content = read(&path).unwrap();
        assert!(content.broken.is_empty(), "{:?}", content.broken);
        let mut seen: Vec<u64> = Vec::new();
        for line in content.lines {
            let Entry::Network(n) = line.entry else { panic!() };
            seen.push(n.latency_s as u64);
        }
        seen.sort_unstable();
        assert_eq!(seen, (0..200).collect::<Vec<u64>>());
    }

    #[test]
    fn an_interrupted_line_does_not_damage_others() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        Record::open(&path).unwrap().append(network(1.0)).unwrap();
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str(&text.clone()[..20]);
        std::fs::write(&path, &text).unwrap();
        Record::open(&path).unwrap().append(network(2.0)).unwrap();
        let content = read(&path).unwrap();
        assert_eq!((content.lines.len(), content.broken.len()), (2, 1));
        assert_eq!(content.broken[0].0, 2);
    }

    #[test]
    fn a_line_of_another_schema_is_reported() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.jsonl");
        Record::open(&path).unwrap().append(network(1.0)).unwrap();
        let text = std::fs::read_to_string(&path).unwrap().replace("bench/1", "bench/9");
        std::fs::write(&path, text).unwrap();
        assert!(read(&path).unwrap().broken[0].1.contains("octree-bench/9"));
    }

    #[test]
    fn times_are_utc_without_fractions_of_a_second() {
        let now = now_utc();
        let read: Timestamp = now.parse().unwrap();
        assert_eq!((read.to_string(), read.subsec_nanosecond()), (now, 0));
        assert!(read.duration_until(Timestamp::now()).as_secs() < 60);
    }
}
