//! How coarse the leaves near an octant are.

use super::{Handle, Hood, NO_LEAF, OFFSETS, Tree};
use crate::octant::Octant;

/// An open box, in level-19 cells.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    low: [i64; 3],
    high: [i64; 3],
}

impl Region {
    /// An octant enlarged on every side.
    pub fn around(octant: &Octant, margin: i64) -> Self {
        let edge = i64::from(octant.edge());
        let low = octant.corner.map(|c| i64::from(c) - margin);
        Self { low, high: low.map(|c| c + edge + 2 * margin) }
    }

    /// Whether an octant's inside meets the box.
    fn meets(&self, corner: [i64; 3], edge: i64) -> bool {
        (0..3).all(|a| corner[a] < self.high[a] && self.low[a] < corner[a] + edge)
    }
}

/// The coarsest leaf found, by level and by a level-19 cell of it.
#[derive(Clone, Copy, Debug)]
pub struct Coarsest {
    /// Its level; [`NO_LEAF`] if there is none.
    pub level: u8,
    cell: [i64; 3],
}

impl Coarsest {
    /// The leaf itself.
    pub fn leaf(&self, tree: &Tree) -> Option<Octant> {
        let cell = self.cell.map(|c| u32::try_from(c).expect("a leaf lies in the root"));
        if self.level >= NO_LEAF { None } else { tree.locate(cell).map(|(octant, _)| octant) }
    }
}

impl Hood {
    /// The coarsest leaf, ghosts aside, whose inside meets the region: exact where the region lies
    /// within the 27 places, or this is the root.
    pub fn coarsest_within(&self, tree: &Tree, region: &Region) -> Coarsest {
        let mut found = Coarsest { level: NO_LEAF, cell: [0; 3] };
        let edge = i64::from(self.octant.edge());
        for (&at, by) in self.around.iter().zip(&OFFSETS) {
            let corner: [i64; 3] =
                std::array::from_fn(|a| i64::from(self.octant.corner[a]) + i64::from(by[a]) * edge);
            search(tree, at, corner, self.octant.level, region, &mut found);
        }
        found
    }
}

/// Looks for a leaf coarser than the one found so far.
fn search(tree: &Tree, at: Handle, corner: [i64; 3], level: u8, region: &Region, found: &mut Coarsest) {
    let coarsest = tree.coarsest_level(at, level);
    let edge = i64::from(crate::octant::CELLS_PER_EDGE >> level);
    if coarsest >= found.level || !region.meets(corner, edge) {
        return;
    }
    if !at.is_node() {
        *found = Coarsest { level: coarsest, cell: corner };
        return;
    }
    for digit in 0..8u8 {
        let corner = std::array::from_fn(|a| corner[a] + edge / 2 * i64::from(digit >> a & 1));
        search(tree, tree.child(at, digit, level), corner, level + 1, region, found);
    }
}
