//! The map from octants to the ranks that own and hold them.
//!
//! Every rank owns intervals of the Morton curve. A brick fills an octant. If one rank owns all of that octant, the brick is local
//! to that rank. A brick that straddles a partition boundary is *partially replicated*: every rank that owns part of it holds a
//! replica, as it has bricks below. If nine or more intervals meet in a brick, or its level is one of the coarsest, to 1 + log4 p on p ranks, the brick is *fully
//! replicated*: all ranks hold a replica. The rank that owns the minimum corner owns the brick: only that rank counts it and
//! emits its leaves. It is a source on that rank alone or, on the coarsest levels, on all ranks: to make there what another rank makes, too,
//! takes less time than to receive it. A rank that holds a brick holds all bricks above it.
//!
//! The boundaries between the intervals are all that a rank has to know.
//!
//! Invariants: intervals are in order from the start of the curve, and adjacent intervals have different owners.

mod redistribute;

use crate::partition::curve::{ALL, Boundary};
use bricks::brick::{Brick, ones};
use bricks::brickset::BrickSet;
use bricks::octant::{LEVEL_MAX, Level, corner, edge, start57};
use bricks::tree::{PerLevel, Tree};
use std::ops::Range;
use std::sync::Arc;

/// Number of intervals in a brick from which on it is fully replicated. With fewer, each owner is sent the brick, which costs
/// messages; with more, all ranks gather it, which costs every rank time.
pub const OWNERS_MANY: usize = 9;

/// Which ranks hold a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// All ranks hold a replica.
    FullyReplicated,
    /// A few ranks hold a replica, this one among them.
    PartiallyReplicated,
    /// Only this rank holds it.
    Local,
    /// This rank does not hold it; its owner.
    Remote(usize),
}

/// The owners of all octants, as seen from one rank.
#[derive(Clone, Debug)]
pub struct Ownership {
    /// This rank; none in a view from outside all ranks.
    rank: Option<usize>,
    ranks: usize,
    /// Where the intervals of all ranks begin, and their owners.
    boundaries: Arc<[Boundary]>,
    /// This rank's longest interval: most queries are for octants within it.
    own: Range<u64>,
    /// Deepest level whose bricks are fully replicated whatever the boundaries.
    level_everywhere: Level,
    /// Deepest level with a brick of several owners.
    level_replicated: Level,
    /// Deepest level with a fully replicated brick.
    level_fully_replicated: Level,
}

impl Ownership {
    /// The ownership of a single rank.
    pub fn solo() -> Self {
        Self::along(0, 1, vec![(0, 0)])
    }

    /// The ownership given by boundaries: level-19 codes in ascending order, each with the owner from there on. The first owner owns the
    /// curve from its start.
    ///
    /// # Panics
    /// If the codes do not ascend, or an owner is not a rank.
    pub fn along(rank: usize, ranks: usize, mut all: Vec<Boundary>) -> Self {
        assert!(all.iter().all(|b| b.1 < ranks), "an owner must be a rank");
        assert!(all.is_sorted_by(|a, b| a.0 < b.0), "boundaries must ascend");
        all.first_mut().expect("every octant must have an owner").0 = 0;
        all.dedup_by_key(|b| b.1);
        // Around a surface, this level has about as many bricks as there are ranks.
        let level_everywhere = 1 + ranks.ilog(4);
        let ownership = Self {
            rank: Some(rank),
            ranks,
            level_everywhere,
            level_replicated: deepest_brick_of(2, &all).max(level_everywhere),
            level_fully_replicated: deepest_brick_of(OWNERS_MANY, &all).max(level_everywhere),
            boundaries: all.into(),
            own: 0..0,
        };
        let longest = ownership.intervals().max_by_key(|own| own.end - own.start);
        Self { own: longest.unwrap_or(0..0), ..ownership }
    }

    /// The same partition seen from outside all ranks: every brick is fully replicated or remote.
    pub fn non_owning_view(&self) -> Self {
        Self { rank: None, own: 0..0, ..self.clone() }
    }

    /// The largest octants that this rank owns all of, in Morton order: level and code.
    pub fn octants(&self) -> Vec<(Level, u64)> {
        let mut octants = Vec::new();
        for Range { start: mut at, end } in self.intervals() {
            while at < end {
                // The largest octant with this corner that ends within the interval.
                let aligned = (at.trailing_zeros() / 3).min(LEVEL_MAX);
                let up = aligned.min((end - at).ilog2() / 3);
                octants.push((LEVEL_MAX - up, at >> (3 * up)));
                at += 1 << (3 * up);
            }
        }
        octants
    }

    /// The level-19 codes that this rank owns, in order.
    pub fn intervals(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        let own = self.boundaries.iter().filter(|boundary| Some(boundary.1) == self.rank);
        own.map(|boundary| self.interval_at(boundary.0).0)
    }

    /// The longest of them; at the start of the curve if this rank owns nothing.
    pub fn longest(&self) -> Range<u64> {
        if self.own.is_empty() { 0..1 } else { self.own.clone() }
    }

    /// The boundaries between the intervals of all ranks.
    pub fn boundaries(&self) -> &[Boundary] {
        &self.boundaries
    }

    /// The owner at a level-19 code.
    #[inline]
    pub fn owner_at(&self, start: u64) -> usize {
        self.boundaries[self.at(start)].1
    }

    /// The interval that contains a level-19 code, and its owner.
    #[inline]
    pub fn interval_at(&self, start: u64) -> (Range<u64>, usize) {
        let interval = self.at(start);
        let (start, owner) = self.boundaries[interval];
        (start..self.boundaries.get(interval + 1).map_or(ALL.end, |next| next.0), owner)
    }

    /// Calls `found` with the owners of those octants in the given one that an extent reaches, all of them closed; with some more than
    /// once. The extent reaches the given octant.
    pub fn owners_in(&self, l: Level, code: u64, extent: &Extent, found: &mut impl FnMut(usize)) {
        let (interval, owner) = self.interval_at(start57(l, code));
        if interval.end >= start57(l, code + 1) {
            return found(owner);
        }
        let (min, half) = (corner(l, code), edge(l + 1));
        let reached = (0..3).fold(u8::MAX, |reached, a| {
            let (middle, lower) = (min[a] + half, [0x55, 0x33, 0x0f][a]);
            let of = |is_reached: bool, children: u8| if is_reached { children } else { 0 };
            reached & (of(extent[a].0 <= middle, lower) | of(extent[a].1 >= middle, !lower))
        });
        for child in ones(reached.into()) {
            self.owners_in(l + 1, code << 3 | u64::from(child), extent, found);
        }
    }

    /// The fully replicated bricks of a tree: the same on all ranks.
    pub fn fully_replicated(&self, tree: &Tree) -> Tree {
        let of = |sets: &PerLevel| {
            let mut held = PerLevel::default();
            for l in 0..=self.level_fully_replicated {
                let is_full = |b: &Brick| self.placement(l, b.key) == Placement::FullyReplicated;
                held[l as usize] = sets[l as usize].bricks().filter(is_full).collect();
            }
            held
        };
        Tree { split: of(&tree.split), crossing: of(&tree.crossing) }
    }

    /// Which ranks hold brick `key` of level `l`.
    #[inline]
    pub fn placement(&self, l: Level, key: u64) -> Placement {
        if self.is_everywhere(l) {
            return Placement::FullyReplicated;
        }
        let (start, end) = (brick_start(l, key), brick_start(l, key + 1));
        if self.ranks == 1 || self.own.start <= start && end <= self.own.end {
            return Placement::Local;
        }
        let intervals = self.meeting_in(l, key);
        let is_own = |interval: &Boundary| Some(interval.1) == self.rank;
        match intervals.len() {
            OWNERS_MANY.. => Placement::FullyReplicated,
            1 if is_own(&intervals[0]) => Placement::Local,
            _ if intervals.iter().any(is_own) => Placement::PartiallyReplicated,
            _ => Placement::Remote(intervals[0].1),
        }
    }

    /// The intervals that meet in a brick of level `l`, which is 2 or more, in order; not all if there are many.
    #[inline]
    fn meeting_in(&self, l: Level, key: u64) -> &[Boundary] {
        let (first, end) = (self.at(brick_start(l, key)), brick_start(l, key + 1));
        let more = self.boundaries[first + 1..].iter().take(OWNERS_MANY);
        &self.boundaries[first..first + 1 + more.take_while(|b| b.0 < end).count()]
    }

    /// The rank that owns brick `key` of level `l`.
    #[inline]
    pub fn owner(&self, l: Level, key: u64) -> usize {
        self.owner_at(brick_start(l, key))
    }

    /// Whether this rank owns a brick that it holds.
    #[inline]
    pub fn owns(&self, l: Level, key: u64) -> bool {
        // Below the children of replicated bricks, a rank holds only bricks that it owns.
        self.ranks == 1
            || l > self.level_replicated + 1
            || self.own.contains(&brick_start(l, key))
            || Some(self.owner(l, key)) == self.rank
    }

    /// The bricks that this rank owns, of those of level `l` that it holds.
    #[inline]
    pub fn owned(&self, l: Level, set: &BrickSet) -> impl Iterator<Item = Brick> {
        set.bricks().filter(move |b| self.owns(l, b.key))
    }

    /// Whether all ranks hold all bricks of level `l`.
    pub fn is_everywhere(&self, l: Level) -> bool {
        l <= self.level_everywhere
    }

    /// Those of some bricks of level `l` from which this rank makes what they reach.
    #[inline]
    pub fn sources(
        &self,
        l: Level,
        all: impl Iterator<Item = Brick>,
    ) -> impl Iterator<Item = Brick> {
        all.filter(move |b| self.is_everywhere(l) || self.owns(l, b.key))
    }

    /// Whether several ranks hold a brick of level `l`.
    pub fn is_replicated(&self, l: Level) -> bool {
        self.ranks > 1 && l <= self.level_replicated
    }

    /// The index, among those of all ranks, of the interval that contains a position.
    #[inline]
    pub fn at(&self, start: u64) -> usize {
        self.boundaries.partition_point(|b| b.0 <= start) - 1
    }
}

/// The least and the greatest lattice coordinate on each axis.
type Extent = [(i64, i64); 3];

/// Bits of a brick's key; the bits above hold the number of a set.
pub const KEY_BITS: u32 = 54;

/// The deepest level with a brick in which `n >= 2` intervals or more meet; 0 if there is none.
fn deepest_brick_of(n: usize, boundaries: &[Boundary]) -> Level {
    let spanned = boundaries[1..].windows(n - 1).map(|inner| {
        // The smallest octant that contains the end of the first interval and the start of the last.
        let differ = (inner[0].0 - 1) ^ inner[n - 2].0;
        let up = (64 - differ.leading_zeros()).div_ceil(3);
        LEVEL_MAX - up + 2
    });
    spanned.max().unwrap_or(0)
}

/// Level-19 Morton code of a brick's minimum corner.
#[inline]
pub fn brick_start(l: Level, key: u64) -> u64 {
    if l < 2 { 0 } else { key << (3 * (LEVEL_MAX + 2 - l)) }
}

#[cfg(test)]
mod tests;
