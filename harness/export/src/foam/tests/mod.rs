//! Tests of exported meshes as complexes of polyhedra, in memory and as files.

mod directories;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use contract::case::Case;
use contract::leafset::LeafSet;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use contract::testing::{leaf_set, random_words, words_with_sides};
use contract::word::Side;
use proptest::prelude::*;

use super::*;
use crate::leaves::{CUT, Square};
use crate::points::Point;
use crate::selection::Selection;
pub use crate::testing::{export, whole};
use contract::mesh::Mesh as OnDisk;

/// Faces with their points, and the cells on both sides of each.
#[derive(Debug, Default)]
struct Complex {
    points: Vec<[f64; 3]>,
    faces: Vec<Vec<usize>>,
    owner: Vec<usize>,
    neighbour: Vec<usize>,
}

fn on_disk(set: &LeafSet) -> (tempfile::TempDir, OnDisk) {
    let dir = tempfile::tempdir().unwrap();
    set.create(&dir.path().join("mesh")).unwrap();
    let mesh = OnDisk::open(&dir.path().join("mesh")).unwrap();
    (dir, mesh)
}

/// The lists in a file, of items of these sizes.
fn lists<const N: usize>(path: &Path, sizes: [usize; N]) -> [Vec<u8>; N] {
    let bytes = fs::read(path).unwrap();
    let dictionary = bytes.windows(3).position(|w| w == b"}\n\n").unwrap() + 3;
    let mut rest = &bytes[dictionary..];
    let found = sizes.map(|size| {
        let end = rest.iter().position(|&b| b == b'\n').unwrap();
        let count: usize = std::str::from_utf8(&rest[..end]).unwrap().parse().unwrap();
        let parentheses = usize::from(count > 0);
        let begin = end + 1 + parentheses;
        let items = rest[begin..][..count * size].to_vec();
        rest = &rest[begin + count * size + parentheses + 1..];
        items
    });
    assert!(rest.is_empty(), "{}", path.display());
    found
}

/// Labels of 32 bits as labels of 64.
fn widened(bytes: &[u8]) -> Vec<u8> {
    let labels = bytes.as_chunks().0.iter().map(|label| i64::from(i32::from_le_bytes(*label)));
    labels.flat_map(i64::to_le_bytes).collect()
}

fn labels_of(bytes: &[u8]) -> Vec<usize> {
    bytes.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap()) as usize).collect()
}

fn complex_in(dir: &Path) -> Complex {
    let labels = |name: &str| labels_of(&lists(&dir.join(name), [4])[0]);
    let [ends, vertices] = lists(&dir.join("faces"), [4, 4]).map(|bytes| labels_of(&bytes));
    let [points] = lists(&dir.join("points"), [24]);
    let number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap());
    let point = |b: &[u8]| [0, 8, 16].map(|at| number(&b[at..at + 8]));
    Complex {
        points: points.chunks_exact(24).map(point).collect(),
        faces: ends.windows(2).map(|ends| vertices[ends[0]..ends[1]].to_vec()).collect(),
        owner: labels("owner"),
        neighbour: labels("neighbour"),
    }
}

/// Sorted words as leaves, some of which are cut.
fn leaves_of(words: &[u64], is_cut: impl Fn(u64) -> bool) -> Leaves {
    Leaves::new(words.iter().map(|&w| if is_cut(w) { w | CUT } else { w }).collect())
}

/// The mesh of these leaves.
pub fn mesh_of(words: &[u64], is_cut: impl Fn(u64) -> bool) -> Mesh {
    let patches = Patches::new(None, true);
    Mesh::new(leaves_of(words, is_cut), None, patches, Regions::All).unwrap()
}

impl Leaves {
    fn visit_all(&self, mut each: impl FnMut(u32, &Octant, &[Square])) {
        self.walk(&mut each).unwrap();
    }
}

/// The complex of sorted words, without files.
fn complex_of(words: &[u64]) -> Complex {
    let mesh = mesh_of(words, |_| false);
    let indices = |cells: &[u32]| cells.iter().map(|&cell| cell as usize).collect();
    Complex {
        points: mesh.points.all.iter().map(|p| p.map(f64::from)).collect(),
        faces: mesh.faces.vertices.iter().map(indices).collect(),
        owner: indices(&mesh.faces.owner),
        neighbour: indices(&mesh.faces.neighbour),
    }
}

impl Complex {
    /// Twice the area vector of a face.
    fn area(&self, face: usize) -> [f64; 3] {
        let at = |i: usize| self.points[self.faces[face][i % self.faces[face].len()]];
        let mut area = [0.0; 3];
        for i in 0..self.faces[face].len() {
            for a in 0..3 {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                area[a] += at(i)[b] * at(i + 1)[c] - at(i)[c] * at(i + 1)[b];
            }
        }
        area
    }

    /// Faces are squares with points on their edges, cells are closed and oriented, and nothing is left over.
    fn assert_closed(&self, cells: usize) {
        let mut edges: BTreeMap<(usize, usize, usize), i32> = BTreeMap::new();
        let mut sums = vec![[0.0; 3]; cells];
        let mut used: BTreeSet<usize> = BTreeSet::new();
        for (face, vertices) in self.faces.iter().enumerate() {
            let area = self.area(face);
            let along: Vec<usize> = (0..3).filter(|&a| area[a] != 0.0).collect();
            assert_eq!(along.len(), 1, "a face is normal to an axis: {area:?}");
            assert!(
                vertices
                    .iter()
                    .all(|&v| self.points[v][along[0]] == self.points[vertices[0]][along[0]])
            );
            let distinct: BTreeSet<_> = vertices.iter().collect();
            assert_eq!(distinct.len(), vertices.len());
            used.extend(vertices);
            let both = [(Some(&self.owner[face]), 1), (self.neighbour.get(face), -1)];
            for (cell, sign) in both.into_iter().filter_map(|(cell, sign)| Some((*cell?, sign))) {
                (0..3).for_each(|a| sums[cell][a] += f64::from(sign) * area[a]);
                for i in 0..vertices.len() {
                    let (from, to) = (vertices[i], vertices[(i + 1) % vertices.len()]);
                    let steps = (0..3).filter(|&a| self.points[from][a] != self.points[to][a]);
                    assert_eq!(steps.count(), 1, "an edge is parallel to an axis");
                    let direction = if from < to { sign } else { -sign };
                    // Two faces of a cell run along an edge, in opposite directions.
                    let key = (cell, from.min(to), from.max(to));
                    match edges.remove(&key) {
                        None => assert!(edges.insert(key, direction).is_none()),
                        Some(first) => assert_eq!(first, -direction),
                    }
                }
            }
        }
        assert!(edges.is_empty(), "edges with one face: {edges:?}");
        assert!(sums.iter().flatten().all(|&sum| sum == 0.0));
        assert_eq!(used.len(), self.points.len());
        let distinct: BTreeSet<_> = self.points.iter().map(|p| p.map(f64::to_bits)).collect();
        assert_eq!(distinct.len(), self.points.len());
    }

    /// Every two cells that touch in a square have one common face, which is that square.
    fn assert_adjacent(&self, octants: &[Octant], scale: f64) {
        let mut expected = BTreeMap::new();
        for (i, a) in octants.iter().enumerate() {
            for (j, b) in octants.iter().enumerate().skip(i + 1) {
                let overlap = |axis: usize| {
                    let end = |o: &Octant| o.corner[axis] + o.edge();
                    i64::from(end(a).min(end(b))) - i64::from(a.corner[axis].max(b.corner[axis]))
                };
                let mut overlaps = [overlap(0), overlap(1), overlap(2)];
                overlaps.sort_unstable();
                if overlaps[0] == 0 && overlaps[1] > 0 {
                    expected.insert((i, j), overlaps[1] * overlaps[2]);
                }
            }
        }
        let pairs = self.owner.iter().zip(&self.neighbour).enumerate();
        let found: Vec<_> = pairs
            .map(|(face, (&o, &n))| {
                let twice: f64 = self.area(face).iter().map(|a| a.abs()).sum();
                ((o, n), (twice / 2.0 / scale / scale).round() as i64)
            })
            .collect();
        assert_eq!(found.len(), expected.len());
        assert_eq!(found.into_iter().collect::<BTreeMap<_, _>>(), expected);
    }

    /// Faces are in the order that OpenFOAM calls upper-triangular.
    fn assert_ordered(&self) {
        let pairs: Vec<_> = self.owner.iter().zip(&self.neighbour).collect();
        assert!(pairs.iter().all(|(owner, neighbour)| owner < neighbour));
        assert!(pairs.windows(2).all(|w| w[0] < w[1]));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    /// Their content is tested by `harness import`, in `oracles/test_import.py`.
    #[test]
    fn files_are_as_long_as_the_summary_states_and_wide_labels_have_the_same_values(
        words in random_words(3)
    ) {
        prop_assume!(!words.is_empty());
        let (dir, mesh) = on_disk(&leaf_set(vec![words]));
        let target = dir.path().join("case/constant/polyMesh");
        let summary = write(&whole(&mesh), &target).unwrap();
        let wide = dir.path().join("wide");
        fs::create_dir(&wide).unwrap();
        read(&whole(&mesh)).unwrap().write(&mesh.manifest, true, &wide).unwrap();
        for name in ["owner", "neighbour", "cellLevel", "side"] {
            let [narrow] = lists(&target.join(name), [4]);
            let [wide] = lists(&wide.join(name), [8]);
            prop_assert_eq!(widened(&narrow), wide);
        }
        let narrow = lists(&target.join("faces"), [4, 4]).map(|list| widened(&list));
        prop_assert_eq!(narrow, lists(&wide.join("faces"), [8, 8]));
        prop_assert_eq!(lists(&target.join("points"), [24]), lists(&wide.join("points"), [24]));
        for name in ["owner", "boundary"] {
            let has = |dir: &Path, bits: &str| {
                String::from_utf8_lossy(&fs::read(dir.join(name)).unwrap()).contains(bits)
            };
            prop_assert!(has(&target, "label=32;") && has(&wide, "label=64;"));
        }
        let size: u64 = fs::read_dir(&target).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
        prop_assert_eq!(summary.bytes, size);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn cells_of_any_tree_are_closed_and_joined_where_they_touch(words in random_words(3)) {
        prop_assume!(!words.is_empty());
        let (dir, mesh) = on_disk(&leaf_set(vec![words.clone()]));
        let target = dir.path().join("case/constant/polyMesh");
        let summary = write(&whole(&mesh), &target).unwrap();
        let complex = complex_in(&target);
        complex.assert_ordered();
        complex.assert_closed(words.len());
        let octants: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
        complex.assert_adjacent(&octants, mesh.manifest.root.edge / f64::from(CELLS_PER_EDGE));
        prop_assert_eq!(summary.leaves, words.len() as u64);
    }

    #[test]
    fn cells_that_differ_by_many_levels_are_closed(words in random_words(5)) {
        complex_of(&words).assert_closed(words.len());
    }
}

/// At both ends of the root's diagonal.
#[test]
fn cells_of_the_finest_level_are_closed() {
    let is_at_end = |o: &Octant| [0, CELLS_PER_EDGE - o.edge()].iter().any(|&c| o.corner == [c; 3]);
    let words = contract::testing::words_of(|o| o.level < LEVEL_MAX && is_at_end(o));
    complex_of(&words).assert_closed(words.len());
}

/// Every octant of level 1 is a hole, a leaf, or eight leaves: 6,560 trees.
#[test]
fn cells_of_every_tree_of_two_levels_are_closed() {
    for tree in 1..3u32.pow(8) {
        let content = |digit: u8| tree / 3u32.pow(u32::from(digit)) % 3;
        let words = words_with_sides(
            |o| o.level == 0 || o.level == 1 && content(o.digit()) == 2,
            |o| (content(o.ancestor(1).digit()) > 0).then_some(Side::Outside),
        );
        let complex = complex_of(&words);
        complex.assert_closed(words.len());
        // The pairs of cells are compared for some: there are many in each tree.
        if tree % 13 == 0 {
            let octants: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
            complex.assert_adjacent(&octants, 1.0);
        }
    }
}

/// The point in the middle of an edge belongs to all faces at that edge, also those of cells that touch finer cells nowhere else.
#[test]
fn a_hanging_node_belongs_to_all_faces_at_its_edge() {
    let words = contract::testing::words_of(|o| o.level == 0 || o.level == 1 && o.corner == [0; 3]);
    let complex = complex_of(&words);
    let half = f64::from(CELLS_PER_EDGE) / 2.0;
    // On the edge along x between the fine octant and the one that touches it in this edge only.
    let node = complex.points.iter().position(|&p| p == [half / 2.0, half, half]).unwrap();
    let faces = complex.faces.iter().filter(|vertices| vertices.contains(&node));
    // Two fine cells at each of two coarse ones and between themselves, and the two faces among coarse cells.
    assert_eq!(faces.count(), 7);
}

/// A cut that leaves out about a quarter of the leaves.
fn is_cut(word: u64) -> bool {
    contract::digest::mix(word) % 4 < 1
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn points_are_the_corners_of_cells_and_of_the_squares_at_missing_cells(words in random_words(5), has_cut in any::<bool>()) {
        let mesh = mesh_of(&words, |word| has_cut && is_cut(word));
        let mut expected: BTreeSet<Point> = BTreeSet::new();
        mesh.leaves.visit_all(|_, octant, squares| {
            let edge = octant.edge();
            let corner = |digit: u32| std::array::from_fn(|a| octant.corner[a] + edge * (digit >> a & 1));
            expected.extend((0..8).map(corner));
            expected.extend(squares.iter().flat_map(|square| square.corners(true)));
        });
        let points = mesh.points.all;
        prop_assert_eq!(points.len(), expected.len());
        prop_assert_eq!(points.into_iter().collect::<BTreeSet<_>>(), expected);
    }

    #[test]
    fn regions_are_the_cells_that_faces_connect(words in random_words(4), one_in in 1u64..5) {
        let holes = words.iter().copied().filter(|&w| contract::digest::mix(w) % 5 < u128::from(one_in));
        let words: Vec<u64> = holes.collect();
        let leaves = leaves_of(&words, is_cut);
        let cells = leaves.count as usize;
        let (mut sets, mut volumes): (Vec<usize>, _) = ((0..cells).collect(), vec![0; cells]);
        leaves.visit_all(|cell, octant, squares| {
            volumes[cell as usize] = word::span(octant.level);
            for across in squares.iter().filter_map(|square| square.across.as_cell()) {
                let (a, b) = (sets[cell as usize], sets[across as usize]);
                sets.iter_mut().filter(|set| **set == a).for_each(|set| *set = b);
            }
        });
        let mut expected: BTreeMap<usize, u64> = BTreeMap::new();
        (0..cells).for_each(|cell| *expected.entry(sets[cell]).or_default() += volumes[cell]);
        let Some(largest) = expected.values().max() else { return Ok(()) };
        // The one that has the first cell, of several that are as large.
        let region = sets[(0..cells).find(|&cell| expected[&sets[cell]] == *largest).unwrap()];
        let kept: Vec<usize> = (0..cells).filter(|&cell| sets[cell] == region).collect();
        let ranks = Some((0..cells as u32).map(|cell| cell % 7).collect());
        let mesh = Mesh::new(leaves, ranks, Patches::new(None, true), Regions::Largest).unwrap();
        prop_assert_eq!(mesh.regions, expected.len());
        // Its cells keep their ranks.
        let ranks: Vec<u32> = kept.iter().map(|&cell| cell as u32 % 7).collect();
        prop_assert_eq!((mesh.leaves.count as usize, mesh.ranks.unwrap()), (kept.len(), ranks));
    }
}
