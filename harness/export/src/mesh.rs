//! Meshes on disk, read leaf by leaf in Morton order.
//!
//! The parts of a leaf-set directory are sorted, so the leaves of an octant are one interval of each. A search by octants
//! therefore reads only the blocks that meet the selection, with the leaves of all parts in a block, which are sorted.

use std::ops::{Deref, Range};
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

use contract::case::Case;
use contract::lattice::Root;
use contract::mesh::{self, Interval, Order, Part, Readers};
use contract::octant::{LEVEL_MAX, Octant};
use contract::word::{self, KEY_END};

use crate::error::ExportError;
use crate::leaf::Leaf;
use crate::selection::Selection;

/// Number of words that are read at once: few enough that a slice reads little besides its own leaves.
const BLOCK: u64 = 1 << 12;

/// A range of Morton codes and the number of leaves in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The Morton codes.
    pub keys: Range<u64>,
    /// The number of leaves.
    pub leaves: u64,
}

/// A mesh on disk, opened for reading.
#[derive(Debug)]
pub struct Mesh {
    files: mesh::Mesh,
    leaves_by_rank: OnceLock<Vec<u64>>,
}

/// A mesh with readers that keep what they have read last. It can be shared by threads.
pub struct Visitor<'a> {
    mesh: &'a Mesh,
    /// The readers that are not in use.
    readers: Mutex<Vec<Readers<'a>>>,
}

impl<'a> Visitor<'a> {
    /// The same as [`Mesh::visit`].
    ///
    /// # Errors
    /// As there.
    pub fn visit<E: From<ExportError>>(
        &self,
        keys: Range<u64>,
        selection: &Selection,
        visit: &mut impl FnMut(Leaf) -> Result<(), E>,
    ) -> Result<(), E> {
        self.with_readers(|readers| {
            let intervals = readers.intervals(keys).map_err(ExportError::from)?;
            let before = intervals.iter().map(|(_, interval)| interval.start).sum();
            let visit = &mut |leaf| visit(leaf);
            let mut visiting =
                Visiting { mesh: self.mesh, readers, selection, order: Order::default(), visit };
            visiting.octant(Octant::ROOT, &intervals, before)
        })
    }

    fn with_readers<T>(&self, read: impl FnOnce(&mut Readers<'a>) -> T) -> T {
        let free = || self.readers.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = free().pop();
        let mut readers = kept.unwrap_or_else(|| Readers::new(&self.mesh.parts));
        let result = read(&mut readers);
        free().push(readers);
        result
    }
}

impl Deref for Mesh {
    type Target = mesh::Mesh;

    fn deref(&self) -> &mesh::Mesh {
        &self.files
    }
}

impl Mesh {
    /// Opens a leaf-set directory. If it has the tree alone, that is its only part.
    ///
    /// # Errors
    /// If the directory is not a leaf set.
    pub fn open(path: &Path) -> Result<Self, ExportError> {
        Ok(Self { files: mesh::Mesh::open(path)?, leaves_by_rank: OnceLock::new() })
    }

    /// Refuses a case that was not meshed here, by its root and its surface level.
    ///
    /// # Errors
    /// If the mesh cannot be one of the case.
    pub fn require_case(&self, case: &Case) -> Result<(), ExportError> {
        let stated = |root: Root, level: u8| {
            let Root { origin: [x, y, z], edge } = root;
            format!("a root of edge {edge} at ({x}, {y}, {z}) and surface level {level}")
        };
        let of_mesh = stated(self.manifest.root, self.manifest.level_surface);
        let of_case = stated(case.root, case.level_surface);
        if of_mesh == of_case {
            return Ok(());
        }
        Err(ExportError::Request(format!(
            "the mesh is not of the case {}: the mesh has {of_mesh}, the case {of_case}; give the case that was meshed",
            case.name
        )))
    }

    /// Whether the rank of each leaf is known: a tree may have been written without ranks.
    pub fn has_ranks(&self) -> bool {
        self.parts.iter().all(Part::has_ranks)
    }

    /// The error of a request that needs them.
    pub fn ranks_unknown(&self) -> ExportError {
        ExportError::Request(
            "the ranks of this mesh are unknown, because its tree was written without --cell-ranks"
                .to_owned(),
        )
    }

    /// Number of leaves of each rank; nothing if the ranks are unknown. All leaves of a tree are read, the first time.
    ///
    /// # Errors
    /// If the tree cannot be read.
    pub fn leaves_by_rank(&self) -> Result<&[u64], ExportError> {
        if let Some(known) = self.leaves_by_rank.get() {
            return Ok(known);
        }
        let mut leaves = Vec::new();
        match &self.parts[..] {
            _ if !self.has_ranks() => {}
            [Part::Tree(_)] => {
                self.visit(Self::ALL, &Selection::default(), &mut |leaf: Leaf| {
                    let rank = leaf.rank as usize;
                    leaves.resize(leaves.len().max(rank + 1), 0);
                    leaves[rank] += 1;
                    Ok::<(), ExportError>(())
                })?
            }
            parts => leaves.extend(parts.iter().map(Part::leaves)),
        }
        Ok(self.leaves_by_rank.get_or_init(|| leaves))
    }

    /// Visits the selected leaves whose Morton codes are in `keys`, in Morton order.
    ///
    /// # Errors
    /// If a part cannot be read or is not a sequence of leaves; or the first error of `visit`, which ends the traversal.
    pub fn visit<E: From<ExportError>>(
        &self,
        keys: Range<u64>,
        selection: &Selection,
        visit: &mut impl FnMut(Leaf) -> Result<(), E>,
    ) -> Result<(), E> {
        self.visitor().visit(keys, selection, visit)
    }

    /// A visitor, for repeated visits of few leaves each.
    pub fn visitor(&self) -> Visitor<'_> {
        Visitor { mesh: self, readers: Mutex::default() }
    }

    /// Ranges of Morton codes, in order, that together contain all selected leaves: each is an octant of at most
    /// `leaves_max` leaves, or several neighbouring ones. All their leaves are counted, selected or not.
    ///
    /// # Errors
    /// If a part cannot be read.
    pub fn blocks(
        &self,
        selection: &Selection,
        leaves_max: u64,
    ) -> Result<Vec<Block>, ExportError> {
        let mut blocks: Vec<Block> = Vec::new();
        let mut readers = Readers::new(&self.parts);
        // Leaves that are not selected separate the next block from the last one.
        let mut has_gap = false;
        let all =
            self.parts.iter().enumerate().map(|(part, file)| (part, 0..file.leaves())).collect();
        let mut stack: Vec<(Octant, Vec<Interval>)> = vec![(Octant::ROOT, all)];
        while let Some((octant, intervals)) = stack.pop() {
            let leaves = count(&intervals);
            if leaves == 0 || !selection.meets(&octant) {
                has_gap |= leaves > 0;
                continue;
            }
            if leaves > leaves_max && octant.level < LEVEL_MAX {
                let children = children(&mut readers, octant, &intervals)?;
                stack.extend(children.into_iter().rev());
                continue;
            }
            let start = word::key_of(octant.corner);
            let end = start + word::span(octant.level);
            match blocks.last_mut() {
                Some(last) if last.leaves + leaves <= leaves_max && !has_gap => {
                    last.keys.end = end;
                    last.leaves += leaves;
                }
                _ => blocks.push(Block { keys: start..end, leaves }),
            }
            has_gap = false;
        }
        Ok(blocks)
    }

    /// The range of all Morton codes.
    pub const ALL: Range<u64> = 0..KEY_END;
}

/// A visit of leaves.
struct Visiting<'r, 'a, V> {
    mesh: &'a Mesh,
    readers: &'r mut Readers<'a>,
    selection: &'r Selection,
    order: Order,
    visit: V,
}

impl<E: From<ExportError>, V: FnMut(Leaf) -> Result<(), E>> Visiting<'_, '_, V> {
    /// Visits the selected leaves of an octant; `before` leaves of the mesh precede its own.
    fn octant(&mut self, octant: Octant, intervals: &[Interval], mut before: u64) -> Result<(), E> {
        if count(intervals) == 0 || !self.selection.meets(&octant) {
            return Ok(());
        }
        if count(intervals) <= BLOCK || octant.level == LEVEL_MAX {
            return self.block(&octant, intervals, before);
        }
        for (child, intervals) in children(self.readers, octant, intervals)? {
            self.octant(child, &intervals, before)?;
            before += count(&intervals);
        }
        Ok(())
    }

    /// The same for an octant whose leaves are read at once.
    fn block(&mut self, octant: &Octant, intervals: &[Interval], before: u64) -> Result<(), E> {
        let leaves = self.readers.leaves(octant, intervals).map_err(ExportError::from)?;
        for ((word, rank), index) in leaves.into_iter().zip(before..) {
            if let Some(why) = self.order.fault(word) {
                return Err(ExportError::from(self.mesh.not_linear(why)).into());
            }
            let (octant, side) = (word::octant(word), word::side(word));
            let leaf = Leaf { octant, side, rank, index };
            if self.selection.has(&leaf) {
                (self.visit)(leaf)?;
            }
        }
        Ok(())
    }
}

/// The children of an octant that contain leaves, with their intervals.
fn children(
    readers: &mut Readers,
    octant: Octant,
    intervals: &[Interval],
) -> Result<Vec<(Octant, Vec<Interval>)>, ExportError> {
    let mut children: Vec<(Octant, Vec<Interval>)> = Vec::new();
    let mut starts: Vec<u64> = intervals.iter().map(|(_, i)| i.start).collect();
    for child in (0..8).map(|d| octant.child(d)) {
        let key_end = word::key_of(child.corner) + word::span(child.level);
        let mut parts = Vec::new();
        for (start, (part, interval)) in starts.iter_mut().zip(intervals) {
            let end = readers.lower_bound(*part, *start..interval.end, key_end)?;
            parts.extend((*start < end).then_some((*part, *start..end)));
            *start = end;
        }
        if !parts.is_empty() {
            children.push((child, parts));
        }
    }
    Ok(children)
}

/// Number of leaves in these intervals.
fn count(intervals: &[Interval]) -> u64 {
    intervals.iter().map(|(_, interval)| interval.end - interval.start).sum()
}

#[cfg(test)]
mod tests;
