//! All part files as one ascending stream of words.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::directory::of_part;
use crate::failure::Unusable;
use crate::npy::PartFile;

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
    fn fill(&mut self) -> Result<bool, Unusable> {
        if self.position == self.words.len() {
            let left = self.file.len() - self.next;
            self.words.resize(usize::try_from(left).unwrap_or(usize::MAX).min(CHUNK), 0);
            let read = self.file.read_at(self.next, &mut self.words);
            read.map_err(|error| of_part(self.file, error))?;
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
/// If a part cannot be read.
pub(super) fn merge(
    parts: &[PartFile],
    run: &mut dyn FnMut(usize, &[u64]) -> bool,
) -> Result<(), Unusable> {
    let reader = |file| Reader { file, next: 0, words: Vec::new(), position: 0 };
    let mut readers: Vec<Reader> = parts.iter().map(reader).collect();
    let mut heads = BinaryHeap::new();
    for (part, reader) in readers.iter_mut().enumerate() {
        if reader.fill()? {
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
        if reader.fill()? {
            heads.push(Reverse((reader.words[reader.position], part)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digest::mix;
    use crate::npy;

    fn parts(words: &[Vec<u64>]) -> (tempfile::TempDir, Vec<PartFile>) {
        let dir = tempfile::tempdir().unwrap();
        let open = |(i, words): (usize, &Vec<u64>)| {
            let path = dir.path().join(format!("{i}.npy"));
            npy::write(&path, words).unwrap();
            PartFile::open(&path).unwrap()
        };
        let files = words.iter().enumerate().map(open).collect();
        (dir, files)
    }

    #[test]
    fn the_words_of_sorted_parts_become_one_sorted_stream() {
        // One part exceeds the buffer, one is empty, and words are repeated within and across parts.
        let random = |count: u64, salt: u64| {
            let mut words: Vec<u64> =
                (0..count).map(|i| (mix(i ^ salt << 40) >> 64) as u64 % 50_000).collect();
            words.sort_unstable();
            words
        };
        let given = [
            random(2 * CHUNK as u64 + 5, 1),
            vec![],
            random(300, 2),
            vec![7; 3],
            random(CHUNK as u64, 3),
        ];
        let (_dir, files) = parts(&given);
        let (mut found, mut by_part) = (Vec::new(), vec![Vec::new(); given.len()]);
        merge(&files, &mut |part, run| {
            assert!(!run.is_empty());
            by_part[part].extend_from_slice(run);
            found.extend_from_slice(run);
            true
        })
        .unwrap();
        let mut expected = given.concat();
        expected.sort_unstable();
        assert!(found == expected && by_part == given);
        let mut runs = 0;
        merge(&files, &mut |_, _| {
            runs += 1;
            runs < 3
        })
        .unwrap();
        assert_eq!(runs, 3);
    }

    #[test]
    fn words_of_unsorted_parts_are_all_passed_on() {
        let given = [vec![9, 1, 5], vec![2, u64::MAX, 0]];
        let (_dir, files) = parts(&given);
        let mut by_part = vec![Vec::new(); 2];
        merge(&files, &mut |part, run| {
            by_part[part].extend_from_slice(run);
            true
        })
        .unwrap();
        assert_eq!(by_part, given);
    }
}
