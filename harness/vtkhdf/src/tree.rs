//! A hyper-tree grid of one oct-tree in VTKHDF: names and shapes of the arrays, and windows of nodes, of which each is one chunk
//! of every array.
//!
//! Nodes are the octants of the tree, leaves or not, level by level, and in Morton order within a level: node 0 is the root, and
//! the children of the split nodes follow in their order, eight at a time. `Descriptors` has one bit per node of all levels but the
//! last, which is set for split nodes, and `Mask` one bit per node, which is set for leaves that are not in the mesh. Bits
//! are packed from the most significant one. Cell data have an element for every node.

use crate::format::{Chunked, SUPERBLOCK_BYTES};
use crate::write::{Deflater, Metadata, Value, datatype};
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;

/// Nodes of a window.
pub const WINDOW: u64 = 1 << 18;
/// The cell data of sides: 0 outside, 1 inside, 2 crossing; 0 for nodes that are no leaves of the mesh.
pub const SIDE: &str = "side";
/// The member that is written first.
pub(crate) const FIRST: &str = "TreeIds";
/// The group of the file.
pub(crate) const GROUP: &str = "VTKHDF";
/// Its group of cell data.
pub(crate) const CELL_DATA: &str = "CellData";
/// Numbers of nodes by level.
pub(crate) const NODES: &str = "NumberOfCellsPerTreeDepth";
/// The array of bits of split nodes.
pub(crate) const SPLIT: &str = "Descriptors";
/// The array of bits of leaves that are not in the mesh.
pub(crate) const MASK: &str = "Mask";
/// The coordinates of the root along x, y and z.
pub(crate) const COORDINATES: [&str; 3] = ["XCoordinates", "YCoordinates", "ZCoordinates"];
/// The attribute with the edge of the root, which VTK does not read: the difference of two coordinates may have lost digits.
pub(crate) const EDGE: &str = "RootEdge";
/// Greatest number of levels.
const LEVELS_MAX: usize = 20;

/// The root and the nodes of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Minimum corner of the root.
    pub origin: [f64; 3],
    /// Edge of the root.
    pub edge: f64,
    /// Number of nodes by level, of the levels that have any.
    pub nodes: Vec<u64>,
}

impl Shape {
    /// Number of nodes of all levels.
    pub fn nodes_total(&self) -> u64 {
        self.nodes.iter().sum()
    }

    /// Whether the numbers of nodes can be those of an oct-tree: one, then eight for some of the nodes of the level above.
    pub(crate) fn is_tree(&self) -> bool {
        let fits = |w: &[u64]| w[1] > 0 && w[1].is_multiple_of(8) && w[1] / 8 <= w[0];
        let counts = &self.nodes;
        counts.first() == Some(&1) && counts.len() <= LEVELS_MAX && counts.windows(2).all(fits)
    }

    /// Number of nodes with a bit in `Descriptors`.
    pub fn nodes_described(&self) -> u64 {
        // VTK reads no empty array: a root that is a leaf has a bit, too.
        (self.nodes_total() - self.nodes.last().copied().unwrap_or(0)).max(1)
    }

    /// Number of windows.
    pub fn windows(&self) -> u64 {
        self.nodes_total().div_ceil(WINDOW)
    }
}

/// Up to eight consecutive groups of eight siblings: a bit for each node, from the lowest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Siblings {
    /// Split nodes.
    pub split: u64,
    /// Leaves that are not in the mesh.
    pub deleted: u64,
    /// Leaves that the surface crosses.
    pub crossing: u64,
    /// Leaves inside.
    pub inside: u64,
}

/// The groups of siblings with a node in a window; the first and the last may have others outside of it. The root is in no group.
pub fn groups(window: u64) -> Range<u64> {
    (window * WINDOW / 8).saturating_sub(1)..(window + 1) * WINDOW / 8
}

/// Bytes of bits before the first of a window and after the last, for groups that are partly outside.
const MARGIN: usize = 8;

/// The nodes of a window and its margins, to be filled in any order.
pub struct Window {
    index: u64,
    /// The bits of split nodes, and those of deleted ones.
    bits: [Vec<u8>; 2],
    sides: Vec<u8>,
}

/// The compressed chunks of a window: split, deleted, side; none for one that is zero.
pub type Chunks = [Option<Vec<u8>>; 3];

impl Window {
    /// The window with a number, all zero.
    pub fn new(index: u64) -> Self {
        let bytes = 2 * MARGIN + WINDOW as usize / 8;
        Self { index, bits: [vec![0; bytes], vec![0; bytes]], sides: vec![0; 8 * bytes] }
    }

    /// Sets the root, which is in the first window.
    pub fn put_root(&mut self, root: Siblings) {
        for (bits, new) in self.bits.iter_mut().zip([root.split, root.deleted]) {
            bits[MARGIN] |= (new as u8 & 1) << 7;
        }
        self.sides[8 * MARGIN] = (root.crossing as u8 & 1) << 1 | root.inside as u8 & 1;
    }

    /// Sets those nodes that are in the window, of groups that begin with this one.
    #[inline]
    pub fn put(&mut self, group: u64, siblings: Siblings) {
        let at = (group + MARGIN as u64).wrapping_sub(self.index * WINDOW / 8) as usize;
        let bytes = at..at.saturating_add(MARGIN + 1);
        if bytes.end > self.bits[0].len() {
            return;
        }
        for (bits, new) in self.bits.iter_mut().zip([siblings.split, siblings.deleted]) {
            // The first sibling is the second node of a byte, because the root is in no group.
            let new = (u128::from(new.reverse_bits()) << 63).to_be_bytes();
            bits[bytes.clone()].iter_mut().zip(new).for_each(|(bits, new)| *bits |= new);
        }
        let Siblings { crossing, inside, .. } = siblings;
        if crossing | inside != 0 {
            for (i, node) in self.sides[8 * at + 1..].iter_mut().take(64).enumerate() {
                *node |= ((crossing >> i & 1) << 1 | inside >> i & 1) as u8;
            }
        }
    }

    /// The compressed chunks.
    pub fn compress(&self, shape: &Shape, deflater: &mut Deflater) -> Chunks {
        let ([split, deleted], [of_split, of_deleted, of_sides]) = (&self.bits, lengths(shape));
        let all = [(split, of_split, 1), (deleted, of_deleted, 1), (&self.sides, of_sides, 8)];
        all.map(|(bytes, length, per_byte)| {
            let bytes = &bytes[per_byte * MARGIN..bytes.len() - per_byte * MARGIN];
            // Arrays shorter than a window have one shorter chunk.
            deflater.compress(&bytes[..bytes.len().min(length as usize)])
        })
    }
}

/// The bytes of the arrays that have a chunk per window: split, deleted, side.
fn lengths(shape: &Shape) -> [u64; 3] {
    let nodes = shape.nodes_total();
    [shape.nodes_described().div_ceil(8), nodes.div_ceil(8), nodes]
}

/// These arrays, all zero.
pub(crate) fn arrays(shape: &Shape) -> [Chunked; 3] {
    let [split, deleted, sides] = lengths(shape);
    let bits = |length| Chunked::new(length, WINDOW as u32 / 8);
    [bits(split), bits(deleted), Chunked::new(sides, WINDOW as u32)]
}

/// The metadata of a tree's file in which they begin at byte `start`; and the superblock.
pub(crate) fn metadata(shape: &Shape, arrays: &[Chunked; 3], start: u64) -> (Vec<u8>, Vec<u8>) {
    let [split, mask, side] = arrays;
    let levels = shape.nodes.len() as u64;
    let numbers = [
        (FIRST, &[0][..]),
        ("NumberOfTrees", &[1]),
        ("NumberOfDepths", &[levels]),
        ("DepthPerTree", &[levels]),
        (NODES, &shape.nodes),
        ("NumberOfCells", &[shape.nodes_total()]),
        ("DescriptorsSize", &[shape.nodes_described()]),
    ];
    let mut out = Metadata::new(start);
    let mut members: Vec<_> =
        numbers.iter().map(|(name, numbers)| (*name, out.small(&Value::ints(numbers)))).collect();
    members.push((SPLIT, out.chunked(split)));
    // Without a mask, no leaf is missing.
    if mask.chunks.iter().any(Option::is_some) {
        members.push((MASK, out.chunked(mask)));
    }
    for (name, low) in COORDINATES.into_iter().zip(shape.origin) {
        members.push((name, out.small(&Value::doubles(&[low, low + shape.edge]))));
    }
    let side = out.chunked(side);
    members.push((CELL_DATA, out.group(&[], &[(SIDE, side)])));
    let attributes = [
        ("Version", Value::ints(&[2, 8])),
        ("Type", Value::text("HyperTreeGrid")),
        ("BranchFactor", Value::number(2)),
        ("Dimensions", Value::array(datatype::INT32, &[2i32; 3].map(i32::to_le_bytes))),
        (EDGE, Value::doubles(&[shape.edge])),
    ];
    let grid = out.group(&attributes, &members);
    let root = out.group(&[], &[(GROUP, grid)]);
    out.finish(root)
}

/// A file that is being written: chunks in any order first, then the metadata.
pub struct TreeWriter<W> {
    out: W,
    end: u64,
    shape: Shape,
    arrays: [Chunked; 3],
}

impl<W: Write + Seek> TreeWriter<W> {
    /// Begins the file of a tree at the start of `out`.
    ///
    /// # Errors
    /// As `out` has.
    pub fn new(mut out: W, shape: Shape) -> io::Result<Self> {
        // Without a superblock the file is invalid until it is finished.
        out.write_all(&[0; SUPERBLOCK_BYTES])?;
        Ok(Self { out, end: SUPERBLOCK_BYTES as u64, arrays: arrays(&shape), shape })
    }

    /// Writes the chunks of a window, which [`Window::compress`] has made.
    ///
    /// # Errors
    /// As `out` has.
    pub fn add(&mut self, window: u64, chunks: &Chunks) -> io::Result<()> {
        for (array, chunk) in self.arrays.iter_mut().zip(chunks) {
            // Descriptors end before the last windows.
            if let (Some(slot), Some(chunk)) = (array.chunks.get_mut(window as usize), chunk) {
                let end = self.end + chunk.len() as u64;
                *slot = Some(self.end..end);
                self.out.write_all(chunk)?;
                self.end = end;
            }
        }
        Ok(())
    }

    /// Completes the file, and returns `out`.
    ///
    /// # Errors
    /// As `out` has.
    pub fn finish(mut self) -> io::Result<W> {
        let (metadata, superblock) = metadata(&self.shape, &self.arrays, self.end);
        self.out.write_all(&metadata)?;
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&superblock)?;
        self.out.flush()?;
        Ok(self.out)
    }
}
