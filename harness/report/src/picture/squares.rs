//! The squares in which a plane cuts leaves, as many as a picture can show.
//!
//! Leaves narrower than `EDGE_MIN` on the page are merged into the octant that is wide enough, and have the greatest of
//! their values. The leaves of an octant that a plane cuts are consecutive in Morton order, so merging needs no search, and
//! memory is bounded by the page, not by the mesh. Squares too small for an outline are merged with their siblings where all
//! four have the same value, which does not change the picture.

use super::colour::Colour;
use contract::failure::Failure;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use export::leaf::Leaf;
use export::mesh::Mesh;
use export::selection::Selection;
use run::engine::interrupt;

/// Edge of the smallest square, in units of the page.
const EDGE_MIN: f64 = 1.0;
/// Edge of the smallest square with an outline, in units of the page.
const EDGE_OUTLINED: f64 = 3.5;

/// A square in a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Minimum corner in the plane, in level-19 cells.
    pub corner: [u32; 2],
    /// Its edge is that of an octant of this level.
    pub level: u8,
    /// Greatest value of its leaves.
    pub value: u32,
    /// Number of its leaves that the plane cuts, where leaves below the deepest level of the request are one.
    pub leaves: u64,
}

impl Square {
    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.level
    }

    fn parent_at(&self, level: u8) -> [u32; 2] {
        let mask = !((CELLS_PER_EDGE >> level) - 1);
        self.corner.map(|c| c & mask)
    }
}

/// How many squares a format can show.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// Greatest number of squares.
    pub squares_max: usize,
    /// Greatest number of squares with outlines.
    pub outlined_max: usize,
    /// Deepest level of a square.
    pub level_max: u8,
}

impl Detail {
    /// The same detail with leaves merged to this level, whose level is then shown.
    pub fn to_level(self, level: u8) -> Self {
        Self { level_max: self.level_max.min(level), ..self }
    }
}

/// The squares of a plane in Morton order.
#[derive(Clone, Debug, PartialEq)]
pub struct Squares {
    /// The squares.
    pub squares: Vec<Square>,
    /// Squares of at most this level have outlines.
    pub level_outlined: u8,
    /// Deepest level of a square; deeper leaves are merged.
    level_drawn: u8,
    /// Whether leaves that are too small for the page were merged.
    pub is_merged: bool,
    /// Number of leaves that the plane cuts, where leaves below the deepest level of the request are one.
    pub leaves: u64,
}

/// The two axes of a plane normal to `axis`: first to the right, then upwards.
pub fn plane_axes(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

impl Squares {
    /// The squares of the selected leaves in the selection's slice. `root_edge` is the edge of the root on the page.
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
        root_edge: f64,
        detail: &Detail,
    ) -> Result<Self, Failure> {
        let axes = plane_axes(selection.slice.expect("a picture has a slice").axis);
        let deepest = |edge: f64| (root_edge / edge).log2().floor().clamp(0.0, 19.0) as u8;
        let level_drawn = deepest(EDGE_MIN).min(detail.level_max);
        let level_outlined = deepest(EDGE_OUTLINED).min(level_drawn);
        let mut found =
            Self { squares: Vec::new(), level_outlined, level_drawn, is_merged: false, leaves: 0 };
        let mut last = None;
        let check = || if interrupt::requested() { Err(Failure::interrupted()) } else { Ok(()) };
        mesh.visit(selection, &check, &mut |leaf| {
            let octant = leaf.octant.ancestor(leaf.octant.level.min(detail.level_max));
            // Leaves merged to the deepest level are one cell of the mesh that is shown.
            let leaves = u64::from(last.replace(octant) != Some(octant));
            found.add(Square { leaves, ..square(&Leaf { octant, ..leaf }, axes, colour) });
            Ok(())
        })?;
        found.outline(detail.outlined_max);
        found.merge_siblings();
        while found.squares.len() > detail.squares_max && found.level_drawn > 0 {
            found.level_drawn -= 1;
            found.level_outlined = found.level_outlined.min(found.level_drawn);
            for square in std::mem::take(&mut found.squares) {
                found.leaves -= square.leaves;
                found.add(square);
            }
            found.outline(detail.outlined_max);
            found.merge_siblings();
        }
        found.check_invariants(detail);
        Ok(found)
    }

    /// Asserts that squares are those of octants in the root, do not overlap and are as many as can be shown, and that every leaf is in one.
    ///
    /// # Panics
    /// If that is not so.
    pub fn check_invariants(&self, detail: &Detail) {
        let (count, most) = (self.squares.len(), detail.squares_max);
        assert!(count <= most.max(1), "{count} squares of at most {most}");
        let leaves: u64 = self.squares.iter().map(|s| s.leaves).sum();
        assert_eq!(leaves, self.leaves, "leaves of all squares and of the slice");
        // The Morton codes of octants in the lowest layer of the root.
        let interval = |s: &Square| {
            let first = contract::word::key_of([s.corner[0], s.corner[1], 0]);
            (first, first + contract::word::span(s.level))
        };
        for s in &self.squares {
            let is_octant = s.level <= detail.level_max
                && s.corner.iter().all(|c| c % s.edge() == 0 && *c < CELLS_PER_EDGE);
            assert!(is_octant && s.leaves > 0, "{s:?} is not the square of an octant with leaves");
        }
        let overlap = self.squares.windows(2).find(|w| interval(&w[0]).1 > interval(&w[1]).0);
        assert!(overlap.is_none(), "squares overlap or are not in Morton order: {overlap:?}");
    }

    /// Adds the next square in Morton order, merged into the last one if both are too small to be drawn.
    fn add(&mut self, square: Square) {
        self.leaves += square.leaves;
        self.is_merged |= square.level > self.level_drawn;
        let level = square.level.min(self.level_drawn);
        let square = Square { corner: square.parent_at(level), level, ..square };
        match self.squares.last_mut() {
            Some(last) if last.corner == square.corner && last.level == level => {
                last.value = last.value.max(square.value);
                last.leaves += square.leaves;
            }
            _ => self.squares.push(square),
        }
    }

    /// Reduces the level with outlines until they are few enough.
    fn outline(&mut self, count_max: usize) {
        let mut counts = [0; LEVEL_MAX as usize + 1];
        self.squares.iter().for_each(|s| counts[usize::from(s.level)] += 1);
        let mut sum = 0;
        let fits = |level: &u8| {
            sum += counts[usize::from(*level)];
            sum <= count_max
        };
        self.level_outlined = (0..=self.level_outlined).take_while(fits).last().unwrap_or(0);
    }

    /// Merges squares without outlines wherever four siblings have the same value.
    fn merge_siblings(&mut self) {
        let mut merged: Vec<Square> = Vec::with_capacity(self.squares.len());
        for &square in &self.squares {
            merged.push(square);
            while let Some(parent) = self.parent_of_last(&merged) {
                merged.truncate(merged.len() - 4);
                merged.push(parent);
            }
        }
        self.squares = merged;
    }

    fn parent_of_last(&self, squares: &[Square]) -> Option<Square> {
        let siblings = squares.last_chunk::<4>()?;
        let Square { level, value, .. } = siblings[3];
        if level <= self.level_outlined + 1 {
            return None;
        }
        let (level_parent, corner) = (level - 1, siblings[3].parent_at(level - 1));
        let alike = |s: &Square| {
            s.level == level && s.value == value && s.parent_at(level_parent) == corner
        };
        let leaves = siblings.iter().map(|s| s.leaves).sum();
        let parent = Square { corner, level: level_parent, value, leaves };
        siblings.iter().all(alike).then_some(parent)
    }
}

fn square(leaf: &Leaf, axes: [usize; 2], colour: Colour) -> Square {
    let Octant { corner, level } = leaf.octant;
    Square { corner: axes.map(|a| corner[a]), level, value: colour.value(leaf), leaves: 1 }
}
