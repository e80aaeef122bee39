//! The patches of the faces at bodies with several named solids.
//!
//! The nearest solid is found once per face. Faces that neighbour each other mostly are at the same solid, so only the faces are kept
//! at which it changes.

use std::ops::Range;

/// The patches of faces, in the order of the cells, and of the squares of a cell.
#[derive(Debug, Default)]
pub struct Solids {
    /// Cell, square and patch of the first face of every run of faces in the same patch.
    runs: Vec<(u32, u32, u32)>,
}

impl Solids {
    /// Adds the next face, which is a square of a cell.
    pub fn push(&mut self, cell: u32, square: usize, patch: usize) {
        let run = (cell, square as u32, patch as u32);
        if self.runs.last().is_none_or(|last| last.2 != run.2) {
            self.runs.push(run);
        }
    }

    /// The patch of a face.
    pub fn patch(&self, cell: u32, square: usize) -> usize {
        let end = self.runs.partition_point(|&(c, s, _)| (c, s) <= (cell, square as u32));
        self.runs[end - 1].2 as usize
    }

    /// Whether cells may have faces in a patch.
    pub fn may_have(&self, cells: &Range<u32>, patch: usize) -> bool {
        let begin = self.runs.partition_point(|run| run.0 < cells.start).saturating_sub(1);
        let mut runs = self.runs[begin..].iter().take_while(|run| run.0 < cells.end);
        runs.any(|run| run.2 as usize == patch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_face_keeps_its_patch(faces in prop::collection::vec((0u32..3, 1usize..4, 0usize..3), 1..40)) {
            let mut solids = Solids::default();
            let (mut cell, mut square) = (5, 0);
            let faces: Vec<_> = faces.into_iter().map(|(cells, squares, patch)| {
                (cell, square) = if cells > 0 { (cell + cells, 0) } else { (cell, square + squares) };
                solids.push(cell, square, patch);
                (cell, square, patch)
            }).collect();
            for &(cell, square, patch) in &faces {
                prop_assert_eq!(solids.patch(cell, square), patch);
                for cells in [cell..cell + 1, 0..cell + 1, cell..cell + 100] {
                    prop_assert!(solids.may_have(&cells, patch));
                }
            }
            let some = faces[0].2;
            prop_assert!(!solids.may_have(&(0..1000), 3) && !solids.may_have(&(0..5), some));
        }
    }
}
