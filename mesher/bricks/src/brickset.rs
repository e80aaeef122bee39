//! Sets of octants of one level: sorted sequences of bricks.
//!
//! The memory that these sets take limits the size of a mesh. Consecutive keys mostly agree in their upper
//! halves; so an upper half is stored once per *run* of bricks, and a brick takes 12 bytes. Thick layers consist of full bricks: a set
//! that will only be read can store these as the octants, two levels higher, that they fill.
//!
//! Invariants:
//! - keys ascend strictly, and no brick is empty;
//! - the first run starts at the first brick, and each run has at least one brick;
//! - runs have strictly ascending upper halves of keys;
//! - what is stored as full is not empty, and all other bricks of such a set are not full.

mod parts;
#[cfg(test)]
pub(crate) mod tests;

use crate::brick::{self, Brick, ones};

/// Bits of a key that are stored per brick.
const LOW_BITS: u32 = 32;

/// A set of octants of one level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BrickSet {
    /// Lower halves of the keys.
    low: Vec<u32>,
    bits: Vec<u64>,
    runs: Vec<Run>,
    /// The octants that full bricks fill, if these are stored so.
    full: Option<Box<BrickSet>>,
}

/// A run of bricks whose keys agree in their upper half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    /// The common upper half; its lower half is zero.
    high: u64,
    /// Position of the first brick.
    start: usize,
}

/// A key with its lower half set to zero.
#[inline]
const fn high_of(key: u64) -> u64 {
    key >> LOW_BITS << LOW_BITS
}

impl BrickSet {
    /// The empty set.
    pub const EMPTY: Self =
        Self { low: Vec::new(), bits: Vec::new(), runs: Vec::new(), full: None };

    /// The set of all octants of some bricks, which may be in any order and repeat keys.
    pub fn from_unsorted(mut bricks: Vec<Brick>) -> Self {
        bricks.sort_unstable_by_key(|b| b.key);
        bricks.into_iter().collect()
    }

    /// The octants `bits` of bricks with these keys, which ascend. Empty bricks are left out, in place.
    pub(crate) fn from_sorted(keys: impl Iterator<Item = u64>, mut bits: Vec<u64>) -> Self {
        let mut set = Self::default();
        for (at, key) in keys.enumerate() {
            if bits[at] != 0 {
                let high = high_of(key);
                if set.runs.last().is_none_or(|run| run.high != high) {
                    set.runs.push(Run { high, start: set.low.len() });
                }
                bits[set.low.len()] = bits[at];
                set.low.push(key as u32);
            }
        }
        bits.truncate(set.low.len());
        bits.shrink_to_fit();
        Self { bits, ..set }
    }

    /// Adds octants to the last brick or after it.
    ///
    /// # Panics
    /// If `key` precedes the last brick's key.
    #[inline]
    pub fn push(&mut self, key: u64, bits: u64) {
        if bits == 0 {
            return;
        }
        debug_assert!(self.full.is_none(), "a condensed set is only read");
        let high = high_of(key);
        let last = self.runs.last().map_or(0, |run| run.high);
        if let Some(&low) = self.low.last() {
            let before = last | u64::from(low);
            if before == key {
                let end = self.bits.len() - 1;
                self.bits[end] |= bits;
                return;
            }
            assert!(before < key, "bricks must be added in Morton order");
        }
        if high != last || self.runs.is_empty() {
            self.runs.push(Run { high, start: self.low.len() });
        }
        self.low.push(key as u32);
        self.bits.push(bits);
    }

    /// The bricks in order.
    #[inline]
    pub fn bricks(&self) -> Cursor<'_> {
        let rest = Brick { key: 0, bits: 0 };
        let full = self.full.as_ref().map(|full| Box::new(Full { cursor: full.cursor(), rest }));
        let runs = &self.runs;
        let mut cursor = Cursor { full, set: self, low: &[], end: 0, high: u64::MAX, runs };
        cursor.next_run();
        cursor
    }

    /// Number of bricks. Full ones must not be stored apart.
    pub fn len(&self) -> usize {
        assert!(self.full.is_none(), "a condensed set is only read");
        self.low.len()
    }

    /// Bytes that its bricks take.
    pub fn bytes(&self) -> usize {
        let full = self.full.as_ref().map_or(0, |full| full.bytes());
        size_of_val(&self.low[..]) + size_of_val(&self.bits[..]) + full
    }

    /// Whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.low.is_empty() && self.full.is_none()
    }

    /// Number of octants.
    pub fn count(&self) -> u64 {
        let full = self.full.as_ref().map_or(0, |full| full.count());
        self.bits.iter().map(|w| u64::from(w.count_ones())).sum::<u64>() + 64 * full
    }

    /// The bits of brick `key`; 0 if the set has no octant in it.
    pub fn get(&self, key: u64) -> u64 {
        let at = self.position(key);
        if at < self.low.len() && self.brick(at).key == key {
            return self.bits[at];
        }
        self.full.as_ref().map_or(0, |full| u64::from(full.contains(key)) * u64::MAX)
    }

    /// Stores full bricks as the octants that they fill, 64 of them in the memory of one, beside those that are. After that the set can only be
    /// read.
    pub fn condense(&mut self) {
        let mut full = Self::default();
        let before = self.replace_full(Self::EMPTY);
        self.retain(|b| {
            let is_full = b.bits == u64::MAX;
            full.push(b.key >> 6, u64::from(is_full) << (b.key & 63));
            if is_full { 0 } else { b.bits }
        });
        self.low.shrink_to_fit();
        self.bits.shrink_to_fit();
        self.replace_full(full.union(before));
    }

    /// Replaces the octants that full bricks are stored as, and returns those before. If there are none, the set can be changed; if there are
    /// some, full bricks that are stored otherwise must be [condensed](Self::condense).
    pub fn replace_full(&mut self, octants: Self) -> Self {
        let new = Some(Box::new(octants)).filter(|full| !full.is_empty());
        std::mem::replace(&mut self.full, new).map_or(Self::EMPTY, |full| *full)
    }

    /// Whether the octant with this Morton code is in the set.
    pub fn contains(&self, code: u64) -> bool {
        self.get(code >> 6) >> (code & 63) & 1 == 1
    }

    /// A reader for queries with ascending keys. It is not for reading the bricks in order, too.
    pub fn cursor(&self) -> Cursor<'_> {
        self.bricks()
    }

    /// Replaces the bits of every brick, in order, by what `keep` returns for it.
    pub fn retain(&mut self, mut keep: impl FnMut(Brick) -> u64) {
        let (len, runs) = (self.len(), std::mem::take(&mut self.runs));
        let mut kept = 0;
        for (i, run) in runs.iter().enumerate() {
            let first = kept;
            for at in run.start..runs.get(i + 1).map_or(len, |r| r.start) {
                let low = self.low[at];
                let bits = keep(Brick { key: run.high | u64::from(low), bits: self.bits[at] });
                if bits != 0 {
                    (self.low[kept], self.bits[kept]) = (low, bits);
                    kept += 1;
                }
            }
            if kept > first {
                self.runs.push(Run { high: run.high, start: first });
            }
        }
        self.low.truncate(kept);
        self.bits.truncate(kept);
    }

    /// The octants that are not in `other`.
    pub fn without(mut self, other: &Self) -> Self {
        let mut other = other.cursor();
        self.retain(|b| b.bits & !other.get(b.key));
        self
    }

    /// The parents of the set's octants.
    pub fn coarsen(&self) -> Self {
        self.bricks().map(Brick::parents).collect()
    }

    /// The children of the set's octants, brick by brick in Morton order.
    #[inline]
    pub fn child_bricks(&self) -> impl Iterator<Item = Brick> + '_ {
        self.bricks().flat_map(|b| {
            ones(brick::parents(b.bits).into()).map(u64::from).map(move |j| Brick {
                key: b.key << 3 | j,
                bits: brick::children(brick::byte(b.bits, j)),
            })
        })
    }

    /// The codes of the set's octants in Morton order.
    pub fn codes(&self) -> impl Iterator<Item = u64> + '_ {
        self.bricks().flat_map(Brick::codes)
    }

    /// Checks the invariants.
    ///
    /// # Panics
    /// If one is violated; the message names it and a key.
    pub fn check_invariants(&self) {
        assert_eq!(self.low.len(), self.bits.len(), "each key must have bits");
        if self.is_empty() {
            return assert!(self.runs.is_empty(), "an empty set must have no runs");
        }
        assert!(self.runs.is_sorted_by(|a, b| a.start < b.start), "each run must have a brick");
        let (mut same, mut before) = (Self::default(), None);
        for Brick { key, bits } in self.bricks() {
            assert!(bits != 0, "brick {key:#x} must not be empty");
            if let Some(before) = before.replace(key) {
                assert!(before < key, "brick {key:#x} must follow brick {before:#x}");
            }
            let is_apart = self.full.is_some() && bits == u64::MAX;
            same.push(key, if is_apart { 0 } else { bits });
        }
        same.full.clone_from(&self.full);
        assert!(*self == same, "each brick must be in the run of its upper half, or full");
        if let Some(full) = &self.full {
            assert!(!full.is_empty(), "a condensed set must have full bricks");
            full.check_invariants();
        }
    }
}

/// The octants of some bricks in Morton order; those with the same key become one.
impl FromIterator<Brick> for BrickSet {
    #[inline]
    fn from_iter<I: IntoIterator<Item = Brick>>(bricks: I) -> Self {
        let (mut set, bricks) = (Self::default(), bricks.into_iter());
        set.low.reserve(bricks.size_hint().0);
        set.bits.reserve(bricks.size_hint().0);
        bricks.for_each(|b| set.push(b.key, b.bits));
        set
    }
}

/// The bricks of a set in order; also finds bricks by ascending keys, see [`BrickSet::cursor`].
pub struct Cursor<'a> {
    /// Full bricks that are stored apart.
    full: Option<Box<Full<'a>>>,
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
        if let Some(full) = &mut self.full {
            let partial = self.low.first().map_or(u64::MAX, |low| self.high | u64::from(*low));
            if let Some(key) = full.before(partial) {
                return Some(Brick { key, bits: u64::MAX });
            }
        }
        let (&low, rest) = self.low.split_first()?;
        let bits = self.set.bits[self.end - self.low.len()];
        self.low = rest;
        Some(Brick { key: self.high | u64::from(low), bits })
    }
}

/// A reader of full bricks that are stored as the octants that they fill.
struct Full<'a> {
    cursor: Cursor<'a>,
    /// The rest of the cursor's last brick.
    rest: Brick,
}

impl Full<'_> {
    /// The key of the next full brick, if it precedes this one.
    fn before(&mut self, key: u64) -> Option<u64> {
        while self.rest.bits == 0 {
            self.rest = self.cursor.next()?;
        }
        let next = self.rest.key << 6 | u64::from(self.rest.bits.trailing_zeros());
        (next < key).then(|| {
            self.rest.bits &= self.rest.bits - 1;
            next
        })
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

impl Cursor<'_> {
    /// The bits of brick `key`, 0 if the set has none. Keys of consecutive queries must not descend.
    #[inline(always)]
    pub fn get(&mut self, key: u64) -> u64 {
        match (self.partial(key), &mut self.full) {
            (0, Some(full)) => (full.cursor.get(key >> 6) >> (key & 63) & 1) * u64::MAX,
            (bits, _) => bits,
        }
    }

    /// The bits of a brick that is not stored as full.
    #[inline(always)]
    fn partial(&mut self, key: u64) -> u64 {
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
        self.end = after.first().map_or(self.set.low.len(), |r| r.start);
        self.low = &self.set.low[run.start..self.end];
        self.runs = after;
    }
}
