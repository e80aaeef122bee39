//! Hyper-tree grids in VTKHDF, as `mesher --write htg` and `harness export` write them: the leaves of a tree of any size, in Morton
//! order.
//!
//! The file has the nodes level by level ([`vtkhdf::tree`] describes it). Its bits, of which nodes are split and which leaves are not in the mesh,
//! are in memory, at most 0.3 bytes per leaf. Sides are not: a walk from the root down reads those of each level once from its begin to its
//! end, because the children of a level's split nodes are the next level. So one chunk of them is in memory for each level.
//!
//! Opening a file verifies the whole structure: every node but the root has a parent, and masked nodes are leaves. Sides are verified as they are
//! read. Damage to the file itself shows in its checksums.

use crate::lattice::Root;
use crate::word;
use std::ops::Range;
use std::path::{Path, PathBuf};
use vtkhdf::format::Chunked;
pub use vtkhdf::format::ReadError as TreeError;
use vtkhdf::read::TreeReader;

/// Number of words that are passed on at once, at least; at most seven more.
const RUN: usize = 4096;

/// The cell data with the sides.
pub use vtkhdf::tree::SIDE;

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
    /// The nodes of each level.
    levels: Vec<Range<u64>>,
    split: Bits,
    /// Leaves that are not in the mesh.
    masked: Bits,
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
        let (mut levels, mut end) = (Vec::new(), 0);
        for count in &file.shape.nodes {
            levels.push(end..end + count);
            end += count;
        }
        let described = levels.last().map_or(0, |last| last.start);
        let split = Bits::read(&file, &file.split, described)?;
        let masked = Bits::read(&file, &file.masked, end)?;
        if split.0.iter().zip(&masked.0).any(|(split, masked)| split & masked != 0) {
            return Err(TreeError::Damaged("a node is masked and split".to_owned()));
        }
        let mut leaves = end - masked.ones(0..end);
        for (level, pair) in levels.windows(2).enumerate() {
            let (parents, children) = (split.ones(pair[0].clone()), pair[1].end - pair[1].start);
            leaves -= parents;
            if 8 * parents != children {
                let why = format!(
                    "{parents} nodes of level {level} are split, and {children} are on the next"
                );
                return Err(TreeError::Damaged(why));
            }
        }
        Ok(Self { path: path.to_owned(), file, root, leaves, levels, split, masked })
    }

    /// Passes the words of all leaves to `run` in Morton order, some thousands at a time, until it returns false.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn words(&self, run: &mut dyn FnMut(&[u64]) -> bool) -> Result<()> {
        let level = |nodes: &Range<u64>| Level { next: nodes.start, ..Level::default() };
        let levels = self.levels.iter().map(level).collect();
        let mut walk = Walk { tree: self, levels, words: Vec::with_capacity(RUN + 8) };
        if walk.siblings(0, 0, 1, run)? {
            run(&walk.words);
        }
        Ok(())
    }
}

/// The position of a walk on a level.
#[derive(Default)]
struct Level {
    next: u64,
    /// The chunk of sides in memory, and the number of its first node.
    sides: Vec<u8>,
    first: u64,
}

/// A walk in Morton order.
struct Walk<'a> {
    tree: &'a TreeFile,
    levels: Vec<Level>,
    words: Vec<u64>,
}

impl Walk<'_> {
    /// Visits some siblings, or the root alone, and what is below; returns false if `run` did. The first has the Morton code `key`.
    fn siblings(
        &mut self,
        level: usize,
        key: u64,
        count: u32,
        run: &mut dyn FnMut(&[u64]) -> bool,
    ) -> Result<bool> {
        let first = self.levels[level].next;
        self.levels[level].next += u64::from(count);
        let [split, masked] =
            [&self.tree.split, &self.tree.masked].map(|bits| bits.get(first, count));
        for i in 0..count {
            let key = key + u64::from(i) * word::span(level as u8);
            if split >> i & 1 == 1 {
                if !self.siblings(level + 1, key, 8, run)? {
                    return Ok(false);
                }
            } else if masked >> i & 1 == 0 {
                let side = self.side(level, first + u64::from(i))?;
                self.words.push(key << 7 | (level as u64) << 2 | u64::from(side));
            }
        }
        if self.words.len() < RUN {
            return Ok(true);
        }
        let goes_on = run(&self.words);
        self.words.clear();
        Ok(goes_on)
    }

    /// The side of a node.
    fn side(&mut self, level: usize, node: u64) -> Result<u8> {
        let Level { sides, first, .. } = &mut self.levels[level];
        let mut at = node.wrapping_sub(*first) as usize;
        if at >= sides.len() {
            let array = &self.tree.file.sides;
            let length = u64::from(array.chunk_len);
            self.tree.file.read_chunk(array, (node / length) as usize, sides)?;
            (*first, at) = (node / length * length, (node % length) as usize);
        }
        match sides[at] {
            side @ 0..=2 => Ok(side),
            side => Err(TreeError::Damaged(format!("node {node} has the side {side}"))),
        }
    }
}

/// The first bits of an array, in bytes up to the last chunk that is stored. The first bit of a byte is the most significant one.
#[derive(Debug)]
struct Bits(Vec<u8>);

impl Bits {
    /// The first `count` bits of an array. Those after them have no meaning, and are zero here.
    fn read(file: &TreeReader, array: &Chunked, count: u64) -> Result<Self> {
        let (mut bits, mut chunk) = (Vec::new(), Vec::new());
        let stored = array.chunks.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        for index in 0..stored {
            file.read_chunk(array, index, &mut chunk)?;
            bits.extend_from_slice(&chunk);
        }
        bits.truncate(count.div_ceil(8) as usize);
        if let Some(last) = bits.get_mut((count / 8) as usize) {
            *last &= !(0xff >> (count % 8));
        }
        Ok(Self(bits))
    }

    /// Up to eight bits from a position on; the first becomes the lowest.
    fn get(&self, first: u64, count: u32) -> u8 {
        let byte = |at: u64| self.0.get(at as usize).copied().unwrap_or(0);
        let pair = u16::from_be_bytes([byte(first / 8), byte(first / 8 + 1)]);
        let bits = ((pair << (first % 8) >> 8) as u8).reverse_bits();
        bits & ((1u16 << count) - 1) as u8
    }

    /// Number of bits that are set in a range.
    fn ones(&self, Range { start, end }: Range<u64>) -> u64 {
        let bits = |first: u64| self.get(first, (end - first).min(8) as u32).count_ones();
        (start..end).step_by(8).map(|first| u64::from(bits(first))).sum()
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
        tree.words(&mut |run| {
            all.extend_from_slice(run);
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
        tree.words(&mut |run| {
            assert!(run.len() < RUN + 8);
            (runs, read) = (runs + 1, read + run.len());
            runs < 2
        })
        .unwrap();
        assert!(runs == 2 && read >= 2 * RUN && read < words.len());
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
        assert!(
            less.starts_with("is damaged: ") && less.contains("of level 4 are split, and"),
            "{less}"
        );
        let more = damaged(&|nodes| {
            let leaf = split(false, nodes);
            (nodes.split[leaf], nodes.masked[leaf]) = (true, false);
        });
        assert!(more.starts_with("is damaged: ") && more.contains(" are split, and "), "{more}");
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
