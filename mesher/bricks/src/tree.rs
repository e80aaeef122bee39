//! The base tree T0, stored as one brick set per level, and its kept region: the part of it that the mesh consists of.
//! The rest is deleted before gradation.
//!
//! Invariants of [`Tree`] (with `exists(l)` the children of `split[l - 1]`, and the root alone for `l = 0`):
//! - `split[l]` is a subset of `exists(l)`: every octant that exists has a split parent;
//! - `crossing[l]` is a subset of `exists(l)` without `split[l]`: only leaves are marked;
//! - an octant that exists is split if and only if a facet crosses it and it is shallower than the surface level, or its interior meets
//!   that of an extent box of a deeper level; it is crossing if and only if a facet crosses it and it is not split.
//!
//! Invariant of the kept region, which is stored as its complement: `deleted[l]` holds leaves of the base tree, none of them crossing.
//! If everything is kept, it is empty at all levels.
//!
//! On several ranks, each rank stores the bricks that it holds. A rank that holds a brick holds all
//! its ancestors, so [`Tree::check_structure`] needs no communication; the checks of the mesher execute the last invariant of the
//! tree, and its sides, which store the deleted leaves, that of the region.

use crate::brick::{self, Brick, ones};
use crate::brickset::{BrickSet, Cursor};
use crate::octant::{LEVEL_MAX, Level, path};

/// Number of levels that sets are stored for: voxelisation looks one level below the deepest leaf.
pub const LEVELS: usize = LEVEL_MAX as usize + 2;

/// One set for each level.
pub type PerLevel = [BrickSet; LEVELS];

/// An oct-tree whose crossing leaves are marked. The leaves of level `l` are the children of
/// `split[l - 1]` that are not in `split[l]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tree {
    /// Octants that have children.
    pub split: PerLevel,
    /// Leaves that a facet crosses.
    pub crossing: PerLevel,
}

impl Tree {
    /// The octants of level `l` that exist, brick by brick in Morton order.
    pub fn exists(split: &[BrickSet], l: Level) -> impl Iterator<Item = Brick> + '_ {
        static NONE: BrickSet = BrickSet::EMPTY;
        let root = (l == 0).then_some(Brick { key: 0, bits: 1 });
        let above = if l == 0 { &NONE } else { &split[l as usize - 1] };
        root.into_iter().chain(above.child_bricks())
    }

    /// Checks the first two invariants on the bricks that this rank holds.
    ///
    /// # Panics
    /// If one is violated; the message names it, the level and an octant.
    pub fn check_structure(&self) {
        check_split(&self.split);
        check_octants(&self.split, &self.crossing, &[&self.split], "is crossing, but no leaf");
    }
}

/// Checks that `split` are the split octants of a tree: the parent of each is split, too.
///
/// # Panics
/// If one is not.
pub fn check_split(split: &PerLevel) {
    check_octants(split, split, &[], "is split, but its parent is not");
}

/// Checks the sets themselves, and that all their octants have split parents and are in none of `others`.
///
/// # Panics
/// If one is wrong; `violation` completes the sentence that names it by its level and path.
pub fn check_octants(split: &PerLevel, sets: &PerLevel, others: &[&PerLevel], violation: &str) {
    for (l, set) in sets.iter().enumerate() {
        set.check_invariants();
        let mut above = split[l.saturating_sub(1)].cursor();
        let mut others: Vec<Cursor> = others.iter().map(|other| other[l].cursor()).collect();
        for b in set.bricks() {
            let exists = match l {
                0 => u64::from(b.key == 0),
                _ => brick::children(brick::byte(above.get(b.key >> 3), b.key & 7)),
            };
            let taken = others.iter_mut().fold(0, |all, other| all | other.get(b.key));
            if let Some(bit) = ones(b.bits & (!exists | taken)).next() {
                let path = path(l as Level, b.key << 6 | u64::from(bit));
                panic!("octant {path} of level {l} {violation}");
            }
        }
    }
}

/// The octants of `set`, of level `l`, that lie in a kept leaf of the base tree or are split in it. `deleted` are its other leaves.
///
/// An octant whose parent is split in the base tree is an octant of that tree and is looked up.
/// Any other octant is kept if its parent is. So the question passes to coarser levels, for ever
/// fewer octants, and reads each level's sets once in order. `split` may be the graded tree's as
/// well as the base tree's: an octant that gradation has split lies in a kept leaf, so all its
/// descendants are kept.
pub fn kept(split: &PerLevel, deleted: &PerLevel, l: Level, mut set: BrickSet) -> BrickSet {
    if set.is_empty() || deleted.iter().all(BrickSet::is_empty) {
        return set;
    }
    if l == 0 {
        return set.without(&deleted[0]);
    }
    let parents = set.coarsen().without(&split[l as usize - 1]);
    let parents = kept(split, deleted, l - 1, parents);
    let (mut below_leaf, mut split) = (parents.cursor(), split[l as usize - 1].cursor());
    let mut deleted = deleted[l as usize].cursor();
    set.retain(|b| {
        let children = |parents: u64| brick::children(brick::byte(parents, b.key & 7));
        let in_tree = children(split.get(b.key >> 3)) & !deleted.get(b.key);
        b.bits & (in_tree | children(below_leaf.get(b.key >> 3)))
    });
    set
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brickset::tests::set;

    /// A tree of level 3 around a facet at the root's minimum corner.
    fn small() -> Tree {
        let mut tree = Tree::default();
        for l in 0..3 {
            tree.split[l] = set(&[0]);
        }
        tree.crossing[3] = set(&[0, 1]);
        tree.check_structure();
        tree
    }

    #[test]
    #[should_panic(expected = "octant 10 of level 2 is split, but its parent is not")]
    fn a_split_octant_without_a_split_parent_is_found() {
        let mut tree = small();
        tree.split[2] = set(&[0, 0o10]);
        tree.check_structure();
    }

    #[test]
    #[should_panic(expected = "octant 00 of level 2 is crossing, but no leaf")]
    fn a_crossing_octant_that_is_split_is_found() {
        let mut tree = small();
        tree.crossing[2] = set(&[0]);
        tree.check_structure();
    }

    #[test]
    #[should_panic(expected = "octant 001 of level 3 is deleted")]
    fn a_deleted_leaf_that_crosses_is_found() {
        let mut deleted = PerLevel::default();
        deleted[3] = set(&[1, 2]);
        let tree = small();
        check_octants(&tree.split, &deleted, &[&tree.split, &tree.crossing], "is deleted");
    }

    #[test]
    fn nothing_is_kept_below_a_deleted_root() {
        let (mut deleted, split) = (PerLevel::default(), PerLevel::default());
        deleted[0] = set(&[0]);
        assert!(kept(&split, &deleted, 0, set(&[0])).is_empty());
        assert!(kept(&split, &deleted, 2, set(&[0, 63])).is_empty());
    }
}
