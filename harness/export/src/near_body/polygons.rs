//! The squares of a front as polygons that fit together.
//!
//! Where a large square borders smaller ones, their corners on its edges become corners of its polygon, as in a mesh of polyhedra: then
//! every edge belongs to an even number of polygons, except where the front ends at the root's boundary or at the limits of
//! a selection.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use super::front::Face;

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
    use crate::mesh::Mesh;
    use crate::near_body::front::front;
    use crate::selection::Selection;
    use crate::testing::on_disk;
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
        let faces = front(&mesh, &Selection::default(), &|| Ok(())).unwrap();
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
    fn an_edge_may_be_divided_more_than_once() {
        let half = Octant::ROOT.edge() / 2;
        // The lower half of the root is filled: one child with leaves of level 4, three leaves of level 1.
        let is_fine = |o: &Octant| o.corner[0] >= half && o.corner[1] < half && o.corner[2] < half;
        let (faces, polygons) = front_of(&words_with_sides(
            |o| o.level == 0 || o.level < 4 && is_fine(o),
            |o| (o.corner[2] < half).then_some(Side::Outside),
        ));
        let corners_of = |level| {
            let of_level = faces.iter().zip(polygons.iter()).filter(move |(f, _)| f.level == level);
            let mut counts: Vec<usize> = of_level.map(|(_, corners)| corners.len()).collect();
            counts.sort_unstable();
            counts
        };
        assert_eq!(corners_of(1), [4, 4 + 7, 4 + 7]);
        assert_eq!(corners_of(4), [4; 64]);
    }
}
