//! The voxel tree: an arena of octants, each with no children or all eight.
//!
//! Invariants, executed by [`Tree::check_invariants`]: the root has index 0; the eight children of
//! an octant are contiguous, in Morton order, at higher indices than their parent; `level_least` of
//! an octant is the least level of the kept leaves among its descendants.
use crate::crossing::crosses;
use crate::lattice::Facet;
use crate::octant::{Extent, LEVEL_MAX, Octant, Side};
use std::num::NonZeroU32;

/// The index of an octant in the arena.
pub type Index = usize;

/// The `level_least` of an octant without kept descendants. It exceeds every level, so such an
/// octant is never refined.
const NOTHING_KEPT: u8 = u8::MAX;

/// What every search reads of an octant. Eight siblings fill a cache line.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The first of eight children; `None` for a leaf. The root, which has index 0, is no child.
    children: Option<NonZeroU32>,
    /// Meaningful for leaves only.
    side: Side,
    level_least: u8,
}

/// A full oct-tree: its leaves tile the root.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    /// The octants of `nodes`. Searches start at the root and compute the octants that they pass.
    octants: Vec<Octant>,
}

impl Tree {
    /// The tree whose only leaf is the root.
    #[must_use]
    pub fn root() -> Self {
        let root = Octant::ROOT;
        Self { nodes: vec![Node::leaf(&root, Side::Outside)], octants: vec![root] }
    }

    /// Splits leaves until every leaf that `facet` crosses has at least level `level`, and marks
    /// these leaves `Crossing`.
    pub fn insert(&mut self, facet: &Facet, level: u32) {
        self.insert_below((0, Octant::ROOT), facet, &Extent::around(facet), level);
    }

    fn insert_below(
        &mut self,
        (index, octant): (Index, Octant),
        facet: &Facet,
        bounds: &Extent,
        level: u32,
    ) {
        // The bounds are for speed only: most octants that a facet is tested against are far away from it.
        let extent = octant.extent();
        if !extent.touches(bounds) || !crosses(facet, &extent) {
            return;
        }
        if self.nodes[index].children.is_none() {
            if octant.level >= level {
                self.nodes[index].side = Side::Crossing;
                return;
            }
            self.split(index);
        }
        for child in self.children(index, octant) {
            self.insert_below(child, facet, bounds, level);
        }
        self.update_level_least(index);
    }

    /// This tree cut at a level: an octant of that level that this tree splits is a leaf, which is
    /// `Crossing` if it contains a crossing leaf.
    #[must_use]
    pub fn cut(&self, level: u32) -> Tree {
        let mut cut = Tree::root();
        cut.copy_below(0, self, (0, Octant::ROOT), level);
        cut
    }

    fn copy_below(&mut self, to: Index, tree: &Tree, from: (Index, Octant), level: u32) {
        let (index, octant) = from;
        if octant.level == level || tree.nodes[index].children.is_none() {
            let mut leaves = tree.leaves_below(from, |_, _| true);
            if leaves.any(|(leaf, _)| tree.side(leaf) == Side::Crossing) {
                self.nodes[to].side = Side::Crossing;
            }
            return;
        }
        self.split(to);
        for ((to, _), from) in self.children(to, octant).zip(tree.children(index, octant)) {
            self.copy_below(to, tree, from, level);
        }
        self.update_level_least(to);
    }

    /// Splits kept leaves until every kept leaf whose interior meets that of `extent` has at least
    /// level `level`.
    pub fn refine(&mut self, extent: &Extent, level: u32) {
        self.refine_below((0, Octant::ROOT), extent, level);
    }

    fn refine_below(&mut self, (index, octant): (Index, Octant), extent: &Extent, level: u32) {
        let node = &self.nodes[index];
        if u32::from(node.level_least) >= level || !octant.extent().interiors_meet(extent) {
            return;
        }
        if node.children.is_none() {
            self.split(index);
        }
        for child in self.children(index, octant) {
            self.refine_below(child, extent, level);
        }
        self.update_level_least(index);
    }

    fn split(&mut self, index: Index) {
        let (octant, side) = (self.octants[index], self.nodes[index].side);
        let first = u32::try_from(self.nodes.len()).expect("a tree that fits into memory");
        self.nodes[index].children = NonZeroU32::new(first);
        let children = (0..8).map(|i| octant.child(i));
        self.nodes.extend(children.clone().map(|child| Node::leaf(&child, side)));
        self.octants.extend(children);
    }

    fn update_level_least(&mut self, index: Index) {
        let children = self.children(index, self.octants[index]);
        let levels = children.map(|(child, _)| self.nodes[child].level_least);
        self.nodes[index].level_least = levels.min().unwrap_or(NOTHING_KEPT);
    }

    /// Deletes the leaves that satisfy `unwanted`. They stay in the tree, which must tile the root,
    /// but they are never refined and no longer among the kept leaves.
    pub fn delete(&mut self, unwanted: impl Fn(Index, Side) -> bool) {
        // Children have higher indices than their parents, so the reverse order visits them first.
        for index in (0..self.nodes.len()).rev() {
            if self.nodes[index].children.is_some() {
                self.update_level_least(index);
            } else if unwanted(index, self.nodes[index].side) {
                self.nodes[index].level_least = NOTHING_KEPT;
            }
        }
    }

    /// The children of an octant, in Morton order; none if it is a leaf.
    fn children(
        &self,
        index: Index,
        octant: Octant,
    ) -> impl DoubleEndedIterator<Item = (Index, Octant)> + use<> {
        let first = self.nodes[index].children.map(|first| first.get() as Index);
        first.into_iter().flat_map(move |first| (0..8).map(move |i| (first + i, octant.child(i))))
    }

    /// Checks the invariants of this module.
    ///
    /// # Panics
    /// If an invariant does not hold.
    pub fn check_invariants(&self) {
        assert_eq!((self.octants[0], self.octants.len()), (Octant::ROOT, self.nodes.len()));
        let parents = self.nodes.iter().filter(|node| node.children.is_some()).count();
        assert_eq!(
            self.nodes.len(),
            1 + 8 * parents,
            "every octant except the root is the child of exactly one octant"
        );
        for (index, node) in self.nodes.iter().enumerate() {
            let (kept, octant) = (node.level_least != NOTHING_KEPT, self.octants[index]);
            if node.children.is_none() {
                assert!(!kept || u32::from(node.level_least) == octant.level);
                continue;
            }
            let children = || self.children(index, octant);
            assert!(children().all(|(child, _)| child > index), "children follow their parent");
            assert!(children().all(|(child, octant)| self.octants[child] == octant));
            let levels = children().map(|(child, _)| self.nodes[child].level_least);
            assert_eq!(Some(node.level_least), levels.min());
        }
    }

    /// The leaves in `octant` that are `wanted`, as are all octants that contain them, in Morton order.
    fn leaves_below(
        &self,
        octant: (Index, Octant),
        wanted: impl Fn(&Node, &Octant) -> bool,
    ) -> impl Iterator<Item = (Index, Octant)> {
        let mut pending = vec![octant];
        std::iter::from_fn(move || {
            while let Some((index, octant)) = pending.pop() {
                if wanted(&self.nodes[index], &octant) {
                    if self.nodes[index].children.is_none() {
                        return Some((index, octant));
                    }
                    pending.extend(self.children(index, octant).rev());
                }
            }
            None
        })
    }

    /// The number of octants, which is more than every index.
    #[must_use]
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// All leaves, in Morton order.
    pub fn leaves(&self) -> impl Iterator<Item = (Index, Octant)> {
        self.leaves_below((0, Octant::ROOT), |_, _| true)
    }

    /// The leaves whose interior meets that of `extent`, in Morton order.
    pub fn leaves_meeting(&self, extent: &Extent) -> impl Iterator<Item = (Index, Octant)> {
        self.leaves_below((0, Octant::ROOT), |_, octant| octant.extent().interiors_meet(extent))
    }

    /// The leaves that share part of a face with a leaf, and this leaf itself.
    pub fn face_neighbours(&self, leaf: Index) -> impl Iterator<Item = Index> {
        let extent = self.octants[leaf].extent();
        let wanted = move |_: &Node, octant: &Octant| octant.extent().share_area(&extent);
        self.leaves_below((0, Octant::ROOT), wanted).map(|(leaf, _)| leaf)
    }

    /// The kept leaves of at most level `level`, in Morton order, each with its side.
    pub fn kept_leaves(&self, level: u32) -> impl Iterator<Item = (Octant, Side)> {
        let leaves = self
            .leaves_below((0, Octant::ROOT), move |node, _| u32::from(node.level_least) <= level);
        leaves.map(|(index, octant)| (octant, self.side(index)))
    }

    /// The words of the kept leaves whose side satisfies `wanted`, in ascending order.
    pub fn words(&self, wanted: impl Fn(Side) -> bool) -> Vec<u64> {
        let leaves = self.kept_leaves(LEVEL_MAX).filter(|&(_, side)| wanted(side));
        leaves.map(|(octant, side)| octant.word(side)).collect()
    }

    /// The octant at an index.
    #[must_use]
    pub fn octant(&self, index: Index) -> Octant {
        self.octants[index]
    }

    /// The side of a leaf.
    #[must_use]
    pub fn side(&self, index: Index) -> Side {
        self.nodes[index].side
    }

    /// Sets the side of a leaf.
    pub fn set_side(&mut self, index: Index, side: Side) {
        self.nodes[index].side = side;
    }
}

impl Node {
    fn leaf(octant: &Octant, side: Side) -> Self {
        Self { children: None, side, level_least: octant.level as u8 }
    }
}
