//! Ranges of a set's bricks: finding, removing, appending and packing them.

use super::{BrickSet, LOW_BITS, Run, high_of};
use crate::brick::Brick;
use std::ops::Range;

impl BrickSet {
    /// Number of bricks before `key`.
    pub fn position(&self, key: u64) -> usize {
        let run = self.runs.partition_point(|r| r.high < high_of(key));
        let start = |run: usize| self.runs.get(run).map_or(self.len(), |r| r.start);
        match self.runs.get(run).filter(|r| r.high == high_of(key)) {
            None => start(run),
            Some(r) => {
                let low = &self.low[r.start..start(run + 1)];
                r.start + low.partition_point(|&low| low < key as u32)
            }
        }
    }

    /// The key of the brick at a position.
    pub fn key_at(&self, position: usize) -> u64 {
        let run = self.runs.partition_point(|r| r.start <= position) - 1;
        self.runs[run].high | u64::from(self.low[position])
    }

    /// The brick at a position.
    pub fn brick(&self, position: usize) -> Brick {
        Brick { key: self.key_at(position), bits: self.bits[position] }
    }

    /// The keys of the first brick and the last; none if the set is empty.
    pub fn ends(&self) -> Option<(u64, u64)> {
        (!self.is_empty()).then(|| (self.key_at(0), self.key_at(self.len() - 1)))
    }

    /// Removes all bricks except those at a range of positions.
    pub fn keep(&mut self, range: Range<usize>) {
        if range == (0..self.len()) {
            return;
        }
        self.runs = self.runs_of(&range);
        self.low.truncate(range.end);
        self.bits.truncate(range.end);
        self.low.drain(..range.start);
        self.bits.drain(..range.start);
    }

    /// The runs of the bricks at a range of positions, with positions relative to the range.
    fn runs_of(&self, range: &Range<usize>) -> Vec<Run> {
        if range.is_empty() {
            return Vec::new();
        }
        let first = self.runs.partition_point(|r| r.start <= range.start) - 1;
        let runs = self.runs[first..].iter().take_while(|r| r.start < range.end);
        runs.map(|r| Run { start: r.start.max(range.start) - range.start, ..*r }).collect()
    }

    /// Adds a set whose bricks all follow those of this set.
    ///
    /// # Panics
    /// If they do not.
    pub fn append(&mut self, after: Self) {
        let Some(runs) = self.runs_with(&after) else {
            return if self.is_empty() {
                *self = after
            };
        };
        self.runs = runs;
        self.low.extend_from_slice(&after.low);
        self.bits.extend_from_slice(&after.bits);
    }

    /// Adds a set whose bricks all precede those of this set.
    ///
    /// # Panics
    /// If they do not.
    pub fn prepend(&mut self, before: Self) {
        let Some(runs) = before.runs_with(self) else {
            return if self.is_empty() {
                *self = before
            };
        };
        self.runs = runs;
        self.low.splice(..0, before.low);
        self.bits.splice(..0, before.bits);
    }

    /// The runs of this set and of one that follows it; none if one of them is empty.
    fn runs_with(&self, after: &Self) -> Option<Vec<Run>> {
        let ((_, last), (first, _)) = (self.ends()?, after.ends()?);
        assert!(last < first, "bricks must be added in Morton order");
        let same = usize::from(high_of(last) == high_of(first));
        let theirs = after.runs[same..].iter();
        let theirs = theirs.map(|r| Run { start: r.start + self.len(), ..*r });
        Some(self.runs.iter().copied().chain(theirs).collect())
    }

    /// The union of sets. Fast if the sets do not overlap, or if one is much larger than the others.
    pub fn union_of(mut sets: Vec<Self>) -> Self {
        sets.retain(|s| !s.is_empty());
        sets.sort_by_key(Self::ends);
        let follows = |w: &[Self]| w[0].ends().map(|e| e.1) < w[1].ends().map(|e| e.0);
        if !sets.windows(2).all(follows) {
            sets.sort_by_key(Self::len);
            return sets.into_iter().reduce(Self::union).unwrap_or_default();
        }
        let Some(largest) = (0..sets.len()).max_by_key(|&i| sets[i].len()) else {
            return Self::default();
        };
        let (more, after) =
            (sets.iter().map(Self::len).sum::<usize>(), sets.split_off(largest + 1));
        let mut all = sets.pop().unwrap_or_default();
        all.reserve_exact(more - all.len());
        let mut before = Self::default();
        sets.into_iter().for_each(|set| before.append(set));
        all.prepend(before);
        after.into_iter().for_each(|set| all.append(set));
        all
    }

    /// Appends the bricks at a range of positions to a message: the numbers of runs and bricks, the runs, the lower
    /// halves of the keys in pairs, and the bits.
    pub fn pack(&self, range: Range<usize>, words: &mut Vec<u64>) {
        let runs = self.runs_of(&range);
        let (low, bits) = (&self.low[range.clone()], &self.bits[range]);
        words.reserve(2 + 2 * runs.len() + low.len().div_ceil(2) + bits.len());
        words.extend([runs.len() as u64, bits.len() as u64]);
        words.extend(runs.iter().flat_map(|r| [r.high, r.start as u64]));
        let (pairs, last) = low.as_chunks::<2>();
        words.extend(pairs.iter().map(|&[a, b]| u64::from(a) | u64::from(b) << LOW_BITS));
        words.extend(last.iter().map(|&low| u64::from(low)));
        words.extend_from_slice(bits);
    }

    /// Reads the bricks that [`pack`](Self::pack) has written at the front of `words`; returns them and the words
    /// that follow.
    ///
    /// # Panics
    /// If there are too few words.
    pub fn unpack(words: &[u64]) -> (Self, &[u64]) {
        let (head, words) = words.split_at(2);
        let (runs, words) = words.split_at(2 * head[0] as usize);
        let (low, words) = words.split_at((head[1] as usize).div_ceil(2));
        let (bits, words) = words.split_at(head[1] as usize);
        let runs = runs.as_chunks().0.iter();
        let mut set = Self {
            low: Vec::with_capacity(2 * low.len()),
            bits: bits.to_vec(),
            runs: runs.map(|&[high, start]| Run { high, start: start as usize }).collect(),
        };
        low.iter().for_each(|w| set.low.extend([*w as u32, (w >> LOW_BITS) as u32]));
        set.low.truncate(bits.len());
        (set, words)
    }
}
