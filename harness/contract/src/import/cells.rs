//! Cells as a foreign file states them, their leaf words, and the root if the file states none.
//!
//! Every cell becomes the leaf of one octant or an error that names the cell: its edge is the root's edge halved a whole
//! number of times, its minimum corner is a multiple of its edge from the root's, both within [`TOLERANCE`] of its
//! edge, and no two cells overlap. Cells may leave parts of the root empty, and neighbours may differ by any
//! number of levels.

use super::TOLERANCE;
use crate::digest::Digest;
use crate::failure::{Failure, Result};
use crate::lattice::Root;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use crate::word::{self, Side};

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
    pub fn count(&self) -> usize {
        self.edges.len()
    }

    /// The sorted leaf words of the cells in a root. Cells without a side are `outside`.
    ///
    /// # Errors
    /// If a cell is not a leaf of an oct-tree with this root, or overlaps another.
    pub fn words(&self, root: &Root) -> Result<Vec<u64>> {
        let cell =
            |i: usize| format!("cell {i} (corner {:?}, edge {})", self.corners[i], self.edges[i]);
        let word = |i: usize| {
            let octant = octant(self.corners[i], self.edges[i], root).map_err(|why| {
                format!(
                    "{} {why}, where the root has the corner {:?} and the edge {}: correct the mesh, or have it imported with --root \
                     X,Y,Z,EDGE",
                    cell(i), root.origin, root.edge
                )
            })?;
            Ok(word::encode(octant, self.sides.as_ref().map_or(Side::Outside, |sides| sides[i])))
        };
        let in_order = (0..self.count()).map(word).collect::<Result<Vec<u64>, String>>()?;
        self.agree_with_levels(&in_order)?;
        let mut words = in_order.clone();
        words.sort_unstable();
        let overlaps =
            |w: &&[u64]| word::key(w[1]) < word::key(w[0]) + word::span(word::level(w[0]));
        let Some(pair) = words.windows(2).find(overlaps) else { return Ok(words) };
        let both = (0..self.count()).filter(|&i| pair.contains(&in_order[i])).map(cell);
        let both: Vec<String> = both.collect();
        Err(Failure::input(format!("{} overlaps {}: remove one of them", both[1], both[0])))
    }

    /// The levels of the words differ from those of the file by one constant.
    fn agree_with_levels(&self, words: &[u64]) -> Result<()> {
        let Some(levels) = &self.levels else { return Ok(()) };
        let offset = |i: usize| i64::from(word::level(words[i])).wrapping_sub(levels[i]);
        let Some(i) = (1..words.len()).find(|&i| offset(i) != offset(0)) else { return Ok(()) };
        Err(Failure::input(format!(
            "cell {i} has level {} and edge {}, but cell 0 has level {} and edge {}: levels and edges contradict each other",
            levels[i], self.edges[i], levels[0], self.edges[0]
        )))
    }

    /// The least root in which the cells can be leaves of one oct-tree, for a file that states none: its edge is a power of two of the coarsest
    /// cell's edge, and its faces are on the grid of the coarsest cells. It is the mesher's root if the mesh fills that; a mesh that fills less of
    /// its root may have a larger one.
    ///
    /// # Errors
    /// If there are no cells, if a number is not finite, or if the cells need more levels than exist.
    pub fn least_root(&self) -> Result<Root> {
        let unusable = |why: &str| {
            Failure::input(format!(
                "the root cannot be derived from the cells, because {why}: give it with --root X,Y,Z,EDGE"
            ))
        };
        let (edges, corners) = (&self.edges, &self.corners);
        let coarsest = edges.iter().zip(corners).max_by(|a, b| a.0.total_cmp(b.0));
        let (&edge, corner) = coarsest.ok_or_else(|| unusable("there are none"))?;
        let finest = edges.iter().copied().fold(f64::INFINITY, f64::min);
        let along = |axis: usize| corners.iter().map(move |corner| corner[axis]);
        let low = [0, 1, 2].map(|axis| along(axis).fold(f64::INFINITY, f64::min));
        let ends = |axis: usize| along(axis).zip(edges).map(|(low, edge)| low + edge);
        let high = [0, 1, 2].map(|axis| ends(axis).fold(f64::NEG_INFINITY, f64::max));
        let depth = (edge / finest).log2().round();
        let finite = low.iter().chain(&high).all(|c| c.is_finite()) && finest > 0.0;
        let why = "a coordinate is not finite, or an edge is not positive";
        Failure::unless(finite && depth.is_finite(), unusable(why))?;
        let why = format!(
            "has cells of {} levels, with edges from {finest} to {edge}, and the levels of a mesh are 0 to {LEVEL_MAX}",
            depth + 1.0,
        );
        Failure::unless(depth <= f64::from(LEVEL_MAX), why)?;
        // The extent of all cells is known more precisely than the edge of one, and is a whole number of finest cells.
        let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let scale = f64::from(1u32 << depth as u32);
        let edge = extent / (extent / (edge / scale)).round() * scale;
        let (mut origin, mut along) = ([0.0; 3], 1.0f64);
        // In coarsest cells: of the finest cell, which may lie beyond all coarser ones.
        let tolerance = TOLERANCE / scale;
        for axis in 0..3 {
            let below = (corner[axis] - low[axis]) / edge;
            let whole = (below - tolerance).ceil();
            let exact = (below - whole).abs() <= tolerance;
            origin[axis] = if exact { low[axis] } else { corner[axis] - whole * edge };
            along = along.max(((high[axis] - origin[axis]) / edge - tolerance).ceil());
        }
        Ok(Root { origin, edge: edge * along.log2().ceil().exp2() })
    }
}

/// The octant of a cell.
fn octant(corner: [f64; 3], edge: f64, root: &Root) -> Result<Octant> {
    let why = "has an edge that is not positive, or coordinates that are not finite";
    Failure::unless(Root { origin: corner, edge }.is_cube(), why)?;
    let depth = (root.edge / edge).log2().round();
    if !(0.0..=f64::from(LEVEL_MAX)).contains(&depth) {
        return Err(format!("needs level {depth} of the 0 to {LEVEL_MAX} that exist").into());
    }
    let level = depth as u8;
    let edge_of_level = root.edge_of(level);
    let why = "has an edge that is not the root's edge halved a whole number of times";
    Failure::unless((edge / edge_of_level - 1.0).abs() <= TOLERANCE, why)?;
    let mut cell = [0; 3];
    for axis in 0..3 {
        let position = (corner[axis] - root.origin[axis]) / edge_of_level;
        let index = position.round();
        if (position - index).abs() > TOLERANCE {
            let axis = ["x", "y", "z"][axis];
            return Err(Failure::input(format_args!(
                "is not aligned: it is {position} of its edges from the root along {axis}"
            )));
        }
        Failure::unless((0.0..f64::from(1u32 << level)).contains(&index), "lies outside the root")?;
        cell[axis] = index as u32 * (CELLS_PER_EDGE >> level);
    }
    Ok(Octant { corner: cell, level })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::cells_of;
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
        assert_eq!(whole.count(), 0);
        whole.push([TOLERANCE, 0.0, 0.0], 1.0);
        assert!(whole.count() == 1 && whole.words(&root).is_ok());
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

#[cfg(test)]
mod roots {
    use super::*;
    use crate::testing::{cells_of, words_of};

    const ROOT: Root = Root { origin: [-1.0, 2.0, 0.5], edge: 4.0 };

    #[test]
    fn cells_that_fill_their_root_give_it_back() {
        for depth in 0..5 {
            let words =
                words_of(|o| o.level == 0 && depth > 0 || o.level < depth && o.corner == [0; 3]);
            assert_eq!(cells_of(&words, &ROOT).least_root().unwrap(), ROOT);
        }
    }

    /// Leaves remain leaves in the derived root, whose levels differ from theirs by a constant.
    #[test]
    fn part_of_a_mesh_is_an_octree_in_its_least_root() {
        let words = words_of(|o| o.level < 2 || o.level < 4 && o.corner[0] >> 17 == 2);
        for part in [&words[3..], &words[..words.len() / 2], &words[words.len() / 3..][..5]] {
            let cells = cells_of(part, &ROOT);
            let root = cells.least_root().unwrap();
            assert!(root.edge <= ROOT.edge * 2.0);
            assert_eq!(cells.words(&root).unwrap().len(), part.len());
        }
    }

    #[test]
    fn the_root_begins_a_whole_number_of_coarsest_cells_below_the_first() {
        let mut cells = Cells::default();
        for (x, edge) in [(2.0, 2.0), (4.0, 2.0), (1.0, 1.0)] {
            cells.push([x, 0.0, 0.0], edge);
        }
        assert_eq!(cells.least_root().unwrap(), Root { origin: [0.0; 3], edge: 8.0 });
    }

    /// However small a cell beyond the coarsest ones is in them.
    #[test]
    fn a_small_cell_beyond_the_coarsest_is_in_the_root() {
        for edge in [0.5, 1.0 / 64.0, 1.0 / 128.0, 1.0 / 4096.0] {
            for (x, low) in [(1.0, 0.0), (-edge, -1.0), (-1.0, -1.0), (edge - 1.0, -1.0)] {
                let mut cells = Cells::default();
                cells.push([0.0; 3], 1.0);
                cells.push([x, 0.0, 0.0], edge);
                let root = cells.least_root().unwrap();
                assert_eq!(root, Root { origin: [low, 0.0, 0.0], edge: 2.0 }, "{edge} at {x}");
                assert_eq!(cells.words(&root).unwrap().len(), 2);
            }
        }
    }

    #[test]
    fn single_precision_coordinates_are_precise_enough() {
        let words = words_of(|o| o.level == 0 || o.level < 10 && o.corner == [0; 3]);
        let mut cells = cells_of(&words, &Root { origin: [0.1, 0.2, 0.3], edge: 0.7 });
        for i in 0..cells.count() {
            let far = cells.corners[i].map(|c| f64::from((c + cells.edges[i]) as f32));
            cells.corners[i] = cells.corners[i].map(|c| f64::from(c as f32));
            cells.edges[i] = far[0] - cells.corners[i][0];
        }
        let root = cells.least_root().unwrap();
        assert_eq!(cells.words(&root).unwrap(), words);
    }

    #[test]
    fn cells_without_a_root_are_an_error() {
        assert!(Cells::default().least_root().is_err());
        for edge in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut cells = Cells::default();
            cells.push([0.0; 3], edge);
            cells.push([0.0; 3], 1.0);
            let message = cells.least_root().unwrap_err().to_string();
            assert!(message.contains("--root"), "{message}");
        }
        for corner in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
            let mut cells = Cells::default();
            cells.push([0.0; 3], 1.0);
            cells.push([1.0, corner, 0.0], 1.0);
            let message = cells.least_root().map_err(|error| error.to_string());
            // A coordinate that is not a number bounds nothing, and is found when the cells become leaves.
            assert!(
                corner.is_nan() || message.is_err_and(|why| why.contains("--root")),
                "{corner}"
            );
        }
    }
}
