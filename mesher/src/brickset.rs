//! Sets of octants of one level: sorted sequences of bricks.
//!
//! Invariants: keys strictly ascend; no brick is empty.

use crate::brick::{self, Brick};

/// A set of octants of one level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BrickSet {
    bricks: Vec<Brick>,
}

impl BrickSet {
    /// The set of the given bricks, which may come in any order and repeat keys.
    pub fn from_unsorted(mut bricks: Vec<Brick>) -> Self {
        bricks.sort_unstable_by_key(|b| b.key);
        let mut set = Self::default();
        set.bricks.reserve_exact(bricks.len());
        for b in bricks {
            set.push(b.key, b.bits);
        }
        set
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
        match self.bricks.last_mut() {
            Some(last) if last.key == key => last.bits |= bits,
            last => {
                assert!(last.is_none_or(|l| l.key < key), "bricks must be added in Morton order");
                self.bricks.push(Brick { key, bits });
            }
        }
    }

    /// The bricks in order.
    #[inline]
    pub fn bricks(&self) -> &[Brick] {
        &self.bricks
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.bricks.len()
    }

    /// Whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty()
    }

    /// Number of octants.
    pub fn count(&self) -> u64 {
        self.bricks.iter().map(|b| u64::from(b.bits.count_ones())).sum()
    }

    /// The bits of a brick, 0 where the set has none of it.
    pub fn get(&self, key: u64) -> u64 {
        self.bricks.binary_search_by_key(&key, |b| b.key).map_or(0, |i| self.bricks[i].bits)
    }

    /// Whether the octant with this Morton code is in the set.
    pub fn contains(&self, code: u64) -> bool {
        self.get(code >> 6) >> (code & 63) & 1 == 1
    }

    /// A reader that must be asked for keys in ascending order.
    pub fn cursor(&self) -> Cursor<'_> {
        Cursor { rest: &self.bricks }
    }

    /// The union of two sets. In place, from the back, as sets can be a good part of all memory.
    pub fn union(self, other: Self) -> Self {
        let (Self { mut bricks }, Self { bricks: rest }) =
            if self.len() < other.len() { (other, self) } else { (self, other) };
        if rest.is_empty() {
            return Self { bricks };
        }
        let mut there = Cursor { rest: &bricks };
        let common = rest.iter().filter(|b| there.get(b.key) != 0).count();
        let (mut i, mut j) = (bricks.len(), rest.len());
        let mut k = i + j - common;
        bricks.reserve_exact(k - i);
        bricks.resize(k, Brick { key: 0, bits: 0 });
        while j > 0 {
            k -= 1;
            let r = rest[j - 1];
            match i.checked_sub(1).map(|i| bricks[i]) {
                Some(b) if b.key > r.key => {
                    bricks[k] = b;
                    i -= 1;
                }
                Some(b) if b.key == r.key => {
                    bricks[k] = Brick { key: b.key, bits: b.bits | r.bits };
                    i -= 1;
                    j -= 1;
                }
                _ => {
                    bricks[k] = r;
                    j -= 1;
                }
            }
        }
        Self { bricks }
    }

    /// Changes the bits of every brick, in order, to what `keep` makes of them.
    pub fn retain(&mut self, mut keep: impl FnMut(Brick) -> u64) {
        self.bricks.retain_mut(|b| {
            b.bits = keep(*b);
            b.bits != 0
        });
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
        for b in &self.bricks {
            set.push(b.key >> 3, u64::from(brick::parents(b.bits)) << (8 * (b.key & 7)));
        }
        set
    }

    /// The children of the set's octants, brick by brick in Morton order.
    pub fn child_bricks(&self) -> impl Iterator<Item = Brick> + '_ {
        self.bricks.iter().flat_map(|b| {
            (0..8).filter_map(move |j| {
                let byte = brick::byte(b.bits, j);
                (byte != 0).then(|| Brick { key: b.key << 3 | j, bits: brick::children(byte) })
            })
        })
    }

    /// The codes of the set's octants in Morton order.
    pub fn codes(&self) -> impl Iterator<Item = u64> + '_ {
        self.bricks.iter().flat_map(|b| ones(b.bits).map(move |bit| b.key << 6 | u64::from(bit)))
    }

    /// Checks the invariants; called at the end of a phase in debug builds.
    pub fn check_invariants(&self) {
        assert!(self.bricks.windows(2).all(|w| w[0].key < w[1].key), "keys must ascend");
        assert!(self.bricks.iter().all(|b| b.bits != 0), "no brick may be empty");
    }
}

/// Reads a set in ascending order of keys; see [`BrickSet::cursor`].
pub struct Cursor<'a> {
    rest: &'a [Brick],
}

impl Cursor<'_> {
    /// The bits of the brick `key`, which is not before any key asked for earlier.
    #[inline]
    pub fn get(&mut self, key: u64) -> u64 {
        if self.rest.first().is_some_and(|b| b.key < key) {
            // A gallop: what the reader skips (another rank's share, deleted parts) may be long.
            let mut step = 1;
            while self.rest.get(step).is_some_and(|b| b.key < key) {
                step *= 2;
            }
            let near = &self.rest[step / 2..self.rest.len().min(step + 1)];
            let skip = step / 2 + near.partition_point(|b| b.key < key);
            self.rest = &self.rest[skip..];
        }
        self.rest.first().filter(|b| b.key == key).map_or(0, |b| b.bits)
    }
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
}
