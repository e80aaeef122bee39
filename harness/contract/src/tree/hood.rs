//! An octant together with the 26 places around it.

use super::{Handle, NO_LEAF, Tree};
use crate::octant::Octant;

/// Index of the octant itself among the 27.
const SELF: usize = 13;

/// Where each of the 27 places lies, in edges of the octant.
pub const OFFSETS: [[i32; 3]; 27] = offsets();

/// For each child and each of its 27 places: the parent's place that holds it, and the digit there.
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
            let (mut place, mut digit, mut a, mut stride) = (0, 0, 0, 1);
            while a < 3 {
                // Counted in child edges from the parent's minimum corner: -1, 0, 1 or 2.
                let at = (child >> a & 1) + OFFSETS[i][a];
                place += (at.div_euclid(2) + 1) * stride;
                digit |= at.rem_euclid(2) << a;
                stride *= 3;
                a += 1;
            }
            all[child as usize][i] = (place as u8, digit as u8);
            i += 1;
        }
        child += 1;
    }
    all
}

/// An octant of the tree and what surrounds it.
#[derive(Clone, Copy, Debug)]
pub struct Hood {
    /// The octant in the middle.
    pub octant: Octant,
    /// What is at each place, in the order of [`OFFSETS`].
    pub around: [Handle; 27],
}

impl Hood {
    /// The root, which nothing surrounds.
    pub fn root(tree: &Tree) -> Self {
        let mut around = [Handle::BEYOND; 27];
        around[SELF] = tree.root();
        Self { octant: Octant::ROOT, around }
    }

    /// The hood of a child.
    pub fn child(&self, tree: &Tree, digit: u8) -> Self {
        let level = self.octant.level;
        let around = DESCENT[usize::from(digit)]
            .map(|(place, digit)| tree.child(self.around[usize::from(place)], digit, level));
        Self { octant: self.octant.child(digit), around }
    }

    /// What lies across a child's face: on the low (-1) or high (1) side of an axis.
    pub fn across(&self, tree: &Tree, digit: u8, axis: usize, by: i32) -> Handle {
        let place = (SELF as i32 + by * [1, 3, 9][axis]) as usize;
        let (place, at) = DESCENT[usize::from(digit)][place];
        tree.child(self.around[usize::from(place)], at, self.octant.level)
    }

    /// The hood of any octant, by descent from the root.
    pub fn at(tree: &Tree, octant: Octant) -> Self {
        let mut hood = Self::root(tree);
        for level in 1..=octant.level {
            hood = hood.child(tree, octant.ancestor(level).digit());
        }
        hood
    }

    /// What is at the octant itself.
    pub fn centre(&self) -> Handle {
        self.around[SELF]
    }

    /// What is at a place given by its offset.
    pub fn place(&self, by: [i32; 3]) -> Handle {
        self.around[(13 + by[0] + 3 * by[1] + 9 * by[2]) as usize]
    }

    /// Level of the coarsest leaf in all 27 places.
    pub fn coarsest_level(&self, tree: &Tree) -> u8 {
        let level = self.octant.level;
        self.around.iter().fold(NO_LEAF, |c, &h| c.min(tree.coarsest_level(h, level)))
    }
}
