//! Cubes of one length, their corners and edges, and the isometries that lay them side by side.
//!
//! Trees are 2^30 units long, whatever the version of p4est. Faces are numbered -x, x, -y, y, -z, z, corners by the bits of x, y, z, and edges by
//! their direction and then as corners, as in p4est. A directed edge has its number, or 12 more if it runs downwards.

use contract::neighbourhood::across;

/// Length of a tree.
pub const LENGTH: i64 = 1 << 30;
/// Number of edges of a cube.
pub const EDGES: usize = 12;

/// A signed permutation of the axes, and a shift.
#[derive(Clone, Copy, Debug)]
pub struct Isometry {
    to: [usize; 3],
    is_reversed: [bool; 3],
    shift: [i64; 3],
}

impl Isometry {
    /// The minimum corner of the image of a cube; of a point, if `size` is 0.
    pub fn of_cube(&self, corner: [i64; 3], size: i64) -> [i64; 3] {
        let mut image = [0; 3];
        for axis in 0..3 {
            let along = corner[axis];
            let turned = if self.is_reversed[axis] { -along - size } else { along };
            image[self.to[axis]] = self.shift[self.to[axis]] + turned;
        }
        image
    }

    /// The isometry to the tree across the first face, which is the second face there, from the corner of the first with one number to that
    /// of the second with another: the only one that lays the cube beyond the face onto that tree. In three dimensions it is a rotation.
    pub fn gluing(dimension: usize, faces: [usize; 2], corners: [usize; 2]) -> Option<Self> {
        let [face, its] = faces;
        let beyond = across(face).map(|edges| i64::from(edges) * LENGTH);
        let low = |i: usize| low_corner(dimension, faces[i] / 2, corners[i]);
        let [from, onto] = [0, 1].map(|i| point(low(i) + ((faces[i] & 1) << (faces[i] / 2))));
        let all = ORDERS.into_iter().flat_map(|to| {
            let reversed = |bits: usize| [0, 1, 2].map(|axis| bits >> axis & 1 == 1);
            (0..8).map(move |bits| Self { to, is_reversed: reversed(bits), shift: [0; 3] })
        });
        all.map(|map| Self { shift: map.of_cube(beyond, LENGTH).map(|c| -c), ..map }).find(|map| {
            map.is_possible(dimension)
                && map.to[face / 2] == its / 2
                && map.of_cube(from, 0) == onto
        })
    }

    fn is_possible(&self, dimension: usize) -> bool {
        if dimension == 2 {
            return self.to[2] == 2 && !self.is_reversed[2];
        }
        let exchanged = (0..3).filter(|&axis| self.to[axis] != axis).count();
        let reversed = self.is_reversed.iter().filter(|&&r| r).count();
        // Two exchanged axes are a reflection; three are a rotation.
        (usize::from(exchanged == 2) + reversed).is_multiple_of(2)
    }
}

/// All orders of the axes.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// A corner on the low side of an axis, numbered among those.
fn low_corner(dimension: usize, axis: usize, number: usize) -> usize {
    let others = (0..dimension).filter(|&other| other != axis);
    others.enumerate().map(|(i, other)| (number >> i & 1) << other).sum()
}

/// A corner of a tree as a point.
pub fn point(corner: usize) -> [i64; 3] {
    [0, 1, 2].map(|axis| (corner >> axis & 1) as i64 * LENGTH)
}

/// The corner of a tree that a point is.
pub fn corner_at(point: [i64; 3]) -> usize {
    (0..3).filter(|&axis| point[axis] == LENGTH).map(|axis| 1 << axis).sum()
}

/// The directed edge from a corner to a neighbouring one.
pub fn edge_between(from: usize, to: usize) -> usize {
    let axis = (from ^ to).trailing_zeros() as usize;
    let number = (0..4).find(|&number| low_corner(3, axis, number) == from & to);
    4 * axis + number.expect("the lower corner") + if from > to { EDGES } else { 0 }
}

/// The corner in which a directed edge begins, or the one in which it ends.
pub fn edge_end(edge: usize, end: bool) -> usize {
    let axis = edge % EDGES / 4;
    low_corner(3, axis, edge % 4) + (usize::from(end != (edge >= EDGES)) << axis)
}
