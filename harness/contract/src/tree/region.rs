//! How coarse the leaves near an octant are.

use super::{Handle, Hood, OFFSETS, Tree};
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

    /// The smallest box around some children of an octant, enlarged on every side. Bit `d` of `digits`
    /// stands for the child with that digit.
    pub fn around_children(of: &Octant, digits: u8, margin: i64) -> Self {
        let half = i64::from(of.edge()) / 2;
        // Children on the low and on the high side of each axis.
        const LOW: [u8; 3] = [0x55, 0x33, 0x0f];
        let skip = |side: u8| if digits & side == 0 { half } else { 0 };
        let Self { low, high } = Self::around(of, margin);
        Self {
            low: std::array::from_fn(|a| low[a] + skip(LOW[a])),
            high: std::array::from_fn(|a| high[a] - skip(!LOW[a])),
        }
    }

    /// Whether an octant's inside meets the box.
    fn meets(&self, corner: [i64; 3], edge: i64) -> bool {
        (0..3).all(|a| corner[a] < self.high[a] && self.low[a] < corner[a] + edge)
    }
}

/// The coarsest leaf found, by level and by a level-19 cell of it.
#[derive(Clone, Copy, Debug)]
pub struct Coarsest {
    /// Its level, or that which is enough.
    pub level: u8,
    cell: Option<[i64; 3]>,
}

impl Coarsest {
    /// The leaf itself.
    pub fn leaf(&self, tree: &Tree) -> Option<Octant> {
        let cell = self.cell?.map(|c| u32::try_from(c).expect("a leaf lies in the root"));
        tree.locate(cell).map(|(octant, _)| octant)
    }
}

impl Hood {
    /// The coarsest leaf, ghosts aside, whose inside meets the region, if it is coarser than level
    /// `enough`; else a level of `enough` and no leaf. Exact where the region lies within the 27
    /// places, or this is the root.
    pub fn coarsest_within(&self, tree: &Tree, region: &Region, enough: u8) -> Coarsest {
        let mut found = Coarsest { level: enough, cell: None };
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
fn search(
    tree: &Tree,
    at: Handle,
    corner: [i64; 3],
    level: u8,
    region: &Region,
    found: &mut Coarsest,
) {
    let coarsest = tree.coarsest_level(at, level);
    let edge = i64::from(crate::octant::CELLS_PER_EDGE >> level);
    if coarsest >= found.level || !region.meets(corner, edge) {
        return;
    }
    if !at.is_node() {
        *found = Coarsest { level: coarsest, cell: Some(corner) };
        return;
    }
    for digit in 0..8u8 {
        let corner = std::array::from_fn(|a| corner[a] + edge / 2 * i64::from(digit >> a & 1));
        search(tree, tree.child(at, digit, level), corner, level + 1, region, found);
    }
}
