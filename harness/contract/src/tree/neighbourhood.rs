//! An octant together with its 26 neighbours of the same level.

use super::{Handle, NO_LEAF, Tree};
use crate::octant::Octant;

/// Index of the octant itself among the 27 octants.
const SELF: usize = 13;

/// Offsets of the 27 octants from the one in the middle, in edges.
pub const OFFSETS: [[i32; 3]; 27] = offsets();

/// For each child and each of its 27 neighbours: the index of the neighbour's parent in the parent's
/// neighbourhood, and the neighbour's digit.
const DESCENT: [[(u8, u8); 27]; 8] = descent();

const fn offsets() -> [[i32; 3]; 27] {
    let mut all = [[0; 3]; 27];
    let mut i = 0;
    while i < 27 {
        all[i] = [i as i32 % 3 - 1, i as i32 / 3 % 3 - 1, i as i32 / 9 - 1];
        i += 1;
    }
    all
}

const fn descent() -> [[(u8, u8); 27]; 8] {
    let mut all = [[(0, 0); 27]; 8];
    let mut child = 0;
    while child < 8 {
        let mut i = 0;
        while i < 27 {
            let (mut index, mut digit, mut a, mut stride) = (0, 0, 0, 1);
            while a < 3 {
                // In child edges from the parent's minimum corner: -1, 0, 1 or 2.
                let position = (child >> a & 1) + OFFSETS[i][a];
                index += (position.div_euclid(2) + 1) * stride;
                digit |= position.rem_euclid(2) << a;
                stride *= 3;
                a += 1;
            }
            all[child as usize][i] = (index as u8, digit as u8);
            i += 1;
        }
        child += 1;
    }
    all
}

/// The contents of an octant and of its neighbours.
#[derive(Clone, Copy, Debug)]
pub struct Neighbourhood {
    /// The octant in the middle.
    pub octant: Octant,
    /// The contents, in the order of [`OFFSETS`].
    pub handles: [Handle; 27],
}

impl Neighbourhood {
    /// The neighbourhood of the root.
    pub fn root(tree: &Tree) -> Self {
        let mut handles = [Handle::OUTSIDE_ROOT; 27];
        handles[SELF] = tree.root();
        Self { octant: Octant::ROOT, handles }
    }

    /// The neighbourhood of a child.
    pub fn child(&self, tree: &Tree, digit: u8) -> Self {
        let level = self.octant.level;
        let handles = DESCENT[usize::from(digit)]
            .map(|(index, digit)| tree.child(self.handles[usize::from(index)], digit, level));
        Self { octant: self.octant.child(digit), handles }
    }

    /// The neighbourhood of any octant, found by descent from the root.
    pub fn of(tree: &Tree, octant: Octant) -> Self {
        let mut neighbourhood = Self::root(tree);
        for level in 1..=octant.level {
            neighbourhood = neighbourhood.child(tree, octant.ancestor(level).digit());
        }
        neighbourhood
    }

    /// The content of the octant itself.
    pub fn centre(&self) -> Handle {
        self.handles[SELF]
    }

    /// The content of the neighbour at an offset in edges.
    pub fn at_offset(&self, [x, y, z]: [i32; 3]) -> Handle {
        self.handles[(SELF as i32 + x + 3 * y + 9 * z) as usize]
    }

    /// Level of the coarsest leaf in all 27 octants, deleted leaves excluded.
    pub fn coarsest_level(&self, tree: &Tree) -> u8 {
        let level = self.octant.level;
        self.handles.iter().fold(NO_LEAF, |c, &h| c.min(tree.coarsest_level(h, level)))
    }
}
