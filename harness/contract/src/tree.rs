//! The leaves of a mesh as a tree that stores equal subtrees once.
//!
//! The tree is built in one pass over sorted words. A node consists of its eight children only and has neither
//! a position nor a level. Most leaves around a smooth surface lie in uniform runs, so a billion of them need a
//! small fraction of the memory of one node per octant. A walk that carries a [`Neighbourhood`](crate::neighbourhood::Neighbourhood) (an octant and
//! its 26 neighbours) finds the neighbours of every leaf without a search.
//!
//! Invariants: a node has at least one child that is not a hole; children are stored before their parents.

#[cfg(test)]
mod tests;

use crate::htg::Block;
use crate::octant::{LEVEL_MAX, Octant};
use crate::word;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxBuildHasher;
use std::hash::BuildHasher;

/// The content of an octant: a hole, a leaf, part of a coarser leaf, a node, or outside the root.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Handle(u32);

/// Kind of a leaf: the code of its side, or [`DELETED`].
pub type Kind = u8;
/// A deleted crossing leaf whose level is a lower bound, because it may have been refined before it was deleted.
pub const DELETED: Kind = 3;
/// Set of kinds, one bit each, and [`HOLES`].
pub type Kinds = u8;
/// Bit of [`Kinds`] that represents holes.
pub const HOLES: Kinds = 1 << 4;

const FIRST_LEAF: u32 = 4;
const FIRST_COARSER: u32 = 16;
const FIRST_NODE: u32 = 128;

impl Handle {
    /// No leaf.
    pub const HOLE: Self = Self(0);
    /// Outside the root.
    pub const OUTSIDE_ROOT: Self = Self(1);

    /// A leaf that coincides with the octant.
    pub fn leaf(kind: Kind) -> Self {
        Self(FIRST_LEAF + u32::from(kind))
    }

    /// Part of a leaf of a coarser level.
    fn coarser_leaf(kind: Kind, level: u8) -> Self {
        Self(FIRST_COARSER + 4 * u32::from(level) + u32::from(kind))
    }

    fn node(index: usize) -> Self {
        Self(FIRST_NODE + u32::try_from(index).expect("fewer than 2^32 distinct nodes"))
    }

    /// The kind, if a leaf coincides with the octant.
    pub fn as_leaf(self) -> Option<Kind> {
        (FIRST_LEAF..FIRST_COARSER).contains(&self.0).then(|| (self.0 - FIRST_LEAF) as Kind)
    }

    /// Kind and level of the leaf, if the octant is part of a coarser leaf.
    pub fn as_coarser_leaf(self) -> Option<(Kind, u8)> {
        let code = self.0.wrapping_sub(FIRST_COARSER);
        (code < FIRST_NODE - FIRST_COARSER).then_some(((code & 3) as Kind, (code >> 2) as u8))
    }

    /// Whether the octant is split.
    pub fn is_node(self) -> bool {
        self.0 >= FIRST_NODE
    }

    /// The index of a node, less than the number of distinct nodes.
    ///
    /// # Panics
    /// If it is none.
    pub fn index(self) -> usize {
        (self.0 - FIRST_NODE) as usize
    }

    /// The leaf that an octant of this level is, or is part of: its kind and its own level.
    #[inline]
    fn leaf_of(self, level: u8) -> Option<(Kind, u8)> {
        self.as_leaf().map(|kind| (kind, level)).or(self.as_coarser_leaf())
    }
}

/// Summary of the leaves below a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Summary {
    /// Largest number of levels from the node down to a leaf.
    finest: u8,
    /// Smallest number of levels from the node down to a leaf that is not deleted; `NO_LEAF` if there is none.
    coarsest: u8,
    kinds: Kinds,
}

/// A level, or number of levels, greater than that of any leaf.
pub const NO_LEAF: u8 = 100;

/// Is called with an octant and its content; returns whether to visit its children.
pub type Enter<'e> = &'e mut dyn FnMut(Octant, Handle) -> bool;

/// The leaves of a mesh as a tree. Walks in other crates ask for content and levels a dozen times per leaf: these functions are
/// `#[inline]`.
#[derive(Debug, Default)]
pub struct Tree {
    /// The content of the root.
    pub root: Handle,
    /// The children of all nodes.
    children: Vec<[Handle; 8]>,
    summaries: Vec<Summary>,
    /// The indices of all nodes, by the hash of their children.
    indices: HashTable<u32>,
}

impl Tree {
    /// The tree of sorted words. Words that are not leaves or that overlap an earlier leaf are omitted; the
    /// check `linear` reports them.
    pub fn of_words(words: &[u64]) -> Self {
        let mut builder = Builder::default();
        words.iter().for_each(|&first| _ = builder.push_block(&Block { first, depth: 0 }));
        builder.finish()
    }

    /// Number of distinct nodes.
    pub fn nodes(&self) -> usize {
        self.children.len()
    }

    /// The contents of the children of a node.
    ///
    /// # Panics
    /// If it is none.
    pub fn children(&self, of: Handle) -> [Handle; 8] {
        self.children[of.index()]
    }

    /// The content of a child of an octant with content `of` at this level.
    #[inline]
    pub fn child(&self, of: Handle, digit: u8, level: u8) -> Handle {
        if of.is_node() {
            return self.children[of.index()][usize::from(digit)];
        }
        of.leaf_of(level).map_or(of, |(kind, level)| Handle::coarser_leaf(kind, level))
    }

    /// Level of the finest leaf in an octant with content `of` at this level; 0 if there is none.
    #[inline]
    pub fn finest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            return level + self.summaries[of.index()].finest;
        }
        of.leaf_of(level).map_or(0, |(_, level)| level)
    }

    /// Level of the coarsest leaf in an octant with content `of` at this level, deleted leaves excluded; at
    /// least [`NO_LEAF`] if there is none.
    #[inline]
    pub fn coarsest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            return level + self.summaries[of.index()].coarsest;
        }
        of.leaf_of(level).filter(|(kind, _)| *kind != DELETED).map_or(NO_LEAF, |(_, level)| level)
    }

    /// The kinds of leaves in `of`, and [`HOLES`] if it has holes; the empty set outside the root.
    #[inline]
    pub fn kinds(&self, of: Handle) -> Kinds {
        if of.is_node() {
            return self.summaries[of.index()].kinds;
        }
        let without_leaf = if of == Handle::HOLE { HOLES } else { 0 };
        of.leaf_of(0).map_or(without_leaf, |(kind, _)| 1 << kind)
    }

    /// Visits octants in Morton order, parents first: the root, and the children of nodes for which `enter` returns true.
    pub fn walk(&self, enter: Enter) {
        self.walk_below(Octant::ROOT, self.root, enter);
    }

    /// The same from an octant with content `of` on.
    pub fn walk_below(&self, octant: Octant, of: Handle, enter: Enter) {
        if enter(octant, of) && of.is_node() {
            for digit in 0..8 {
                self.walk_below(octant.child(digit), self.child(of, digit, octant.level), enter);
            }
        }
    }

    /// Visits the leaves and holes that satisfy a condition, in Morton order. A node must satisfy it if something in it does.
    pub fn walk_where(
        &self,
        holds: impl Fn(&Octant, Handle) -> bool,
        visit: &mut impl FnMut(Octant, Handle),
    ) {
        self.walk(&mut |octant, handle| {
            let holds = holds(&octant, handle);
            if holds && !handle.is_node() {
                visit(octant, handle);
            }
            holds
        });
    }

    /// What the tree has at an octant: a node, a leaf, or a hole. Within a leaf it is the leaf's handle.
    pub fn at(&self, octant: &Octant) -> Handle {
        self.descend(octant).1
    }

    /// The leaf that contains a level-19 cell, and its kind.
    pub fn locate(&self, cell: [u32; 3]) -> Option<(Octant, Kind)> {
        let cell = Octant { corner: cell, level: LEVEL_MAX };
        let (level, handle) = self.descend(&cell);
        handle.as_leaf().map(|kind| (cell.ancestor(level), kind))
    }

    /// The level of the first octant on the way from the root to this one that is not split, or of itself, and what the tree has there.
    fn descend(&self, to: &Octant) -> (u8, Handle) {
        let (mut level, mut handle) = (0, self.root);
        while handle.is_node() && level < to.level {
            level += 1;
            handle = self.children[handle.index()][usize::from(to.ancestor(level).digit())];
        }
        (level, handle)
    }

    /// The node with these children, which is stored if it is new.
    fn intern(&mut self, children: [Handle; 8]) -> Handle {
        let (all, hash) = (&self.children, |node: &[Handle; 8]| FxBuildHasher.hash_one(node));
        let is_same = |&index: &u32| all[index as usize] == children;
        match self.indices.entry(hash(&children), is_same, |&index| hash(&all[index as usize])) {
            Entry::Occupied(known) => Handle::node(*known.get() as usize),
            Entry::Vacant(vacant) => {
                let index = all.len();
                vacant.insert(u32::try_from(index).expect("fewer than 2^32 nodes"));
                self.summaries.push(self.summarise(&children));
                self.children.push(children);
                Handle::node(index)
            }
        }
    }

    fn summarise(&self, children: &[Handle; 8]) -> Summary {
        let mut all = Summary { finest: 0, coarsest: NO_LEAF, kinds: 0 };
        for &child in children {
            all.finest = all.finest.max(self.finest_level(child, 1));
            all.coarsest = all.coarsest.min(self.coarsest_level(child, 1));
            all.kinds |= self.kinds(child);
        }
        all
    }
}

/// Builds a tree from leaves in ascending order of their keys.
///
/// The octants from the root to the parent of the last leaf are open, one per level. An octant is closed, and
/// its node is stored, as soon as a leaf follows that lies outside it.
#[derive(Debug, Default)]
pub struct Builder {
    tree: Tree,
    path: [[Handle; 8]; LEVEL_MAX as usize],
    /// Number of open octants: `path[..open]` is in use.
    open: usize,
    /// Key of the last leaf, which determines the open octants.
    key: u64,
    /// End of the key range of the last leaf.
    end: u64,
    /// The last content whose leaves have one kind, and their number of levels below it.
    block: (Kind, u8, Handle),
}

impl Builder {
    /// Adds a leaf of any kind, [`DELETED`] included.
    ///
    /// # Panics
    /// If it overlaps or precedes the leaf before it.
    pub fn push_leaf(&mut self, key: u64, level: u8, kind: Kind) {
        self.push_content(key, level, Handle::leaf(kind)).expect("leaves in order");
    }

    /// Adds all leaves of a block.
    ///
    /// # Errors
    /// If they are rejected; the tree is unchanged.
    pub fn push_block(&mut self, block: &Block) -> Result<(), String> {
        word::check(block.first)?;
        let kind = (block.first & 3) as Kind;
        if self.block.0 != kind || self.block.1 != block.depth || block.depth == 0 {
            let of_depth = |content, _| self.tree.intern([content; 8]);
            self.block = (kind, block.depth, (0..block.depth).fold(Handle::leaf(kind), of_depth));
        }
        self.push_content(word::key(block.first), block.level(), self.block.2)
    }

    fn push_content(&mut self, key: u64, level: u8, content: Handle) -> Result<(), String> {
        if key < self.end {
            return Err("it overlaps or precedes the leaf before it".to_owned());
        }
        self.end = key + word::span(level);
        if level == 0 {
            self.tree.root = content;
            return Ok(());
        }
        let parent = usize::from(level) - 1;
        // The common ancestors of both leaves stay open.
        let other_levels = (self.key ^ key).checked_ilog2().unwrap_or(0) as usize / 3;
        self.close_down_to(usize::from(LEVEL_MAX) - other_levels);
        self.key = key;
        self.path[self.open..=parent].fill([Handle::HOLE; 8]);
        self.open = parent + 1;
        self.path[parent][digit(key, parent)] = content;
        Ok(())
    }

    /// Closes open octants until at most `levels` are open.
    fn close_down_to(&mut self, levels: usize) {
        while self.open > levels {
            self.open -= 1;
            let node = self.tree.intern(self.path[self.open]);
            match self.open.checked_sub(1) {
                Some(parent) => self.path[parent][digit(self.key, parent)] = node,
                None => self.tree.root = node,
            }
        }
    }

    /// Number of distinct nodes so far.
    pub fn nodes(&self) -> usize {
        self.tree.nodes()
    }

    /// The tree of all leaves added.
    pub fn finish(mut self) -> Tree {
        self.close_down_to(0);
        self.tree
    }
}

/// The digit of the child that contains this cell, among the children of its ancestor at `level`.
fn digit(key: u64, level: usize) -> usize {
    (key >> (3 * (usize::from(LEVEL_MAX) - 1 - level)) & 7) as usize
}
