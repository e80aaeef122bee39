//! The leaves of a mesh, by octant.

use std::cell::RefCell;

use contract::octant::Octant;
use contract::tree::{Handle, Kind, Tree};
use contract::word::{self, Side};
use rustc_hash::FxHashMap;

/// The leaves of a mesh.
#[derive(Debug)]
pub struct Leaves<'a> {
    tree: &'a Tree,
    /// Numbers of leaves below nodes.
    counts: RefCell<FxHashMap<Handle, u64>>,
}

/// The children of an octant in a mesh, one bit per digit: leaves, and octants that are split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// The children that are leaves.
    pub leaves: u8,
    /// The children that are split.
    pub split: u8,
}

impl Node {
    /// Whether the octant itself is split.
    pub fn is_split(self) -> bool {
        self.leaves | self.split != 0
    }
}

/// A number that identifies an octant.
pub fn id(octant: &Octant) -> u64 {
    word::key_of(octant.corner) << 5 | u64::from(octant.level)
}

/// The parent of an octant other than the root.
pub fn parent(octant: &Octant) -> Octant {
    octant.ancestor(octant.level - 1)
}

impl<'a> Leaves<'a> {
    /// The leaves of a tree.
    pub fn new(tree: &'a Tree) -> Self {
        Self { tree, counts: RefCell::default() }
    }

    /// The leaf that contains a level-19 cell, with its kind.
    pub fn leaf_at(&self, cell: [u32; 3]) -> Option<(Octant, Kind)> {
        self.tree.locate(cell)
    }

    /// The children of an octant.
    pub fn node(&self, octant: &Octant) -> Node {
        let (mut node, handle) = (Node::default(), self.tree.at(octant));
        for digit in (0..8).filter(|_| handle.is_node()) {
            let child = self.tree.child(handle, digit, octant.level);
            node.leaves |= u8::from(child.as_leaf().is_some()) << digit;
            node.split |= u8::from(child.is_node()) << digit;
        }
        node
    }

    /// Number of leaves in an octant.
    pub fn count(&self, octant: &Octant) -> u64 {
        self.count_below(self.tree.at(octant))
    }

    fn count_below(&self, handle: Handle) -> u64 {
        if !handle.is_node() {
            return u64::from(handle != Handle::HOLE);
        }
        if let Some(&known) = self.counts.borrow().get(&handle) {
            return known;
        }
        // Which children a node has does not depend on the level.
        let count = (0..8).map(|digit| self.count_below(self.tree.child(handle, digit, 0))).sum();
        self.counts.borrow_mut().insert(handle, count);
        count
    }

    /// Whether an octant contains a crossing leaf, or lies in one.
    pub fn has_crossing(&self, octant: &Octant) -> bool {
        self.tree.kinds(self.tree.at(octant)) & 1 << Side::Crossing as u8 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::octant::LEVEL_MAX;
    use contract::testing::{octants_of, words_of, words_with_sides};
    use std::collections::HashSet;

    #[test]
    fn the_leaves_of_an_octant_are_those_among_all_words() {
        let side = |o: &Octant| match o.path().len() % 3 {
            _ if o.corner == [5 << 15; 3] => Some(Side::Crossing),
            0 => Some(Side::Outside),
            _ => (!o.corner[1].is_multiple_of(3)).then_some(Side::Inside),
        };
        let words = words_with_sides(
            |o| {
                o.level < 4
                    || o.level < 5 && o.corner[0] < 1 << 18
                    || o.corner == [0; 3] && o.level < 9
            },
            side,
        );
        let tree = Tree::of_words(&words);
        let leaves = Leaves::new(&tree);
        let octants: HashSet<Octant> = words.iter().map(|&w| word::octant(w)).collect();
        let within = |octant: &Octant| {
            let (first, key) = (word::key_of(octant.corner), |w: &u64| word::key(*w));
            let from = words.partition_point(|w| key(w) < first);
            let until = words.partition_point(|w| key(w) < first + word::span(octant.level));
            &words[from..until]
        };
        for octant in octants_of(&words) {
            if octants.contains(&octant) {
                assert_eq!(leaves.node(&octant), Node::default(), "{octant}");
                let cell = octant.corner.map(|c| c + octant.edge() - 1);
                assert_eq!(leaves.leaf_at(cell).map(|leaf| leaf.0), Some(octant));
                continue;
            }
            let children: Vec<Octant> = (0..8).map(|digit| octant.child(digit)).collect();
            let set = |fit: &dyn Fn(&Octant) -> bool| {
                (0..8).filter(|&d| fit(&children[d])).map(|d| 1u8 << d).sum()
            };
            let expected = Node {
                leaves: set(&|child| octants.contains(child)),
                split: set(&|child| !octants.contains(child) && !within(child).is_empty()),
            };
            assert_eq!(leaves.node(&octant), expected, "{octant}");
            assert_eq!(leaves.count(&octant), within(&octant).len() as u64, "{octant}");
            let crossing = within(&octant).iter().any(|&w| word::side(w) == Side::Crossing);
            assert_eq!(leaves.has_crossing(&octant), crossing, "{octant}");
        }
    }

    #[test]
    fn octants_have_ids_of_their_own() {
        let octants =
            octants_of(&words_of(|o| o.level < 3 || o.level < LEVEL_MAX && o.corner == [0; 3]));
        let ids: HashSet<u64> = octants.iter().map(id).collect();
        assert_eq!(ids.len(), octants.len());
    }
}
