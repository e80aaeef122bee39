//! The faces of a cell: the pieces of the six faces of its cube.
//!
//! A face of the cube that touches finer cells is split into their faces, and what is left of it, into the largest squares of
//! the quadtree that touch no cell. An edge of a face has every point of the mesh that bisects it, or bisects a half of it,
//! and so on. Two faces with a common piece of an edge therefore divide it in the same way, which closes every cell: a
//! point that bisects an edge of one face is a corner of a smaller square beside it, or lies where no cell needs it.

use contract::octant::CELLS_PER_EDGE;

use crate::leaves::{Around, Content, Leaves, Point};

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

/// Replaces `squares` by those of a cell.
pub fn squares(leaves: &Leaves, around: &Around, squares: &mut Vec<Square>) {
    squares.clear();
    let (edge, level) = (around.octant.edge(), around.octant.level);
    for (axis, is_high) in (0..6).map(|face| (face / 2, face % 2 == 1)) {
        let mut corner = around.octant.corner;
        corner[axis] += if is_high { edge } else { 0 };
        let across = around.across[axis][usize::from(is_high)];
        split(leaves, Square { corner, level, axis, is_high, across }, squares);
    }
}

/// Appends the squares of a square whose `across` may be split.
fn split(leaves: &Leaves, square: Square, squares: &mut Vec<Square>) {
    if !matches!(square.across, Content::Split(..)) {
        return squares.push(square);
    }
    let (u, v) = ((square.axis + 1) % 3, (square.axis + 2) % 3);
    let (begin, level) = (squares.len(), square.level + 1);
    let edge = CELLS_PER_EDGE >> level;
    let children = leaves.children(square.across, level);
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let mut corner = square.corner;
        corner[u] += i * edge;
        corner[v] += j * edge;
        // The children that touch the square are on the side from which it is seen.
        let digit =
            (i as usize) << u | (j as usize) << v | usize::from(!square.is_high) << square.axis;
        split(leaves, Square { corner, level, across: children[digit], ..square }, squares);
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

impl Square {
    /// The corners, counterclockwise around the positive axis, the minimum corner first.
    pub fn corners(&self) -> [Point; 4] {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let edge = CELLS_PER_EDGE >> self.level;
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
            let mut corner = self.corner;
            corner[u] += i * edge;
            corner[v] += j * edge;
            corner
        })
    }
}
