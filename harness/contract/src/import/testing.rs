//! Cells for tests.

use super::cells::Cells;
use crate::lattice::Root;
use crate::word;

/// The cells of leaf words.
pub(crate) fn cells_of(words: &[u64], root: &Root) -> Cells {
    let mut cells = Cells::default();
    for octant in words.iter().map(|&w| word::octant(w)) {
        cells.push(root.to_user(octant.bounds().0), root.edge_of(octant.level));
    }
    cells.sides = Some(words.iter().map(|&w| word::side(w)).collect());
    cells
}
