//! The cells of an export as a tree.
//!
//! As in [`contract::tree`], equal subtrees are stored once. The number of a cell is therefore stored nowhere: each child of a node
//! has the number of cells in the children before it, and a descent from the root adds them up. A node is one line of the cache.
//!
//! Invariants: cells are numbered in Morton order from 0; a node follows its children.

use contract::tree::DELETED;

/// What an octant is, without the numbers of its cells: a content without cells, a cell with its side, or a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Handle(u32);

/// Content of an octant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content {
    /// What it is.
    pub what: Handle,
    /// Number of the first cell; in a node, counted from the node's own first cell; 0 if the octant is not split and has no cell.
    pub first: u32,
}

/// Number of cells that can be distinguished.
pub const CELLS_MAX: u64 = u32::MAX as u64;
/// Handles from here on are cells; the code of the side is added.
const FIRST_CELL: u32 = 3;
/// Handles from here on are nodes; the index is added.
const FIRST_NODE: u32 = 6;

/// A set of the following.
pub type Kinds = u8;
/// Cells.
pub const CELLS: Kinds = 1;
/// [`Content::HOLE`].
pub const HOLES: Kinds = 2;
/// [`Content::CUT`].
pub const CUTS: Kinds = 4;
/// [`Content::OUTSIDE`].
pub const OUTSIDE: Kinds = 8;
/// In place of a face.
pub const ANYWHERE: usize = 6;

impl Handle {
    /// Outside the root.
    pub const OUTSIDE: Self = Self(2);
    /// No leaf of the mesh.
    pub const HOLE: Self = Self(0);

    /// The code of the side of a cell.
    pub fn as_cell(self) -> Option<u32> {
        (FIRST_CELL..FIRST_NODE).contains(&self.0).then(|| self.0 - FIRST_CELL)
    }

    /// The index of a node.
    pub fn as_node(self) -> Option<usize> {
        self.0.checked_sub(FIRST_NODE).map(|node| node as usize)
    }

    /// The node with an index.
    pub fn node(index: usize) -> Self {
        Self(FIRST_NODE + u32::try_from(index).expect("fewer than 2^32 nodes"))
    }
}

impl Content {
    /// No leaf of the mesh.
    pub const HOLE: Self = Self { what: Handle::HOLE, first: 0 };
    /// Leaves of the mesh that are not exported.
    pub const CUT: Self = Self { what: Handle(1), first: 0 };
    /// Outside the root.
    pub const OUTSIDE: Self = Self { what: Handle::OUTSIDE, first: 0 };

    /// The number of the cell that the octant is, or is part of.
    pub fn as_cell(self) -> Option<u32> {
        self.what.as_cell().map(|_| self.first)
    }

    /// Whether the octant is split.
    pub fn is_node(self) -> bool {
        self.what.as_node().is_some()
    }
}

/// The tree.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<[Content; 8]>,
    /// What each node has at its six faces (twice the axis, plus 1 on the high side) and, last, anywhere.
    kinds: Vec<[Kinds; 7]>,
    root: Content,
}

impl Tree {
    /// The leaves of a mesh as cells, except [`DELETED`] ones, which are [`Content::CUT`]. There are at most [`CELLS_MAX`] cells.
    pub fn new(leaves: &contract::tree::Tree) -> Self {
        let what = |handle: contract::tree::Handle| match (handle.as_node(), handle.as_leaf()) {
            (Some(node), _) => Handle::node(node),
            (_, Some(DELETED)) => Content::CUT.what,
            (_, Some(side)) => Handle(FIRST_CELL + u32::from(side)),
            _ => Handle::HOLE,
        };
        let nodes = leaves.distinct().iter().map(|children| children.map(what));
        Self::numbered(what(leaves.root()), nodes)
    }

    /// Counts the cells in nodes, each of which follows its children.
    pub fn numbered(root: Handle, nodes: impl ExactSizeIterator<Item = [Handle; 8]>) -> Self {
        let (numbered, kinds) = (Vec::with_capacity(nodes.len()), Vec::with_capacity(nodes.len()));
        let mut tree = Self { nodes: numbered, kinds, root: Content { what: root, first: 0 } };
        for children in nodes {
            let mut first = 0;
            let kinds = std::array::from_fn(|face| {
                let at_face =
                    (0..8).filter(|digit| face == ANYWHERE || digit >> (face / 2) & 1 == face % 2);
                at_face.fold(0, |kinds, digit: usize| kinds | tree.kinds(children[digit], face))
            });
            tree.kinds.push(kinds);
            tree.nodes.push(children.map(|what| {
                let child = Content { what, first };
                first += tree.cells_in(child);
                child
            }));
        }
        tree
    }

    /// The content of the root.
    pub fn root(&self) -> Content {
        self.root
    }

    /// The children of every node.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = [Handle; 8]> {
        self.nodes.iter().map(|node| node.map(|child| child.what))
    }

    /// Number of cells.
    pub fn cells(&self) -> u32 {
        self.cells_in(self.root)
    }

    /// Number of cells in an octant.
    pub fn cells_in(&self, of: Content) -> u32 {
        let Some(node) = of.what.as_node() else { return u32::from(of.as_cell().is_some()) };
        let last = self.nodes[node][7];
        last.first + self.cells_in(last)
    }

    /// The content of a child of an octant with content `of`.
    pub fn child(&self, of: Content, digit: usize) -> Content {
        let Some(node) = of.what.as_node() else { return of };
        let Content { what, first } = self.nodes[node][digit];
        Content { what, first: if what.0 < FIRST_CELL { 0 } else { of.first + first } }
    }

    /// Number of the first cell in a child of a node or after it.
    pub fn first_in(&self, of: Content, digit: usize) -> u32 {
        of.first + of.what.as_node().map_or(0, |node| self.nodes[node][digit].first)
    }

    /// The same as [`Self::child`] without numbers.
    pub fn child_of(&self, of: Handle, digit: usize) -> Handle {
        of.as_node().map_or(of, |node| self.nodes[node][digit].what)
    }

    /// What an octant has at a face (twice the axis, plus 1 on the high side), or [`ANYWHERE`].
    pub fn kinds(&self, of: Handle, face: usize) -> Kinds {
        match of.as_node() {
            Some(node) => self.kinds[node][face],
            None => [HOLES, CUTS, OUTSIDE][..].get(of.0 as usize).copied().unwrap_or(CELLS),
        }
    }
}
