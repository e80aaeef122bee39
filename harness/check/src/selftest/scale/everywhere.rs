//! Corruptions of the catalogue that concern the whole mesh and not a place in it, leaf by leaf.

use super::whole::Whole;
use crate::selftest::surgery::{self, is};
use contract::manifest::Manifest;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::word::{self, Side};
use std::io;

/// What is done to every part, whose leaves stay sorted.
#[derive(Debug)]
pub(super) enum Everywhere {
    /// Moved along x by so many level-19 cells.
    Shifted(u32),
    /// Mirrored in the middle plane across x.
    Mirrored,
    /// Without the leaves of an octant.
    Emptied(Octant),
    /// Without the leaves from this word on.
    CutShort(u64),
}

impl Everywhere {
    /// The change that a corruption of this name is, if it is one; nothing within where it does not apply.
    pub(super) fn named(name: &str, whole: &Whole) -> io::Result<Option<Option<Self>>> {
        Ok(Some(match name {
            "all leaves shifted by one finest cell" => by_finest(whole.manifest()),
            "all leaves shifted by half the root" => Some(Self::Shifted(CELLS_PER_EDGE / 2)),
            "mesh mirrored" => Some(Self::Mirrored),
            "octant emptied" => emptied(whole)?,
            "all leaves after the first half dropped" => {
                Some(Self::CutShort(whole.leaf(whole.leaves() / 2)?.1))
            }
            _ => return Ok(None),
        }))
    }

    /// The changed leaves.
    pub(super) fn apply(&self, words: &[u64]) -> Vec<u64> {
        let kept =
            |keep: &dyn Fn(u64) -> bool| words.iter().copied().filter(|&w| keep(w)).collect();
        match self {
            Self::Shifted(by) => {
                let mut moved = surgery::shifted(words, *by);
                moved.sort_unstable();
                moved
            }
            Self::Mirrored => surgery::mirrored(words),
            Self::Emptied(octant) => kept(&|w| !octant.contains(&word::octant(w))),
            Self::CutShort(from) => kept(&|w| w < *from),
        }
    }
}

/// By the finest cell, where there are coarser ones that it moves off their grid.
fn by_finest(manifest: &Manifest) -> Option<Everywhere> {
    let finest = manifest.leaves_by_level.iter().rposition(|&count| count > 0)?;
    let coarser = manifest.leaves_by_level[..finest].iter().any(|&count| count > 0);
    coarser.then_some(Everywhere::Shifted(CELLS_PER_EDGE >> finest))
}

/// The octant in the corner of the root, where it has leaves and no surface.
fn emptied(whole: &Whole) -> io::Result<Option<Everywhere>> {
    let octant = Octant::ROOT.child(0).child(0);
    let (mut any, mut surface) = (false, false);
    for file in whole.parts() {
        // The corner's leaves are the first of every part.
        let end = word::span(octant.level) << 7;
        let mut words = vec![0; usize::try_from(file.lower_bound(end)?).unwrap_or(usize::MAX)];
        file.read_at(0, &mut words)?;
        any |= !words.is_empty();
        surface |= words.iter().any(|&w| is(w, Side::Crossing));
    }
    Ok((any && !surface).then_some(Everywhere::Emptied(octant)))
}

#[cfg(test)]
mod tests {
    use crate::selftest::catalogue;

    /// Names are how corruptions are told apart, so those above must be the catalogue's.
    #[test]
    fn names_are_the_catalogues() {
        let source = include_str!("everywhere.rs");
        let of_arms = source.lines().filter(|line| line.trim_start().starts_with('"'));
        let names: Vec<&str> = of_arms.filter_map(|line| line.split('"').nth(1)).collect();
        assert_eq!(names.len(), 5);
        for name in names {
            assert!(catalogue().iter().any(|mutant| mutant.name == name), "{name}");
        }
    }
}
