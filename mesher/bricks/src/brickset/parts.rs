//! Parts of sets: finding, removing and uniting them.

use super::{BrickSet, Run, high_of};
use crate::brick::Brick;
use std::ops::Range;

impl BrickSet {
    /// Number of bricks before `key`.
    pub fn position(&self, key: u64) -> usize {
        let run = self.runs.partition_point(|r| r.high < high_of(key));
        let start = |run: usize| self.runs.get(run).map_or(self.low.len(), |r| r.start);
        match self.runs.get(run).filter(|r| r.high == high_of(key)) {
            None => start(run),
            Some(r) => {
                let low = &self.low[r.start..start(run + 1)];
                r.start + low.partition_point(|&low| low < key as u32)
            }
        }
    }

    /// The brick at a position.
    pub fn brick(&self, position: usize) -> Brick {
        let run = self.runs.partition_point(|r| r.start <= position) - 1;
        let key = self.runs[run].high | u64::from(self.low[position]);
        Brick { key, bits: self.bits[position] }
    }

    /// The bricks at a range of positions; the others are removed in place.
    pub fn keep(mut self, range: Range<usize>) -> Self {
        if range == (0..self.len()) {
            return self;
        }
        if range.is_empty() {
            return Self::default();
        }
        self.runs.retain(|r| r.start < range.end);
        let before = self.runs.partition_point(|r| r.start <= range.start) - 1;
        self.runs.drain(..before);
        self.runs.iter_mut().for_each(|r| r.start = r.start.saturating_sub(range.start));
        self.low.truncate(range.end);
        self.bits.truncate(range.end);
        self.low.drain(..range.start);
        self.bits.drain(..range.start);
        self
    }

    /// The union of two sets. Merges in place, from the back, because sets take much of the memory.
    pub fn union(self, other: Self) -> Self {
        let (mut set, rest) = if self.len() < other.len() { (other, self) } else { (self, other) };
        if rest.is_empty() {
            return set;
        }
        let mut cursor = set.cursor();
        let common = rest.bricks().filter(|b| cursor.get(b.key) != 0).count();
        let (mut i, mut j) = (set.len(), rest.len());
        let mut k = i + j - common;
        set.low.reserve_exact(k - i);
        set.bits.reserve_exact(k - i);
        set.low.resize(k, 0);
        set.bits.resize(k, 0);
        // Run by run; new runs are in descending order, and those that remain at the end do not change.
        let (mut mine, mut theirs) = (std::mem::take(&mut set.runs), &rest.runs[..]);
        let mut runs: Vec<Run> = Vec::new();
        while let Some(last) = theirs.last() {
            let high = mine.last().map_or(last.high, |run| run.high.max(last.high));
            let from_mine = mine.pop_if(|run| run.high == high).map_or(i, |run| run.start);
            let mut from_theirs = j;
            if last.high == high {
                from_theirs = last.start;
                theirs = &theirs[..theirs.len() - 1];
            }
            while j > from_theirs {
                (j, k) = (j - 1, k - 1);
                while i > from_mine && set.low[i - 1] > rest.low[j] {
                    i -= 1;
                    (set.low[k], set.bits[k]) = (set.low[i], set.bits[i]);
                    k -= 1;
                }
                let mut bits = rest.bits[j];
                if i > from_mine && set.low[i - 1] == rest.low[j] {
                    i -= 1;
                    bits |= set.bits[i];
                }
                (set.low[k], set.bits[k]) = (rest.low[j], bits);
            }
            if k > i {
                set.low.copy_within(from_mine..i, k + from_mine - i);
                set.bits.copy_within(from_mine..i, k + from_mine - i);
            }
            (i, k) = (from_mine, k + from_mine - i);
            runs.push(Run { high, start: k });
        }
        mine.extend(runs.into_iter().rev());
        set.runs = mine;
        set
    }
}
