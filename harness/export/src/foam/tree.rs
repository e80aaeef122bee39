//! The cells of an export as a tree, and a walk that knows what is across each face.
//!
//! As in [`contract::tree`], equal subtrees are stored once. The number of a cell is therefore stored nowhere: each child of a node
//! has the number of cells in the children before it, and a descent from the root adds them up. A node is one line of the cache.
//!
//! Invariants: cells are numbered in Morton order from 0; a node follows its children.

use std::iter::Peekable;
use std::ops::Range;

use contract::octant::Octant;
use contract::tree::{DELETED, Handle};

/// Content of an octant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content {
    /// One of the contents without cells, or [`FIRST_CELL`] and the code of a cell's side, or [`FIRST_NODE`] and the index of a node.
    what: u32,
    /// Number of the first cell; in a node, counted from the node's own first cell; 0 if the octant is not split and has no cell.
    first: u32,
}

/// Number of cells that can be distinguished.
pub const CELLS_MAX: u64 = u32::MAX as u64;
const FIRST_CELL: u32 = 3;
const FIRST_NODE: u32 = 6;

impl Content {
    /// No leaf of the mesh.
    pub const HOLE: Self = Self { what: 0, first: 0 };
    /// Leaves of the mesh that are not exported.
    pub const CUT: Self = Self { what: 1, first: 0 };
    /// Outside the root.
    pub const OUTSIDE: Self = Self { what: 2, first: 0 };

    /// The number of the cell that the octant is, or is part of.
    pub fn as_cell(self) -> Option<u32> {
        (FIRST_CELL..FIRST_NODE).contains(&self.what).then_some(self.first)
    }

    fn as_node(self) -> Option<usize> {
        self.what.checked_sub(FIRST_NODE).map(|node| node as usize)
    }

    /// Whether the octant is split.
    pub fn is_node(self) -> bool {
        self.what >= FIRST_NODE
    }
}

/// The tree.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<[Content; 8]>,
    root: Content,
}

impl Tree {
    /// The leaves of a mesh as cells, except [`DELETED`] ones, which are [`Content::CUT`]. There are at most [`CELLS_MAX`] cells.
    pub fn new(leaves: &contract::tree::Tree) -> Self {
        let what = |handle: Handle| match (handle.as_node(), handle.as_leaf()) {
            (Some(node), _) => FIRST_NODE + node as u32,
            (_, Some(DELETED)) => Content::CUT.what,
            (_, Some(side)) => FIRST_CELL + u32::from(side),
            _ => Content::HOLE.what,
        };
        let nodes = leaves.distinct().iter().map(|children| children.map(what));
        Self::numbered(what(leaves.root()), nodes)
    }

    /// Counts the cells in nodes, each of which follows its children.
    fn numbered(root: u32, nodes: impl ExactSizeIterator<Item = [u32; 8]>) -> Self {
        let root = Content { what: root, first: 0 };
        let mut tree = Self { nodes: Vec::with_capacity(nodes.len()), root };
        for children in nodes {
            let mut first = 0;
            tree.nodes.push(children.map(|what| {
                let child = Content { what, first };
                first += tree.cells_in(child);
                child
            }));
        }
        tree
    }

    /// Number of cells.
    pub fn cells(&self) -> u32 {
        self.cells_in(self.root)
    }

    fn cells_in(&self, of: Content) -> u32 {
        let Some(node) = of.as_node() else { return u32::from(of.as_cell().is_some()) };
        let last = self.nodes[node][7];
        last.first + self.cells_in(last)
    }

    /// The content of a child of an octant with content `of`.
    pub fn child(&self, of: Content, digit: usize) -> Content {
        let Some(node) = of.as_node() else { return of };
        let Content { what, first } = self.nodes[node][digit];
        Content { what, first: if what < FIRST_CELL { 0 } else { of.first + first } }
    }

    /// The same tree with every octant that cells fill as one cell: a block, whose cells are connected by faces.
    pub fn blocks(&self) -> Self {
        let mut is_filled: Vec<bool> = Vec::with_capacity(self.nodes.len());
        let fills = |content: &Content, is_filled: &[bool]| {
            content.as_node().map_or(content.as_cell().is_some(), |node| is_filled[node])
        };
        for node in &self.nodes {
            is_filled.push(node.iter().all(|child| fills(child, &is_filled)));
        }
        let what = |child: Content| if fills(&child, &is_filled) { FIRST_CELL } else { child.what };
        Self::numbered(what(self.root), self.nodes.iter().map(|node| node.map(what)))
    }

    /// Visits the [blocks](Self::blocks) of the tree in order: number, level and cells of each.
    pub fn visit_blocks(&self, blocks: &Self, visit: &mut impl FnMut(u32, u8, Range<u32>)) {
        self.visit_blocks_in(self.root, (blocks, blocks.root), 0, visit);
    }

    fn visit_blocks_in(
        &self,
        of: Content,
        (blocks, in_blocks): (&Self, Content),
        level: u8,
        visit: &mut impl FnMut(u32, u8, Range<u32>),
    ) {
        if let Some(block) = in_blocks.as_cell() {
            visit(block, level, of.first..of.first + self.cells_in(of));
        } else if in_blocks.is_node() {
            for digit in 0..8 {
                let child = blocks.child(in_blocks, digit);
                self.visit_blocks_in(self.child(of, digit), (blocks, child), level + 1, visit);
            }
        }
    }

    /// Makes holes of the blocks for which `keep` is false. The other cells are renumbered.
    pub fn retain(&mut self, blocks: &Self, keep: &[bool]) {
        let mut nodes: Vec<_> = self.nodes.iter().map(|node| node.map(|c| c.what)).collect();
        let root = retained(&mut nodes, self.root.what, (blocks, blocks.root), keep);
        *self = Self::numbered(root, nodes.into_iter());
    }
}

/// What remains of an octant. Nodes that change are appended.
fn retained(
    nodes: &mut Vec<[u32; 8]>,
    what: u32,
    (blocks, in_blocks): (&Tree, Content),
    keep: &[bool],
) -> u32 {
    if let Some(block) = in_blocks.as_cell() {
        return if keep[block as usize] { what } else { Content::HOLE.what };
    }
    if !in_blocks.is_node() {
        return what;
    }
    let before = nodes[(what - FIRST_NODE) as usize];
    let mut after = before;
    for (digit, child) in after.iter_mut().enumerate() {
        *child = retained(nodes, *child, (blocks, blocks.child(in_blocks, digit)), keep);
    }
    if after == before {
        return what;
    }
    nodes.push(after);
    FIRST_NODE + nodes.len() as u32 - 1
}

/// An octant with its content and that of the octants of the same level across its faces.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    /// The octant.
    pub octant: Octant,
    content: Content,
    across: [[Content; 2]; 3],
}

impl Around {
    fn child(&self, tree: &Tree, digit: usize) -> Self {
        let across = |axis: usize, side: usize| {
            let is_sibling = (digit >> axis & 1) != side;
            let parent = if is_sibling { self.content } else { self.across[axis][side] };
            tree.child(parent, digit ^ 1 << axis)
        };
        Self {
            octant: self.octant.child(digit as u8),
            content: tree.child(self.content, digit),
            across: std::array::from_fn(|axis| [across(axis, 0), across(axis, 1)]),
        }
    }

    /// The content across a face, on the low (0) or high (1) side of an axis.
    pub fn across(&self, axis: usize, side: usize) -> Content {
        self.across[axis][side]
    }

    /// The code of the side of a cell.
    pub fn side(&self) -> u32 {
        self.content.what - FIRST_CELL
    }
}

/// Visits cells, given by ascending numbers, in this order, and as often as they are given.
///
/// # Errors
/// The first error of `visit`, which ends the walk.
pub fn walk<E>(
    tree: &Tree,
    cells: impl Iterator<Item = u32>,
    visit: &mut impl FnMut(u32, &Around) -> Result<(), E>,
) -> Result<(), E> {
    let root =
        Around { octant: Octant::ROOT, content: tree.root, across: [[Content::OUTSIDE; 2]; 3] };
    descend(tree, &root, tree.cells(), &mut cells.peekable(), visit)
}

/// Visits those cells of an octant; `end` is one more than its last cell. All cells before it have been visited.
fn descend<E>(
    tree: &Tree,
    around: &Around,
    end: u32,
    cells: &mut Peekable<impl Iterator<Item = u32>>,
    visit: &mut impl FnMut(u32, &Around) -> Result<(), E>,
) -> Result<(), E> {
    let Some(node) = around.content.as_node() else {
        while let Some(cell) = cells.next_if(|&cell| cell < end) {
            visit(cell, around)?;
        }
        return Ok(());
    };
    let ends = tree.nodes[node][1..].iter().map(|next| around.content.first + next.first);
    for (digit, end) in ends.chain([end]).enumerate() {
        if cells.peek().is_some_and(|&cell| cell < end) {
            descend(tree, &around.child(tree, digit), end, cells, visit)?;
        }
    }
    Ok(())
}
