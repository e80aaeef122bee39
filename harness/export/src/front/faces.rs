//! The front of a mesh towards the body: the faces at which its cells end at crossing leaves, deleted or not.
//!
//! A leaf on a side (not crossing) borders leaves of its own side and crossing leaves only, because a component is kept or deleted as
//! a whole. Where it borders neither the root's boundary nor a leaf on a side, a crossing leaf was deleted, or is there. Such
//! a face is exposed. A face that is exposed in part is divided into quarters, and these again, until each is exposed or
//! not; so no two squares of the front overlap, and a whole face is one square whatever the crossing leaves are like.

use contract::octant::CELLS_PER_EDGE;
use contract::word::Side;

use crate::leaves::{Content, Leaves};
use crate::mesh::Mesh;
use crate::options::Options;
use crate::selection::Selection;
use crate::squares::{Square, squares};
use contract::failure::Failure;

/// A square of the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The square; its level is that of the leaf, or deeper if only part of the leaf's face is exposed.
    pub square: Square,
    /// The word of the leaf, which is not crossing.
    pub leaf: u64,
}

impl Face {
    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.square.level
    }

    /// Whether the leaf is on the positive side.
    pub fn is_leaf_above(&self) -> bool {
        !self.square.is_high
    }

    /// The four corners in level-19 cells, counterclockwise as seen from the leaf.
    pub fn corners(&self) -> [[u32; 3]; 4] {
        let mut corners = self.square.corners();
        if !self.is_leaf_above() {
            corners[1..].reverse();
        }
        corners
    }
}

/// The faces of the selected leaves that belong to the front.
///
/// # Errors
/// If the mesh is not a linear oct-tree or cannot be read, or if the user interrupts.
pub fn front(
    mesh: &Mesh,
    selection: &Selection,
    options: &Options<'_>,
) -> Result<Vec<Face>, Failure> {
    // Without crossing leaves, exposed faces are those at holes.
    let leaves =
        Leaves::read(mesh, selection, options, &mut |leaf, _| leaf.side != Side::Crossing)?;
    let (mut faces, mut of_cell, mut words) = (Vec::new(), Vec::new(), leaves.cells());
    leaves.walk(options, &mut |_, around| {
        let leaf = words.next().expect("cells are visited in the order of their words");
        squares(&leaves, around, &mut of_cell);
        let exposed = of_cell.iter().filter(|square| square.across == Content::Hole);
        faces.extend(exposed.map(|&square| Face { square, leaf }));
        Ok(())
    })?;
    Ok(faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{on_disk, options};
    use contract::octant::Octant;
    use contract::testing::random_words;
    use contract::word;
    use proptest::prelude::*;
    use rustc_hash::FxHashMap;

    /// Level of the finest cells of the random meshes.
    const LEVEL: u8 = 4;

    fn faces(words: &[u64], parts: usize) -> Vec<Face> {
        let (_dir, mesh) = on_disk(words, parts, |i| i / 5);
        front(&mesh, &Selection::default(), &options()).unwrap()
    }

    /// A square of the finest level: its minimum corner in finest cells, and its axis.
    type Unit = ([u32; 3], usize);

    /// The word of the leaf, and whether it is above, for each square of the finest level between a cell on a side and one that
    /// is not: by brute force.
    fn expected(words: &[u64]) -> FxHashMap<Unit, (u64, bool)> {
        let scale = Octant::ROOT.child(0).edge() >> (LEVEL - 1);
        let mut cells: FxHashMap<[u32; 3], u64> = FxHashMap::default();
        for &w in words.iter().filter(|&&w| word::side(w) != Side::Crossing) {
            let octant = word::octant(w);
            let edge = octant.edge() / scale;
            for i in 0..edge.pow(3) {
                let along = [i % edge, i / edge % edge, i / edge / edge];
                cells.insert(std::array::from_fn(|a| octant.corner[a] / scale + along[a]), w);
            }
        }
        let mut expected = FxHashMap::default();
        let neighbours = |at: [u32; 3]| (0..3).flat_map(move |axis| [(at, axis, 0), (at, axis, 1)]);
        for (at, axis, end) in cells.keys().copied().flat_map(neighbours) {
            let mut other = at;
            match (end, at[axis]) {
                (0, 0) => continue,
                (0, _) => other[axis] -= 1,
                (_, last) if last + 1 == 1 << LEVEL => continue,
                _ => other[axis] += 1,
            }
            if !cells.contains_key(&other) {
                let mut corner = at;
                corner[axis] += end;
                expected.insert((corner, axis), (cells[&at], end == 0));
            }
        }
        expected
    }

    proptest! {
        #[test]
        fn the_front_is_what_brute_force_finds_and_its_squares_are_the_largest(
            words in random_words(LEVEL), parts in 1usize..4
        ) {
            let scale = Octant::ROOT.child(0).edge() >> (LEVEL - 1);
            let expected = expected(&words);
            let leaf_of = |face: &Face| {
                let corner = face.square.corner.map(|c| c / scale);
                expected.get(&(corner, face.square.axis)).copied()
            };
            let mut covered = 0;
            let faces = faces(&words, parts);
            for face in &faces {
                let (u, v) = ((face.square.axis + 1) % 3, (face.square.axis + 2) % 3);
                let leaf = leaf_of(face).unwrap();
                prop_assert_eq!(leaf, (face.leaf, face.is_leaf_above()));
                let edge = face.edge() / scale;
                for i in 0..edge * edge {
                    let mut at = face.square.corner.map(|c| c / scale);
                    at[u] += i % edge;
                    at[v] += i / edge;
                    prop_assert_eq!(expected.get(&(at, face.square.axis)), Some(&leaf));
                }
                covered += edge * edge;
                // Of a square that is not the whole face, the square of which it is a quarter is not exposed.
                if face.square.level > word::level(face.leaf) {
                    let size = 2 * edge;
                    let low = face.square.corner.map(|c| c / scale);
                    let parent = |a: usize| if a == face.square.axis { low[a] } else { low[a] / size * size };
                    let whole = (0..size * size).all(|i| {
                        let mut at: [u32; 3] = std::array::from_fn(parent);
                        at[u] += i % size;
                        at[v] += i / size;
                        expected.contains_key(&(at, face.square.axis))
                    });
                    prop_assert!(!whole);
                }
            }
            prop_assert_eq!(covered as usize, expected.len());
        }
    }
}
