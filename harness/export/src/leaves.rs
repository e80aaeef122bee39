//! The leaves of a mesh in Morton order, a walk over them that knows what is across each face, and the squares of a cell: the pieces of the six
//! faces of its cube.
//!
//! An octant's leaves are an interval of the array, so what an octant contains needs no tree of its own.
//!
//! A face of the cube that touches finer cells is split into their faces, and what is left of it, into the largest squares of
//! the quadtree that touch no cell. An edge of a face has every point of the mesh that bisects it, or bisects a half of it,
//! and so on. Two faces with a common piece of an edge therefore divide it in the same way, which closes every cell: a
//! point that bisects an edge of one face is a corner of a smaller square beside it, or lies where no cell needs it.
//!
//! Invariants: words ascend and do not overlap; cells are numbered from 0 in this order, without the leaves that are [`CUT`].

use crate::options::Export;
use crate::points::Point;
use contract::failure::{Failure, Result, uninterrupted};
use contract::mesh::Leaf;
use contract::octant::{CELLS_PER_EDGE, Octant, UNITS_PER_CELL};
use contract::word;

/// In place of a side: a leaf of the mesh that is not exported.
pub const CUT: u64 = 3;

/// Visits a cell with its number, its octant and its squares.
pub type Visit<'a> = &'a mut dyn FnMut(u32, &Octant, &[Square]);

/// The leaves.
pub struct Leaves {
    words: Vec<u64>,
    /// How many cells are before each leaf.
    numbers: Vec<u32>,
    /// Number of cells.
    pub count: u32,
}

/// Content of an octant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Outside the root.
    Outside,
    /// No leaf of the mesh.
    Hole,
    /// A leaf of the mesh that is not exported, or part of one.
    Cut,
    /// The cell with this number, or part of it.
    Cell(u32),
    /// The leaves with these indices.
    Split(usize, usize),
}

impl Content {
    /// The number of the cell that the octant is, or is part of.
    pub fn as_cell(self) -> Option<u32> {
        if let Self::Cell(number) = self { Some(number) } else { None }
    }
}

impl Leaves {
    /// The leaves of a mesh that `takes` accepts, given each and whether it is selected; those that are not selected are [`CUT`].
    ///
    /// # Errors
    /// If the mesh cannot be read, or if the user interrupts.
    pub fn read(export: &Export<'_>, takes: &mut dyn FnMut(&Leaf, bool) -> bool) -> Result<Self> {
        let why = "the mesh has 2^32 leaves or more, of which this format needs all, selected or not: write .vtu or .vtkhdf";
        Failure::unless(u32::try_from(export.mesh.leaf_count()).is_ok(), why)?;
        let mut words = Vec::new();
        export.mesh.leaves(&|_| true, &mut |leaf| {
            let is_selected = export.selection.has(&leaf);
            if takes(&leaf, is_selected) {
                let word = word::encode(leaf.octant, leaf.side);
                words.push(if is_selected { word } else { word | CUT });
            }
            if is_selected { export.require_resolved(leaf.octant.level) } else { Ok(()) }
        })?;
        Ok(Self::new(words))
    }

    /// Leaves with these words.
    pub fn new(words: Vec<u64>) -> Self {
        let mut count = 0u32;
        let number = |word: &u64| {
            let number = count;
            count = count.checked_add(u32::from(word & 3 != CUT)).expect("fewer than 2^32 cells");
            number
        };
        let numbers = words.iter().map(number).collect();
        Self { words, numbers, count }
    }

    /// The words of the cells.
    pub fn cells(&self) -> impl Iterator<Item = u64> {
        self.words.iter().copied().filter(|word| word & 3 != CUT)
    }

    /// The leaves without those cells that `is_kept` rejects.
    pub fn retain(self, is_kept: impl Fn(u32) -> bool) -> Self {
        let Self { words, numbers, .. } = self;
        let all = words.into_iter().zip(numbers);
        let kept = all.filter(|&(word, number)| word & 3 == CUT || is_kept(number));
        Self::new(kept.map(|(word, _)| word).collect())
    }

    /// The content of an octant of this level with these leaves.
    fn content(&self, begin: usize, end: usize, level: u8) -> Content {
        match self.words[begin..end] {
            [] => Content::Hole,
            [one] if word::level(one) <= level && one & 3 == CUT => Content::Cut,
            [one] if word::level(one) <= level => Content::Cell(self.numbers[begin]),
            _ => Content::Split(begin, end),
        }
    }

    /// The contents of the children, which have this level, of an octant.
    pub fn children(&self, of: Content, level: u8) -> [Content; 8] {
        let Content::Split(begin, end) = of else { return [of; 8] };
        let span = word::span(level);
        let corner = word::key(self.words[begin]) & !(8 * span - 1);
        let mut first = begin;
        std::array::from_fn(|digit| {
            let key_end = corner + (digit as u64 + 1) * span;
            let begin = first;
            first += self.words[first..end].partition_point(|&word| word::key(word) < key_end);
            self.content(begin, first, level)
        })
    }

    /// Visits the cells in the order of their numbers, with their octants and squares.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn walk(&self, visit: Visit) -> Result<()> {
        let content = self.content(0, self.words.len(), 0);
        let root = Around { octant: Octant::ROOT, content, across: [[Content::Outside; 2]; 3] };
        self.descend(&root, &mut Vec::new(), visit)
    }

    fn descend(&self, around: &Around, squares: &mut Vec<Square>, visit: Visit) -> Result<()> {
        if let Content::Cell(number) = around.content {
            uninterrupted()?;
            self.squares(around, squares);
            visit(number, &around.octant, squares);
        }
        if !matches!(around.content, Content::Split(..)) {
            return Ok(());
        }
        let level = around.octant.level + 1;
        let own = self.children(around.content, level);
        let beyond = around.across.map(|ends| ends.map(|end| self.children(end, level)));
        for digit in 0..8 {
            let across = |axis: usize, side: usize| {
                let of = if (digit >> axis & 1) != side { &own } else { &beyond[axis][side] };
                of[digit ^ 1 << axis]
            };
            let child = Around {
                octant: around.octant.child(digit as u8),
                content: own[digit],
                across: std::array::from_fn(|axis| [across(axis, 0), across(axis, 1)]),
            };
            self.descend(&child, squares, visit)?;
        }
        Ok(())
    }

    /// Replaces `squares` by those of a cell.
    fn squares(&self, around: &Around, squares: &mut Vec<Square>) {
        squares.clear();
        let (edge, level) = (around.octant.edge(), around.octant.level);
        for (axis, is_high) in (0..6).map(|face| (face / 2, face % 2 == 1)) {
            let mut corner = around.octant.corner;
            corner[axis] += if is_high { edge } else { 0 };
            let across = around.across[axis][usize::from(is_high)];
            self.split(Square { corner, level, axis, is_high, across }, squares);
        }
    }

    /// Appends the squares of a square whose `across` may be split.
    fn split(&self, square: Square, squares: &mut Vec<Square>) {
        if !matches!(square.across, Content::Split(..)) {
            return squares.push(square);
        }
        let (u, v) = ((square.axis + 1) % 3, (square.axis + 2) % 3);
        let (begin, level) = (squares.len(), square.level + 1);
        let children = self.children(square.across, level);
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let corner = square.moved(level, i, j);
            // The children that touch the square are on the side from which it is seen.
            let digit =
                (i as usize) << u | (j as usize) << v | usize::from(!square.is_high) << square.axis;
            self.split(Square { corner, level, across: children[digit], ..square }, squares);
        }
        let parts = &squares[begin..];
        let across = parts[0].across;
        if across.as_cell().is_none()
            && parts.len() == 4
            && parts.iter().all(|part| part.across == across && part.level == level)
        {
            squares.truncate(begin);
            squares.push(Square { across, ..square });
        }
    }
}

/// An octant with its content and that of the octants of the same level across its faces.
struct Around {
    /// The octant.
    octant: Octant,
    content: Content,
    /// On the low and on the high side of each axis.
    across: [[Content; 2]; 3],
}

/// A square that a cell shares with another cell or with a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Minimum corner.
    pub corner: Point,
    /// The edge is that of an octant of this level.
    pub level: u8,
    /// The axis of its normal.
    pub axis: usize,
    /// Whether it is on the high side of the cell along the axis.
    pub is_high: bool,
    /// A cell, a hole, a cut or the outside.
    pub across: Content,
}

impl Square {
    /// The minimum corner, moved by these numbers of a level's edges along the next two axes.
    fn moved(&self, level: u8, i: u32, j: u32) -> Point {
        let (mut corner, edge) = (self.corner, CELLS_PER_EDGE >> level);
        corner[(self.axis + 1) % 3] += i * edge;
        corner[(self.axis + 2) % 3] += j * edge;
        corner
    }

    /// The centre in lattice units.
    pub fn centre(&self) -> [i64; 3] {
        let [low, _, high, _] = self.corners(true);
        std::array::from_fn(|a| i64::from(low[a] + high[a]) * UNITS_PER_CELL / 2)
    }

    /// The corners, counterclockwise around the positive axis or the negative one, the minimum corner first.
    pub fn corners(&self, is_positive: bool) -> [Point; 4] {
        let mut all = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| self.moved(self.level, i, j));
        if !is_positive {
            all[1..].reverse();
        }
        all
    }
}
