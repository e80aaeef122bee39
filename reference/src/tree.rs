//! The voxel tree: an arena of octants, each with no children or all eight.
//!
//! Invariants, executed by [`Tree::check_invariants`]: the root has index 0; the eight children of
//! an octant are contiguous, in Morton order, at higher indices than their parent; `level_least` of
//! an octant is the least level of the kept leaves among its descendants.
use crate::crossing::crosses;
use crate::lattice::Facet;
use crate::octant::{Extent, Octant, Side};

/// The index of an octant in the arena.
pub type Index = usize;

/// The `level_least` of an octant without kept descendants. It exceeds every level, so such an
/// octant is never refined.
const NOTHING_KEPT: u32 = u32::MAX;

#[derive(Clone, Debug)]
struct Node {
    octant: Octant,
    /// The first of eight children; `None` for a leaf.
    children: Option<Index>,
    /// Meaningful for leaves only.
    side: Side,
    level_least: u32,
}

/// A full oct-tree: its leaves tile the root.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// The tree whose only leaf is the root.
    #[must_use]
    pub fn root() -> Self {
        Self { nodes: vec![Node::leaf(Octant::ROOT, Side::Outside)] }
    }

    /// Splits leaves until every leaf that `facet` crosses has at least level `level`, and marks
    /// these leaves `Crossing`.
    pub fn insert(&mut self, facet: &Facet, level: u32) {
        self.insert_below(0, facet, level);
    }

    fn insert_below(&mut self, index: Index, facet: &Facet, level: u32) {
        let octant = self.nodes[index].octant;
        if !crosses(facet, &octant.extent()) {
            return;
        }
        if self.nodes[index].children.is_none() {
            if octant.level >= level {
                self.nodes[index].side = Side::Crossing;
                return;
            }
            self.split(index);
        }
        for child in self.children(index) {
            self.insert_below(child, facet, level);
        }
        self.update_level_least(index);
    }

    /// Splits kept leaves until every kept leaf whose interior meets that of `extent` has at least
    /// level `level`.
    pub fn refine(&mut self, extent: &Extent, level: u32) {
        self.refine_below(0, extent, level);
    }

    fn refine_below(&mut self, index: Index, extent: &Extent, level: u32) {
        let node = &self.nodes[index];
        if node.level_least >= level || !node.octant.extent().interiors_meet(extent) {
            return;
        }
        if node.children.is_none() {
            self.split(index);
        }
        for child in self.children(index) {
            self.refine_below(child, extent, level);
        }
        self.update_level_least(index);
    }

    fn split(&mut self, index: Index) {
        let Node { octant, side, .. } = self.nodes[index];
        self.nodes[index].children = Some(self.nodes.len());
        self.nodes.extend((0..8).map(|i| Node::leaf(octant.child(i), side)));
    }

    fn update_level_least(&mut self, index: Index) {
        let levels = self.children(index).map(|child| self.nodes[child].level_least);
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

    fn children(&self, index: Index) -> std::ops::Range<Index> {
        self.nodes[index].children.map_or(0..0, |first| first..first + 8)
    }

    /// Checks the invariants of this module.
    ///
    /// # Panics
    /// If an invariant does not hold.
    pub fn check_invariants(&self) {
        assert_eq!(self.nodes[0].octant, Octant::ROOT);
        let parents = self.nodes.iter().filter(|node| node.children.is_some()).count();
        assert_eq!(
            self.nodes.len(),
            1 + 8 * parents,
            "every octant except the root is the child of exactly one octant"
        );
        for (index, node) in self.nodes.iter().enumerate() {
            let kept = node.level_least != NOTHING_KEPT;
            if node.children.is_none() {
                assert!(!kept || node.level_least == node.octant.level);
                continue;
            }
            assert!(self.children(index).start > index, "children follow their parent");
            let children = || self.children(index).map(|child| &self.nodes[child]);
            assert!(children().enumerate().all(|(i, child)| child.octant == node.octant.child(i)));
            assert_eq!(Some(node.level_least), children().map(|child| child.level_least).min());
        }
    }

    /// All leaves, in Morton order.
    #[must_use]
    pub fn leaves(&self) -> Vec<Index> {
        let mut leaves = Vec::new();
        self.push_leaves(0, &|_| true, &mut leaves);
        leaves
    }

    /// The leaves whose interior meets that of `extent`, in Morton order.
    #[must_use]
    pub fn leaves_meeting(&self, extent: &Extent) -> Vec<Index> {
        let mut leaves = Vec::new();
        self.push_leaves(0, &|octant| octant.extent().interiors_meet(extent), &mut leaves);
        leaves
    }

    fn push_leaves(&self, index: Index, wanted: &impl Fn(&Octant) -> bool, to: &mut Vec<Index>) {
        if !wanted(&self.nodes[index].octant) {
            return;
        }
        if self.nodes[index].children.is_none() {
            to.push(index);
        }
        for child in self.children(index) {
            self.push_leaves(child, wanted, to);
        }
    }

    /// The kept leaves, in Morton order, each with its side.
    pub fn kept_leaves(&self) -> impl Iterator<Item = (Octant, Side)> {
        let kept = |&index: &Index| self.nodes[index].level_least != NOTHING_KEPT;
        self.leaves().into_iter().filter(kept).map(|index| (self.octant(index), self.side(index)))
    }

    /// The words of the kept leaves whose side satisfies `wanted`, in ascending order.
    pub fn words(&self, wanted: impl Fn(Side) -> bool) -> Vec<u64> {
        let leaves = self.kept_leaves().filter(|&(_, side)| wanted(side));
        leaves.map(|(octant, side)| octant.word(side)).collect()
    }

    /// The octant at an index.
    #[must_use]
    pub fn octant(&self, index: Index) -> Octant {
        self.nodes[index].octant
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
    fn leaf(octant: Octant, side: Side) -> Self {
        Self { octant, children: None, side, level_least: octant.level }
    }
}
