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
/// If the line cannot be written, or if the file has other content than such lines, which is left as it was.
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
    let is_line = |line: &[u8]| serde_json::from_slice::<IgnoredAny>(line).is_ok();
    // One value in many lines begins with a brace, too.
    let first = bytes.split_inclusive(|byte| *byte == b'\n').next().unwrap_or(b"{");
    let is_ours = first.starts_with(b"{") && (!first.ends_with(b"\n") || is_line(first));
    // A crash may leave zeros where the last line was to be.
    if !is_ours || !matches!(last.first(), None | Some(b'{' | 0)) {
        let why = "it does not consist of JSON lines, so nothing is appended: give another file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    }
    if is_line(last) {
        text.insert(0, '\n');
    } else if !last.is_empty() {
        length -= last.len() as u64;
        file.set_len(length)?;
        eprintln!("harness: {}: its last line was unfinished and is removed", path.display());
    }
    file.write_all(text.as_bytes()).and_then(|()| file.sync_data()).inspect_err(|_| {
        // Nobody else has appended since, because of the lock.
        let _ = file.set_len(length);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_something_else_stays_as_it_is() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("file");
        for content in
            ["solid a\nendsolid", "key = 1\n", "\0\0\n\0", "{}\n[a]\nnote", "a", "{\n\"a\": 1\n}\n"]
        {
            fs::write(&path, content).unwrap();
            let error = append(&path, &1).unwrap_err().to_string();
            assert!(error.contains("does not consist of JSON lines"), "{error}");
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        fs::write(&path, "{}\n{\"a\":\0\0").unwrap();
        append(&path, &1).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "{}\n1\n");
    }
}
