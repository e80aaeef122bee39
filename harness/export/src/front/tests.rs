use super::*;
use crate::testing::{in_root, on_disk, whole};
use contract::octant::Octant;
use contract::testing::{random_words, words_with_sides};
use contract::word::KEY_END;
use proptest::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::HashMap;
use std::fs;

/// Without the cells of edge 1 that a plate at z = 3.3 crosses, both sheets end at the root's boundary, along 32 edges each.
#[test]
fn both_sides_of_a_plate_are_open_at_the_boundary() {
    let root = Root { origin: [0.0; 3], edge: 8.0 };
    let words =
        words_with_sides(|o| o.level < 3, |o| (o.corner[2] >> 16 != 3).then_some(Side::Outside));
    let (dir, mesh) = in_root(&words, 2, |i| i / 256, root);
    let path = dir.path().join("front.vtp");
    let summary = vtp(&whole(&mesh), &path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!((summary.leaves, summary.bytes), (128, text.len() as u64));
    assert!(summary.notes[0].starts_with("a surface of area 128, open at 64 edges"), "{summary:?}");
    for array in ["level", "side", "spacing"] {
        assert!(text.contains(&format!("Name=\"{array}\"")), "{array}");
    }
}

#[test]
fn the_triangles_of_a_file_are_as_closed_as_the_polygons() {
    // A hole of level 3 beside leaves of levels 2 and 3.
    let words = words_with_sides(
        |o| o.level < 2 || o.level < 3 && o.corner.iter().all(|&c| c >> 17 == 1),
        |o| (o.corner.iter().any(|&c| c >> 17 != 1 && c >> 17 != 2)).then_some(Side::Outside),
    );
    let (dir, mesh) = on_disk(&words, 1, |_| 0);
    let path = dir.path().join("front.stl");
    let summary = stl(&whole(&mesh), &path).unwrap();
    assert!(summary.notes[0].ends_with("closed"), "{summary:?}");
    let bytes = fs::read(path).unwrap();
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (mut edges, mut volume) = (HashMap::<_, u32>::new(), 0.0);
    for facet in (84..bytes.len()).step_by(50) {
        let [a, b, c]: [[f32; 3]; 3] = std::array::from_fn(|v| {
            std::array::from_fn(|axis| number(facet + 12 + 12 * v + 4 * axis))
        });
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = (p.map(f32::to_bits), q.map(f32::to_bits));
            *edges.entry((p.min(q), p.max(q))).or_default() += 1;
        }
        volume += (0..3)
            .map(|x| a[x] * (b[(x + 1) % 3] * c[(x + 2) % 3] - b[(x + 2) % 3] * c[(x + 1) % 3]))
            .sum::<f32>()
            / 6.0;
    }
    assert!(edges.values().all(|count| count % 2 == 0));
    assert!((volume - 0.125).abs() < 1e-6, "{volume}");
}

/// Cells are 0.99 wide, and f32 numbers near 1e4 and 1e6 are 0.001 and 0.06 apart.
#[test]
fn numbers_that_would_move_corners_are_refused() {
    let words =
        words_with_sides(|o| o.level < 3, |o| (o.corner[2] >> 16 != 3).then_some(Side::Outside));
    for (x, is_resolved) in [(1e4, true), (1e6, false)] {
        let root = Root { origin: [x, 0.0, 0.0], edge: 7.92 };
        let (dir, mesh) = in_root(&words, 1, |_| 0, root);
        let path = dir.path().join("front.stl");
        let written = stl(&whole(&mesh), &path);
        let refusal = written.err().map_or(String::new(), |failure| failure.to_string());
        assert_eq!(refusal.contains("which do not resolve the faces"), !is_resolved, "{refusal}");
        assert_eq!(path.exists(), is_resolved);
    }
}

/// Level of the finest cells of the random meshes.
const LEVEL: u8 = 4;

fn faces(words: &[u64], parts: usize) -> Vec<Face> {
    let (_dir, mesh) = on_disk(words, parts, |i| i / 5);
    front(&whole(&mesh)).unwrap()
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
            prop_assert_eq!(leaf, (face.leaf, !face.square.is_high));
            let edge = edge_of(face.square.level) as u32 / scale;
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

/// Random trees whose leaves at the root's boundary are present, so that the front is closed.
fn closed_words() -> impl Strategy<Value = Vec<u64>> {
    any::<u64>().prop_map(|seed| {
        let pick = |o: &Octant, salt: u64| {
            let word = word::key_of(o.corner) << 5 | u64::from(o.level);
            (contract::digest::mix(word ^ seed.rotate_left(salt as u32 * 8)) >> 100) as u64
        };
        let at_boundary =
            |o: &Octant| o.corner.iter().any(|&c| c == 0 || c + o.edge() == Octant::ROOT.edge());
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

fn front_of(words: &[u64]) -> Front {
    let (_dir, mesh) = on_disk(words, 1, |_| 0);
    Front::new(mesh.manifest.root, front(&whole(&mesh)).unwrap())
}

proptest! {
    #[test]
    fn every_edge_belongs_to_an_even_number_of_polygons(words in closed_words()) {
        let Front { polygons, .. } = front_of(&words);
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
        let Front { points, polygons, .. } = front_of(&words);
        // Six times the volume, from the tetrahedra of a fan and the origin.
        let mut volume = 0i128;
        for corners in polygons.iter() {
            let p = |i: usize| points.all[corners[i] as usize].map(i128::from);
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
    let noticed = |why: &str, change: &dyn Fn(&mut Front)| {
        let mut front = front_of(&words);
        assert_eq!(front.edges_open(), 0);
        front.check_invariants(true);
        change(&mut front);
        let check = std::panic::AssertUnwindSafe(|| front.check_invariants(true));
        let caught = std::panic::catch_unwind(check).unwrap_err();
        let message = caught.downcast_ref::<String>().expect("a message with values");
        assert!(message.contains(why), "{message}");
    };
    noticed("a polygon for every face", &|front| front.faces.truncate(3));
    noticed("twice the area", &|front| front.faces[0].square.is_high ^= true);
    noticed("twice the area", &|front| front.polygons.corners.swap(0, 1));
    noticed("that add up to", &|Front { faces, polygons, .. }| {
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
    let Front { faces, polygons, .. } = front_of(&words_with_sides(
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
