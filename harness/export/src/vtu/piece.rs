//! One piece of an unstructured grid: its leaves as hexahedra, compressed.
//!
//! Coinciding corners of leaves are one point within a piece. A hanging node is a point of the finer cells only.

use contract::digest::Digest;
use contract::mesh::Leaf;
use contract::octant::UNITS_PER_CELL;
use contract::word;

use super::Content;
use super::zlib::Zlib;
use crate::options::Written;
use crate::points::{Point, Points};

/// VTK's number of the cell type hexahedron.
const HEXAHEDRON: u8 = 12;
/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A piece in the form in which it is written.
#[derive(Clone, Debug, Default)]
pub struct Piece {
    /// Number of points.
    pub points: u64,
    /// The cells.
    pub written: Written,
    /// Position of each array in the appended data, or in the piece's.
    pub offsets: Vec<u64>,
    /// Digest of the leaves.
    pub digest: Digest,
    /// The compressed arrays.
    pub bytes: Vec<u8>,
}

/// The memory of a thread that encodes pieces. New memory for every piece would cost a page fault per page.
#[derive(Default)]
pub struct Encoder {
    /// The leaves of the next piece, which are in Morton order.
    pub leaves: Vec<Leaf>,
    points: Points,
    /// Eight points for each leaf, in VTK's order.
    connectivity: Vec<u32>,
    zlib: Zlib,
}

impl Encoder {
    /// Encodes the leaves, and removes them.
    pub fn encode(&mut self, content: &Content) -> Piece {
        self.connect();
        self.check_invariants();
        let (mut written, mut digest) = (Written::default(), Digest::default());
        for Leaf { octant, side, .. } in &self.leaves {
            written.add(octant, true);
            digest.add(word::encode(&word::Leaf { octant: *octant, side: *side }));
        }
        let Self { leaves, points, connectivity, zlib } = self;
        let (root, points) = (content.root, &points.all);
        let edge = |leaf: &Leaf| root.edge / f64::from(1u32 << leaf.octant.level);
        let point = |at: &Point| {
            root.to_user(at.map(|c| i64::from(c) * UNITS_PER_CELL)).map(f64::to_le_bytes)
        };
        let cells = 0..leaves.len();
        let (mut bytes, mut offsets) = (Vec::new(), Vec::new());
        for (_, name, _) in &content.arrays {
            offsets.push(bytes.len() as u64);
            let to = &mut bytes;
            match *name {
                "Points" => zlib.append(points.iter().map(point), to),
                "connectivity" => {
                    zlib.append(connectivity.iter().map(|&i| [u64::from(i).to_le_bytes()]), to)
                }
                "offsets" => zlib
                    .append(cells.clone().map(|i| [8 * (i as u64 + 1)].map(u64::to_le_bytes)), to),
                "types" => zlib.append(cells.clone().map(|_| [[HEXAHEDRON]]), to),
                "level" => zlib.append(leaves.iter().map(|leaf| [[leaf.octant.level]]), to),
                "rank" => zlib.append(leaves.iter().map(|leaf| [leaf.rank.to_le_bytes()]), to),
                "spacing" => zlib.append(leaves.iter().map(|leaf| [edge(leaf).to_le_bytes()]), to),
                "id" => zlib.append(leaves.iter().map(|leaf| [leaf.index.to_le_bytes()]), to),
                _ => zlib.append(leaves.iter().map(|leaf| [[leaf.side as u8]]), to),
            }
        }
        leaves.clear();
        Piece { points: points.len() as u64, written, offsets, digest, bytes }
    }

    /// Finds the points.
    fn connect(&mut self) {
        self.points.clear();
        self.connectivity.clear();
        for Leaf { octant, .. } in &self.leaves {
            let (low, edge) = (octant.corner, octant.edge());
            let number =
                |corner: [u32; 3]| self.points.add([0, 1, 2].map(|a| low[a] + edge * corner[a]));
            self.connectivity.extend(CORNERS.map(number));
        }
    }

    /// Asserts that every cell has eight points, of which the first and the seventh are its lowest and its highest corner, and that the
    /// last point is that of a cell.
    ///
    /// # Panics
    /// If that is not so.
    fn check_invariants(&self) {
        let Self { leaves, points, connectivity, .. } = self;
        assert_eq!(connectivity.len(), 8 * leaves.len(), "eight points per cell");
        for (Leaf { octant, .. }, corners) in leaves.iter().zip(connectivity.chunks_exact(8)) {
            let [low, high] = [0, 6].map(|i| points.all[corners[i] as usize]);
            let expected = octant.corner.map(|c| c + octant.edge());
            assert!(low == octant.corner && high == expected, "{octant} from {low:?} to {high:?}");
        }
        let last = connectivity.iter().max().map_or(0, |last| *last as usize + 1);
        assert_eq!(last, points.all.len(), "points of cells and all points");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_of};
    use proptest::prelude::*;

    fn leaves_of(words: &[u64]) -> Vec<Leaf> {
        let leaf =
            |&w: &u64| Leaf { octant: word::octant(w), side: word::side(w), rank: 0, index: 0 };
        words.iter().map(leaf).collect()
    }

    /// Every vertex of a cell is the point at that corner of its leaf, and no two points coincide.
    fn check(words: &[u64]) -> Encoder {
        let leaves = leaves_of(words);
        // What is left of another piece has no effect.
        let mut encoder =
            Encoder { leaves: leaves[leaves.len() / 2..].to_vec(), ..Encoder::default() };
        encoder.connect();
        encoder.leaves = leaves;
        encoder.connect();
        assert_eq!(encoder.connectivity.len(), 8 * words.len());
        for (vertices, Leaf { octant, .. }) in encoder.connectivity.chunks(8).zip(&encoder.leaves) {
            for (&vertex, c) in vertices.iter().zip(CORNERS) {
                let corner = [0, 1, 2].map(|a| octant.corner[a] + octant.edge() * c[a]);
                assert_eq!(encoder.points.all[vertex as usize], corner);
            }
        }
        let mut distinct = encoder.points.all.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), encoder.points.all.len());
        encoder
    }

    #[test]
    fn planted_wrong_points_are_noticed() {
        let noticed = |why: &str, change: &dyn Fn(&mut Encoder)| {
            let leaves = leaves_of(&words_of(|o| o.level < 2));
            let mut encoder = Encoder { leaves, ..Encoder::default() };
            encoder.connect();
            encoder.check_invariants();
            change(&mut encoder);
            let check = std::panic::AssertUnwindSafe(|| encoder.check_invariants());
            let caught = std::panic::catch_unwind(check).unwrap_err();
            let message = caught.downcast_ref::<String>().unwrap();
            assert!(message.contains(why), "{message}");
        };
        noticed("eight points", &|e| e.connectivity.truncate(500));
        noticed("from [", &|e| e.connectivity.swap(0, 1));
        noticed("from [", &|e| e.points.all[40][0] += 1);
        noticed("all points", &|e| e.points.all.push([0; 3]));
    }

    #[test]
    fn leaves_of_one_level_have_a_lattice_of_points() {
        for level in 0..5 {
            let encoder = check(&words_of(|o| o.level < level));
            assert_eq!(encoder.points.all.len(), ((1 << level) + 1usize).pow(3));
        }
    }

    #[test]
    fn blocks_of_different_levels_share_points() {
        for level in 2..6 {
            check(&words_of(|o| o.level < 2 || o.level < level && o.corner[0] == 0));
        }
    }

    proptest! {
        #[test]
        fn vertices_are_the_corners_of_leaves(words in random_words(5)) {
            check(&words);
        }
    }
}
