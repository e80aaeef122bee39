//! Sets of octants of one level: sorted sequences of bricks.
//!
//! A mesh is limited by the memory that its sets take. Keys that follow each other agree in their upper
//! halves but for a few thousand places; so those are kept once per run, and a brick takes 12 bytes.
//!
//! Invariants: keys strictly ascend; no brick is empty; runs have ascending upper halves, and at least a
//! brick each.

mod parts;
mod read;
mod union;

pub use read::{Bricks, ChildBricks, Cursor, Groups};

use crate::brick::{self, Brick};
use crate::wide::widest;
use std::ops::Range;

/// Bits of a key that are kept per brick.
const LOW_BITS: u32 = 32;

/// A set of octants of one level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BrickSet {
    /// Lower halves of the keys.
    low: Vec<u32>,
    bits: Vec<u64>,
    runs: Vec<Run>,
}

/// Bricks whose keys agree in their upper half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    /// The upper half, in its place.
    high: u64,
    /// The first brick's position.
    start: usize,
}

/// A key's upper half, in its place.
#[inline]
const fn high_of(key: u64) -> u64 {
    key >> LOW_BITS << LOW_BITS
}

impl BrickSet {
    /// Nothing.
    pub const EMPTY: Self = Self { low: Vec::new(), bits: Vec::new(), runs: Vec::new() };

    /// The set of the given bricks, which may come in any order and repeat keys.
    pub fn from_unsorted(mut bricks: Vec<Brick>) -> Self {
        bricks.sort_unstable_by_key(|b| b.key);
        let mut set = Self::default();
        set.reserve_exact(bricks.len());
        for b in bricks {
            set.push(b.key, b.bits);
        }
        set
    }

    fn reserve_exact(&mut self, more: usize) {
        self.low.reserve_exact(more);
        self.bits.reserve_exact(more);
    }

    /// Adds octants at or behind the last brick.
    ///
    /// # Panics
    /// If `key` is before the last brick's.
    #[inline]
    pub fn push(&mut self, key: u64, bits: u64) {
        if bits == 0 {
            return;
        }
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
    pub fn bricks(&self) -> Bricks<'_> {
        Bricks::new(self)
    }

    /// The bricks in order, those together whose keys agree but for so many low bits (and whose upper halves do): the first
    /// one's key, and the positions of all.
    #[inline]
    pub fn groups(&self, low_bits: u32) -> Groups<'_> {
        Groups::new(self, low_bits)
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.low.len()
    }

    /// Whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.low.is_empty()
    }

    /// Number of octants.
    pub fn count(&self) -> u64 {
        count_ones(&self.bits)
    }

    /// Number of octants in the bricks of a range of positions.
    pub fn count_in(&self, range: Range<usize>) -> u64 {
        count_ones(&self.bits[range])
    }

    /// The bits of a brick, 0 where the set has none of it.
    pub fn get(&self, key: u64) -> u64 {
        let Ok(run) = self.runs.binary_search_by_key(&high_of(key), |r| r.high) else {
            return 0;
        };
        let range = self.runs[run].start..self.runs.get(run + 1).map_or(self.len(), |r| r.start);
        let found = self.low[range.clone()].binary_search(&(key as u32));
        found.map_or(0, |i| self.bits[range.start + i])
    }

    /// Whether the octant with this Morton code is in the set.
    pub fn contains(&self, code: u64) -> bool {
        self.get(code >> 6) >> (code & 63) & 1 == 1
    }

    /// A reader that must be asked for keys in ascending order.
    pub fn cursor(&self) -> Cursor<'_> {
        Cursor::new(self)
    }

    /// Changes the bits of every brick, in order, to what `keep` makes of them.
    pub fn retain(&mut self, mut keep: impl FnMut(Brick) -> u64) {
        let runs = std::mem::take(&mut self.runs);
        let mut kept = 0;
        for (i, run) in runs.iter().enumerate() {
            let first = kept;
            for at in run.start..runs.get(i + 1).map_or(self.low.len(), |r| r.start) {
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
        let mut there = other.cursor();
        self.retain(|b| b.bits & !there.get(b.key));
        self
    }

    /// The parents of the set's octants.
    pub fn coarsen(&self) -> Self {
        let mut set = Self::default();
        for b in self.bricks() {
            set.push(b.key >> 3, u64::from(brick::parents(b.bits)) << (8 * (b.key & 7)));
        }
        set
    }

    /// The children of the set's octants, brick by brick in Morton order.
    #[inline]
    pub fn child_bricks(&self) -> ChildBricks<'_> {
        ChildBricks::new(self)
    }

    /// The codes of the set's octants in Morton order.
    pub fn codes(&self) -> impl Iterator<Item = u64> + '_ {
        self.bricks().flat_map(|b| ones(b.bits).map(move |bit| b.key << 6 | u64::from(bit)))
    }

    /// Checks the invariants; called at the end of a phase in debug builds.
    pub fn check_invariants(&self) {
        assert!(self.bricks().is_sorted_by(|a, b| a.key < b.key), "keys must ascend");
        assert!(self.bits.iter().all(|b| *b != 0), "no brick may be empty");
        assert_eq!(self.low.len(), self.bits.len(), "every key has bits");
        assert!(self.runs.is_sorted_by(|a, b| a.high < b.high && a.start < b.start));
    }
}

widest! {
    /// Number of bits that are set in some words.
    fn count_ones(words: &[u64]) -> u64 = count_ones_lanes;
}

#[inline(always)]
fn count_ones_lanes(words: &[u64]) -> u64 {
    words.iter().map(|w| u64::from(w.count_ones())).sum()
}

/// Positions of the set bits of `bits`, ascending.
#[inline]
pub fn ones(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        (bits != 0).then(|| {
            let bit = bits.trailing_zeros();
            bits &= bits - 1;
            bit
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn set(codes: &[u64]) -> BrickSet {
        BrickSet::from_unsorted(
            codes.iter().map(|c| Brick { key: c >> 6, bits: 1 << (c & 63) }).collect(),
        )
    }

    #[test]
    fn codes_come_back_sorted_and_once() {
        let s = set(&[900, 3, 64, 3, 5, 65]);
        s.check_invariants();
        assert_eq!(s.codes().collect::<Vec<_>>(), [3, 5, 64, 65, 900]);
        assert_eq!(s.count(), 5);
        assert!(s.contains(900) && !s.contains(4));
    }

    #[test]
    fn coarsening_gives_parents_and_children_give_back() {
        let s = set(&[3, 5, 64, 900, 70_000]);
        assert_eq!(s.coarsen().codes().collect::<Vec<_>>(), [0, 8, 112, 8_750]);
        let mut kids = BrickSet::default();
        s.child_bricks().for_each(|b| kids.push(b.key, b.bits));
        assert_eq!(kids.coarsen(), s);
        assert_eq!(kids.count(), 8 * s.count());
    }

    #[test]
    fn union_and_cursor_agree_with_sets() {
        let (a, b) = (set(&[1, 70, 200, 5000]), set(&[2, 70, 300]));
        let u = a.clone().union(b);
        assert_eq!(u.codes().collect::<Vec<_>>(), [1, 2, 70, 200, 300, 5000]);
        let many = set(&(0..100_000).step_by(77).collect::<Vec<_>>());
        for stride in [1, 3, 50, 400] {
            let mut c = many.cursor();
            for key in (0..1600).step_by(stride) {
                assert_eq!(c.get(key), many.get(key), "key {key} stride {stride}");
                assert_eq!(c.get(key), many.get(key), "asked twice");
            }
        }
    }

    /// Bricks of few runs, close together and far apart.
    fn scattered() -> impl Strategy<Value = BTreeMap<u64, u64>> {
        let key = (0u64..4, prop_oneof![0u64..6, (1u64 << LOW_BITS) - 3..1 << LOW_BITS])
            .prop_map(|(high, low)| high << LOW_BITS | low);
        prop::collection::btree_map(key, 1u64..8, 0..24)
    }

    fn of(bricks: &BTreeMap<u64, u64>) -> BrickSet {
        BrickSet::from_unsorted(bricks.iter().map(|(&key, &bits)| Brick { key, bits }).collect())
    }

    proptest! {
        #[test]
        fn sets_of_several_runs_behave_as_maps(a in scattered(), b in scattered(), mask in 0u64..8) {
            let (x, y) = (of(&a), of(&b));
            x.check_invariants();
            let (mut both, mut without, mut kept) = (a.clone(), a.clone(), a.clone());
            b.iter().for_each(|(k, v)| *both.entry(*k).or_default() |= v);
            without.iter_mut().for_each(|(k, v)| *v &= !b.get(k).unwrap_or(&0));
            without.retain(|_, v| *v != 0);
            kept.retain(|k, v| (*v & mask != 0) && k % 3 != 0);
            prop_assert_eq!(x.clone().union(y.clone()), of(&both));
            prop_assert_eq!(x.clone().without(&y), of(&without));
            let mut some = x.clone();
            some.retain(|b| if b.key % 3 != 0 && b.bits & mask != 0 { b.bits } else { 0 });
            prop_assert_eq!(some, of(&kept));
            prop_assert!(x.bricks().map(|b| (b.key, b.bits)).eq(a.iter().map(|(k, v)| (*k, *v))));
            let key = b.keys().nth(b.len() / 2).copied().unwrap_or(3);
            let (i, j) = (x.position(key), x.position(2 * key));
            prop_assert_eq!((i, j), (a.range(..key).count(), a.range(..2 * key).count()));
            prop_assert!((0..x.len()).map(|i| x.brick(i)).eq(x.bricks()));
            let octants: u32 = a.values().take(j).skip(i).map(|bits| bits.count_ones()).sum();
            for (_, counted) in crate::wide::tests::widths(|| x.count_in(i..j)) {
                prop_assert_eq!(counted, u64::from(octants));
            }
            for low_bits in [0, 1, 2, 31, 32, 40] {
                let low = |key: u64| (key as u32).checked_shr(low_bits).unwrap_or(0);
                let group = |b: &Brick| (high_of(b.key), low(b.key));
                let (mut behind, mut last) = (0, None);
                for (key, range) in x.groups(low_bits) {
                    prop_assert_eq!((range.start, key), (behind, x.key_at(behind)));
                    let all = group(&x.brick(behind));
                    prop_assert!(last < Some(all));
                    prop_assert!(range.clone().all(|at| group(&x.brick(at)) == all));
                    (behind, last) = (range.end, Some(all));
                }
                prop_assert_eq!(behind, x.len());
            }
            let ranges = [0..i, i..j, j..x.len()];
            let intervals = ranges.clone().map(|range| {
                let mut interval = x.clone();
                interval.keep(range);
                interval.check_invariants();
                interval
            });
            let mut words = vec![7];
            ranges.into_iter().for_each(|range| x.pack(range, &mut words));
            let mut rest = &words[1..];
            for interval in &intervals {
                let (set, behind) = BrickSet::unpack(rest);
                prop_assert_eq!(&set, interval);
                rest = behind;
            }
            prop_assert!(rest.is_empty());
            let [before, middle, behind] = intervals;
            let around = before.clone().union(behind.clone());
            prop_assert_eq!(BrickSet::union_of(vec![around, middle.clone()]), x.clone());
            prop_assert_eq!(BrickSet::union_of(vec![behind, middle, before]), x.clone());
            prop_assert_eq!(BrickSet::union_of(vec![y, x.clone()]), of(&both));
            let mut cursor = x.cursor();
            for key in both.keys() {
                let want = a.get(key).copied().unwrap_or(0);
                prop_assert_eq!((cursor.get(*key), x.get(*key)), (want, want));
            }
        }
    }
}
