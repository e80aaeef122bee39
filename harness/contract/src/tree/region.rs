//! Search for the coarsest leaf near an octant.

use super::{Handle, Neighbourhood, OFFSETS, Tree};
use crate::octant::Octant;

/// An open box, in level-19 cells.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    low: [i64; 3],
    high: [i64; 3],
}

impl Region {
    /// An octant enlarged by `margin` on every side.
    pub fn around(octant: &Octant, margin: i64) -> Self {
        Self::along(octant, [margin; 3])
    }

    /// An octant enlarged on both sides of each axis by the margin for that axis.
    pub fn along(octant: &Octant, margins: [i64; 3]) -> Self {
        let edge = i64::from(octant.edge());
        let low = std::array::from_fn(|a| i64::from(octant.corner[a]) - margins[a]);
        Self { low, high: std::array::from_fn(|a| low[a] + edge + 2 * margins[a]) }
    }

    /// Whether the interior of an octant meets the box.
    fn meets(&self, corner: [i64; 3], edge: i64) -> bool {
        (0..3).all(|a| corner[a] < self.high[a] && self.low[a] < corner[a] + edge)
    }
}

/// Result of a search for the coarsest leaf.
#[derive(Clone, Copy, Debug)]
pub struct Coarsest {
    /// Level of the leaf, or the bound of the search if there is no coarser leaf.
    pub level: u8,
    /// A level-19 cell of the leaf.
    cell: Option<[i64; 3]>,
}

impl Coarsest {
    /// The leaf; `None` if no leaf is coarser than the bound of the search.
    pub fn leaf(&self, tree: &Tree) -> Option<Octant> {
        let cell = self.cell?.map(|c| u32::try_from(c).expect("a leaf lies in the root"));
        tree.locate(cell).map(|(octant, _)| octant)
    }
}

impl Neighbourhood {
    /// The coarsest leaf that is coarser than level `bound` and whose interior meets the region, deleted leaves
    /// excluded. The result is exact if the region lies within the 27 octants, or if this is the neighbourhood
    /// of the root.
    pub fn coarsest_within(&self, tree: &Tree, region: &Region, bound: u8) -> Coarsest {
        let mut found = Coarsest { level: bound, cell: None };
        let edge = i64::from(self.octant.edge());
        for (&handle, offset) in self.handles.iter().zip(&OFFSETS) {
            let corner: [i64; 3] = std::array::from_fn(|a| {
                i64::from(self.octant.corner[a]) + i64::from(offset[a]) * edge
            });
            search(tree, handle, corner, self.octant.level, region, &mut found);
        }
        found
    }
}

/// Searches an octant for a leaf that is coarser than the one found so far.
fn search(
    tree: &Tree,
    handle: Handle,
    corner: [i64; 3],
    level: u8,
    region: &Region,
    found: &mut Coarsest,
) {
    let coarsest = tree.coarsest_level(handle, level);
    let edge = i64::from(crate::octant::CELLS_PER_EDGE >> level);
    if coarsest >= found.level || !region.meets(corner, edge) {
        return;
    }
    if !handle.is_node() {
        *found = Coarsest { level: coarsest, cell: Some(corner) };
        return;
    }
    for digit in 0..8u8 {
        let corner = std::array::from_fn(|a| corner[a] + edge / 2 * i64::from(digit >> a & 1));
        search(tree, tree.child(handle, digit, level), corner, level + 1, region, found);
    }
}
