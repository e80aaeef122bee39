//! The parts of a mesh on disk: files of sorted leaf words, or the tree.

use std::ops::Range;
use std::path::Path;

use crate::directory::ReadError;
use crate::htg::{Cursor, TreeError, TreeFile};
use crate::npy::PartFile;
use crate::octant::Octant;
use crate::word::{self, KEY_END};

/// A part.
#[derive(Debug)]
pub enum Part {
    /// A file of leaf words.
    Words(PartFile),
    /// The whole tree.
    Tree(Box<TreeFile>),
}

impl Part {
    /// Its file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Words(file) => file.path(),
            Self::Tree(tree) => tree.path(),
        }
    }

    /// Whether it states the rank of each leaf: a file of words is that of one rank, but a tree may have none.
    pub fn has_ranks(&self) -> bool {
        match self {
            Self::Words(_) => true,
            Self::Tree(tree) => tree.has_ranks(),
        }
    }

    /// Number of leaves.
    pub fn leaves(&self) -> u64 {
        match self {
            Self::Words(file) => file.len(),
            Self::Tree(tree) => tree.leaves,
        }
    }
}

/// Leaves of a part: its number, and an interval of indices.
pub type Interval = (usize, Range<u64>);

/// One reader for each part. Each thread has readers of its own, because those of trees have buffers.
pub struct Readers<'a>(Vec<Reader<'a>>);

enum Reader<'a> {
    Words(&'a PartFile),
    Tree(&'a TreeFile, Cursor<'a>),
}

impl<'a> Readers<'a> {
    /// Readers of all parts.
    pub fn new(parts: &'a [Part]) -> Self {
        let reader = |part: &'a Part| match part {
            Part::Words(file) => Reader::Words(file),
            Part::Tree(tree) => Reader::Tree(tree, Cursor::new(tree)),
        };
        Self(parts.iter().map(reader).collect())
    }

    /// The leaves whose Morton codes are in `keys`.
    ///
    /// # Errors
    /// If a part cannot be read.
    pub fn intervals(&mut self, keys: Range<u64>) -> Result<Vec<Interval>, ReadError> {
        let mut intervals = Vec::new();
        for part in 0..self.0.len() {
            let all = match &self.0[part] {
                Reader::Words(file) => 0..file.len(),
                Reader::Tree(tree, _) => 0..tree.leaves,
            };
            let first = self.lower_bound(part, all.clone(), keys.start)?;
            intervals.push((part, first..self.lower_bound(part, first..all.end, keys.end)?));
        }
        Ok(intervals)
    }

    /// The leaves in these intervals, which are those of an octant: words in ascending order, if those of each part are, with their ranks.
    ///
    /// # Errors
    /// If a part cannot be read.
    pub fn leaves(
        &mut self,
        octant: &Octant,
        intervals: &[Interval],
    ) -> Result<Vec<(u64, u32)>, ReadError> {
        let mut leaves = Vec::new();
        for (part, interval) in intervals {
            let (words, ranks) = self.words(*part, octant, interval.clone())?;
            let rank = |i: usize| ranks.get(i).copied().unwrap_or(*part as u32);
            leaves.extend(words.into_iter().enumerate().map(|(i, word)| (word, rank(i))));
        }
        if intervals.len() > 1 {
            leaves.sort_unstable();
        }
        Ok(leaves)
    }

    /// Index of the first leaf in a range of a part whose Morton code is at least `key`.
    pub fn lower_bound(
        &mut self,
        part: usize,
        range: Range<u64>,
        key: u64,
    ) -> Result<u64, ReadError> {
        // The code one past the last one does not fit in a word.
        if key >= KEY_END {
            return Ok(range.end);
        }
        match &mut self.0[part] {
            Reader::Words(file) => {
                file.lower_bound(range, key << 7).map_err(|error| ReadError::part(file, error))
            }
            Reader::Tree(_, cursor) => Ok(cursor.leaves_before(key).clamp(range.start, range.end)),
        }
    }

    /// The words at these indices, which are leaves of the octant, and their ranks if the part is a tree with ranks.
    fn words(
        &mut self,
        part: usize,
        octant: &Octant,
        interval: Range<u64>,
    ) -> Result<(Vec<u64>, Vec<u32>), ReadError> {
        let (mut words, mut ranks) = (Vec::new(), Vec::new());
        match &mut self.0[part] {
            Reader::Words(file) => {
                words.resize((interval.end - interval.start) as usize, 0);
                let read = file.read_at(interval.start, &mut words);
                read.map_err(|error| ReadError::part(file, error))?;
            }
            Reader::Tree(tree, cursor) => {
                let read = append(cursor, octant, &interval, &mut words, &mut ranks);
                read.map_err(|error| ReadError::tree(tree, error))?;
            }
        }
        Ok((words, ranks))
    }
}

/// Appends those leaves of an octant whose indices are in the interval.
fn append(
    cursor: &mut Cursor,
    octant: &Octant,
    interval: &Range<u64>,
    words: &mut Vec<u64>,
    ranks: &mut Vec<u32>,
) -> Result<(), TreeError> {
    let key = word::key_of(octant.corner);
    let first = cursor.leaves_before(key);
    let end = cursor.leaves_before(key + word::span(octant.level));
    if first >= interval.end || end <= interval.start {
        return Ok(());
    }
    if interval.start <= first && end <= interval.end {
        return cursor.words(key, octant.level, words, ranks);
    }
    (0..8).try_for_each(|digit| append(cursor, &octant.child(digit), interval, words, ranks))
}
