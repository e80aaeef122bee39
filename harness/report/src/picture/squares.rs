//! The squares in which a plane cuts leaves, as many as a picture can show.
//!
//! Leaves narrower than `EDGE_MIN` on the page are merged into the octant that is wide enough, and have the greatest of
//! their values. The leaves of an octant that a plane cuts are consecutive in Morton order, so merging needs no search, and
//! memory is bounded by the page, not by the mesh.

use super::colour::Colour;
use super::plane_axes;
use contract::failure::Result;
use contract::mesh::Mesh;
use contract::octant::CELLS_PER_EDGE;
use export::selection::Selection;

/// Edge of the smallest square, in units of the page.
const EDGE_MIN: f64 = 1.0;
/// Edge of the smallest square with an outline, in units of the page.
const EDGE_OUTLINED: f64 = 3.5;
/// Greatest number of squares: about two megabytes of SVG.
pub const SQUARES_MAX: usize = 60_000;

/// A square in a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Minimum corner in the plane, in level-19 cells.
    pub corner: [u32; 2],
    /// Its edge is that of an octant of this level.
    pub level: u8,
    /// Greatest value of its leaves.
    pub value: u32,
    /// Number of its leaves that the plane cuts.
    pub leaves: u64,
}

impl Square {
    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.level
    }
}

/// The squares of a plane in Morton order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Squares {
    /// The squares.
    pub squares: Vec<Square>,
    /// Squares of at most this level have outlines.
    pub level_outlined: u8,
    /// Deepest level of a square; deeper leaves are merged.
    pub level_drawn: u8,
    /// Number of leaves that the plane cuts.
    pub leaves: u64,
}

/// Deepest levels of a square and of one with an outline, where the root has this edge on the page.
pub fn deepest(root_edge: f64) -> [u8; 2] {
    [EDGE_MIN, EDGE_OUTLINED].map(|edge| (root_edge / edge).log2().floor().clamp(0.0, 19.0) as u8)
}

impl Squares {
    /// The squares of the selected leaves in the selection's slice, as many as can be shown. Leaves are merged to the levels `deepest`.
    ///
    /// # Errors
    /// If the mesh cannot be read.
    ///
    /// # Panics
    /// If the selection has no slice.
    pub fn collect(
        mesh: &Mesh,
        selection: &Selection,
        colour: Colour,
        [level_drawn, level_outlined]: [u8; 2],
        squares_max: usize,
    ) -> Result<Self> {
        let axes = plane_axes(selection.slice.expect("a picture has a slice").axis);
        let mut found = Self { level_outlined, level_drawn, ..Self::default() };
        selection.visit(mesh, &mut |leaf| {
            let (octant, value) = (leaf.octant, colour.value(&leaf));
            let corner = axes.map(|a| octant.corner[a]);
            found.add(Square { corner, level: octant.level, value, leaves: 1 });
            Ok(())
        })?;
        while found.squares.len() > squares_max && found.level_drawn > 0 {
            found.level_drawn -= 1;
            found.leaves = 0;
            std::mem::take(&mut found.squares).into_iter().for_each(|square| found.add(square));
        }
        found.check_invariants(squares_max);
        Ok(found)
    }

    /// Asserts that squares are those of octants in the root, do not overlap and are as many as can be shown, and that every leaf is in one.
    ///
    /// # Panics
    /// If that is not so.
    pub fn check_invariants(&self, squares_max: usize) {
        let count = self.squares.len();
        assert!(count <= squares_max.max(1), "{count} squares of at most {squares_max}");
        let leaves: u64 = self.squares.iter().map(|s| s.leaves).sum();
        assert_eq!(leaves, self.leaves, "leaves of all squares and of the slice");
        // The Morton codes of octants in the lowest layer of the root.
        let interval = |s: &Square| {
            let first = contract::word::key_of([s.corner[0], s.corner[1], 0]);
            (first, first + contract::word::span(s.level))
        };
        for s in &self.squares {
            let is_octant = s.level <= self.level_drawn
                && s.corner.iter().all(|c| c % s.edge() == 0 && *c < CELLS_PER_EDGE);
            assert!(is_octant && s.leaves > 0, "{s:?} is not the square of an octant with leaves");
        }
        let overlap = self.squares.windows(2).find(|w| interval(&w[0]).1 > interval(&w[1]).0);
        assert!(overlap.is_none(), "squares overlap or are not in Morton order: {overlap:?}");
    }

    /// Adds the next square in Morton order, merged into the last one if both are too small to be drawn.
    fn add(&mut self, square: Square) {
        self.leaves += square.leaves;
        let level = square.level.min(self.level_drawn);
        let mask = !((CELLS_PER_EDGE >> level) - 1);
        let square = Square { corner: square.corner.map(|c| c & mask), level, ..square };
        match self.squares.last_mut() {
            Some(last) if last.corner == square.corner && last.level == level => {
                last.value = last.value.max(square.value);
                last.leaves += square.leaves;
            }
            _ => self.squares.push(square),
        }
    }
}
