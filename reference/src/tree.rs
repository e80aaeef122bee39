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

/// An octant of the arena, in 24 bytes: most of the time is spent on reading nodes.
#[derive(Clone, Debug)]
struct Node {
    octant: Octant,
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
        self.insert_below(0, facet, &Extent::around(facet).enlarged(1), level);
    }

    /// `bounds`, which enclose the facet, are for speed only: most octants are far away from it.
    fn insert_below(&mut self, index: Index, facet: &Facet, bounds: &Extent, level: u32) {
        let octant = self.octant(index);
        if !crosses(facet, &octant.extent()) {
            return;
        }
        if self.children(index).is_none() && octant.level >= level {
            return self.set_side(index, Side::Crossing);
        }
        let first = self.children(index).unwrap_or_else(|| self.split(index));
        let children = octant.children_meeting(*bounds);
        children.for_each(|i| self.insert_below(first + i, facet, bounds, level));
        self.update_level_least(index);
    }

    /// This tree cut at a level: an octant of that level that this tree splits is a leaf, which is
    /// `Crossing` if it contains a crossing leaf. Other sides are not known yet.
    pub fn cut(&self, level: u32) -> Tree {
        let (mut cut, mut originals, mut index) = (Tree::root(), vec![0], 0);
        while let Some(&original) = originals.get(index) {
            let octant = self.octant(original);
            if let Some(first) = self.children(original).filter(|_| octant.level < level) {
                cut.split(index);
                originals.extend(first..first + 8);
            } else if self.find(octant.extent(), |_| true).any(|i| self.side(i) == Side::Crossing) {
                cut.set_side(index, Side::Crossing);
            }
            index += 1;
        }
        // Deletes nothing, but determines every `level_least`.
        cut.delete(|_, _| false);
        cut
    }

    /// Splits kept leaves until every kept leaf whose interior meets that of `extent` has at least
    /// level `level`.
    pub fn refine(&mut self, extent: &Extent, level: u32) {
        if extent.interiors_meet(&Octant::ROOT.extent()) {
            self.refine_below(0, extent, level);
        }
    }

    /// As [`Tree::refine`], for an octant whose interior meets that of `extent`. Returns whether it
    /// split an octant.
    fn refine_below(&mut self, index: Index, extent: &Extent, level: u32) -> bool {
        if u32::from(self.nodes[index].level_least) >= level {
            return false;
        }
        let mut splits = self.children(index).is_none();
        let first = self.children(index).unwrap_or_else(|| self.split(index));
        let children = self.octant(index).children_meeting(*extent);
        children.for_each(|i| splits |= self.refine_below(first + i, extent, level));
        if splits {
            self.update_level_least(index);
        }
        splits
    }

    /// Splits a leaf, and returns the index of its first child.
    fn split(&mut self, index: Index) -> Index {
        let (octant, side, first) = (self.octant(index), self.side(index), self.nodes.len());
        let first_u32 = u32::try_from(first).expect("fewer than 2^32 octants");
        self.nodes[index].children = NonZeroU32::new(first_u32);
        self.nodes.extend((0..8).map(|i| Node::leaf(octant.child(i), side)));
        first
    }

    fn update_level_least(&mut self, index: Index) {
        let children = self.children(index).map_or(0..0, |first| first..first + 8);
        let levels = self.nodes[children].iter().map(|child| child.level_least);
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

    /// The index of the first child of an octant; `None` if it is a leaf.
    fn children(&self, index: Index) -> Option<Index> {
        self.nodes[index].children.map(|first| first.get() as Index)
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
            let Some(first) = self.children(index) else {
                assert!(!kept || u32::from(node.level_least) == node.octant.level);
                continue;
            };
            assert!(first > index, "children follow their parent");
            assert!((0..8).all(|i| self.octant(first + i) == node.octant.child(i)));
            let levels = self.nodes[first..first + 8].iter().map(|child| child.level_least);
            assert_eq!(Some(node.level_least), levels.min());
        }
    }

    /// The leaves whose interior meets that of `extent`, if they and all octants that contain them
    /// are `wanted`, in Morton order.
    fn find(&self, extent: Extent, wanted: impl Fn(&Node) -> bool) -> impl Iterator<Item = Index> {
        let mut pending = Vec::with_capacity(64);
        pending.extend(extent.interiors_meet(&Octant::ROOT.extent()).then_some(0));
        std::iter::from_fn(move || {
            while let Some(index) = pending.pop() {
                if wanted(&self.nodes[index]) {
                    let Some(first) = self.children(index) else {
                        return Some(index);
                    };
                    let children = self.octant(index).children_meeting(extent).rev();
                    children.for_each(|i| pending.push(first + i));
                }
            }
            None
        })
    }

    /// All leaves, in Morton order.
    pub fn leaves(&self) -> impl Iterator<Item = Index> {
        self.leaves_meeting(Octant::ROOT.extent())
    }

    /// The leaves whose interior meets that of `extent`, in Morton order.
    pub fn leaves_meeting(&self, extent: Extent) -> impl Iterator<Item = Index> {
        self.find(extent, |_| true)
    }

    /// The leaves that share part of a face with a leaf, and this leaf itself.
    pub fn face_neighbours(&self, leaf: Index) -> impl Iterator<Item = Index> {
        let extent = self.octant(leaf).extent();
        let wanted = move |node: &Node| node.octant.extent().share_area(&extent);
        self.find(extent.enlarged(1), wanted)
    }

    /// The kept leaves of at most level `level`, in Morton order, each with its side.
    pub fn kept_leaves(&self, level: u32) -> impl Iterator<Item = (Octant, Side)> {
        let wanted = move |node: &Node| u32::from(node.level_least) <= level;
        let leaves = self.find(Octant::ROOT.extent(), wanted);
        leaves.map(|leaf| (self.octant(leaf), self.side(leaf)))
    }

    /// The words of the kept leaves whose side satisfies `wanted`, in ascending order.
    pub fn words(&self, wanted: impl Fn(Side) -> bool) -> Vec<u64> {
        let leaves = self.kept_leaves(LEVEL_MAX).filter(|&(_, side)| wanted(side));
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
        Self { octant, children: None, side, level_least: octant.level as u8 }
    }
}
