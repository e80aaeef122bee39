//! The union of two sets, in place.

use super::{BrickSet, Run, high_of};
use crate::brick::Brick;

impl BrickSet {
    /// The union of two sets. Merges in place, from the back, because sets take much of the memory.
    pub fn union(self, other: Self) -> Self {
        let (mut set, rest) = if self.len() < other.len() { (other, self) } else { (self, other) };
        if rest.is_empty() {
            return set;
        }
        let mut cursor = set.cursor();
        let common = rest.bricks().filter(|b| cursor.get(b.key) != 0).count();
        let (mut mine, mut theirs) = (Back::new(&set), Back::new(&rest));
        let mut k = set.len() + rest.len() - common;
        set.reserve_exact(k - set.len());
        set.low.resize(k, 0);
        set.bits.resize(k, 0);
        // New runs, in descending order; the runs before them do not change.
        let mut runs: Vec<Run> = Vec::new();
        while let Some(r) = theirs.last(&rest) {
            k -= 1;
            let b = mine.last(&set);
            let (from_mine, from_theirs) =
                (b.is_some_and(|b| b.key >= r.key), b.is_none_or(|b| b.key <= r.key));
            let key = if from_theirs { r.key } else { b.map_or(r.key, |b| b.key) };
            let part = |from: bool, bits: u64| if from { bits } else { 0 };
            set.low[k] = key as u32;
            set.bits[k] = part(from_theirs, r.bits) | part(from_mine, b.map_or(0, |b| b.bits));
            match runs.last_mut() {
                Some(run) if run.high == high_of(key) => run.start = k,
                _ => runs.push(Run { high: high_of(key), start: k }),
            }
            if from_mine {
                mine.step(&set);
            }
            if from_theirs {
                theirs.step(&rest);
            }
        }
        set.runs.truncate(mine.runs);
        if set.runs.last().is_some_and(|r| runs.last().is_some_and(|n| n.high == r.high)) {
            runs.pop();
        }
        set.runs.extend(runs.into_iter().rev());
        set
    }
}

/// Reads a set from the back; bricks that have been read may be overwritten.
struct Back {
    /// Number of bricks that remain.
    left: usize,
    /// Number of runs that they belong to.
    runs: usize,
}

impl Back {
    fn new(set: &BrickSet) -> Self {
        Self { left: set.len(), runs: set.runs.len() }
    }

    #[inline]
    fn last(&self, set: &BrickSet) -> Option<Brick> {
        let at = self.left.checked_sub(1)?;
        let key = set.runs[self.runs - 1].high | u64::from(set.low[at]);
        Some(Brick { key, bits: set.bits[at] })
    }

    #[inline]
    fn step(&mut self, set: &BrickSet) {
        self.left -= 1;
        self.runs -= usize::from(set.runs[self.runs - 1].start == self.left);
    }
}
