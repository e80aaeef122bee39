//! Part files read as one ascending stream, in runs.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use contract::npy::PartFile;

/// Words read from a part at a time: large enough to stream, small enough for thousands of parts.
const CHUNK: usize = 1 << 15;

/// One part being read.
struct Reader<'a> {
    file: &'a PartFile,
    next: u64,
    words: Vec<u64>,
    at: usize,
}

impl Reader<'_> {
    /// Makes sure that the next word is in memory; false at the end.
    fn fill(&mut self) -> std::io::Result<bool> {
        if self.at == self.words.len() {
            let left = self.file.len() - self.next;
            self.words.resize(usize::try_from(left).unwrap_or(usize::MAX).min(CHUNK), 0);
            self.file.read_at(self.next, &mut self.words)?;
            (self.next, self.at) = (self.next + self.words.len() as u64, 0);
        }
        Ok(!self.words.is_empty())
    }
}

/// Hands out the words of all parts as runs: each run comes from one part (by its index), and no
/// other part's next word is below the run's words. If each part is sorted, so is the whole.
/// An error names the part.
pub(crate) fn merge(
    parts: &[PartFile],
    run: &mut dyn FnMut(usize, &[u64]) -> bool,
) -> Result<(), (usize, std::io::Error)> {
    let reader = |file| Reader { file, next: 0, words: Vec::new(), at: 0 };
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
        let ahead = &reader.words[reader.at..];
        // At least one word, so that equal heads and unsorted parts make progress too.
        let len = 1 + ahead[1..].iter().take_while(|&&w| w < limit).count();
        if !run(part, &ahead[..len]) {
            return Ok(());
        }
        reader.at += len;
        if reader.fill().map_err(|e| (part, e))? {
            heads.push(Reverse((reader.words[reader.at], part)));
        }
    }
    Ok(())
}
