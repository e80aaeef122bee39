//! The root cube of cells whose file states none: the least cube in which they can be leaves of one oct-tree.

use super::cells::Cells;
use crate::failure::Unusable;
use crate::lattice::Root;
use crate::octant::LEVEL_MAX;

/// The least root of these cells: its edge is a power of two of the coarsest cell's edge, and its faces are on the grid of
/// the coarsest cells. It is the mesher's root if the mesh fills that; a mesh that fills less of its root may have a
/// larger one.
///
/// # Errors
/// If there are no cells, if a number is not finite, or if the cells need more levels than exist.
pub fn derive(cells: &Cells) -> Result<Root, Unusable> {
    let unusable = |why: &str| {
        Unusable::because(format!(
            "the root cannot be derived from the cells, because {why}: give it with --root X,Y,Z,EDGE"
        ))
    };
    let Some(coarsest) =
        (0..cells.len()).max_by(|&a, &b| cells.edges[a].total_cmp(&cells.edges[b]))
    else {
        return Err(unusable("there are none"));
    };
    let finest = cells.edges.iter().copied().fold(f64::INFINITY, f64::min);
    let (low, high) = bounds(cells);
    let depth = (cells.edges[coarsest] / finest).log2().round();
    let finite = low.iter().chain(&high).all(|c| c.is_finite()) && finest > 0.0;
    if !finite || !depth.is_finite() {
        return Err(unusable("a coordinate is not finite, or an edge is not positive"));
    }
    if depth > f64::from(LEVEL_MAX) {
        return Err(Unusable::because(format!(
            "has cells of {} levels, with edges from {finest} to {}, and the levels of a mesh are 0 to {LEVEL_MAX}",
            depth + 1.0,
            cells.edges[coarsest]
        )));
    }
    // The extent of all cells is known more precisely than the edge of one, and is a whole number of finest cells.
    let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let scale = f64::from(1u32 << depth as u32);
    let edge = extent / (extent / (cells.edges[coarsest] / scale)).round() * scale;
    let (mut origin, mut along) = ([0.0; 3], 1.0f64);
    for axis in 0..3 {
        let below = (cells.corners[coarsest][axis] - low[axis]) / edge;
        let whole = (below - 0.01).ceil();
        let exact = (below - whole).abs() <= 0.01;
        origin[axis] = if exact { low[axis] } else { cells.corners[coarsest][axis] - whole * edge };
        along = along.max(((high[axis] - origin[axis]) / edge - 0.01).ceil());
    }
    Ok(Root { origin, edge: edge * along.log2().ceil().exp2() })
}

/// Minimum and maximum corner of all cells.
fn bounds(cells: &Cells) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (corner, edge) in cells.corners.iter().zip(&cells.edges) {
        for axis in 0..3 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis] + edge);
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::testing::cells_of;
    use crate::testing::words_of;

    const ROOT: Root = Root { origin: [-1.0, 2.0, 0.5], edge: 4.0 };

    #[test]
    fn cells_that_fill_their_root_give_it_back() {
        for depth in 0..5 {
            let words =
                words_of(|o| o.level == 0 && depth > 0 || o.level < depth && o.corner == [0; 3]);
            assert_eq!(derive(&cells_of(&words, &ROOT)).unwrap(), ROOT);
        }
    }

    /// Leaves remain leaves in the derived root, whose levels differ from theirs by a constant.
    #[test]
    fn part_of_a_mesh_is_an_octree_in_its_least_root() {
        let words = words_of(|o| o.level < 2 || o.level < 4 && o.corner[0] >> 17 == 2);
        for part in [&words[3..], &words[..words.len() / 2], &words[words.len() / 3..][..5]] {
            let cells = cells_of(part, &ROOT);
            let root = derive(&cells).unwrap();
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
        assert_eq!(derive(&cells).unwrap(), Root { origin: [0.0; 3], edge: 8.0 });
    }

    #[test]
    fn single_precision_coordinates_are_precise_enough() {
        let words = words_of(|o| o.level == 0 || o.level < 10 && o.corner == [0; 3]);
        let mut cells = cells_of(&words, &Root { origin: [0.1, 0.2, 0.3], edge: 0.7 });
        for i in 0..cells.len() {
            let far = cells.corners[i].map(|c| f64::from((c + cells.edges[i]) as f32));
            cells.corners[i] = cells.corners[i].map(|c| f64::from(c as f32));
            cells.edges[i] = far[0] - cells.corners[i][0];
        }
        let root = derive(&cells).unwrap();
        assert_eq!(cells.words(&root).unwrap(), words);
    }

    #[test]
    fn cells_without_a_root_are_an_error() {
        assert!(derive(&Cells::default()).is_err());
        for edge in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut cells = Cells::default();
            cells.push([0.0; 3], edge);
            cells.push([0.0; 3], 1.0);
            let message = derive(&cells).unwrap_err().to_string();
            assert!(message.contains("--root"), "{message}");
        }
        for corner in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
            let mut cells = Cells::default();
            cells.push([0.0; 3], 1.0);
            cells.push([1.0, corner, 0.0], 1.0);
            let message = derive(&cells).map_err(|error| error.to_string());
            // A coordinate that is not a number bounds nothing, and is found when the cells become leaves.
            assert!(
                corner.is_nan() || message.is_err_and(|why| why.contains("--root")),
                "{corner}"
            );
        }
    }
}
