//! All part files as one ascending stream of words.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use contract::npy::PartFile;

/// Words per read: large enough for streaming, small enough for thousands of parts.
const CHUNK: usize = 1 << 15;

/// A part and its buffer.
struct Reader<'a> {
    file: &'a PartFile,
    /// Index in the file of the first word after the buffer.
    next: u64,
    words: Vec<u64>,
    /// Index in the buffer of the next word.
    position: usize,
}

impl Reader<'_> {
    /// Refills an exhausted buffer; false at the end of the part.
    fn fill(&mut self) -> std::io::Result<bool> {
        if self.position == self.words.len() {
            let left = self.file.len() - self.next;
            self.words.resize(usize::try_from(left).unwrap_or(usize::MAX).min(CHUNK), 0);
            self.file.read_at(self.next, &mut self.words)?;
            (self.next, self.position) = (self.next + self.words.len() as u64, 0);
        }
        Ok(!self.words.is_empty())
    }
}

/// Passes the words of all parts to `run` in runs, until it returns false. Each run comes from the part with
/// the given index, and the next word of every other part is at least as large. If every part is sorted, so is
/// the stream.
///
/// # Errors
/// The index of a part that cannot be read.
pub(crate) fn merge(
    parts: &[PartFile],
    run: &mut dyn FnMut(usize, &[u64]) -> bool,
) -> Result<(), (usize, std::io::Error)> {
    let reader = |file| Reader { file, next: 0, words: Vec::new(), position: 0 };
    let mut readers: Vec<_> = parts.iter().map(reader).collect();
    let mut heads = BinaryHeap::new();
    for (part, reader) in readers.iter_mut().enumerate() {
        if reader.fill().map_err(|e| (part, e))? {
            heads.push(Reverse((reader.words[0], part)));
        }
    }
    while let Some(Reverse((_, part))) = heads.pop() {
        let limit = heads.peek().map_or(u64::MAX, |Reverse((head, _))| *head);
        let reader = &mut readers[part];
        let buffered = &reader.words[reader.position..];
        // At least one word, so that equal heads and unsorted parts make progress.
        let len = 1 + buffered[1..].iter().take_while(|&&w| w < limit).count();
        if !run(part, &buffered[..len]) {
            return Ok(());
        }
        reader.position += len;
        if reader.fill().map_err(|e| (part, e))? {
            heads.push(Reverse((reader.words[reader.position], part)));
        }
    }
    Ok(())
}
