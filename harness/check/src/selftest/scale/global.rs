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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::scale::Source;
    use crate::selftest::{SelftestCase, catalogue};
    use contract::case::Case;
    use contract::testing::{leaf_set, words_with_sides};

    /// A mesh that is refined towards a corner, with crossing leaves there or in the opposite one.
    fn words(crossing: u32, has_corner: bool) -> Vec<u64> {
        let is_crossing = |o: &Octant| o.corner == [crossing * (CELLS_PER_EDGE - o.edge()); 3];
        let corner = Octant::ROOT.child(0).child(0);
        let side = |o: &Octant| if is_crossing(o) { Side::Crossing } else { Side::Outside };
        words_with_sides(
            |o| o.level < 2 || o.level < 5 && o.corner == [0; 3],
            |o| (has_corner || !corner.contains(o)).then(|| side(o)),
        )
    }

    #[test]
    fn a_change_of_every_part_is_the_corruption_of_the_whole_mesh() {
        let text = "spacing_min = 1.0\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let case =
            Case::from_parts(text, vec![[[0.5; 3], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]]]).unwrap();
        let names = [
            leaves::SHIFTED_BY_CELL,
            leaves::SHIFTED_BY_HALF,
            leaves::MIRRORED,
            leaves::OCTANT_EMPTIED,
            leaves::TRUNCATED,
        ];
        for (crossing, has_corner) in [(0, true), (1, true), (1, false)] {
            let place = tempfile::tempdir().unwrap();
            let mesh = place.path().join("given");
            std::fs::create_dir(&mesh).unwrap();
            let set = leaf_set(vec![words(crossing, has_corner)]);
            set.write(&mesh).unwrap();
            let source = Source { name: "given".into(), mesh, base: None };
            let original = DistributedMesh::new(&source, place.path()).unwrap();
            let correct =
                SelftestCase { case: case.clone(), mesh: set.clone(), base: leaf_set(vec![]) };
            for mutant in catalogue() {
                let change = GlobalChange::named(mutant.name, &original).unwrap();
                assert_eq!(change.is_some(), names.contains(&mutant.name), "{}", mutant.name);
                let Some(change) = change else { continue };
                let applied = change.map(|change| change.apply(&set.words));
                let whole = (mutant.make)(&correct).map(|mutation| mutation.mesh.words);
                assert_eq!(applied, whole, "{}, {crossing}, {has_corner}", mutant.name);
            }
        }
    }
}
