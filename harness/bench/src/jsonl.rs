//! Files of JSON lines that only grow.
//!
//! Invariants: a line is written under an exclusive lock that other processes respect, so that concurrent writers do not interleave.
//! An unfinished last line, which an interruption leaves, costs that line: readers report it, and the next writer removes
//! it. If a line cannot be written as a whole, the file is left as it was.

use contract::files::{append_log, read_log};
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// A line that was read.
pub struct Line<T> {
    /// Its number, from 1.
    pub number: usize,
    /// Whether it has its end.
    pub is_finished: bool,
    /// Its content, or why it cannot be read.
    pub content: Result<T, String>,
}

/// Reads all lines that are not empty.
///
/// # Errors
/// If the file cannot be read.
pub fn read<T: DeserializeOwned>(path: &Path) -> io::Result<Vec<Line<T>>> {
    let bytes = read_log(path)?;
    let lines = bytes.split_inclusive(|byte| *byte == b'\n').zip(1..);
    let line = |(line, number): (&[u8], usize)| Line {
        number,
        is_finished: line.ends_with(b"\n"),
        content: serde_json::from_slice(line).map_err(|error| error.to_string()),
    };
    Ok(lines.filter(|(line, _)| !line.trim_ascii().is_empty()).map(line).collect())
}

/// Appends a line. Creates the file and its directory if necessary.
///
/// # Errors
/// If the line cannot be written.
pub fn append(path: &Path, line: &impl Serialize) -> io::Result<()> {
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory)?;
    }
    let mut text = serde_json::to_string(line)?;
    text.push('\n');
    let mut file = append_log(path)?;
    file.lock()?;
    let bytes = fs::read(path)?;
    let last = bytes.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
    let mut length = bytes.len() as u64;
    if serde_json::from_slice::<IgnoredAny>(last).is_ok() {
        text.insert(0, '\n');
    } else if !last.is_empty() {
        length -= last.len() as u64;
        file.set_len(length)?;
    }
    file.write_all(text.as_bytes()).and_then(|()| file.sync_data()).inspect_err(|_| {
        // Nobody else has appended since, because of the lock.
        let _ = file.set_len(length);
    })
}
