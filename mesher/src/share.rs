//! Who holds which bricks.
//!
//! The base tree's leaves are dealt out to the ranks. A brick fills an octant; if that octant lies in
//! a base leaf, the brick is that leaf's owner's alone. If not (it is split in the base tree, or the
//! brick is one of levels 0 and 1) the brick is a *top* brick: all ranks hold a copy, kept equal, and
//! one of them, the owner of the base leaf at its minimum corner, answers for it: counts it, emits its
//! leaves and takes its sources.
//!
//! Invariants: base leaves tile the root, in Morton order; `internal[l]` are the octants above them.

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::{Comm, Entry, gather_merged};
use crate::octant::{LEVEL_MAX, Level};
use crate::tree::{PerLevel, Tree, per_level};
use std::sync::Arc;

/// A leaf of the base tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BaseLeaf {
    /// Its level.
    pub level: Level,
    /// Its Morton code.
    pub code: u64,
    /// The rank that it was dealt to.
    pub owner: usize,
}

/// Whose a brick is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Above the base leaves: everyone holds a copy.
    Top,
    /// This rank's alone.
    Mine,
    /// Another rank's.
    Remote(usize),
}

/// The base tree and the owners of its leaves, as every rank knows them.
#[derive(Clone, Debug)]
pub struct Ownership {
    rank: usize,
    ranks: usize,
    dealt: Arc<Dealt>,
    /// Deepest level that has a top brick.
    level_top: Level,
}

/// What is the same for all ranks.
#[derive(Debug)]
struct Dealt {
    internal: PerLevel,
    leaves: Vec<BaseLeaf>,
    starts: Vec<u64>,
}

/// The rank of a bystander, who has nothing: see [`Ownership::bystander`].
const NOBODY: usize = usize::MAX;

impl Ownership {
    /// The ownership of a single rank, whose base tree is the root.
    pub fn solo() -> Self {
        Self::new(0, 1, per_level(), vec![BaseLeaf { level: 0, code: 0, owner: 0 }])
    }

    /// The ownership in which `leaves`, in Morton order, have their owners; `internal` are the octants
    /// above them.
    pub fn new(rank: usize, ranks: usize, internal: PerLevel, leaves: Vec<BaseLeaf>) -> Self {
        let starts = leaves.iter().map(|b| crate::octant::start57(b.level, b.code)).collect();
        let deepest = internal.iter().rposition(|s| !s.is_empty()).map_or(0, |l| l as Level + 1);
        let dealt = Arc::new(Dealt { internal, leaves, starts });
        Self { rank, ranks, dealt, level_top: deepest + 1 }
    }

    /// The same as seen by someone who owns nothing: every brick is a top brick or remote.
    pub fn bystander(&self) -> Self {
        Self { rank: NOBODY, ..self.clone() }
    }

    /// What of a tree lies in top bricks: the same on all ranks.
    pub fn top_of(&self, tree: &Tree) -> Tree {
        let mut top = Tree::default();
        let all = [(&mut top.split, &tree.split), (&mut top.crossing, &tree.crossing)];
        for (to, from) in all {
            for l in 0..=self.level_top as usize {
                let mut internal = (l >= 2).then(|| self.dealt.internal[l - 2].cursor());
                let mut is_top = |key: u64| {
                    internal.as_mut().is_none_or(|set| set.get(key >> 6) >> (key & 63) & 1 == 1)
                };
                let bricks = from[l].bricks().filter(|b| is_top(b.key));
                bricks.for_each(|b| to[l].push(b.key, b.bits));
            }
        }
        top
    }

    /// The base leaves in Morton order.
    pub fn leaves(&self) -> &[BaseLeaf] {
        &self.dealt.leaves
    }

    /// The octants above the base leaves.
    pub fn internal(&self) -> &PerLevel {
        &self.dealt.internal
    }

    /// The number of the base leaf at a level-19 Morton code.
    pub fn leaf_at(&self, start: u64) -> usize {
        self.dealt.starts.partition_point(|&s| s <= start) - 1
    }

    /// Whose brick `key` of level `l` is.
    #[inline]
    pub fn place(&self, l: Level, key: u64) -> Place {
        if l < 2 {
            return Place::Top;
        }
        if self.ranks == 1 {
            return Place::Mine;
        }
        if l <= self.level_top && self.dealt.internal[l as usize - 2].contains(key) {
            return Place::Top;
        }
        match self.owner(l, key) {
            r if r == self.rank => Place::Mine,
            r => Place::Remote(r),
        }
    }

    /// Whether this rank counts and emits the leaves of a brick that it holds.
    #[inline]
    pub fn answers_for(&self, l: Level, key: u64) -> bool {
        // Deeper than a child of a top brick, whatever a rank holds is its own.
        self.ranks == 1 || l > self.level_top + 1 || self.owner(l, key) == self.rank
    }

    /// Whether any brick of level `l` is held by several ranks.
    pub fn is_shared(&self, l: Level) -> bool {
        self.ranks > 1 && l <= self.level_top
    }

    /// Owner of the base leaf at a brick's minimum corner.
    fn owner(&self, l: Level, key: u64) -> usize {
        self.dealt.leaves[self.leaf_at(brick_start(l, key))].owner
    }

    /// Brings octants to the ranks that hold their bricks: returns those for this rank, from all
    /// ranks together, and the number of bricks sent. Collective, unless there is one rank.
    pub fn scatter(&self, l: Level, set: BrickSet, comm: &dyn Comm) -> (BrickSet, u64) {
        if self.ranks == 1 {
            return (set, 0);
        }
        let mut mine = BrickSet::default();
        let mut out: Vec<Vec<u64>> = vec![Vec::new(); self.ranks];
        let mut top: Vec<Entry> = Vec::new();
        for b in set.bricks() {
            match self.place(l, b.key) {
                Place::Mine => mine.push(b.key, b.bits),
                Place::Remote(r) => out[r].extend([b.key, b.bits]),
                Place::Top => top.push([b.key, b.bits]),
            }
        }
        let sent = out.iter().map(|w| w.len() as u64 / 2).sum();
        let heard = comm.exchange(out.into_iter().enumerate().collect());
        let heard = heard.iter().flat_map(|(_, words)| words.as_chunks().0);
        let told = heard.map(|&[key, bits]| Brick { key, bits }).collect();
        let mut all = mine.union(BrickSet::from_unsorted(told));
        if self.is_shared(l) {
            let mut known = BrickSet::default();
            let top = gather_merged(top, |a, b| a | b, comm);
            top.into_iter().for_each(|[key, bits]| known.push(key, bits));
            all = all.union(known);
        }
        (all, sent)
    }

    /// Checks that the base leaves tile the root.
    pub fn check_invariants(&self) {
        let mut at = 0;
        for (b, &start) in self.dealt.leaves.iter().zip(&self.dealt.starts) {
            assert_eq!(start, at, "base leaves must follow each other");
            assert!(b.owner < self.ranks, "a base leaf's owner is a rank");
            at += 1 << (3 * (LEVEL_MAX - b.level));
        }
        assert_eq!(at, 1 << (3 * LEVEL_MAX), "base leaves must tile the root");
    }
}

/// Level-19 Morton code of a brick's minimum corner.
fn brick_start(l: Level, key: u64) -> u64 {
    if l < 2 { 0 } else { key << (3 * (LEVEL_MAX + 2 - l)) }
}
