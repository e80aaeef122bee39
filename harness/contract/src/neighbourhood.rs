//! An octant together with its 26 neighbours of the same level.

use crate::octant::Octant;
use crate::tree::{Handle, Tree};
use std::array;
use std::sync::LazyLock;

/// Index of the octant itself among the 27 octants.
const SELF: usize = 13;

/// Offsets of the 27 octants from the one in the middle, in edges.
pub static OFFSETS: LazyLock<[[i32; 3]; 27]> = LazyLock::new(|| {
    array::from_fn(|i| [i as i32 % 3 - 1, i as i32 / 3 % 3 - 1, i as i32 / 9 - 1])
});

/// For each child and each of its 27 neighbours: the index of the neighbour's parent in the parent's
/// neighbourhood, and the neighbour's digit.
static DESCENT: LazyLock<[[(usize, u8); 27]; 8]> = LazyLock::new(|| {
    array::from_fn(|child| {
        OFFSETS.map(|offset| {
            // In child edges from the parent's minimum corner: -1, 0, 1 or 2.
            let position = [0, 1, 2].map(|a| (child as i32 >> a & 1) + offset[a]);
            let digit = (0..3).map(|a| position[a].rem_euclid(2) << a).sum::<i32>();
            (index(position.map(|p| p.div_euclid(2))), digit as u8)
        })
    })
});

/// The index of the octant at an offset in edges.
fn index([x, y, z]: [i32; 3]) -> usize {
    (SELF as i32 + x + 3 * y + 9 * z) as usize
}

/// The offset of the octant across a face. Faces are numbered -x, x, -y, y, -z, z.
pub fn across(face: usize) -> [i32; 3] {
    array::from_fn(|a| if a == face / 2 { 2 * (face as i32 % 2) - 1 } else { 0 })
}

/// The contents of an octant and of its neighbours.
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
        handles[SELF] = tree.root;
        Self { octant: Octant::ROOT, handles }
    }

    /// The neighbourhood of a child.
    pub fn child(&self, tree: &Tree, digit: u8) -> Self {
        let handles = DESCENT[usize::from(digit)]
            .map(|(index, digit)| tree.child(self.handles[index], digit, self.octant.level));
        Self { octant: self.octant.child(digit), handles }
    }

    /// The content across a face of a child.
    pub fn across(&self, tree: &Tree, digit: u8, face: usize) -> Handle {
        let (index, digit) = DESCENT[usize::from(digit)][index(across(face))];
        tree.child(self.handles[index], digit, self.octant.level)
    }

    /// The neighbourhood of any octant, found by descent from the root.
    pub fn of(tree: &Tree, octant: Octant) -> Self {
        let digits = (1..=octant.level).map(|level| octant.ancestor(level).digit());
        digits.fold(Self::root(tree), |around, digit| around.child(tree, digit))
    }

    /// The content of the octant itself.
    pub fn centre(&self) -> Handle {
        self.handles[SELF]
    }

    /// The content across a face.
    pub fn at_face(&self, face: usize) -> Handle {
        self.handles[index(across(face))]
    }
}

/// An open box, in level-19 cells.
pub struct Region {
    low: [i64; 3],
    high: [i64; 3],
}

impl Region {
    /// All of an octant.
    pub const WHOLE: [[u8; 3]; 2] = [[0; 3], [255; 3]];

    /// A part of an octant, given by the first and the last 256th of its edge on each axis, enlarged on both sides of each axis by the margin for
    /// that axis.
    pub fn around(octant: &Octant, [first, last]: [[u8; 3]; 2], margins: [i64; 3]) -> Self {
        let edge = i64::from(octant.edge());
        let corner = octant.corner.map(i64::from);
        // Rounded outwards to whole cells.
        let low = |a: usize| (edge * i64::from(first[a])) >> 8;
        let high = |a: usize| (edge * (1 + i64::from(last[a])) + 255) >> 8;
        Self {
            low: array::from_fn(|a| corner[a] + low(a) - margins[a]),
            high: array::from_fn(|a| corner[a] + high(a) + margins[a]),
        }
    }

    /// Whether the boxes have a common point.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|a| other.low[a] < self.high[a] && self.low[a] < other.high[a])
    }
}
