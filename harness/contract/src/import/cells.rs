//! Cells as a foreign file states them, and their leaf words.
//!
//! Every cell becomes the leaf of one octant or an error that names the cell: its edge is the root's edge halved a whole
//! number of times, its minimum corner is a multiple of its edge from the root's, both within [`TOLERANCE`] of its
//! edge, and no two cells overlap. Cells may leave parts of the root empty, and neighbours may differ by any
//! number of levels.

use super::TOLERANCE;
use crate::digest::Digest;
use crate::failure::Unusable;
use crate::lattice::Root;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use crate::word::{self, Leaf, Side};

/// The axis-aligned cubes of a file, in its order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Minimum corner of each cell.
    pub corners: Vec<[f64; 3]>,
    /// Edge length of each cell.
    pub edges: Vec<f64>,
    /// The level that the file gives each cell, from a level of its own: only differences have a meaning.
    pub levels: Option<Vec<i64>>,
    /// The side of each cell, if it was requested.
    pub sides: Option<Vec<Side>>,
    /// The root cube that the file states.
    pub root: Option<Root>,
    /// The digest that the file states for the leaves of its root with their sides.
    pub digest: Option<Digest>,
}

impl Cells {
    /// Adds a cell.
    pub fn push(&mut self, corner: [f64; 3], edge: f64) {
        self.corners.push(corner);
        self.edges.push(edge);
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// The sorted leaf words of the cells in a root. Cells without a side are `outside`.
    ///
    /// # Errors
    /// If a cell is not a leaf of an oct-tree with this root, or overlaps another.
    pub fn words(&self, root: &Root) -> Result<Vec<u64>, Unusable> {
        let mut words = self.words_in_order(root)?;
        self.agree_with_levels(&words)?;
        words.sort_unstable();
        let overlaps =
            |w: &&[u64]| word::key(w[1]) < word::key(w[0]) + word::span(word::level(w[0]));
        match words.windows(2).find(overlaps) {
            None => Ok(words),
            Some(pair) => Err(self.overlap(&self.words_in_order(root)?, pair)),
        }
    }

    fn words_in_order(&self, root: &Root) -> Result<Vec<u64>, Unusable> {
        let word = |i: usize| {
            let octant = octant(self.corners[i], self.edges[i], root)
                .map_err(|why| self.misfit(i, root, &why))?;
            let side = self.sides.as_ref().map_or(Side::Outside, |sides| sides[i]);
            Ok(word::encode(&Leaf { octant, side }))
        };
        (0..self.len()).map(word).collect()
    }

    /// The levels of the words differ from those of the file by one constant.
    fn agree_with_levels(&self, words: &[u64]) -> Result<(), Unusable> {
        let Some(levels) = &self.levels else { return Ok(()) };
        let offset = |i: usize| i64::from(word::level(words[i])).wrapping_sub(levels[i]);
        match (1..words.len()).find(|&i| offset(i) != offset(0)) {
            None => Ok(()),
            Some(i) => Err(Unusable::because(format!(
                "cell {i} has level {} and edge {}, but cell 0 has level {} and edge {}: levels and edges contradict each \
                 other",
                levels[i], self.edges[i], levels[0], self.edges[0]
            ))),
        }
    }

    fn misfit(&self, i: usize, root: &Root, why: &str) -> Unusable {
        let (corner, edge, Root { origin, edge: root }) = (self.corners[i], self.edges[i], root);
        Unusable::because(format!(
            "cell {i} (corner {corner:?}, edge {edge}) {why}, where the root has the corner {origin:?} and the edge {root}: \
             correct the mesh, or the root with --root X,Y,Z,EDGE"
        ))
    }

    /// The error for two words that overlap; `words` are those of the cells in the order of the file.
    fn overlap(&self, words: &[u64], pair: &[u64]) -> Unusable {
        let at =
            |i: usize| format!("cell {i} (corner {:?}, edge {})", self.corners[i], self.edges[i]);
        let both: Vec<_> = (0..words.len()).filter(|&i| pair.contains(&words[i])).map(at).collect();
        Unusable::because(format!("{} overlaps {}: remove one of them", both[1], both[0]))
    }
}

/// The octant of a cell.
fn octant(corner: [f64; 3], edge: f64, root: &Root) -> Result<Octant, String> {
    if !(edge > 0.0 && edge.is_finite() && corner.iter().all(|c| c.is_finite())) {
        return Err(
            "has an edge that is not positive, or coordinates that are not finite".to_owned()
        );
    }
    let depth = (root.edge / edge).log2().round();
    let level = if (0.0..=f64::from(LEVEL_MAX)).contains(&depth) {
        depth as u8
    } else {
        return Err(format!("needs level {depth} of the 0 to {LEVEL_MAX} that exist"));
    };
    let edge_of_level = root.edge / f64::from(1u32 << level);
    if (edge / edge_of_level - 1.0).abs() > TOLERANCE {
        return Err(
            "has an edge that is not the root's edge halved a whole number of times".to_owned()
        );
    }
    let mut cell = [0; 3];
    for axis in 0..3 {
        let position = (corner[axis] - root.origin[axis]) / edge_of_level;
        let index = position.round();
        if (position - index).abs() > TOLERANCE {
            return Err(format!(
                "is not aligned: it is {position} of its edges from the root along axis {}",
                axis + 1
            ));
        }
        if !(0.0..f64::from(1u32 << level)).contains(&index) {
            return Err("lies outside the root".to_owned());
        }
        cell[axis] = index as u32 * (CELLS_PER_EDGE >> level);
    }
    Ok(Octant { corner: cell, level })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::testing::cells_of;
    use crate::testing::random_words;
    use proptest::prelude::*;

    const ROOT: Root = Root { origin: [-1.0, 2.0, 0.5], edge: 4.0 };

    proptest! {
        #[test]
        fn cells_in_any_order_become_their_words(words in random_words(4), turn in 0usize..1000) {
            let mut turned = words.clone();
            if !turned.is_empty() {
                turned.rotate_left(turn % words.len());
            }
            prop_assert_eq!(cells_of(&turned, &ROOT).words(&ROOT).unwrap(), words);
        }
    }

    fn refused(cells: &[([f64; 3], f64)]) -> String {
        let mut all = Cells::default();
        cells.iter().for_each(|&(corner, edge)| all.push(corner, edge));
        all.words(&Root { origin: [0.0; 3], edge: 1.0 }).unwrap_err().to_string()
    }

    #[test]
    fn each_misfit_names_its_cell() {
        let good = ([0.5, 0.0, 0.0], 0.5);
        let cases = [
            (
                ([0.0; 3], 0.3),
                "cell 1 (corner [0.0, 0.0, 0.0], edge 0.3) has an edge that is not the root's",
            ),
            (([0.1, 0.0, 0.0], 0.25), "cell 1 (corner [0.1, 0.0, 0.0], edge 0.25) is not aligned"),
            (
                ([0.0, 1.0, 0.0], 0.25),
                "cell 1 (corner [0.0, 1.0, 0.0], edge 0.25) lies outside the root",
            ),
            (([0.0; 3], 2.0), "cell 1 (corner [0.0, 0.0, 0.0], edge 2) needs level -1"),
            (([0.0; 3], 1e-9), "needs level 30"),
            (([0.0; 3], f64::NAN), "has an edge that is not positive"),
            (([0.0, f64::INFINITY, 0.0], 0.5), "not finite"),
            (good, "cell 1 (corner [0.5, 0.0, 0.0], edge 0.5) overlaps cell 0"),
            (
                ([0.75, 0.0, 0.0], 0.25),
                "cell 1 (corner [0.75, 0.0, 0.0], edge 0.25) overlaps cell 0",
            ),
        ];
        for (cell, expected) in cases {
            let message = refused(&[good, cell]);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn rounded_coordinates_are_accepted_within_the_tolerance() {
        let mut cells = Cells::default();
        cells.push([0.5004, 0.2497, 0.0], 0.2496);
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        assert_eq!(word::octant(cells.words(&root).unwrap()[0]).path(), "1.2");
        cells.corners[0][0] = 0.503;
        assert!(cells.words(&root).is_err());
        // The limit itself, which a cell of the root's size can have exactly.
        let mut whole = Cells::default();
        assert!(whole.is_empty());
        whole.push([TOLERANCE, 0.0, 0.0], 1.0);
        assert!(!whole.is_empty() && whole.words(&root).is_ok());
        whole.corners[0][0] = TOLERANCE.next_up();
        assert!(whole.words(&root).is_err());
    }

    #[test]
    fn levels_that_contradict_the_edges_are_an_error() {
        let mut cells = Cells::default();
        cells.push([0.0; 3], 0.5);
        cells.push([0.5, 0.0, 0.0], 0.25);
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        cells.levels = Some(vec![3, 4]);
        assert!(cells.words(&root).is_ok());
        cells.levels = Some(vec![3, 5]);
        let message = cells.words(&root).unwrap_err().to_string();
        assert!(message.contains("cell 1 has level 5"), "{message}");
    }
}
