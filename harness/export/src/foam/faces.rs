//! The faces of a cell: the pieces of the six faces of its cube, as polygons.
//!
//! A face of the cube that touches finer cells is split into their faces, and what is left of it, into the largest squares of
//! the quadtree that touch no cell. An edge of a polygon has every point of the mesh that bisects it, or bisects a half of it,
//! and so on. Two polygons with a common piece of an edge therefore divide it in the same way, which closes every cell: a
//! point that bisects an edge of one face is a corner of a smaller square beside it, or lies where no cell needs it.

use contract::octant::CELLS_PER_EDGE;

use super::points::{Near, Point};
use super::tree::{Content, Tree};
use super::walk::{Around, Follow};

/// A square that a cell shares with another cell or with a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Minimum corner.
    pub corner: Point,
    /// The edge is that of an octant of this level.
    pub level: u8,
    /// The axis of its normal.
    pub axis: u8,
    /// Whether it is on the high side of the cell along the axis.
    pub is_high: bool,
    /// A cell, or one of [`Content::HOLE`], [`Content::CUT`] and [`Content::OUTSIDE`].
    pub across: Content,
}

/// Appends the squares of a cell.
pub fn squares<P: Follow>(tree: &Tree, around: &Around<P>, squares: &mut Vec<Square>) {
    let edge = around.octant.edge();
    for (axis, is_high) in (0..6).map(|face| (face / 2, face % 2 == 1)) {
        let mut corner = around.octant.corner;
        corner[axis] += if is_high { edge } else { 0 };
        let across = around.across(axis, usize::from(is_high));
        let level = around.octant.level;
        split(tree, Square { corner, level, axis: axis as u8, is_high, across }, squares);
    }
}

/// Appends the squares of a square whose `across` may be split.
fn split(tree: &Tree, square: Square, squares: &mut Vec<Square>) {
    if !square.across.is_node() {
        return squares.push(square);
    }
    let axis = usize::from(square.axis);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let begin = squares.len();
    let edge = square.edge() / 2;
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let mut corner = square.corner;
        corner[u] += i * edge;
        corner[v] += j * edge;
        // The children that touch the square are on the side from which it is seen.
        let digit = (i as usize) << u | (j as usize) << v | usize::from(!square.is_high) << axis;
        let across = tree.child(square.across, digit);
        split(tree, Square { corner, level: square.level + 1, across, ..square }, squares);
    }
    let parts = &squares[begin..];
    let across = parts[0].across;
    if across.as_cell().is_none()
        && parts.len() == 4
        && parts.iter().all(|part| part.across == across && part.level == square.level + 1)
    {
        squares.truncate(begin);
        squares.push(Square { across, ..square });
    }
}

impl Square {
    fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.level
    }

    /// The corners, counterclockwise around the positive axis, the minimum corner first.
    pub fn corners(&self) -> [Point; 4] {
        let axis = usize::from(self.axis);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
            let mut corner = self.corner;
            corner[u] += i * self.edge();
            corner[v] += j * self.edge();
            corner
        })
    }

    /// Replaces `polygon` by the numbers of the vertices of the face of a cell: counterclockwise around the positive axis, or clockwise, the
    /// minimum corner first in both cases.
    pub fn polygon(&self, around: &Around<Near>, clockwise: bool, polygon: &mut Vec<u32>) {
        let axis = usize::from(self.axis);
        let mut face = around.more.on_face(axis, self.is_high);
        for level in around.octant.level + 1..=self.level {
            let bit = |a: usize| usize::from(self.corner[a % 3] & CELLS_PER_EDGE >> level != 0);
            face = face.quarter(bit(axis + 1) | bit(axis + 2) << 1);
        }
        face.polygon(clockwise, polygon);
    }
}
