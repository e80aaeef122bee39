//! A walk over cells in the order of their numbers that knows what is across each face.

use std::ops::Range;

use contract::octant::Octant;

use super::tree::{ANYWHERE, Content, Kinds, Tree};

/// What a walk finds for an octant from what it found for the parent.
pub trait Follow: Copy {
    /// The same for a child.
    fn child(self, digit: usize) -> Self;
}

impl Follow for () {
    fn child(self, _: usize) {}
}

/// An octant with its content and that of the octants of the same level across its faces.
#[derive(Clone, Copy, Debug)]
pub struct Around<P> {
    /// The octant.
    pub octant: Octant,
    /// What else the walk follows.
    pub more: P,
    content: Content,
    across: [[Content; 2]; 3],
}

impl<P: Follow> Around<P> {
    fn child(&self, tree: &Tree, digit: usize) -> Self {
        let across = |axis: usize, side: usize| {
            let is_sibling = (digit >> axis & 1) != side;
            let parent = if is_sibling { self.content } else { self.across[axis][side] };
            tree.child(parent, digit ^ 1 << axis)
        };
        Self {
            octant: self.octant.child(digit as u8),
            more: self.more.child(digit),
            content: tree.child(self.content, digit),
            across: std::array::from_fn(|axis| [across(axis, 0), across(axis, 1)]),
        }
    }

    /// The content across a face, on the low (0) or high (1) side of an axis.
    pub fn across(&self, axis: usize, side: usize) -> Content {
        self.across[axis][side]
    }

    /// Whether the octant may have a cell at one of these.
    pub fn may_touch(&self, tree: &Tree, kinds: Kinds) -> bool {
        let facing = |face: usize| tree.kinds(self.across[face / 2][face % 2].what, face ^ 1);
        tree.kinds(self.content.what, ANYWHERE) & kinds != 0
            || (0..6).any(|f| facing(f) & kinds != 0)
    }

    /// The cells of the octant.
    pub fn cells(&self, tree: &Tree) -> Range<u32> {
        self.content.first..self.content.first + tree.cells_in(self.content)
    }

    /// The code of the side of a cell.
    pub fn side(&self) -> u32 {
        self.content.what.as_cell().expect("the octant is a cell")
    }
}

/// Visits the cells in ascending intervals in this order, except those of octants that `enter` rejects.
///
/// # Errors
/// The first error of `visit`, which ends the walk.
pub fn walk<P: Follow, E>(
    tree: &Tree,
    more: P,
    cells: impl Iterator<Item = Range<u32>>,
    enter: &impl Fn(&Around<P>) -> bool,
    visit: &mut impl FnMut(u32, &Around<P>) -> Result<(), E>,
) -> Result<(), E> {
    let (octant, content) = (Octant::ROOT, tree.root());
    let root = Around { octant, more, content, across: [[Content::OUTSIDE; 2]; 3] };
    let mut cells = Cells { now: 0..0, next: cells };
    cells.skip_to(0);
    descend(tree, &root, tree.cells(), &mut cells, enter, visit)
}

/// The cells that remain to be visited.
struct Cells<I> {
    now: Range<u32>,
    next: I,
}

impl<I: Iterator<Item = Range<u32>>> Cells<I> {
    fn has_below(&self, end: u32) -> bool {
        !self.now.is_empty() && self.now.start < end
    }

    /// Leaves out the cells below `cell`.
    fn skip_to(&mut self, cell: u32) {
        self.now.start = self.now.start.max(cell);
        while self.now.is_empty() {
            let Some(next) = self.next.next() else { return };
            self.now = next.start.max(cell)..next.end;
        }
    }
}

/// Visits those cells of an octant; `end` is one more than its last cell. All cells before it have been visited or left out.
fn descend<P: Follow, E>(
    tree: &Tree,
    around: &Around<P>,
    end: u32,
    cells: &mut Cells<impl Iterator<Item = Range<u32>>>,
    enter: &impl Fn(&Around<P>) -> bool,
    visit: &mut impl FnMut(u32, &Around<P>) -> Result<(), E>,
) -> Result<(), E> {
    if !enter(around) {
        cells.skip_to(end);
    } else if around.content.is_node() {
        for digit in 0..8 {
            let next = if digit == 7 { end } else { tree.first_in(around.content, digit + 1) };
            if cells.has_below(next) {
                descend(tree, &around.child(tree, digit), next, cells, enter, visit)?;
            }
        }
    } else if cells.has_below(end) {
        visit(around.content.first, around)?;
        cells.skip_to(end);
    }
    Ok(())
}
