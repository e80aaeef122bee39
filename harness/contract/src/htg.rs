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
use crate::octant::LEVEL_MAX;
use crate::word;
use level::LevelReader;

use std::path::{Path, PathBuf};
use vtkhdf::format::{Chunked, Group, Kind, Member, ReadError, Value};
use vtkhdf::read::File;
use vtkhdf::tree::{CELL_DATA, COORDINATES, EDGE, GROUP, RANK, TYPE};

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
    file: File,
    /// The root cube.
    pub root: Root,
    /// Number of nodes by level.
    nodes: Vec<u64>,
    split: Chunked,
    masked: Option<Chunked>,
    sides: Option<Chunked>,
    ranks: Option<Chunked>,
}

/// Why a file is not a usable hyper-tree grid: the predicate of a sentence whose subject is the file.
#[derive(Debug, thiserror::Error)]
pub enum TreeError {
    /// The HDF5 file is damaged, or has what only the HDF5 library reads.
    #[error(transparent)]
    File(#[from] ReadError),
    /// It is not a hyper-tree grid of one oct-tree.
    #[error("is not a hyper-tree grid of one oct-tree: {0}")]
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
    /// Opens a file. With `sides`, the name of cell data, its leaves have sides; otherwise all are outside.
    ///
    /// # Errors
    /// If the file is not a hyper-tree grid of one oct-tree, or is damaged.
    pub fn open(path: &Path, sides: Option<&str>) -> Result<Self> {
        let file = File::open(path)?;
        let root = file.root()?;
        let Some(Member::Group(grid)) = root.member(GROUP) else {
            return layout(format!("it has no group {GROUP}"));
        };
        expect(grid.attribute("Type"), &Value::Text(TYPE.to_owned()), "Type")?;
        expect(grid.attribute("BranchFactor"), &Value::Number(2), "BranchFactor")?;
        expect(grid.attribute("Dimensions"), &Value::Ints32(vec![2; 3]), "Dimensions")?;
        let nodes = level_counts(grid)?;
        let total: u64 = nodes.iter().sum();
        let described = (total - nodes.last().copied().unwrap_or(0)).max(1);
        for (name, number) in
            [("NumberOfTrees", 1), ("NumberOfCells", total), ("DescriptorsSize", described)]
        {
            expect(small(grid, name), &Value::Ints(vec![number as i64]), name)?;
        }
        let split = bytes(grid, "Descriptors", described.div_ceil(8))?;
        let Some(split) = split else { return layout("it has no Descriptors") };
        let masked = bytes(grid, "Mask", total.div_ceil(8))?;
        let data = match grid.member(CELL_DATA) {
            Some(Member::Group(data)) => data,
            _ => &Group::default(),
        };
        let sides = match sides {
            None => None,
            Some(name) => match bytes(data, name, total)? {
                Some(sides) => Some(sides),
                None => return layout(format!("it has no cell data {name} of unsigned bytes")),
            },
        };
        // Cell data of another type are not those of this repository, and no fault of the tree.
        let ranks = match data.member(RANK) {
            Some(Member::Chunked(array)) if array.kind == Kind::Int32 && array.len == total => {
                Some(array.clone())
            }
            _ => None,
        };
        let (path, root) = (path.to_owned(), root_of(grid)?);
        Ok(Self { path, root, file, nodes, split, masked, sides, ranks })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether its leaves have sides.
    pub fn has_sides(&self) -> bool {
        self.sides.is_some()
    }

    /// Whether its leaves have ranks.
    pub fn has_ranks(&self) -> bool {
        self.ranks.is_some()
    }

    /// Passes the words of all leaves to `run` in Morton order, some thousands at a time, until it returns false.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn words(&self, run: &mut dyn FnMut(&[u64]) -> bool) -> Result<()> {
        let levels = (0..self.nodes.len()).map(|level| self.level(level, None)).collect();
        let run = &mut |words: &[u64], _: &[u32]| run(words);
        let (words, ranks) = (Vec::with_capacity(RUN + 8), Vec::new());
        let mut walk = Walk { levels, words, ranks, run };
        if !(walk.siblings(0, 0, 1)? && walk.flush()) {
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
        let total: u64 = self.nodes.iter().sum();
        let described = total - self.nodes.last().copied().unwrap_or(0);
        Index::new(&self.file, [described, total], &self.split, self.masked.as_ref())
    }

    /// A reader of a level, with ranks if they are given.
    fn level<'a>(&'a self, level: usize, ranks: Option<&'a Chunked>) -> LevelReader<'a> {
        let begin = self.nodes[..level].iter().sum();
        let is_last = level + 1 == self.nodes.len();
        let split = (!is_last).then_some(&self.split);
        let end = begin + self.nodes[level];
        let arrays = [split, self.masked.as_ref(), self.sides.as_ref(), ranks];
        LevelReader::new(&self.file, begin..end, arrays)
    }
}

/// A walk in Morton order.
struct Walk<'a, 'r> {
    levels: Vec<LevelReader<'a>>,
    words: Vec<u64>,
    /// The rank of each word; none if the readers have no ranks.
    ranks: Vec<u32>,
    run: &'r mut dyn FnMut(&[u64], &[u32]) -> bool,
}

impl Walk<'_, '_> {
    /// Visits some siblings, or the root alone, and what is below; returns false if `run` did. The first has the Morton code `key`.
    fn siblings(&mut self, level: usize, key: u64, count: u32) -> Result<bool> {
        let siblings = self.levels[level].next(count)?;
        let (edge, code) = (word::span(level as u8), (level as u64) << 2);
        for i in 0..count {
            let key = key + u64::from(i) * edge;
            if siblings.split >> i & 1 == 1 {
                if level + 1 == self.levels.len() {
                    return nodes(format!("a node of level {level} is split"));
                }
                if !self.siblings(level + 1, key, 8)? {
                    return Ok(false);
                }
            } else if siblings.masked >> i & 1 == 0 {
                self.words.push(key << 7 | code | u64::from(siblings.sides[i as usize]));
                self.ranks.extend(siblings.ranks.map(|ranks| ranks[i as usize]));
            }
        }
        Ok(self.words.len() < RUN || self.flush())
    }

    fn flush(&mut self) -> bool {
        let goes_on = (self.run)(&self.words, &self.ranks);
        self.words.clear();
        self.ranks.clear();
        goes_on
    }
}

fn expect(found: Option<&Value>, expected: &Value, name: &str) -> Result<()> {
    match found {
        Some(value) if value == expected => Ok(()),
        Some(value) => layout(format!("its {name} is {value:?}, not {expected:?}")),
        None => layout(format!("it has no {name}")),
    }
}

fn small<'a>(grid: &'a Group, name: &str) -> Option<&'a Value> {
    match grid.member(name) {
        Some(Member::Small(value)) => Some(value),
        _ => None,
    }
}

/// The array of bytes with this name; none if there is none.
fn bytes(group: &Group, name: &str, len: u64) -> Result<Option<Chunked>> {
    match group.member(name) {
        None => Ok(None),
        Some(Member::Chunked(array)) if array.kind == Kind::Byte && array.len == len => {
            Ok(Some(array.clone()))
        }
        Some(_) => layout(format!("its {name} is not an array of {len} bytes")),
    }
}

/// Numbers of nodes by level: one, and then at most eight for each node of the level above.
fn level_counts(grid: &Group) -> Result<Vec<u64>> {
    let Some(Value::Ints(counts)) = small(grid, "NumberOfCellsPerTreeDepth") else {
        return layout("it has no NumberOfCellsPerTreeDepth");
    };
    let counts: Vec<u64> = counts.iter().map(|&n| u64::try_from(n).unwrap_or(0)).collect();
    let is_tree = counts.first() == Some(&1)
        && counts.windows(2).all(|w| w[1] > 0 && w[1].is_multiple_of(8) && w[1] / 8 <= w[0]);
    let levels = usize::from(LEVEL_MAX) + 1;
    if is_tree && counts.len() <= levels {
        return Ok(counts);
    }
    layout(format!(
        "its NumberOfCellsPerTreeDepth {counts:?} is not that of an oct-tree of at most {levels} levels"
    ))
}

/// The root cube.
fn root_of(grid: &Group) -> Result<Root> {
    let ends = |name: &str| match small(grid, name) {
        Some(Value::Doubles(ends)) if ends.len() == 2 => Ok([ends[0], ends[1]]),
        _ => layout(format!("its {name} are not two coordinates")),
    };
    let mut axes = [[0.0; 2]; 3];
    for (axis, name) in axes.iter_mut().zip(COORDINATES) {
        *axis = ends(name)?;
    }
    // The difference of two coordinates has lost digits of the edge.
    let edge = match grid.attribute(EDGE) {
        Some(Value::Doubles(edge)) if edge.len() == 1 => edge[0],
        _ => axes[0][1] - axes[0][0],
    };
    let is_cube = axes.iter().all(|[low, high]| (high - low - edge).abs() <= 1e-6 * edge);
    if !(is_cube && edge > 0.0 && edge.is_finite() && axes.iter().all(|a| a[0].is_finite())) {
        return layout(format!("its coordinates {axes:?} are not those of a cube of edge {edge}"));
    }
    Ok(Root { origin: axes.map(|axis| axis[0]), edge })
}
