//! One piece of an unstructured grid: its leaves as hexahedra, compressed.
//!
//! Coinciding corners of leaves are one point within a piece. A hanging node is a point of the finer cells only.
//!
//! An array is stored in blocks, each compressed by zlib (`vtkZLibDataCompressor`): a header of 64-bit numbers - blocks, bytes per block, bytes of
//! the last block if it is shorter and otherwise 0, and the compressed bytes of each - followed by the compressed blocks.

use bytemuck::NoUninit;
use contract::digest::Digest;
use contract::lattice::Root;
use contract::mesh::Leaf;
use contract::word::{self, Order};
use libdeflater::{CompressionLvl, Compressor};

use super::Array;
use crate::points::{Points, to_user};

/// VTK's number of the cell type hexahedron.
const HEXAHEDRON: u8 = 12;
/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A piece in the form in which it is written.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Number of points.
    pub points: u64,
    /// Number of cells.
    pub cells: u64,
    /// Position of each array in the appended data, or in the piece's.
    pub offsets: Vec<u64>,
    /// The compressed arrays.
    pub bytes: Vec<u8>,
}

/// Encodes pieces one after the other. New memory for every piece would cost a page fault per page.
#[derive(Default)]
pub struct Encoder {
    /// The leaves of the next piece, which are in Morton order.
    pub leaves: Vec<Leaf>,
    /// The number of cells of all pieces.
    pub cells: u64,
    order: Order,
    /// The digest of their leaves.
    pub digest: Digest,
    points: Points,
    /// Eight points for each leaf, in VTK's order.
    connectivity: Vec<u32>,
    zlib: Zlib,
}

impl Encoder {
    /// Encodes the leaves, and removes them.
    pub fn encode(&mut self, root: &Root, arrays: &[Array]) -> Piece {
        self.connect();
        self.check_invariants();
        for Leaf { octant, side, .. } in &self.leaves {
            let word = word::encode(*octant, *side);
            self.order.add(word).expect("leaves are in order");
            self.digest.add(word);
        }
        self.cells += self.leaves.len() as u64;
        let Self { leaves, points, connectivity, zlib, .. } = self;
        let points = &points.all;
        let edge = |leaf: &Leaf| root.edge_of(leaf.octant.level);
        let cells = 0..leaves.len();
        let (mut bytes, mut offsets) = (Vec::new(), Vec::new());
        for (_, name, _) in arrays {
            offsets.push(bytes.len() as u64);
            let to = &mut bytes;
            match *name {
                "Points" => zlib.append(points.iter().map(|at| to_user(at, root)), to),
                "connectivity" => zlib.append(connectivity.iter().map(|&i| u64::from(i)), to),
                "offsets" => zlib.append(cells.clone().map(|i| 8 * (i as u64 + 1)), to),
                "types" => zlib.append(cells.clone().map(|_| HEXAHEDRON), to),
                "level" => zlib.append(leaves.iter().map(|leaf| leaf.octant.level), to),
                "rank" => zlib.append(leaves.iter().map(|leaf| leaf.rank), to),
                "spacing" => zlib.append(leaves.iter().map(edge), to),
                "id" => zlib.append(leaves.iter().map(|leaf| leaf.index), to),
                _ => zlib.append(leaves.iter().map(|leaf| leaf.side as u8), to),
            }
        }
        leaves.clear();
        Piece { points: points.len() as u64, cells: cells.len() as u64, offsets, bytes }
    }

    /// Finds the points.
    fn connect(&mut self) {
        self.points.clear();
        self.connectivity.clear();
        for Leaf { octant, .. } in &self.leaves {
            let (low, edge) = (octant.corner, octant.edge());
            let corners = CORNERS.map(|corner| [0, 1, 2].map(|a| low[a] + edge * corner[a]));
            self.connectivity.extend(corners.map(|corner| self.points.add(corner)));
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

/// Bytes per block before compression: a whole number of points, of numbers and of cells. Larger blocks gain nothing, because
/// zlib looks back 32 KiB.
const BLOCK: usize = 24 << 12;

/// A compressor and its memory.
struct Zlib {
    compressor: Compressor,
    block: Vec<u8>,
}

impl Default for Zlib {
    fn default() -> Self {
        // Level 2 takes a quarter more time and gains 6 %, and no level gains more than 8 %.
        let level = CompressionLvl::new(1).expect("a level from 0 to 12");
        Self { compressor: Compressor::new(level), block: vec![0; BLOCK] }
    }
}

impl Zlib {
    /// Appends an array of values.
    fn append<T: NoUninit>(&mut self, mut all: impl ExactSizeIterator<Item = T>, to: &mut Vec<u8>) {
        const { assert!(BLOCK.is_multiple_of(size_of::<T>())) };
        let bytes = all.len() * size_of::<T>();
        let mut numbers = vec![bytes.div_ceil(BLOCK), BLOCK, bytes % BLOCK];
        let header = to.len();
        to.resize(header + 8 * (numbers.len() + numbers[0]), 0);
        for begin in (0..bytes).step_by(BLOCK) {
            let block = &mut self.block[..BLOCK.min(bytes - begin)];
            let slots = block.chunks_exact_mut(size_of::<T>()).zip(&mut all);
            slots.for_each(|(slot, value)| slot.copy_from_slice(bytemuck::bytes_of(&value)));
            let start = to.len();
            to.resize(start + self.compressor.zlib_compress_bound(block.len()), 0);
            let written = self.compressor.zlib_compress(block, &mut to[start..]);
            numbers.push(written.expect("the bound suffices"));
            to.truncate(start + numbers[numbers.len() - 1]);
        }
        for (slot, number) in to[header..].chunks_exact_mut(8).zip(numbers) {
            slot.copy_from_slice(&(number as u64).to_le_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_of};
    use libdeflater::Decompressor;
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

    #[test]
    fn an_array_is_the_content_of_its_blocks() {
        let mut zlib = Zlib::default();
        for count in [0, 1, 5, BLOCK / 8 - 1, BLOCK / 8, BLOCK / 8 + 1, BLOCK / 4] {
            let values = |i: usize| (i * i) as u64;
            let mut out = b"before".to_vec();
            zlib.append((0..count).map(values), &mut out);
            let mut number = out[6..].chunks(8).map(|b| u64::from_le_bytes(b.try_into().unwrap()));
            let mut next = || number.next().unwrap() as usize;
            let (blocks, size, last) = (next(), next(), next());
            assert_eq!((size, last), (BLOCK, 8 * count % BLOCK));
            let (mut at, mut content) = (6 + 8 * (3 + blocks), Vec::new());
            for block in 0..blocks {
                let (compressed, is_last) = (next(), block == blocks - 1);
                let mut bytes = vec![0; if is_last && last > 0 { last } else { size }];
                let from = &out[at..at + compressed];
                assert_eq!(Decompressor::new().zlib_decompress(from, &mut bytes), Ok(bytes.len()));
                content.extend(bytes);
                at += compressed;
            }
            assert_eq!(at, out.len());
            let expected: Vec<u64> = (0..count).map(values).collect();
            assert!(content == bytemuck::cast_slice::<u64, u8>(&expected));
        }
    }
}
