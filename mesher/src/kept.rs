//! The kept region: what is wanted of the base tree; the rest is deleted before gradation.
//!
//! Invariants: `deleted[l]` holds leaves of the base tree, none of them crossing; empty at all levels
//! if everything is kept.

use crate::brick::{self, Brick};
use crate::brickset::BrickSet;
use crate::octant::Level;
use crate::tree::{PerLevel, Tree};

/// The kept region of a base tree, by what was deleted.
#[derive(Clone, Copy, Debug)]
pub struct Kept<'a> {
    deleted: &'a PerLevel,
    any: bool,
}

impl<'a> Kept<'a> {
    /// The region that is left when these leaves are deleted.
    pub fn new(deleted: &'a PerLevel) -> Self {
        let any = deleted.iter().any(|s| !s.is_empty());
        Self { deleted, any }
    }

    /// The deleted leaves of level `l`.
    pub fn deleted(&self, l: Level) -> &'a BrickSet {
        &self.deleted[l as usize]
    }

    /// The octants of `set`, of level `l`, that lie in a kept leaf of the base tree or are split in it.
    ///
    /// An octant whose parent is split in the base tree is one of its octants, and is looked up. The
    /// others are kept where their parents are: so the question goes up, level by level, for ever
    /// fewer octants, and each level's sets are read once in order. `split` may be the graded tree's as
    /// well as the base tree's: what gradation has split lies in a kept leaf, so all below it is kept.
    pub fn only(&self, split: &PerLevel, l: Level, mut set: BrickSet) -> BrickSet {
        if !self.any || set.is_empty() {
            return set;
        }
        let mut deleted = self.deleted[l as usize].cursor();
        if l == 0 {
            set.retain(|b| b.bits & !deleted.get(b.key));
            return set;
        }
        let parents = set.coarsen().without(&split[l as usize - 1]);
        let parents = self.only(split, l - 1, parents);
        let (mut below_leaf, mut split) = (parents.cursor(), split[l as usize - 1].cursor());
        set.retain(|b| {
            let of = |parents: u64| brick::children(brick::byte(parents, b.key & 7));
            let here = of(split.get(b.key >> 3)) & !deleted.get(b.key);
            b.bits & (here | of(below_leaf.get(b.key >> 3)))
        });
        set
    }

    /// Debug check that deleted leaves are leaves of the base tree.
    pub fn check_invariants(&self, base: &Tree) {
        for l in 0..self.deleted.len() {
            self.deleted[l].check_invariants();
            let mut split = base.split[l].cursor();
            let mut crossing = base.crossing[l].cursor();
            for Brick { key, bits } in self.deleted[l].bricks() {
                assert_eq!(
                    bits & (split.get(key) | crossing.get(key)),
                    0,
                    "level {l}: only leaves off the surface are deleted"
                );
            }
        }
    }
}
