//! The points of a mesh: the corners of its cells, and of the squares into which their faces are split where cells are missing.
//!
//! The points of an octant, without those on its high sides, depend on the contents of the eight octants of its level that meet in its
//! minimum corner, and on whether this corner is a point because of something coarser. So equal surroundings are looked at once, as
//! long as they are remembered.

use std::hash::BuildHasher;

use rustc_hash::FxBuildHasher;

use super::points::{Builder, Handle as Set, POINTS_MAX, Points};
use super::tree::{CUTS, HOLES, Handle, OUTSIDE, Tree};
use crate::error::ExportError;
use crate::options::Options;

/// Number of surroundings that are remembered, of a tree with many nodes.
const REMEMBERED_MAX: usize = 1 << 16;

/// The contents of the octants that meet in a point, and whether something coarser makes it a point of the mesh. Bit `a` of the index is
/// set if the octant is on the high side along axis `a`.
type Surroundings = ([Handle; 8], bool);

/// The points of the cells of a tree.
///
/// # Errors
/// If there are too many, or if the user interrupts.
pub fn points(tree: &Tree, options: &Options) -> Result<Points, ExportError> {
    let slots = (4 * tree.nodes().len()).next_power_of_two().min(REMEMBERED_MAX);
    let remembered = vec![((Default::default(), false), Set::NONE); slots];
    let mut search = Search { tree, options, builder: Builder::default(), remembered, steps: 0 };
    let root = tree.root().what;
    let is_cell = root.as_cell().is_some();
    // The root and the octants on its high sides, each with the root opposite to itself.
    let mut octants = [Set::NONE; 8];
    for (digit, octant) in octants.iter_mut().enumerate() {
        let mut around = [Handle::OUTSIDE; 8];
        around[7 ^ digit] = root;
        *octant = search.points((around, is_cell))?;
    }
    let all = search.builder.intern(octants);
    search.builder.finish(all).ok_or_else(|| {
        ExportError::Request(format!(
            "a polyMesh can have {POINTS_MAX} points here: select fewer leaves"
        ))
    })
}

struct Search<'a> {
    tree: &'a Tree,
    options: &'a Options<'a>,
    builder: Builder,
    remembered: Vec<(Surroundings, Set)>,
    /// Number of surroundings that have been looked at.
    steps: u64,
}

impl Search<'_> {
    fn points(&mut self, around: Surroundings) -> Result<Set, ExportError> {
        let (contents, has_corner) = around;
        if contents.iter().all(|content| content.as_node().is_none()) {
            return Ok(Set::corner(has_corner));
        }
        let slot = FxBuildHasher.hash_one(around) as usize & (self.remembered.len() - 1);
        if self.remembered[slot].0 == around {
            return Ok(self.remembered[slot].1);
        }
        self.options.check_at(self.steps)?;
        self.steps += 1;
        let mut children = [Set::NONE; 8];
        for (digit, child) in children.iter_mut().enumerate() {
            *child = self.points(self.child(&around, digit))?;
        }
        let points = self.builder.intern(children);
        self.remembered[slot] = (around, points);
        Ok(points)
    }

    /// The surroundings of the minimum corner of a child.
    fn child(&self, (parents, has_corner): &Surroundings, digit: usize) -> Surroundings {
        // One bit per axis: a child on the high side has its parent on both sides.
        let parent = |octant: usize| parents[digit | octant];
        let contents =
            std::array::from_fn(|octant| self.tree.child_of(parent(octant), 7 ^ digit ^ octant));
        let is_cell = |octant: usize| contents[octant].as_cell().is_some();
        let is_new = |octant: usize| parent(octant).as_node().is_some();
        let has_corner = digit == 0 && *has_corner
            || (0..8).any(|octant| is_cell(octant) && is_new(octant))
            || (0..8).any(|octant| {
                is_new(octant)
                    && (0..3).any(|axis| {
                        let opposite = octant ^ 1 << axis;
                        let face = 2 * axis + usize::from(octant & 1 << axis == 0);
                        is_cell(opposite)
                            && !is_new(opposite)
                            && self.is_whole(contents[octant], face)
                            && !self.is_whole(parent(octant), face)
                    })
            });
        (contents, has_corner)
    }

    /// Whether a face at an octant without cells is not split.
    fn is_whole(&self, content: Handle, face: usize) -> bool {
        [HOLES, CUTS, OUTSIDE].contains(&self.tree.kinds(content, face))
    }
}
