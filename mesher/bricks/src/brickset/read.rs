//! Reading a set: bricks in order, and lookups by ascending keys.

use super::{BrickSet, Run, high_of};
use crate::brick::Brick;

/// The bricks of a set in order; also finds bricks by ascending keys, see [`BrickSet::cursor`].
#[derive(Clone)]
pub struct Cursor<'a> {
    set: &'a BrickSet,
    /// The rest of the current run.
    low: &'a [u32],
    /// The run's end, and its keys' upper half: after the last run, higher than that of any key.
    end: usize,
    high: u64,
    /// Runs after the current one.
    runs: &'a [Run],
}

impl Iterator for Cursor<'_> {
    type Item = Brick;

    #[inline]
    fn next(&mut self) -> Option<Brick> {
        if self.low.is_empty() {
            self.next_run();
        }
        let (&low, rest) = self.low.split_first()?;
        let bits = self.set.bits[self.end - self.low.len()];
        self.low = rest;
        Some(Brick { key: self.high | u64::from(low), bits })
    }
}

/// Number of elements before the first one for which `leads` is false. Galloping search: fast if that one is
/// near.
#[inline]
fn leading(low: &[u32], leads: impl Fn(u32) -> bool) -> usize {
    let mut step = 1;
    while low.get(step).is_some_and(|&low| leads(low)) {
        step *= 2;
    }
    let near = &low[step / 2..low.len().min(step)];
    step / 2 + near.partition_point(|&low| leads(low))
}

impl<'a> Cursor<'a> {
    #[inline]
    pub(super) fn new(set: &'a BrickSet) -> Self {
        let mut cursor = Self { set, low: &[], end: 0, high: u64::MAX, runs: &set.runs };
        cursor.next_run();
        cursor
    }

    /// The bits of brick `key`, 0 if the set has none. Keys of consecutive queries must not descend.
    #[inline(always)]
    pub fn get(&mut self, key: u64) -> u64 {
        if self.high == high_of(key) {
            // The usual case is the next brick.
            if let [low, rest @ ..] = self.low
                && *low < key as u32
            {
                self.low = rest;
            }
            match self.low {
                [low, ..] if *low == key as u32 => return self.set.bits[self.end - self.low.len()],
                [low, ..] if *low > key as u32 => return 0,
                _ => {}
            }
        }
        self.seek(key)
    }

    /// Continues the search after the next brick.
    fn seek(&mut self, key: u64) -> u64 {
        while self.high < high_of(key) {
            self.next_run();
        }
        if self.high != high_of(key) {
            return 0;
        }
        let want = key as u32;
        // Long parts may be skipped: those of other ranks, or of the deleted region.
        self.low = &self.low[leading(self.low, |low| low < want)..];
        match self.low {
            [low, ..] if *low == want => self.set.bits[self.end - self.low.len()],
            _ => 0,
        }
    }

    fn next_run(&mut self) {
        let Some((run, after)) = self.runs.split_first() else {
            (self.low, self.high) = (&[], u64::MAX);
            return;
        };
        self.high = run.high;
        self.end = after.first().map_or(self.set.len(), |r| r.start);
        self.low = &self.set.low[run.start..self.end];
        self.runs = after;
    }
}

#[cfg(test)]
mod tests {
    use super::leading;

    #[test]
    fn leading_elements_are_counted_for_every_length() {
        let all: Vec<u32> = (0..40).collect();
        for (length, end) in (0..40).flat_map(|length| (0..42).map(move |end| (length, end))) {
            let found = leading(&all[..length], |low| low < end);
            assert_eq!(found, length.min(end as usize), "{length}, {end}");
        }
    }
}
