//! The faces of a mesh: those between two cells, then those of each patch.
//!
//! Invariants, which are asserted before any file has its name:
//! - a face between cells is that of the cell with the lower number, and these faces ascend by both numbers: OpenFOAM's upper-triangular order;
//! - a face has at least four vertices, and every point of the mesh is a vertex;
//! - every cell is closed: each edge of a cell belongs to two of its faces, which run along it in opposite directions;
//! - the faces of the patches point out of the cells and enclose their volume, so each of them lies within the root.

use contract::octant::CELLS_PER_EDGE;
use contract::word;

use super::Patches;
use crate::leaves::Leaves;
use crate::points::{Points, Polygons, edges};
use contract::failure::Result;

/// The faces.
#[derive(Clone, Debug, Default)]
pub struct Faces {
    /// The cell that each face belongs to.
    pub owner: Vec<u32>,
    /// The cells across the faces between two cells, which come first.
    pub neighbour: Vec<u32>,
    /// Index of the first face of every patch, and the number of all faces.
    pub starts: Vec<usize>,
    /// The vertices of all faces, around normals that point away from the owners.
    pub vertices: Polygons,
}

impl Faces {
    /// The faces of the cells among leaves.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn new(leaves: &Leaves, points: &Points, patches: &Patches) -> Result<Self> {
        let mut all = Self::default();
        let mut of_patches = vec![Self::default(); patches.names.len()];
        let mut owned = Vec::new();
        leaves.walk(&mut |cell, _, squares| {
            owned.clear();
            for (i, square) in squares.iter().enumerate() {
                match square.across.as_cell() {
                    // The cell on the high side has the higher number.
                    Some(across) => owned.extend(square.is_high.then_some((across, i))),
                    None => {
                        let patch = &mut of_patches[patches.of(square)];
                        patch.vertices.push(points, square.corners(square.is_high));
                        patch.owner.push(cell);
                    }
                }
            }
            owned.sort_unstable();
            for &(across, i) in &owned {
                all.vertices.push(points, squares[i].corners(true));
                all.owner.push(cell);
                all.neighbour.push(across);
            }
        })?;
        for patch in of_patches {
            all.starts.push(all.count());
            let before = all.vertices.corners.len() as u64;
            all.owner.extend(patch.owner);
            all.vertices.corners.extend(patch.vertices.corners);
            all.vertices.ends.extend(patch.vertices.ends.iter().map(|end| before + end));
        }
        all.starts.push(all.count());
        Ok(all)
    }

    /// Number of faces.
    pub fn count(&self) -> usize {
        self.owner.len()
    }

    /// Asserts the invariants.
    ///
    /// # Panics
    /// If one is violated.
    pub fn check_invariants(&self, leaves: &Leaves, points: &Points) {
        let pairs = || self.owner.iter().zip(&self.neighbour);
        assert!(pairs().all(|(a, b)| a < b), "a face belongs to the cell with the higher number");
        assert!(pairs().is_sorted_by(|a, b| a < b), "a face is not in upper-triangular order");
        let cells = leaves.count;
        let exist = self.owner.iter().chain(&self.neighbour).all(|&cell| cell < cells);
        assert!(exist, "a face of cell {cells} or beyond");
        let (mut used, mut sums) = (vec![false; points.all.len()], vec![0u64; cells as usize]);
        let mut volume = 0;
        let is_beyond = points.all.as_flattened().iter().any(|&c| c > CELLS_PER_EDGE);
        assert!(!is_beyond, "a point outside of the root");
        for (face, (&owner, vertices)) in self.owner.iter().zip(self.vertices.iter()).enumerate() {
            assert!(vertices.len() >= 4, "face {face} of cell {owner} has {vertices:?} only");
            vertices.iter().for_each(|&v| used[v as usize] = true);
            let sum = sum_of_edges(vertices);
            let to = &mut sums[owner as usize];
            *to = to.wrapping_add(sum);
            match self.neighbour.get(face) {
                Some(&across) => sums[across as usize] = sums[across as usize].wrapping_sub(sum),
                // Twice the volume between the face and the plane x = 0.
                None => {
                    let x = points.all[vertices[0] as usize][0];
                    volume += i128::from(points.area(vertices)[0]) * i128::from(x);
                }
            }
        }
        assert_eq!(used.iter().position(|used| !used), None, "a point belongs to no face");
        assert_eq!(sums.iter().position(|&sum| sum != 0), None, "a cell is not closed");
        let of_cells: u64 = leaves.cells().map(|w| word::span(word::level(w))).sum();
        let expected = 2 * i128::from(of_cells);
        assert_eq!(volume, expected, "twice the volume within the patches, and that of cells");
    }
}

/// A sum over the edges of a polygon, in which the edges of a closed surface cancel, and others practically never.
fn sum_of_edges(vertices: &[u32]) -> u64 {
    let edge = |(from, to): (u32, u32)| {
        let mix = |a: u32, b: u32| contract::digest::mix(u64::from(a) << 32 | u64::from(b)) as u64;
        if from < to { mix(from, to) } else { mix(to, from).wrapping_neg() }
    };
    edges(vertices).map(edge).fold(0, u64::wrapping_add)
}

#[cfg(test)]
mod tests {
    use super::super::tests::mesh_of;
    use super::*;
    use contract::testing::words_of;

    /// Asserts that a change of the faces of a small mesh is noticed, and for the stated reason.
    fn assert_noticed(why: &str, change: impl Fn(&mut Faces)) {
        let words = words_of(|o| o.level == 0 || o.level == 1 && o.corner == [0; 3]);
        let mesh = mesh_of(&words, |_| false);
        mesh.faces.check_invariants(&mesh.leaves, &mesh.points);
        let mut faces = mesh.faces.clone();
        change(&mut faces);
        let check =
            std::panic::AssertUnwindSafe(|| faces.check_invariants(&mesh.leaves, &mesh.points));
        let caught = std::panic::catch_unwind(check).unwrap_err();
        let message = caught.downcast_ref::<String>().cloned();
        let message =
            message.or_else(|| caught.downcast_ref::<&str>().map(|m| (*m).to_owned())).unwrap();
        assert!(message.contains(why), "{message}");
    }

    #[test]
    fn planted_wrong_faces_are_noticed() {
        assert_noticed("higher number", |f| std::mem::swap(&mut f.owner[3], &mut f.neighbour[3]));
        assert_noticed("upper-triangular", |f| f.neighbour.swap(0, 1));
        assert_noticed("or beyond", |f| *f.neighbour.last_mut().unwrap() = 15);
        // A hanging node is missing in one face.
        assert_noticed("not closed", |f| {
            let face = f.vertices.iter().position(|face| face.len() == 5).unwrap();
            let begin = f.vertices.ends[face - 1] as usize;
            f.vertices.corners.remove(begin + 4);
            f.vertices.ends[face..].iter_mut().for_each(|end| *end -= 1);
        });
        assert_noticed("no face", |f| {
            let last = f.vertices.corners.iter().copied().max().unwrap();
            f.vertices.corners.iter_mut().filter(|v| **v == last).for_each(|v| *v -= 1);
        });
        // All cells are closed, but inside out.
        assert_noticed("the volume within", |f| {
            let mut begin = 0;
            for &end in &f.vertices.ends {
                f.vertices.corners[begin..end as usize].reverse();
                begin = end as usize;
            }
        });
    }
}
