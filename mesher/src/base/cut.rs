//! A cut through the base tree: its base leaves, and what of T0 lies above them.

use crate::brickset::{BrickSet, ones};
use crate::octant::{Level, start57};
use crate::share::BaseLeaf;
use crate::tree::{PerLevel, Tree, per_level};
use crate::voxelise::Start;

/// A cut through the base tree.
#[derive(Clone, Debug)]
pub struct Cut {
    /// Octants above the base leaves.
    pub internal: PerLevel,
    /// T0 down to the base leaves.
    pub top: Tree,
    /// The base leaves in order.
    pub leaves: Vec<BaseLeaf>,
    /// Which of them are split in T0.
    pub heavy: Vec<bool>,
    /// Level of the deepest base leaves, or of those that there might be.
    pub level_base: Level,
}

/// The octants above base leaves of one level.
pub fn uniform(marks: &Tree, level_base: Level) -> PerLevel {
    let mut internal = per_level();
    let above = ..level_base as usize;
    internal[above].clone_from_slice(&marks.split[above]);
    internal
}

/// The octants above base leaves, each of which is light enough, or not split in T0, or one that `may` not
/// be an internal octant.
pub fn adaptive(
    marks: &Tree,
    may: impl Fn(Level, u64) -> bool,
    expected: impl Fn(&BaseLeaf) -> u64,
    limit: u64,
) -> PerLevel {
    let mut internal = per_level();
    for l in 0..internal.len() as Level {
        let mut heavy = BrickSet::default();
        let mut split = marks.split[l as usize].cursor();
        for b in Tree::exists(&internal, l) {
            for bit in ones(b.bits & split.get(b.key)) {
                let code = b.key << 6 | u64::from(bit);
                if may(l, code) && expected(&BaseLeaf { level: l, code, owner: 0 }) > limit {
                    heavy.push(b.key, 1 << bit);
                }
            }
        }
        if heavy.is_empty() {
            break;
        }
        internal[l as usize] = heavy;
    }
    internal
}

impl Cut {
    /// Cuts marks below the octants `internal`; `surface` is the level from which on leaves cross.
    pub fn new(marks: &Tree, internal: PerLevel, surface: Level) -> Self {
        let mut leaves = Vec::new();
        for l in 0..=deepest_leaf(&internal) {
            let mut above = internal[l as usize].cursor();
            for b in Tree::exists(&internal, l) {
                let codes = ones(b.bits & !above.get(b.key));
                let codes = codes.map(|bit| b.key << 6 | u64::from(bit));
                leaves.extend(codes.map(|code| BaseLeaf { level: l, code, owner: 0 }));
            }
        }
        leaves.sort_unstable_by_key(|b| start57(b.level, b.code));
        Self::of(marks, internal, leaves, surface)
    }

    /// The same with siblings of one owner joined, as far up as that goes: what only separates leaves of one
    /// rank need not be known to all.
    pub fn joined(self, marks: &Tree, surface: Level) -> Self {
        let mut joined: Vec<BaseLeaf> = Vec::new();
        for leaf in self.leaves {
            joined.push(leaf);
            while let Some(parent) = parent_of_last(&joined) {
                joined.truncate(joined.len() - 8);
                joined.push(parent);
            }
        }
        let mut internal = per_level();
        for l in (1..internal.len()).rev() {
            let here = joined.iter().filter(|b| b.level as usize == l);
            let mut set = std::mem::take(&mut internal[l]);
            let above = set.coarsen();
            internal[l] = std::mem::take(&mut set);
            let mut parents = BrickSet::default();
            here.for_each(|b| parents.push(b.code >> 9, 1 << (b.code >> 3 & 63)));
            internal[l - 1] = above.union(parents);
        }
        Self::of(marks, internal, joined, surface)
    }

    fn of(marks: &Tree, internal: PerLevel, leaves: Vec<BaseLeaf>, surface: Level) -> Self {
        let level_base = deepest_leaf(&internal);
        let mut top = Tree::default();
        for l in 0..=level_base {
            let mut split = marks.split[l as usize].cursor();
            let mut crossing = marks.crossing[l as usize].cursor();
            // What is below a base leaf, its owner knows better: marks do not reach far.
            for b in Tree::exists(&internal, l) {
                let split = b.bits & split.get(b.key);
                top.split[l as usize].push(b.key, split);
                if l >= surface {
                    // A leaf that one rank's facets cross may be split by another's box or facets.
                    let crossing = b.bits & crossing.get(b.key) & !split;
                    top.crossing[l as usize].push(b.key, crossing);
                }
            }
        }
        let heavy = leaves.iter().map(|b| marks.split[b.level as usize].contains(b.code)).collect();
        Self { internal, top, leaves, heavy, level_base }
    }

    /// Levels of base leaves that are split in T0, ascending.
    pub fn levels_split(&self) -> Vec<Level> {
        let split = self.leaves.iter().zip(&self.heavy).filter(|(_, heavy)| **heavy);
        let mut levels: Vec<Level> = split.map(|(b, _)| b.level).collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// A rank's base leaves that are split in T0.
    pub fn starts(&self, rank: usize) -> Vec<Start> {
        let mine =
            self.leaves.iter().zip(&self.heavy).filter(|(b, heavy)| **heavy && b.owner == rank);
        mine.map(|(b, _)| Start { level: b.level, code: b.code }).collect()
    }
}

/// Level of the deepest leaves below `internal`.
fn deepest_leaf(internal: &PerLevel) -> Level {
    internal.iter().rposition(|s| !s.is_empty()).map_or(0, |l| l as Level + 1)
}

/// The parent of the last eight leaves, if they are its children and have one owner.
fn parent_of_last(leaves: &[BaseLeaf]) -> Option<BaseLeaf> {
    let last = leaves.last()?;
    let eight = leaves.len().checked_sub(8).map(|at| &leaves[at..])?;
    let one = |b: &BaseLeaf| {
        b.level == last.level && b.code >> 3 == last.code >> 3 && b.owner == last.owner
    };
    (last.level > 0 && eight.iter().all(one)).then(|| BaseLeaf {
        level: last.level - 1,
        code: last.code >> 3,
        ..*last
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::Brick;

    /// Splits of the root, and of octants 0 and 2 of level 1.
    fn marks() -> Tree {
        let mut marks = Tree::default();
        marks.split[0] = BrickSet::from_unsorted(vec![Brick { key: 0, bits: 1 }]);
        marks.split[1] = BrickSet::from_unsorted(vec![Brick { key: 0, bits: 0b101 }]);
        marks
    }

    #[test]
    fn heavy_octants_are_split_and_light_ones_are_not() {
        let expected = |b: &BaseLeaf| match (b.level, b.code) {
            (0, _) => 6400,
            (1, 0) => 900,
            _ => 100,
        };
        // Octant 2 is split in T0, but light.
        let internal = adaptive(&marks(), |l, _| l < 2, expected, 200);
        assert_eq!(internal[0].count(), 1);
        assert_eq!(internal[1].codes().collect::<Vec<_>>(), [0]);
        assert_eq!(Cut::new(&marks(), internal, 9).leaves.len(), 7 + 8);
        let none = adaptive(&marks(), |l, _| l < 1, expected, 200);
        assert!(none[1].is_empty(), "octants of level 1 may not be internal");
    }

    #[test]
    fn siblings_of_one_owner_are_joined_all_the_way_up() {
        let cut = |owner: fn(&BaseLeaf) -> usize| {
            let mut cut = Cut::new(&marks(), uniform(&marks(), 2), 9);
            cut.leaves.iter_mut().for_each(|b| b.owner = owner(b));
            cut.joined(&marks(), 9)
        };
        assert_eq!(cut(|_| 5).leaves, [BaseLeaf { level: 0, code: 0, owner: 5 }]);
        // Octant 0 has one owner, octant 2 two of them.
        let some = cut(|b| usize::from(b.level == 2 && b.code >= 8 * 2 + 3));
        assert_eq!(some.leaves.len(), 7 + 8);
        assert_eq!(some.internal[1].codes().collect::<Vec<_>>(), [2]);
        assert_eq!(some.internal[0].count(), 1);
        assert_eq!(some.heavy.iter().filter(|h| **h).count(), 1, "octant 0 is split in T0");
        assert_eq!(some.starts(0).len(), 1);
    }
}
