//! Hyper-tree grids in VTKHDF, as `mesher --write htg` and `harness export` write them: the leaves of a tree of any size, in Morton
//! order.
//!
//! The file has the nodes level by level ([`vtkhdf::tree`] describes it). Its bits, of which nodes are split and which leaves are not in the mesh,
//! are in memory, at most 0.3 bytes per leaf. Sides and ranks are not: a walk from the root down reads those of each level once from its begin to its
//! end, because the children of a level's split nodes are the next level. So one chunk of them is in memory for each level.
//!
//! Opening a file verifies the whole structure: every node but the root has a parent, and masked nodes are leaves. Sides and ranks are verified as they are
//! read. Damage to the file itself shows in its checksums.

mod bits;
mod bytes;
#[cfg(test)]
mod tests;

use crate::lattice::Root;
use crate::word;
use bits::Bits;
use bytes::Bytes;

use std::ops::Range;
use std::path::{Path, PathBuf};
use vtkhdf::format::Chunked;
pub use vtkhdf::format::ReadError as TreeError;
use vtkhdf::read::TreeReader;
use vtkhdf::tree::Shape;

/// Number of words that are passed on at once, at least; at most seven more.
const RUN: usize = 4096;

/// The least number that is no rank, so that counting leaves by rank takes little memory whatever a file contains.
const RANKS_MAX: u32 = 1 << 24;

/// The cell data with the sides.
pub use vtkhdf::tree::SIDE;

/// A hyper-tree grid whose structure was read and is valid.
#[derive(Debug)]
pub struct TreeFile {
    path: PathBuf,
    file: TreeReader,
    /// The root cube.
    pub root: Root,
    /// Number of leaves.
    pub leaves: u64,
    with_sides: bool,
    /// The nodes of each level.
    levels: Vec<Range<u64>>,
    split: Bits,
    /// Leaves that are not in the mesh.
    masked: Bits,
}

type Result<T> = std::result::Result<T, TreeError>;

fn layout<T>(why: impl Into<String>) -> Result<T> {
    Err(TreeError::Unknown(why.into()))
}

fn nodes<T>(why: impl Into<String>) -> Result<T> {
    Err(TreeError::Damaged(why.into()))
}

impl TreeFile {
    /// Opens a file. With `sides`, its leaves have sides; otherwise all are outside.
    ///
    /// # Errors
    /// If the file is not a hyper-tree grid as this repository writes it.
    pub fn open(path: &Path, with_sides: bool) -> Result<Self> {
        let file = TreeReader::open(path)?;
        let Shape { origin, edge, .. } = file.shape;
        let is_cube = edge > 0.0 && edge.is_finite() && origin.iter().all(|c| c.is_finite());
        if !is_cube {
            return layout(format!("its root is no cube: corner {origin:?}, edge {edge}"));
        }
        let (mut levels, mut end) = (Vec::new(), 0);
        for count in &file.shape.nodes {
            levels.push(end..end + count);
            end += count;
        }
        let described = levels.last().map_or(0, |last| last.start);
        let split = Bits::read(&file, &file.split, described)?;
        let masked = file.masked.as_ref().map(|array| Bits::read(&file, array, end)).transpose()?;
        let masked = masked.unwrap_or_default();
        if !split.are_disjoint(&masked) {
            return nodes("a node is masked and split");
        }
        let mut leaves = end - masked.ones(0..end);
        for (level, pair) in levels.windows(2).enumerate() {
            let (parents, children) = (split.ones(pair[0].clone()), pair[1].end - pair[1].start);
            leaves -= parents;
            if 8 * parents != children {
                return nodes(format!(
                    "{parents} nodes of level {level} are split, and {children} are on the next"
                ));
            }
        }
        let (path, root) = (path.to_owned(), Root { origin, edge });
        Ok(Self { path, file, root, leaves, with_sides, levels, split, masked })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether its leaves have ranks.
    pub fn has_ranks(&self) -> bool {
        self.file.ranks.is_some()
    }

    /// Passes the words of all leaves to `run` in Morton order, some thousands at a time, until it returns false.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn words(&self, run: &mut dyn FnMut(&[u64]) -> bool) -> Result<()> {
        self.walk(None, &mut |words, _| run(words))
    }

    /// The same with the ranks of the leaves, if the file has them.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn words_and_ranks(&self, run: &mut Run) -> Result<()> {
        self.walk(self.file.ranks.as_ref(), run)
    }

    fn walk(&self, ranks: Option<&Chunked>, run: &mut Run) -> Result<()> {
        let mut walk = Walk::new(self, ranks);
        if walk.siblings(0, 0, 1, run)? {
            walk.flush(run);
        }
        Ok(())
    }
}

/// What is given the words of leaves, and their ranks if the walk reads ranks. A walk ends when it returns false.
type Run<'r> = dyn FnMut(&[u64], &[u32]) -> bool + 'r;

/// The position of a walk on a level.
struct Level<'a> {
    next: u64,
    sides: Option<Bytes<'a>>,
    ranks: Option<Bytes<'a>>,
}

/// A walk in Morton order.
struct Walk<'a> {
    tree: &'a TreeFile,
    levels: Vec<Level<'a>>,
    words: Vec<u64>,
    ranks: Vec<u32>,
}

impl<'a> Walk<'a> {
    /// A walk from the root, with ranks if they are given.
    fn new(tree: &'a TreeFile, ranks: Option<&'a Chunked>) -> Self {
        let bytes = |array| Bytes::new(&tree.file, array);
        let level = |nodes: &Range<u64>| Level {
            next: nodes.start,
            sides: tree.with_sides.then(|| bytes(&tree.file.sides)),
            ranks: ranks.map(bytes),
        };
        let levels = tree.levels.iter().map(level).collect();
        Self { tree, levels, words: Vec::with_capacity(RUN + 8), ranks: Vec::new() }
    }

    /// Visits some siblings, or the root alone, and what is below; returns false if `run` did. The first has the Morton code `key`.
    fn siblings(&mut self, level: usize, key: u64, count: u32, run: &mut Run) -> Result<bool> {
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
                self.leaf(level, key, first + u64::from(i))?;
            }
        }
        Ok(self.words.len() < RUN || self.flush(run))
    }

    /// Adds a leaf.
    fn leaf(&mut self, level: usize, key: u64, node: u64) -> Result<()> {
        let Level { sides, ranks, .. } = &mut self.levels[level];
        let side = sides.as_mut().map_or(Ok(0), |sides| sides.at(node))?;
        if side > 2 {
            return nodes(format!("node {node} has the side {side}"));
        }
        self.words.push(key << 7 | (level as u64) << 2 | u64::from(side));
        if let Some(ranks) = ranks {
            let found = ranks.int(node)?;
            match u32::try_from(found).ok().filter(|&rank| rank < RANKS_MAX) {
                Some(rank) => self.ranks.push(rank),
                None => return nodes(format!("node {node} has the rank {found}")),
            }
        }
        Ok(())
    }

    fn flush(&mut self, run: &mut Run) -> bool {
        let goes_on = run(&self.words, &self.ranks);
        self.words.clear();
        self.ranks.clear();
        goes_on
    }
}
