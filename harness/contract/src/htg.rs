//! Hyper-tree grids in VTKHDF, as `mesher --write htg` and `harness export` write them: the leaves of a tree of any size, in Morton
//! order.
//!
//! The file has the nodes level by level ([`vtkhdf::tree`] describes it). A walk from the root down reads each level once from
//! its begin to its end, because the children of a level's split nodes are the next level. So one chunk of each array and
//! level is in memory.
//!
//! Reading verifies the whole structure: every node has a parent, every side exists, and masked nodes are leaves. Damage to the file itself
//! shows in its checksums.

mod bytes;
mod cursor;
mod index;
mod level;
#[cfg(test)]
mod tests;

use crate::lattice::Root;
use crate::word;
use level::LevelReader;

use std::path::{Path, PathBuf};
use vtkhdf::format::{Chunked, ReadError};
use vtkhdf::read::TreeReader;
use vtkhdf::tree::Shape;

/// Number of words that are passed on at once, at least; at most seven more.
const RUN: usize = 4096;

pub use cursor::Cursor;
pub use index::Index;
/// The cell data with the sides.
pub use vtkhdf::tree::SIDE;

/// A hyper-tree grid whose shape was read and is valid. No node has been read.
#[derive(Debug)]
pub struct TreeFile {
    path: PathBuf,
    file: TreeReader,
    /// The root cube.
    pub root: Root,
    with_sides: bool,
}

/// Why a file is not a usable hyper-tree grid: the predicate of a sentence whose subject is the file.
#[derive(Debug, thiserror::Error)]
pub enum TreeError {
    /// The file is damaged, or has what only VTK reads.
    #[error(transparent)]
    File(#[from] ReadError),
    /// It is not a hyper-tree grid of this mesh.
    #[error("is not a hyper-tree grid of this mesh: {0}")]
    Layout(String),
    /// Its nodes are no tree.
    #[error("is damaged: {0}")]
    Nodes(String),
}

impl TreeError {
    /// Whether the file may be valid, and VTK may read it.
    pub fn is_of_another_layout(&self) -> bool {
        matches!(self, Self::File(ReadError::Unknown(_)) | Self::Layout(_))
    }
}

type Result<T> = std::result::Result<T, TreeError>;

fn layout<T>(why: impl Into<String>) -> Result<T> {
    Err(TreeError::Layout(why.into()))
}

fn nodes<T>(why: impl Into<String>) -> Result<T> {
    Err(TreeError::Nodes(why.into()))
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
        Ok(Self { path: path.to_owned(), file, root: Root { origin, edge }, with_sides })
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
        let levels =
            (0..self.file.shape.nodes.len()).map(|level| self.level(level, None)).collect();
        let run = &mut |words: &[u64], _: &[u32]| run(words);
        let mut walk = Walk::new(levels);
        if !(walk.siblings(0, 0, 1, run)? && walk.flush(run)) {
            return Ok(());
        }
        match walk.levels.iter().position(|level| !level.is_at_end()) {
            None => Ok(()),
            Some(level) => nodes(format!("nodes of level {level} have no parent")),
        }
    }

    /// Counts the nodes, so that the leaves of any octant can be read with a [`Cursor`].
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn index(&self) -> Result<Index> {
        Index::new(&self.file)
    }

    /// A reader of a level, with ranks if they are given.
    fn level<'a>(&'a self, level: usize, ranks: Option<&'a Chunked>) -> LevelReader<'a> {
        let nodes = &self.file.shape.nodes;
        let begin = nodes[..level].iter().sum();
        let split = (level + 1 < nodes.len()).then_some(&self.file.split);
        let sides = self.with_sides.then_some(&self.file.sides);
        let arrays = [split, self.file.masked.as_ref(), sides, ranks];
        LevelReader::new(&self.file, begin..begin + nodes[level], arrays)
    }
}

/// What is given the words of leaves, and their ranks if the readers have ranks. A walk ends when it returns false.
type Run<'r> = dyn FnMut(&[u64], &[u32]) -> bool + 'r;

/// A walk in Morton order.
struct Walk<'a> {
    levels: Vec<LevelReader<'a>>,
    words: Vec<u64>,
    ranks: Vec<u32>,
}

impl<'a> Walk<'a> {
    fn new(levels: Vec<LevelReader<'a>>) -> Self {
        Self { levels, words: Vec::with_capacity(RUN + 8), ranks: Vec::new() }
    }

    /// Visits some siblings, or the root alone, and what is below; returns false if `run` did. The first has the Morton code `key`.
    fn siblings(&mut self, level: usize, key: u64, count: u32, run: &mut Run) -> Result<bool> {
        let siblings = self.levels[level].next(count)?;
        let (edge, code) = (word::span(level as u8), (level as u64) << 2);
        for i in 0..count {
            let key = key + u64::from(i) * edge;
            if siblings.split >> i & 1 == 1 {
                if level + 1 == self.levels.len() {
                    return nodes(format!("a node of level {level} is split"));
                }
                if !self.siblings(level + 1, key, 8, run)? {
                    return Ok(false);
                }
            } else if siblings.masked >> i & 1 == 0 {
                self.words.push(key << 7 | code | u64::from(siblings.sides[i as usize]));
                self.ranks.extend(siblings.ranks.map(|ranks| ranks[i as usize]));
            }
        }
        Ok(self.words.len() < RUN || self.flush(run))
    }

    fn flush(&mut self, run: &mut Run) -> bool {
        let goes_on = run(&self.words, &self.ranks);
        self.words.clear();
        self.ranks.clear();
        goes_on
    }
}
