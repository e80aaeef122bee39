//! One piece of an unstructured grid: its leaves as hexahedra, compressed.
//!
//! Coinciding corners of leaves are one point within a piece. A hanging node is a point of the finer cells only.

use contract::digest::Digest;
use contract::lattice::Root;
use contract::octant::CELLS_PER_EDGE;
use contract::word;

use super::header::{Content, Place};
use super::points::{Points, unpacked};
use super::zlib::Zlib;
use crate::leaf::Leaf;
use crate::written::Written;

/// VTK's number of the cell type hexahedron.
const HEXAHEDRON: u8 = 12;

/// A piece in the form in which it is written.
#[derive(Debug, Default)]
pub struct Encoded {
    /// Number of points.
    pub points: u64,
    /// The cells.
    pub written: Written,
    /// Digest of the leaves.
    pub digest: Digest,
    /// Position of each array in `bytes`, in the order in which `header` lists the arrays.
    pub offsets: Vec<u64>,
    /// The compressed arrays.
    pub bytes: Vec<u8>,
}

/// The memory of a thread that encodes pieces. New memory for every piece would cost a page fault per page.
#[derive(Default)]
pub struct Encoder {
    /// The leaves of the piece.
    pub leaves: Vec<Leaf>,
    points: Points,
    zlib: Zlib,
}

impl Encoder {
    /// Encodes the leaves with the arrays that the content has.
    pub fn encode(&mut self, content: &Content) -> Encoded {
        let Content { root, with_ranks, with_sides, .. } = content;
        let Self { leaves, points, zlib } = self;
        points.set(leaves);
        points.check_invariants(leaves);
        let cells = leaves.len();
        let mut to = Encoded { points: points.packed.len() as u64, ..Encoded::default() };
        for leaf in leaves.iter() {
            to.written.add(&leaf.octant, true);
            to.digest.add(word::encode(&word::Leaf { octant: leaf.octant, side: leaf.side }));
        }
        let edges = |leaf: &Leaf| root.edge / f64::from(1u32 << leaf.octant.level);
        let connectivity = points.connectivity.iter();
        to.push(zlib, points.packed.len(), points.packed.iter().map(|&p| point(p, root)));
        to.push(zlib, 8 * cells, connectivity.map(|&i| u64::from(i).to_le_bytes()));
        to.push(zlib, cells, (1..=cells as u64).map(|cell| (8 * cell).to_le_bytes()));
        to.push(zlib, cells, (0..cells).map(|_| [HEXAHEDRON]));
        to.push(zlib, cells, leaves.iter().map(|leaf| [leaf.octant.level]));
        if *with_ranks {
            to.push(zlib, cells, leaves.iter().map(|leaf| leaf.rank.to_le_bytes()));
        }
        to.push(zlib, cells, leaves.iter().map(|leaf| edges(leaf).to_le_bytes()));
        to.push(zlib, cells, leaves.iter().map(|leaf| leaf.index.to_le_bytes()));
        if *with_sides {
            to.push(zlib, cells, leaves.iter().map(|leaf| [leaf.side as u8]));
        }
        to
    }
}

impl Encoded {
    /// Its place if its bytes begin at `start` of the appended data.
    pub fn place(&self, start: u64) -> Place {
        let offsets = self.offsets.iter().map(|offset| start + offset).collect();
        Place { points: self.points, cells: self.written.cells, offsets }
    }

    fn push<const N: usize>(
        &mut self,
        zlib: &mut Zlib,
        count: usize,
        values: impl Iterator<Item = [u8; N]>,
    ) {
        self.offsets.push(self.bytes.len() as u64);
        zlib.append(count, values, &mut self.bytes);
    }
}

/// Coordinates of a packed corner in the units of the geometry, as bytes.
fn point(packed: u64, root: &Root) -> [u8; 24] {
    let step = root.edge / f64::from(CELLS_PER_EDGE);
    let mut bytes = [0; 24];
    for (axis, cells) in unpacked(packed).into_iter().enumerate() {
        let coordinate = root.origin[axis] + f64::from(cells) * step;
        bytes[8 * axis..][..8].copy_from_slice(&coordinate.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::points::packed;
    use super::*;

    #[test]
    fn packed_corners_have_the_coordinates_of_the_geometry() {
        let root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };
        for (corner, expected) in [
            ([0, 0, 0], [-1.0, 0.0, 2.0]),
            ([CELLS_PER_EDGE, 0, 0], [3.0, 0.0, 2.0]),
            ([0, CELLS_PER_EDGE / 2, CELLS_PER_EDGE], [-1.0, 2.0, 6.0f64]),
        ] {
            assert_eq!(
                point(packed(corner), &root),
                *expected.map(f64::to_le_bytes).as_flattened()
            );
        }
    }
}
