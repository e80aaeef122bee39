//! The cells of an export as a tree, and a walk that knows what is across each face.
//!
//! [`contract::tree::Tree`] stores equal subtrees once and therefore has no place for the number of a cell, which the labels
//! of a polyMesh need. This one has it, at 4.6 to 6 bytes per cell.
//!
//! Invariants: cells are numbered in Morton order from 0; `end` of a node is one more than its last cell.

use std::iter::Peekable;

use contract::octant::{LEVEL_MAX, Octant};
use contract::tree::{digit, shared_levels};
use contract::word;

/// Content of an octant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content(u32);

/// Number of cells that can be distinguished.
pub const CELLS_MAX: u64 = (FIRST_NODE - FIRST_CELL) as u64;
const FIRST_CELL: u32 = 3;
const FIRST_NODE: u32 = 1 << 31;

impl Content {
    /// No leaf of the mesh.
    pub const HOLE: Self = Self(0);
    /// Leaves of the mesh that are not exported.
    pub const CUT: Self = Self(1);
    /// Outside the root.
    pub const OUTSIDE: Self = Self(2);

    fn cell(number: u32) -> Self {
        Self(FIRST_CELL + number)
    }

    /// The number of the cell that the octant is, or is part of.
    pub fn as_cell(self) -> Option<u32> {
        (FIRST_CELL..FIRST_NODE).contains(&self.0).then(|| self.0 - FIRST_CELL)
    }

    fn as_node(self) -> Option<usize> {
        self.0.checked_sub(FIRST_NODE).map(|node| node as usize)
    }

    /// Whether the octant is split.
    pub fn is_node(self) -> bool {
        self.0 >= FIRST_NODE
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    children: [Content; 8],
    end: u32,
}

/// The tree.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    root: Content,
    cells: u32,
}

impl Tree {
    /// Number of cells.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// The content of a child of an octant with content `of`.
    pub fn child(&self, of: Content, digit: usize) -> Content {
        of.as_node().map_or(of, |node| self.nodes[node].children[digit])
    }

    /// Removes the cells for which `keep` is false and renumbers the others.
    pub fn retain(&mut self, keep: &[bool]) {
        let mut number = 0;
        let mut numbers: Vec<u32> = Vec::with_capacity(keep.len() + 1);
        for &kept in keep {
            numbers.push(number);
            number += u32::from(kept);
        }
        numbers.push(number);
        let renumbered = |content: Content| match content.as_cell() {
            Some(cell) if keep[cell as usize] => Content::cell(numbers[cell as usize]),
            Some(_) => Content::HOLE,
            None => content,
        };
        for node in &mut self.nodes {
            node.children = node.children.map(renumbered);
            node.end = numbers[node.end as usize];
        }
        self.root = renumbered(self.root);
        self.cells = number;
    }
}

/// Builds the tree from leaves in Morton order that do not overlap.
#[derive(Debug)]
pub struct Builder {
    nodes: Vec<Node>,
    path: [[Content; 8]; LEVEL_MAX as usize],
    /// Number of open octants: `path[..open]` is in use.
    open: usize,
    /// Morton code of the last leaf, which determines the open octants.
    key: u64,
    root: Content,
    cells: u32,
}

impl Default for Builder {
    fn default() -> Self {
        let path = [[Content::HOLE; 8]; LEVEL_MAX as usize];
        Self { nodes: Vec::new(), path, open: 0, key: 0, root: Content::HOLE, cells: 0 }
    }
}

impl Builder {
    /// Adds a leaf, which becomes the next cell if it is exported. Panics above [`CELLS_MAX`] cells.
    pub fn push(&mut self, octant: &Octant, is_exported: bool) {
        let mut content = Content::CUT;
        if is_exported {
            assert!(u64::from(self.cells) < CELLS_MAX, "too many cells");
            content = Content::cell(self.cells);
        }
        let key = word::key_of(octant.corner);
        // The nodes that end before this leaf do not contain it.
        self.close_down_to(shared_levels(self.key, key));
        self.cells += u32::from(is_exported);
        self.key = key;
        let Some(parent) = usize::from(octant.level).checked_sub(1) else {
            self.root = content;
            return;
        };
        while self.open <= parent {
            self.path[self.open] = [Content::HOLE; 8];
            self.open += 1;
        }
        self.path[parent][digit(key, parent)] = content;
    }

    fn close_down_to(&mut self, levels: usize) {
        while self.open > levels {
            self.open -= 1;
            let children = self.path[self.open];
            // What is not exported takes no memory, however much it is.
            let content = match children.iter().all(|&child| child == Content::CUT) {
                true => Content::CUT,
                false => {
                    self.nodes.push(Node { children, end: self.cells });
                    Content(FIRST_NODE + self.nodes.len() as u32 - 1)
                }
            };
            match self.open.checked_sub(1) {
                Some(parent) => self.path[parent][digit(self.key, parent)] = content,
                None => self.root = content,
            }
        }
    }

    /// The tree of all leaves added.
    pub fn finish(mut self) -> Tree {
        self.close_down_to(0);
        Tree { nodes: self.nodes, root: self.root, cells: self.cells }
    }
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
}

/// Visits cells, given by ascending numbers, in this order.
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
    descend(tree, &root, &mut cells.peekable(), visit)
}

fn descend<E>(
    tree: &Tree,
    around: &Around,
    cells: &mut Peekable<impl Iterator<Item = u32>>,
    visit: &mut impl FnMut(u32, &Around) -> Result<(), E>,
) -> Result<(), E> {
    let Some(&next) = cells.peek() else { return Ok(()) };
    if let Some(node) = around.content.as_node() {
        // All cells before this node have been visited, so its first cell is not after `next`.
        if next < tree.nodes[node].end {
            return (0..8).try_for_each(|d| descend(tree, &around.child(tree, d), cells, visit));
        }
    } else if around.content.as_cell() == Some(next) {
        cells.next();
        return visit(next, around);
    }
    Ok(())
}
