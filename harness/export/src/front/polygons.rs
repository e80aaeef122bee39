//! The squares of a front as polygons that fit together.
//!
//! Where a large square borders smaller ones, their corners on its edges become corners of its polygon, as in a mesh of polyhedra: then
//! every edge belongs to an even number of polygons, except where the front ends at the root's boundary or at the limits of
//! a selection.
//!
//! Invariants: every polygon is the square of its face with points on its edges, and faces the leaf; the areas of a closed front cancel.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use super::faces::Face;

/// The polygons of a front.
#[derive(Debug, Default)]
pub struct Polygons {
    /// The corners of all squares, in level-19 cells.
    pub points: Vec<[u32; 3]>,
    /// The corners of all polygons, one polygon after the other, counterclockwise as seen from the leaf.
    pub corners: Vec<u32>,
    /// One past the last corner of each polygon, in the order of the faces.
    pub ends: Vec<u64>,
}

impl Polygons {
    /// The polygons of some faces.
    pub fn new(faces: &[Face]) -> Self {
        let mut polygons = Self::default();
        let mut indices = FxHashMap::default();
        for corner in faces.iter().flat_map(Face::corners) {
            if let Entry::Vacant(vacant) = indices.entry(corner) {
                vacant.insert(polygons.points.len() as u32);
                polygons.points.push(corner);
            }
        }
        for face in faces {
            let corners = face.corners();
            for (i, &from) in corners.iter().enumerate() {
                polygons.corners.push(indices[&from]);
                let index = |point| indices.get(&point).copied();
                hanging(from, corners[(i + 1) % 4], &index, &mut polygons.corners);
            }
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
            let area = area(corners.iter().map(|&c| self.points[c as usize]));
            let edge = i64::from(face.edge());
            let mut expected = [0; 3];
            expected[face.square.axis] =
                if face.is_leaf_above() { 2 * edge * edge } else { -2 * edge * edge };
            assert_eq!(area, expected, "twice the area of {face:?}");
            (0..3).for_each(|a| sum[a] += area[a]);
        }
        assert!(!is_closed || sum == [0; 3], "a closed front of areas that add up to {sum:?}");
    }
}

/// Twice the area vector of a polygon, in level-19 cells.
fn area(corners: impl Iterator<Item = [u32; 3]>) -> [i64; 3] {
    let corners: Vec<[i64; 3]> = corners.map(|c| c.map(i64::from)).collect();
    let next = corners.iter().cycle().skip(1);
    let mut area = [0; 3];
    for (p, q) in corners.iter().zip(next) {
        for a in 0..3 {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            area[a] += p[b] * q[c] - p[c] * q[b];
        }
    }
    area
}

/// Adds the points within an edge, in order: those that bisect it, or bisect a half of it, and so on. Squares are aligned with the
/// oct-tree, so where there are any, one is the middle.
pub(crate) fn hanging(
    from: [u32; 3],
    to: [u32; 3],
    index_of: &impl Fn([u32; 3]) -> Option<u32>,
    corners: &mut Vec<u32>,
) {
    let middle = std::array::from_fn(|a| u32::midpoint(from[a], to[a]));
    match index_of(middle) {
        Some(index) if middle != from && middle != to => {
            hanging(from, middle, index_of, corners);
            corners.push(index);
            hanging(middle, to, index_of, corners);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::front::faces::front;
    use crate::mesh::Mesh;
    use crate::selection::Selection;
    use crate::testing::{on_disk, options};
    use contract::octant::Octant;
    use contract::testing::words_with_sides;
    use contract::word::{self, KEY_END, Side};
    use proptest::prelude::*;

    /// Random trees whose leaves at the root's boundary are present, so that the front is closed.
    fn closed_words() -> impl Strategy<Value = Vec<u64>> {
        any::<u64>().prop_map(|seed| {
            let pick = |o: &Octant, salt: u64| {
                let word = word::key_of(o.corner) << 5 | u64::from(o.level);
                (contract::digest::mix(word ^ seed.rotate_left(salt as u32 * 8)) >> 100) as u64
            };
            let at_boundary = |o: &Octant| {
                o.corner.iter().any(|&c| c == 0 || c + o.edge() == Octant::ROOT.edge())
            };
            words_with_sides(
                |o| o.level < 2 || o.level < 4 && pick(o, 0) % 5 < 2,
                |o| match pick(o, 1) % 4 {
                    0 if !at_boundary(o) => None,
                    1 if !at_boundary(o) => Some(Side::Crossing),
                    2 => Some(Side::Inside),
                    _ => Some(Side::Outside),
                },
            )
        })
    }

    fn front_of(words: &[u64]) -> (Vec<Face>, Polygons) {
        let (_dir, mesh): (_, Mesh) = on_disk(words, 1, |_| 0);
        let faces = front(&mesh, &Selection::default(), &options()).unwrap();
        let polygons = Polygons::new(&faces);
        (faces, polygons)
    }

    proptest! {
        #[test]
        fn every_edge_belongs_to_an_even_number_of_polygons(words in closed_words()) {
            let (_, polygons) = front_of(&words);
            let mut counts: FxHashMap<(u32, u32), u32> = FxHashMap::default();
            for corners in polygons.iter() {
                for (i, &from) in corners.iter().enumerate() {
                    let to = corners[(i + 1) % corners.len()];
                    prop_assert_ne!(from, to);
                    *counts.entry((from.min(to), from.max(to))).or_default() += 1;
                }
            }
            prop_assert!(counts.values().all(|count| count % 2 == 0));
        }

        #[test]
        fn the_volume_within_is_what_the_leaves_on_a_side_leave_empty(words in closed_words()) {
            let (_, polygons) = front_of(&words);
            // Six times the volume, from the tetrahedra of a fan and the origin.
            let mut volume = 0i128;
            for corners in polygons.iter() {
                let p = |i: usize| polygons.points[corners[i] as usize].map(i128::from);
                for i in 2..corners.len() {
                    let (a, b, c) = (p(0), p(i - 1), p(i));
                    volume += (0..3).map(|x| {
                        let (y, z) = ((x + 1) % 3, (x + 2) % 3);
                        a[x] * (b[y] * c[z] - b[z] * c[y])
                    }).sum::<i128>();
                }
            }
            let on_a_side = words.iter().filter(|&&w| word::side(w) != Side::Crossing);
            let filled: u64 = on_a_side.map(|&w| word::span(word::level(w))).sum();
            prop_assert_eq!(volume, 6 * i128::from(KEY_END - filled));
        }
    }

    #[test]
    fn planted_wrong_surfaces_are_noticed() {
        // The cells around a hole, of two levels.
        let words = words_with_sides(
            |o| o.level < 2 || o.level < 3 && o.corner[0] == 0,
            |o| (o.ancestor(2).corner.map(|c| c >> 17) != [1, 2, 1]).then_some(Side::Outside),
        );
        let noticed = |why: &str, change: &dyn Fn(&mut Vec<Face>, &mut Polygons)| {
            let (mut faces, mut polygons) = front_of(&words);
            assert_eq!(polygons.edges_open(), 0);
            polygons.check_invariants(&faces, true);
            change(&mut faces, &mut polygons);
            let check = std::panic::AssertUnwindSafe(|| polygons.check_invariants(&faces, true));
            let caught = std::panic::catch_unwind(check).unwrap_err();
            let message = caught.downcast_ref::<String>().expect("a message with values");
            assert!(message.contains(why), "{message}");
        };
        noticed("a polygon for every face", &|faces, _| faces.truncate(3));
        noticed("twice the area", &|faces, _| faces[0].square.is_high ^= true);
        noticed("twice the area", &|_, polygons| polygons.corners.swap(0, 1));
        noticed("that add up to", &|faces, polygons| {
            faces.pop();
            polygons.ends.pop();
            polygons.corners.truncate(*polygons.ends.last().unwrap() as usize);
        });
    }

    #[test]
    fn an_edge_may_be_divided_more_than_once() {
        let half = Octant::ROOT.edge() / 2;
        // The lower half of the root is filled: one child with leaves of level 4, three leaves of level 1.
        let is_fine = |o: &Octant| o.corner[0] >= half && o.corner[1] < half && o.corner[2] < half;
        let (faces, polygons) = front_of(&words_with_sides(
            |o| o.level == 0 || o.level < 4 && is_fine(o),
            |o| (o.corner[2] < half).then_some(Side::Outside),
        ));
        let corners_of = |level| {
            let of_level =
                faces.iter().zip(polygons.iter()).filter(move |(f, _)| f.square.level == level);
            let mut counts: Vec<usize> = of_level.map(|(_, corners)| corners.len()).collect();
            counts.sort_unstable();
            counts
        };
        assert_eq!(corners_of(1), [4, 4 + 7, 4 + 7]);
        assert_eq!(corners_of(4), [4; 64]);
    }
}
