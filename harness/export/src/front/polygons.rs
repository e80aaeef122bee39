//! The squares of a front as polygons that fit together.
//!
//! Where a large square borders smaller ones, their corners on its edges become corners of its polygon, as in a mesh of polyhedra: then
//! every edge belongs to an even number of polygons, except where the front ends at the root's boundary or at the limits of
//! a selection.
//!
//! Invariants: every polygon is the square of its face with points on its edges, and faces the leaf; the areas of a closed front cancel.

use super::Face;
use crate::points::Points;

/// The polygons of a front.
#[derive(Debug, Default)]
pub struct Polygons {
    /// The corners of all squares.
    pub points: Points,
    /// The corners of all polygons, one polygon after the other, counterclockwise as seen from the leaf.
    pub corners: Vec<u32>,
    /// One past the last corner of each polygon, in the order of the faces.
    pub ends: Vec<u64>,
}

impl Polygons {
    /// The polygons of some faces.
    pub fn new(faces: &[Face]) -> Self {
        let mut polygons = Self::default();
        for corner in faces.iter().flat_map(Face::corners) {
            polygons.points.add(corner);
        }
        for face in faces {
            polygons.points.polygon(face.corners(), &mut polygons.corners);
            polygons.ends.push(polygons.corners.len() as u64);
        }
        polygons
    }

    /// The corners of each polygon.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let begins = std::iter::once(&0).chain(&self.ends);
        begins.zip(&self.ends).map(|(&begin, &end)| &self.corners[begin as usize..end as usize])
    }

    /// Number of edges that belong to an odd number of polygons: 0 if the front is closed.
    pub fn edges_open(&self) -> u64 {
        let mut edges = Vec::with_capacity(self.corners.len());
        for corners in self.iter() {
            let next = corners.iter().cycle().skip(1);
            edges.extend(corners.iter().zip(next).map(|(&a, &b)| (a.min(b), a.max(b))));
        }
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).count() as u64
    }

    /// Asserts the invariants of the polygons of these faces.
    ///
    /// # Panics
    /// If one is violated.
    pub fn check_invariants(&self, faces: &[Face], is_closed: bool) {
        assert_eq!(self.ends.len(), faces.len(), "a polygon for every face");
        let mut sum = [0i64; 3];
        for (face, corners) in faces.iter().zip(self.iter()) {
            let area = self.points.area(corners);
            let edge = i64::from(face.square.edge());
            let mut expected = [0; 3];
            expected[face.square.axis] =
                if face.square.is_high { -2 * edge * edge } else { 2 * edge * edge };
            assert_eq!(area, expected, "twice the area of {face:?}");
            (0..3).for_each(|a| sum[a] += area[a]);
        }
        assert!(!is_closed || sum == [0; 3], "a closed front of areas that add up to {sum:?}");
    }
}
