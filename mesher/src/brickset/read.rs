//! Readers of a set: its bricks, groups of them, those of the level below, and bits by ascending keys.

use super::{BrickSet, Run, high_of};
use crate::brick::{self, Brick};
use std::ops::Range;

/// The bricks of a set in order.
#[derive(Clone)]
pub struct Bricks<'a> {
    set: &'a BrickSet,
    at: usize,
    /// End of the current run, and its keys' upper half.
    run_end: usize,
    high: u64,
    /// Runs behind.
    runs: &'a [Run],
}

impl<'a> Bricks<'a> {
    #[inline]
    pub(super) fn new(set: &'a BrickSet) -> Self {
        Self { set, at: 0, run_end: 0, high: 0, runs: &set.runs }
    }
}

impl Iterator for Bricks<'_> {
    type Item = Brick;

    #[inline]
    fn next(&mut self) -> Option<Brick> {
        if self.at == self.run_end {
            let (run, behind) = self.runs.split_first()?;
            self.high = run.high;
            self.run_end = behind.first().map_or(self.set.len(), |r| r.start);
            self.runs = behind;
        }
        let at = self.at;
        self.at += 1;
        Some(Brick { key: self.high | u64::from(self.set.low[at]), bits: self.set.bits[at] })
    }
}

/// See [`BrickSet::groups`].
pub struct Groups<'a> {
    bricks: Bricks<'a>,
    shift: u32,
}

impl<'a> Groups<'a> {
    pub(super) fn new(set: &'a BrickSet, shift: u32) -> Self {
        Self { bricks: set.bricks(), shift }
    }
}

impl Iterator for Groups<'_> {
    /// The first brick's key, and the positions of all.
    type Item = (u64, Range<usize>);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let first = self.bricks.next()?;
        let Bricks { set, at, run_end, .. } = self.bricks;
        let group = |low: u32| low.checked_shr(self.shift).unwrap_or(0);
        let more = leading(&set.low[at..run_end], |low| group(low) == group(first.key as u32));
        self.bricks.at += more;
        Some((first.key, at - 1..at + more))
    }
}

/// How many elements are before the first of which `leads` is not true. A gallop: quick where that is near.
#[inline]
fn leading(low: &[u32], leads: impl Fn(u32) -> bool) -> usize {
    let mut step = 1;
    while low.get(step).is_some_and(|&low| leads(low)) {
        step *= 2;
    }
    let near = &low[step / 2..low.len().min(step + 1)];
    step / 2 + near.partition_point(|&low| leads(low))
}

/// See [`BrickSet::child_bricks`].
#[derive(Clone)]
pub struct ChildBricks<'a> {
    bricks: Bricks<'a>,
    now: Brick,
    /// Groups of the brick that are not told yet.
    left: u8,
}

impl<'a> ChildBricks<'a> {
    #[inline]
    pub(super) fn new(set: &'a BrickSet) -> Self {
        Self { bricks: set.bricks(), now: Brick { key: 0, bits: 0 }, left: 0 }
    }
}

impl Iterator for ChildBricks<'_> {
    type Item = Brick;

    #[inline]
    fn next(&mut self) -> Option<Brick> {
        if self.left == 0 {
            self.now = self.bricks.next()?;
            self.left = brick::parents(self.now.bits);
        }
        let j = u64::from(self.left.trailing_zeros());
        self.left &= self.left - 1;
        let bits = brick::children(brick::byte(self.now.bits, j));
        Some(Brick { key: self.now.key << 3 | j, bits })
    }
}

/// Reads a set in ascending order of keys; see [`BrickSet::cursor`].
pub struct Cursor<'a> {
    set: &'a BrickSet,
    /// What is left of the current run.
    low: &'a [u32],
    /// The run's end, and its keys' upper half; behind the last run higher than any.
    end: usize,
    high: u64,
    /// Runs behind.
    runs: &'a [Run],
}

impl<'a> Cursor<'a> {
    pub(super) fn new(set: &'a BrickSet) -> Self {
        let mut cursor = Self { set, low: &[], end: 0, high: u64::MAX, runs: &set.runs };
        cursor.next_run();
        cursor
    }

    /// The bits of the brick `key`, which is not before any key asked for earlier.
    #[inline(always)]
    pub fn get(&mut self, key: u64) -> u64 {
        if self.high == high_of(key) {
            // Most often it is the next one.
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

    /// Goes on to a brick behind the one that is next.
    fn seek(&mut self, key: u64) -> u64 {
        while self.high < high_of(key) {
            self.next_run();
        }
        if self.high != high_of(key) {
            return 0;
        }
        let want = key as u32;
        // What the reader skips (another rank's share, deleted parts) may be long.
        self.low = &self.low[leading(self.low, |low| low < want)..];
        match self.low {
            [low, ..] if *low == want => self.set.bits[self.end - self.low.len()],
            _ => 0,
        }
    }

    fn next_run(&mut self) {
        let Some((run, behind)) = self.runs.split_first() else {
            (self.low, self.high) = (&[], u64::MAX);
            return;
        };
        self.high = run.high;
        self.end = behind.first().map_or(self.set.len(), |r| r.start);
        self.low = &self.set.low[run.start..self.end];
        self.runs = behind;
    }
}
