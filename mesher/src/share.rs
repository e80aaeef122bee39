//! Who holds which bricks.
//!
//! The base tree's leaves are dealt out to the ranks. A brick fills an octant; if that octant lies in
//! a base leaf, or in several of one owner, the brick is that owner's alone. If not (or if the
//! brick is one of levels 0 and 1) the brick is a *top* brick: all ranks hold a copy, kept equal, and
//! one of them, the owner of the base leaf at its minimum corner, answers for it: counts it, emits its
//! leaves and takes its sources.
//!
//! All that this takes is the owners along the Morton curve, run by run.
//!
//! Invariants: runs follow each other from the curve's start, and neighbours have different owners.

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::{Comm, Entry, gather_merged};
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::tree::Tree;
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

impl BaseLeaf {
    /// The root, a single rank's.
    pub const ROOT: Self = Self { level: 0, code: 0, owner: 0 };
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

/// Who owns what, as every rank knows it.
#[derive(Clone, Debug)]
pub struct Ownership {
    rank: usize,
    ranks: usize,
    runs: Arc<Runs>,
    /// Deepest level that has a top brick.
    level_top: Level,
}

/// Owners along the Morton curve.
#[derive(Debug)]
struct Runs {
    /// Level-19 codes at which the owner changes, from 0.
    starts: Vec<u64>,
    owners: Vec<usize>,
}

/// The rank of a bystander, who has nothing: see [`Ownership::bystander`].
const NOBODY: usize = usize::MAX;

impl Ownership {
    /// The ownership of a single rank.
    pub fn solo() -> Self {
        Self::new(0, 1, &[BaseLeaf::ROOT])
    }

    /// The ownership in which base leaves, which tile the root in Morton order, have their owners.
    ///
    /// # Panics
    /// If the leaves do not follow each other, or an owner is no rank.
    pub fn new(rank: usize, ranks: usize, leaves: &[BaseLeaf]) -> Self {
        let mut runs = Runs { starts: Vec::new(), owners: Vec::new() };
        let mut at = 0;
        for b in leaves {
            assert_eq!(start57(b.level, b.code), at, "base leaves must follow each other");
            assert!(b.owner < ranks, "a base leaf's owner is a rank");
            if runs.owners.last() != Some(&b.owner) {
                runs.starts.push(at);
                runs.owners.push(b.owner);
            }
            at += 1 << (3 * (LEVEL_MAX - b.level));
        }
        assert_eq!(at, 1 << (3 * LEVEL_MAX), "base leaves must tile the root");
        // An octant above the level to which a change of owner is aligned spans it; its brick is two deeper.
        let aligned = |s: &u64| LEVEL_MAX - s.trailing_zeros() / 3;
        let level_top = runs.starts[1..].iter().map(aligned).max().unwrap_or(0) + 1;
        Self { rank, ranks, runs: Arc::new(runs), level_top }
    }

    /// The same as seen by someone who owns nothing: every brick is a top brick or remote.
    pub fn bystander(&self) -> Self {
        Self { rank: NOBODY, ..self.clone() }
    }

    /// What of a tree lies in top bricks: the same on all ranks.
    pub fn top_of(&self, tree: &Tree) -> Tree {
        let mut top = Tree::default();
        for (to, from) in [(&mut top.split, &tree.split), (&mut top.crossing, &tree.crossing)] {
            for l in 0..=self.level_top {
                let bricks = from[l as usize].bricks().filter(|b| self.is_top(l, b.key));
                bricks.for_each(|b| to[l as usize].push(b.key, b.bits));
            }
        }
        top
    }

    /// Deepest level that has a top brick.
    pub fn level_top(&self) -> Level {
        self.level_top
    }

    /// The owner of all of an octant; none if it has several.
    #[inline]
    pub fn sole_owner(&self, l: Level, code: u64) -> Option<usize> {
        let run = self.run_at(start57(l, code));
        let whole = self.runs.starts.get(run + 1).is_none_or(|&s| s >= start57(l, code + 1));
        whole.then(|| self.runs.owners[run])
    }

    /// Whether brick `key` of level `l` is a top brick.
    #[inline]
    pub fn is_top(&self, l: Level, key: u64) -> bool {
        l < 2 || l <= self.level_top && self.sole_owner(l - 2, key).is_none()
    }

    #[inline]
    fn run_at(&self, start: u64) -> usize {
        self.runs.starts.partition_point(|&s| s <= start) - 1
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
        let owner = match l <= self.level_top {
            true => self.sole_owner(l - 2, key),
            false => Some(self.owner(l, key)),
        };
        match owner {
            None => Place::Top,
            Some(r) if r == self.rank => Place::Mine,
            Some(r) => Place::Remote(r),
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

    /// Owner at a brick's minimum corner.
    fn owner(&self, l: Level, key: u64) -> usize {
        self.runs.owners[self.run_at(brick_start(l, key))]
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
}

/// Level-19 Morton code of a brick's minimum corner.
fn brick_start(l: Level, key: u64) -> u64 {
    if l < 2 { 0 } else { key << (3 * (LEVEL_MAX + 2 - l)) }
}
