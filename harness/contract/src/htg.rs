//! Hyper-tree grids in VTKHDF, as `mesher --write htg` and `harness export` write them: the leaves of a tree of any size, in Morton
//! order.
//!
//! The file has the nodes level by level ([`vtkhdf::tree`] describes it). A walk from the root down reads what each level has from its begin to
//! its end, because the children of a level's split nodes are the next level. So memory holds a chunk or two of every array for each level, whatever
//! the size of the tree. A [`Block`] of leaves is recognised by its bits: 64 of them are one word. So time grows with the blocks, not with the leaves.
//!
//! Opening a file verifies the whole structure: every node but the root has a parent, and masked nodes are leaves. Sides are verified as they are
//! read. Damage to the file itself shows in its checksums.

use crate::lattice::Root;
use crate::octant::Octant;
use crate::word::{self, Side};
use std::path::{Path, PathBuf};
use vtkhdf::format::Chunked;
pub use vtkhdf::format::ReadError as TreeError;
use vtkhdf::read::TreeReader;

/// Number of blocks that are passed on at once, at least; at most seven more.
const RUN: usize = 4096;

/// The level of the octants whose digests are in a manifest.
const OCTANT_LEVEL: usize = 3;

/// The cell data with the sides.
pub use vtkhdf::tree::SIDE;

/// All leaves of an octant, if they have one level and one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The word of the first leaf.
    pub first: u64,
    /// Number of levels from the octant down to its leaves.
    pub depth: u8,
}

impl Block {
    /// Number of leaves.
    pub fn leaves(&self) -> u64 {
        1 << (3 * self.depth)
    }

    /// The level of the octant.
    pub fn level(&self) -> u8 {
        word::level(self.first) - self.depth
    }

    /// The octant.
    pub fn octant(&self) -> Octant {
        Octant { corner: word::corner_of(word::key(self.first)), level: self.level() }
    }

    /// The difference of the words of a leaf and of the next. A word alone may be no leaf.
    pub fn step(&self) -> u64 {
        if self.depth == 0 { 0 } else { word::span(word::level(self.first)) << 7 }
    }

    /// The words of all leaves.
    pub fn words(self) -> impl Iterator<Item = u64> {
        (0..self.leaves()).map(move |i| self.first + i * self.step())
    }
}

/// Is called with some blocks; returns whether to go on.
pub type Run<'r> = &'r mut dyn FnMut(&[Block]) -> bool;

/// A hyper-tree grid whose structure was read and is valid.
#[derive(Debug)]
pub struct TreeFile {
    /// Its path.
    pub path: PathBuf,
    file: TreeReader,
    /// The root cube.
    pub root: Root,
    /// Number of leaves.
    pub leaves: u64,
}

type Result<T> = std::result::Result<T, TreeError>;

impl TreeFile {
    /// Opens a file.
    ///
    /// # Errors
    /// If the file is not a hyper-tree grid as this repository writes it.
    pub fn open(path: &Path) -> Result<Self> {
        let file = TreeReader::open(path)?;
        let root = Root { origin: file.shape.origin, edge: file.shape.edge };
        if !root.is_cube() {
            return Err(TreeError::Unknown(format!("its root is no cube: {root}")));
        }
        let mut tree = Self { path: path.to_owned(), file, root, leaves: 0 };
        tree.leaves = tree.verify()?;
        Ok(tree)
    }

    /// Verifies the structure, 64 nodes at a time; returns the number of leaves.
    fn verify(&self) -> Result<u64> {
        let (mut leaves, nodes) = (0, &self.file.shape.nodes);
        for (index, count) in nodes.iter().enumerate() {
            let (mut level, mut parents) = (self.level(index), 0);
            let end = level.next + count;
            while level.next < end {
                let count = (end - level.next).min(64);
                let [split, masked] = level.bits::<9>()?.map(|bits| bits >> (64 - count));
                if split & masked != 0 {
                    return Err(TreeError::Damaged("a node is masked and split".to_owned()));
                }
                parents += u64::from(split.count_ones());
                leaves += count - u64::from((split | masked).count_ones());
                level.next += count;
            }
            let next = nodes.get(index + 1).copied().unwrap_or(0);
            if 8 * parents != next {
                let why = format!("level {index} splits {parents} nodes, and the next has {next}");
                return Err(TreeError::Damaged(why));
            }
        }
        Ok(leaves)
    }

    /// The beginning of a level.
    fn level(&self, index: usize) -> Level<'_> {
        let (nodes, [split, masked, sides]) = (&self.file.shape.nodes, &self.file.arrays);
        let next = nodes[..index].iter().sum();
        let bytes = |array, position| Bytes::of(&self.file, array, position);
        Level {
            next,
            split: (index + 1 < nodes.len()).then(|| bytes(split, next / 8)),
            masked: bytes(masked, next / 8),
            sides: bytes(sides, next),
        }
    }

    /// Passes all leaves to `run` in Morton order, some thousands of blocks at a time, until it returns false. Blocks are as large as
    /// possible within a run, but not larger than the octants whose digests are in a manifest.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn blocks(&self, run: Run) -> Result<()> {
        let levels = (0..self.file.shape.nodes.len()).map(|index| self.level(index)).collect();
        let mut walk = Walk { levels, blocks: Vec::with_capacity(RUN + 8) };
        if walk.siblings(0, 0, 1, run)? {
            run(&walk.blocks);
        }
        Ok(())
    }
}

/// The bytes of an array from a position on, which are read once.
struct Bytes<'a> {
    file: &'a TreeReader,
    array: &'a Chunked,
    /// The next chunk to be read.
    next: usize,
    /// Bytes in memory, and the position of the first.
    bytes: Vec<u8>,
    begin: u64,
    chunk: Vec<u8>,
}

impl<'a> Bytes<'a> {
    fn of(file: &'a TreeReader, array: &'a Chunked, position: u64) -> Self {
        let chunk_len = u64::from(array.chunk_len);
        let next = (position / chunk_len) as usize;
        let begin = next as u64 * chunk_len;
        Self { file, array, next, bytes: Vec::new(), begin, chunk: Vec::new() }
    }

    /// The bytes from a position on, which must not decrease. After the array, all are zero.
    #[inline]
    fn at<const N: usize>(&mut self, position: u64) -> Result<[u8; N]> {
        if position + N as u64 > self.begin + self.bytes.len() as u64 {
            self.read(position, N)?;
        }
        let offset = (position - self.begin) as usize;
        Ok(*self.bytes[offset..].first_chunk().expect("the bytes were read"))
    }

    #[cold]
    fn read(&mut self, position: u64, count: usize) -> Result<()> {
        while position + count as u64 > self.begin + self.bytes.len() as u64 {
            let passed = self.bytes.len().min((position - self.begin) as usize);
            self.bytes.drain(..passed);
            self.begin += passed as u64;
            match self.next < self.array.chunks.len() {
                true => self.file.read_chunk(self.array, self.next, &mut self.chunk)?,
                false => self.chunk = vec![0; self.array.chunk_len as usize],
            }
            self.bytes.extend_from_slice(&self.chunk);
            self.next += 1;
        }
        Ok(())
    }

    /// The bits of `N - 1` bytes from a node on, the first of them the most significant one.
    #[inline]
    fn bits<const N: usize>(&mut self, node: u64) -> Result<u64> {
        let bytes: [u8; N] = self.at(node / 8)?;
        let all = bytes.iter().fold(0, |all: u128, &byte| all << 8 | u128::from(byte));
        Ok((all >> (8 - node % 8)) as u64 & (u64::MAX >> (64 - 8 * (N as u32 - 1))))
    }
}

/// The position of a walk on a level.
struct Level<'a> {
    next: u64,
    /// The last level has none.
    split: Option<Bytes<'a>>,
    masked: Bytes<'a>,
    sides: Bytes<'a>,
}

impl Level<'_> {
    /// The bits of the next nodes, those of split and of masked ones; the first node has the most significant bit.
    #[inline]
    fn bits<const N: usize>(&mut self) -> Result<[u64; 2]> {
        let split = self.split.as_mut().map_or(Ok(0), |split| split.bits::<N>(self.next))?;
        Ok([split, self.masked.bits::<N>(self.next)?])
    }

    /// The side of the next 64 nodes, if they are leaves with one side.
    fn side_of_64(&mut self) -> Result<Option<u8>> {
        let (bits, sides) = (self.bits::<9>()?, self.sides.at::<64>(self.next)?);
        let is_one = bits == [0; 2] && sides == [sides[0]; 64];
        Ok((is_one && usize::from(sides[0]) < Side::ALL.len()).then_some(sides[0]))
    }
}

/// A walk in Morton order.
struct Walk<'a> {
    levels: Vec<Level<'a>>,
    blocks: Vec<Block>,
}

impl Walk<'_> {
    /// Visits some siblings, or the root alone, and what is below; returns false if `run` did. The first has the Morton code `key`.
    fn siblings(&mut self, level: usize, key: u64, count: u32, run: Run) -> Result<bool> {
        let at = &mut self.levels[level];
        let [split, masked] = at.bits::<2>()?.map(|bits| bits as u8 & !(0xff >> count) as u8);
        let (first, sides) = (at.next, at.sides.at::<8>(at.next)?);
        at.next += u64::from(count);
        // A block lies in one octant of level 3.
        let may_be_block = level > OCTANT_LEVEL;
        let word = |key: u64, level: usize, side| key << 7 | (level as u64) << 2 | u64::from(side);
        if may_be_block
            && split == 0xff
            && let Some(side) = self.levels[level + 1].side_of_64()?
        {
            self.levels[level + 1].next += 64;
            self.blocks.push(Block { first: word(key, level + 1, side), depth: 2 });
        } else {
            for (i, &side) in (0..count).zip(&sides) {
                let (key, bit) = (key + u64::from(i) * word::span(level as u8), 0x80 >> i);
                if split & bit != 0 {
                    if !self.siblings(level + 1, key, 8, run)? {
                        return Ok(false);
                    }
                } else if masked & bit == 0 {
                    if usize::from(side) >= Side::ALL.len() {
                        let node = first + u64::from(i);
                        return Err(TreeError::Damaged(format!("node {node} has the side {side}")));
                    }
                    self.blocks.push(Block { first: word(key, level, side), depth: 0 });
                }
            }
            if may_be_block {
                self.join(level as u8, key);
            }
        }
        if self.blocks.len() < RUN {
            return Ok(true);
        }
        let goes_on = run(&self.blocks);
        self.blocks.clear();
        Ok(goes_on)
    }

    /// Joins the last blocks if they are eight siblings of this level, the first with this Morton code, and have leaves of one level and side.
    fn join(&mut self, level: u8, key: u64) {
        let Some((others, last)) = self.blocks.split_last_chunk::<8>() else { return };
        let Block { first, depth } = last[0];
        let is_like = |block: &Block| block.depth == depth && (block.first ^ first) & 127 == 0;
        if word::key(first) == key && last[0].level() == level && last.iter().all(is_like) {
            self.blocks.truncate(others.len());
            self.blocks.push(Block { first, depth: depth + 1 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::Octant;
    use crate::testing::words_with_sides;
    use crate::word::{Side, key, key_of, level, span};
    use std::fs;
    use tempfile::NamedTempFile;
    use vtkhdf::tree::{Shape, Siblings, TreeWriter, WINDOW, Window, groups};
    use vtkhdf::write::Deflater;

    const ROOT: Root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };

    /// The nodes of a tree, level by level.
    #[derive(Default)]
    struct Nodes {
        by_level: Vec<u64>,
        split: Vec<bool>,
        masked: Vec<bool>,
        sides: Vec<u8>,
    }

    fn nodes_of(words: &[u64]) -> Nodes {
        let (mut nodes, mut octants) = (Nodes::default(), vec![Octant::ROOT]);
        while !octants.is_empty() {
            nodes.by_level.push(octants.len() as u64);
            let mut children = Vec::new();
            for octant in octants {
                let begin = key_of(octant.corner);
                let first = words.get(words.partition_point(|&w| key(w) < begin)).copied();
                let first = first.filter(|&w| key(w) < begin + span(octant.level));
                let is_split = first.is_some_and(|w| level(w) > octant.level);
                nodes.split.push(is_split);
                nodes.masked.push(first.is_none());
                nodes.sides.push(first.filter(|_| !is_split).map_or(0, |w| (w & 3) as u8));
                children.extend((0..8).filter(|_| is_split).map(|d| octant.child(d)));
            }
            octants = children;
        }
        nodes
    }

    /// A file of these nodes.
    fn file_of(nodes: &Nodes) -> NamedTempFile {
        let file = NamedTempFile::new().unwrap();
        let shape = Shape { origin: ROOT.origin, edge: ROOT.edge, nodes: nodes.by_level.clone() };
        let mut out =
            TreeWriter::new(fs::File::create(file.path()).unwrap(), shape.clone()).unwrap();
        let siblings = |first: usize| {
            let bits = |is_set: &dyn Fn(usize) -> bool| {
                (0..8)
                    .map(|i| u64::from(nodes.sides.len() > first + i && is_set(first + i)) << i)
                    .sum()
            };
            Siblings {
                split: bits(&|node| nodes.split[node]),
                deleted: bits(&|node| nodes.masked[node]),
                crossing: bits(&|node| nodes.sides[node] & 2 != 0),
                inside: bits(&|node| nodes.sides[node] & 1 != 0),
            }
        };
        for index in 0..shape.windows() {
            let mut window = Window::new(index);
            if index == 0 {
                window.put_root(siblings(0));
            }
            for group in groups(index).take_while(|group| 8 * group + 1 < shape.nodes_total()) {
                window.put(group, siblings(1 + 8 * group as usize));
            }
            out.add(index, &window.compress(&shape, &mut Deflater::default())).unwrap();
        }
        out.finish().unwrap();
        file
    }

    /// A tree with holes and all sides.
    fn words(levels: u8) -> Vec<u64> {
        let pick = |o: &Octant, below: u64| {
            (crate::digest::mix(key_of(o.corner) << 5 | u64::from(o.level)) >> 70) as u64 % below
        };
        words_with_sides(
            |o| o.level < levels && pick(o, 10) < 9,
            |o| Side::ALL.get(pick(o, 4) as usize).copied(),
        )
    }

    fn words_in(tree: &TreeFile) -> Result<Vec<u64>> {
        let mut all = Vec::new();
        tree.blocks(&mut |run| {
            all.extend(run.iter().flat_map(|block| block.words()));
            true
        })?;
        Ok(all)
    }

    #[test]
    fn a_tree_in_several_chunks_is_read_as_a_whole() {
        let words = words(7);
        let nodes = nodes_of(&words);
        assert!(nodes.split.len() as u64 > 2 * WINDOW && nodes.by_level.len() == 8);
        let file = file_of(&nodes);
        let tree = TreeFile::open(file.path()).unwrap();
        assert_eq!((tree.root, &*tree.path), (ROOT, file.path()));
        assert_eq!(words_in(&tree).unwrap(), words);
        assert_eq!(tree.leaves, words.len() as u64);
        let (mut runs, mut read) = (0, 0);
        tree.blocks(&mut |run| {
            assert!(run.len() < RUN + 8);
            (runs, read) = (runs + 1, read + run.len());
            runs < 2
        })
        .unwrap();
        assert!(runs == 2 && read >= 2 * RUN && read < words.len());
    }

    /// Blocks are leaves of all levels, and as large as possible, but not larger than an octant of level 3.
    #[test]
    fn equal_leaves_are_read_as_blocks() {
        let words = words_with_sides(
            |o| o.level < 6 || o.level < 8 && o.corner[0] < 1 << 14,
            |o| match o.corner {
                [.., 0] => Some(Side::Crossing),
                [_, y, z] if y == z && o.corner[0] > 1 << 18 => None,
                [x, ..] => Some(if x < 1 << 16 { Side::Inside } else { Side::Outside }),
            },
        );
        let file = file_of(&nodes_of(&words));
        let tree = TreeFile::open(file.path()).unwrap();
        let (mut blocks, mut runs) = (Vec::new(), 0);
        tree.blocks(&mut |run| {
            blocks.extend_from_slice(run);
            runs += 1;
            true
        })
        .unwrap();
        assert!(blocks.iter().flat_map(|block| block.words()).eq(words.iter().copied()));
        assert!((0..4).all(|depth| blocks.iter().any(|block| block.depth == depth)));
        let is_joined = |eight: &[Block]| {
            let Block { first, depth } = eight[0];
            let octant = eight[0].octant();
            let alike = |b: &Block| b.depth == depth && (b.first ^ first) & 127 == 0;
            let siblings = |b: &Block| {
                b.octant().ancestor(octant.level - 1) == octant.ancestor(octant.level - 1)
            };
            octant.level > 3 && eight.iter().all(|b| alike(b) && siblings(b))
        };
        // The end of a run separates siblings, and those of their ancestors.
        let separate = blocks.windows(8).filter(|eight| is_joined(eight)).count();
        assert!(separate <= 6 * runs && 100 * runs < blocks.len(), "{separate} of {runs} runs");
        assert!(blocks.iter().all(|block| block.level() >= 3));
    }

    #[test]
    fn trees_of_one_leaf_and_without_leaves_are_read() {
        for (words, leaves) in [(vec![2], 1), (vec![], 0)] {
            let file = file_of(&nodes_of(&words));
            let tree = TreeFile::open(file.path()).unwrap();
            assert_eq!((words_in(&tree).unwrap(), tree.leaves), (words, leaves));
        }
    }

    #[test]
    fn a_root_that_is_no_cube_is_another_layout() {
        for edge in [0.0, -4.0, f64::NAN, f64::INFINITY] {
            let shape = Shape { origin: ROOT.origin, edge, nodes: vec![1] };
            let file = NamedTempFile::new().unwrap();
            let out = fs::File::create(file.path()).unwrap();
            TreeWriter::new(out, shape).unwrap().finish().unwrap();
            let error = TreeFile::open(file.path()).unwrap_err();
            assert!(
                matches!(&error, TreeError::Unknown(why) if why.contains("no cube")),
                "{error}"
            );
        }
    }

    #[test]
    fn nodes_that_are_no_tree_are_damage() {
        let damaged = |edit: &dyn Fn(&mut Nodes)| {
            let mut nodes = nodes_of(&words(5));
            edit(&mut nodes);
            let file = file_of(&nodes);
            let read = TreeFile::open(file.path()).and_then(|tree| words_in(&tree));
            let error = read.unwrap_err();
            assert!(matches!(error, TreeError::Damaged(_)), "{error}");
            error.to_string()
        };
        let split =
            |split: bool, nodes: &Nodes| nodes.split.iter().position(|&is| is == split).unwrap();
        let less = damaged(&|nodes| {
            let last = nodes.split.iter().rposition(|&is| is).unwrap();
            nodes.split[last] = false;
        });
        assert!(less.starts_with("is damaged: ") && less.contains("level 4 splits "), "{less}");
        let more = damaged(&|nodes| {
            let leaf = split(false, nodes);
            (nodes.split[leaf], nodes.masked[leaf]) = (true, false);
        });
        assert!(more.starts_with("is damaged: ") && more.contains(" splits "), "{more}");
        let both = damaged(&|nodes| nodes.masked[0] = true);
        assert_eq!(both, "is damaged: a node is masked and split");
        let side = damaged(&|nodes| {
            let leaf =
                (0..nodes.split.len()).find(|&i| !nodes.split[i] && !nodes.masked[i]).unwrap();
            nodes.sides[leaf] = 3;
        });
        assert!(
            side.starts_with("is damaged: node ") && side.ends_with(" has the side 3"),
            "{side}"
        );
    }
}
