//! Corruptions that change leaves everywhere in the mesh, applied part by part.

use super::distributed::DistributedMesh;
use crate::selftest::edit::{self, has_side};
use crate::selftest::leaves;
use contract::manifest::Manifest;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::word::{self, Side};
use std::io;

/// A change of every part. The leaves of a part stay sorted.
#[derive(Debug)]
pub(super) enum GlobalChange {
    /// Shifts all leaves by a number of level-19 cells along x.
    Shifted(u32),
    /// Mirrors all leaves in the middle plane across x.
    Mirrored,
    /// Removes the leaves of an octant.
    Emptied(Octant),
    /// Removes this word and all greater ones.
    Truncated(u64),
}

impl GlobalChange {
    /// The change of the corruption with this name: `None` if the corruption is local, `Some(None)` if it does
    /// not apply.
    ///
    /// # Errors
    /// If the mesh cannot be read.
    pub(super) fn named(
        name: &str,
        original: &DistributedMesh,
    ) -> io::Result<Option<Option<Self>>> {
        Ok(Some(match name {
            leaves::SHIFTED_BY_CELL => shifted_by_cell(original.manifest()),
            leaves::SHIFTED_BY_HALF => Some(Self::Shifted(CELLS_PER_EDGE / 2)),
            leaves::MIRRORED => Some(Self::Mirrored),
            leaves::OCTANT_EMPTIED => emptied(original)?,
            leaves::TRUNCATED => Some(Self::Truncated(original.leaf(original.leaves() / 2)?.1)),
            _ => return Ok(None),
        }))
    }

    /// The leaves of a part after the change.
    pub(super) fn apply(&self, words: &[u64]) -> Vec<u64> {
        let kept =
            |keep: &dyn Fn(u64) -> bool| words.iter().copied().filter(|&w| keep(w)).collect();
        match self {
            Self::Shifted(by) => {
                let mut moved = edit::shifted(words, *by);
                moved.sort_unstable();
                moved
            }
            Self::Mirrored => edit::mirrored(words),
            Self::Emptied(octant) => kept(&|w| !octant.contains(&word::octant(w))),
            Self::Truncated(from) => kept(&|w| w < *from),
        }
    }
}

/// A shift by the finest cell, if there are coarser ones that it misaligns.
fn shifted_by_cell(manifest: &Manifest) -> Option<GlobalChange> {
    let finest = manifest.leaves_by_level.iter().rposition(|&count| count > 0)?;
    let coarser = manifest.leaves_by_level[..finest].iter().any(|&count| count > 0);
    coarser.then_some(GlobalChange::Shifted(CELLS_PER_EDGE >> finest))
}

/// The octant in the corner of the root, if it has leaves, but none that are crossing.
fn emptied(original: &DistributedMesh) -> io::Result<Option<GlobalChange>> {
    let octant = Octant::ROOT.child(0).child(0);
    let (mut any, mut surface) = (false, false);
    for file in original.parts() {
        // The leaves in the corner come first in every part.
        let end = word::span(octant.level) << 7;
        let mut words =
            vec![0; usize::try_from(file.lower_bound(0..file.len(), end)?).unwrap_or(usize::MAX)];
        file.read_at(0, &mut words)?;
        any |= !words.is_empty();
        surface |= words.iter().any(|&w| has_side(w, Side::Crossing));
    }
    Ok((any && !surface).then_some(GlobalChange::Emptied(octant)))
}
