//! The kept region: the part of the base tree that the mesh consists of. The rest is deleted before
//! gradation.
//!
//! Invariant: `deleted[l]` holds leaves of the base tree, none of them crossing. If everything is
//! kept, it is empty at all levels. The sides of the mesher, which store it, execute this.

use crate::brick;
use crate::brickset::BrickSet;
use crate::octant::Level;
use crate::tree::PerLevel;

/// The kept region of a base tree, stored as its complement.
#[derive(Clone, Copy, Debug)]
pub struct Kept<'a> {
    deleted: &'a PerLevel,
    is_partial: bool,
}

impl<'a> Kept<'a> {
    /// The region that remains when these leaves are deleted.
    pub fn new(deleted: &'a PerLevel) -> Self {
        Self { deleted, is_partial: deleted.iter().any(|s| !s.is_empty()) }
    }

    /// The deleted leaves of level `l`.
    pub fn deleted(&self, l: Level) -> &'a BrickSet {
        &self.deleted[l as usize]
    }

    /// The octants of `set`, of level `l`, that lie in a kept leaf of the base tree or are split in it.
    ///
    /// An octant whose parent is split in the base tree is an octant of that tree and is looked up.
    /// Any other octant is kept if its parent is. So the question passes to coarser levels, for ever
    /// fewer octants, and reads each level's sets once in order. `split` may be the graded tree's as
    /// well as the base tree's: an octant that gradation has split lies in a kept leaf, so all its
    /// descendants are kept.
    pub fn only(&self, split: &PerLevel, l: Level, mut set: BrickSet) -> BrickSet {
        if !self.is_partial || set.is_empty() {
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
            let children = |parents: u64| brick::children(brick::byte(parents, b.key & 7));
            let in_tree = children(split.get(b.key >> 3)) & !deleted.get(b.key);
            b.bits & (in_tree | children(below_leaf.get(b.key >> 3)))
        });
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brickset::tests::set;

    #[test]
    fn nothing_is_kept_below_a_deleted_root() {
        let (mut deleted, split) = (PerLevel::default(), PerLevel::default());
        deleted[0] = set(&[0]);
        let kept = Kept::new(&deleted);
        assert!(kept.only(&split, 0, set(&[0])).is_empty());
        assert!(kept.only(&split, 2, set(&[0, 63])).is_empty());
    }
}
