//! One piece of an unstructured grid: its leaves as hexahedra, compressed.
//!
//! Coinciding corners of leaves are one point within a piece. A hanging node is a point of the finer cells only.

use contract::digest::Digest;
use contract::lattice::Root;
use contract::octant::CELLS_PER_EDGE;
use contract::word;
use rustc_hash::FxHashMap;

use super::zlib;
use crate::mesh::Leaf;

/// VTK's number of the cell type hexahedron.
const HEXAHEDRON: u8 = 12;
/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A piece in the form in which it is written.
#[derive(Debug, Default)]
pub struct Encoded {
    /// Number of points.
    pub points: u64,
    /// Number of cells.
    pub cells: u64,
    /// Digest of the leaves.
    pub digest: Digest,
    /// Position of each array in `bytes`, in the order of [`super::header::ARRAYS`].
    pub offsets: Vec<u64>,
    /// The compressed arrays.
    pub bytes: Vec<u8>,
}

/// Encodes leaves; `with_sides` is whether their sides are known.
pub fn encode(leaves: &[Leaf], root: &Root, with_sides: bool) -> Encoded {
    let (points, connectivity) = number_corners(leaves);
    let mut encoded =
        Encoded { points: points.len() as u64, cells: leaves.len() as u64, ..Encoded::default() };
    for leaf in leaves {
        encoded.digest.add(word::encode(&word::Leaf { octant: leaf.octant, side: leaf.side }));
    }
    let edge = |leaf: &Leaf| root.edge / f64::from(1u32 << leaf.octant.level);
    encoded.push(coordinates(&points, root));
    encoded.push(connectivity.iter().flat_map(|&i| u64::from(i).to_le_bytes()));
    encoded.push((1..=leaves.len() as u64).flat_map(|i| (8 * i).to_le_bytes()));
    encoded.push(leaves.iter().map(|_| HEXAHEDRON));
    encoded.push(leaves.iter().map(|leaf| leaf.octant.level));
    encoded.push(leaves.iter().flat_map(|leaf| leaf.part.to_le_bytes()));
    encoded.push(leaves.iter().flat_map(|leaf| edge(leaf).to_le_bytes()));
    encoded.push(leaves.iter().flat_map(|leaf| leaf.index.to_le_bytes()));
    if with_sides {
        encoded.push(leaves.iter().map(|leaf| leaf.side as u8));
    }
    encoded
}

impl Encoded {
    fn push(&mut self, array: impl Iterator<Item = u8>) {
        self.offsets.push(self.bytes.len() as u64);
        zlib::append(&array.collect::<Vec<u8>>(), &mut self.bytes);
    }
}

/// The points of a piece, packed, in the order in which cells use them first; and eight points for each cell.
fn number_corners(leaves: &[Leaf]) -> (Vec<u64>, Vec<u32>) {
    let mut numbers = FxHashMap::default();
    let mut points = Vec::new();
    let mut connectivity = Vec::with_capacity(8 * leaves.len());
    for Leaf { octant, .. } in leaves {
        for c in CORNERS {
            let corner = packed([0, 1, 2].map(|a| octant.corner[a] + octant.edge() * c[a]));
            connectivity.push(*numbers.entry(corner).or_insert_with(|| {
                points.push(corner);
                points.len() as u32 - 1
            }));
        }
    }
    (points, connectivity)
}

/// A corner as one number, 20 bits per axis: lattice coordinates range from 0 to 2^19 inclusive.
fn packed(corner: [u32; 3]) -> u64 {
    corner.iter().rev().fold(0, |p, &c| p << 20 | u64::from(c))
}

/// Coordinates of packed corners in the units of the geometry, as bytes.
fn coordinates(points: &[u64], root: &Root) -> impl Iterator<Item = u8> {
    let step = root.edge / f64::from(CELLS_PER_EDGE);
    let along = move |p: u64, a: usize| root.origin[a] + (p >> (20 * a) & 0xf_ffff) as f64 * step;
    points.iter().flat_map(move |&p| [0, 1, 2].map(|a| along(p, a).to_le_bytes())).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_corners_have_the_coordinates_of_the_geometry() {
        let root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };
        let corners = [[0, 0, 0], [CELLS_PER_EDGE, 0, 0], [0, CELLS_PER_EDGE / 2, CELLS_PER_EDGE]];
        let bytes: Vec<u8> = coordinates(&corners.map(packed), &root).collect();
        let found: Vec<f64> =
            bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(found, [-1.0, 0.0, 2.0, 3.0, 0.0, 2.0, -1.0, 2.0, 6.0]);
    }
}
