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
        self.insert_below(0, Octant::ROOT, facet, &Extent::around(facet).enlarged(1), level);
    }

    /// `bounds` are for speed only: most octants are far away from the facet.
    fn insert_below(
        &mut self,
        index: Index,
        octant: Octant,
        facet: &Facet,
        bounds: &Extent,
        level: u32,
    ) {
        if !crosses(facet, &octant.extent()) {
            return;
        }
        if self.is_leaf(index) && octant.level >= level {
            self.nodes[index].side = Side::Crossing;
            return;
        }
        let first = self.children(index).unwrap_or_else(|| self.split(index));
        octant.children_meeting(bounds).for_each(|i| {
            self.insert_below(first + i, octant.child(i), facet, bounds, level);
        });
        self.update_level_least(index);
    }

    /// This tree cut at a level: an octant of that level that this tree splits is a leaf, which is
    /// `Crossing` if it contains a crossing leaf.
    #[must_use]
    pub fn cut(&self, level: u32) -> Tree {
        let mut cut = Tree::root();
        cut.copy_below(0, self, 0, level);
        cut
    }

    fn copy_below(&mut self, to: Index, tree: &Tree, from: Index, level: u32) {
        let octant = tree.octants[from];
        if let Some(children) = tree.children(from).filter(|_| octant.level < level) {
            let first = self.split(to);
            (0..8).for_each(|i| self.copy_below(first + i, tree, children + i, level));
            self.update_level_least(to);
        } else if tree
            .leaves_below(from, octant.extent(), |_, _| true)
            .any(|(leaf, _)| tree.side(leaf) == Side::Crossing)
        {
            self.nodes[to].side = Side::Crossing;
        }
    }

    /// Splits kept leaves until every kept leaf whose interior meets that of `extent` has at least
    /// level `level`.
    pub fn refine(&mut self, extent: &Extent, level: u32) {
        if Octant::ROOT.extent().interiors_meet(extent) {
            self.refine_below(0, Octant::ROOT, extent, level);
        }
    }

    /// Returns whether it split an octant. The interior of the given octant meets that of `extent`.
    fn refine_below(&mut self, index: Index, octant: Octant, extent: &Extent, level: u32) -> bool {
        if u32::from(self.nodes[index].level_least) >= level {
            return false;
        }
        let mut splits = self.is_leaf(index);
        let first = self.children(index).unwrap_or_else(|| self.split(index));
        octant.children_meeting(extent).for_each(|i| {
            splits |= self.refine_below(first + i, octant.child(i), extent, level);
        });
        if splits {
            self.update_level_least(index);
        }
        splits
    }

    /// Splits a leaf, and returns the index of its first child.
    fn split(&mut self, index: Index) -> Index {
        let (octant, side, first) = (self.octants[index], self.nodes[index].side, self.nodes.len());
        let children = (0..8).map(|i| octant.child(i));
        self.nodes.extend(children.clone().map(|child| Node::leaf(&child, side)));
        self.octants.extend(children);
        let first_u32 = u32::try_from(first).expect("a tree that fits into memory");
        self.nodes[index].children = NonZeroU32::new(first_u32);
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

    fn is_leaf(&self, index: Index) -> bool {
        self.nodes[index].children.is_none()
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
            let kept = node.level_least != NOTHING_KEPT;
            let Some(first) = self.children(index) else {
                assert!(!kept || u32::from(node.level_least) == self.octants[index].level);
                continue;
            };
            assert!(first > index, "children follow their parent");
            assert!((0..8).all(|i| self.octants[first + i] == self.octants[index].child(i)));
            let levels = self.nodes[first..first + 8].iter().map(|child| child.level_least);
            assert_eq!(Some(node.level_least), levels.min());
        }
    }

    /// The leaves in an octant whose interior meets that of `extent`, if they and all octants that
    /// contain them are `wanted`, in Morton order.
    fn leaves_below(
        &self,
        index: Index,
        extent: Extent,
        wanted: impl Fn(&Node, &Octant) -> bool,
    ) -> impl Iterator<Item = (Index, Octant)> {
        let octant = self.octants[index];
        let meets = octant.extent().interiors_meet(&extent);
        let mut pending = Vec::with_capacity(25);
        pending.extend(meets.then_some((index, octant)));
        std::iter::from_fn(move || {
            while let Some((index, octant)) = pending.pop() {
                if wanted(&self.nodes[index], &octant) {
                    let Some(first) = self.children(index) else {
                        return Some((index, octant));
                    };
                    let children = octant.children_meeting(&extent).rev();
                    children.for_each(|i| pending.push((first + i, octant.child(i))));
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
        self.leaves_meeting(Octant::ROOT.extent())
    }

    /// The leaves whose interior meets that of `extent`, in Morton order.
    pub fn leaves_meeting(&self, extent: Extent) -> impl Iterator<Item = (Index, Octant)> {
        self.leaves_below(0, extent, |_, _| true)
    }

    /// The leaves that share part of a face with a leaf, and this leaf itself.
    pub fn face_neighbours(&self, leaf: Index) -> impl Iterator<Item = Index> {
        let extent = self.octants[leaf].extent();
        let wanted = move |_: &Node, octant: &Octant| octant.extent().share_area(&extent);
        self.leaves_below(0, extent.enlarged(1), wanted).map(|(leaf, _)| leaf)
    }

    /// The kept leaves of at most level `level`, in Morton order, each with its side.
    pub fn kept_leaves(&self, level: u32) -> impl Iterator<Item = (Octant, Side)> {
        let leaves = self.leaves_below(0, Octant::ROOT.extent(), move |node, _| {
            u32::from(node.level_least) <= level
        });
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
