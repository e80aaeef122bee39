//! The parts of a mesh on disk: files of sorted leaf words, or the tree.

use crate::htg::TreeFile;
use crate::npy::PartFile;

/// A part.
#[derive(Debug)]
pub enum Part {
    /// A file of leaf words.
    Words(PartFile),
    /// The whole tree.
    Tree(Box<TreeFile>),
}

impl Part {
    /// Whether it states the rank of each leaf: a file of words is that of one rank, but a tree may have none.
    pub fn has_ranks(&self) -> bool {
        match self {
            Self::Words(_) => true,
            Self::Tree(tree) => tree.has_ranks(),
        }
    }

    /// Number of leaves.
    pub fn leaves(&self) -> u64 {
        match self {
            Self::Words(file) => file.len(),
            Self::Tree(tree) => tree.leaves,
        }
    }
}
