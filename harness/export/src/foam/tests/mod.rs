//! Tests of exported meshes as complexes of polyhedra, in memory and as files.

mod cells;
mod directories;
mod whole;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use contract::case::Case;
use contract::leafset::LeafSet;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use contract::testing::{leaf_set, random_words, words_with_sides};
use proptest::prelude::*;

use super::*;
use crate::leaves::{CUT, Square};
use crate::options::Label;
use crate::points::Point;
use crate::selection::Selection;
pub use crate::testing::{options, whole};
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
pub fn mesh_of(words: &[u64], is_cut: impl Fn(u64) -> bool, options: &Options<'_>) -> Mesh {
    let patches = Patches::new(None, true);
    Mesh::new(leaves_of(words, is_cut), None, patches, options).unwrap()
}

impl Leaves {
    fn visit_all(&self, options: &Options, mut each: impl FnMut(u32, &Octant, &[Square])) {
        let visit = &mut |cell, octant: &Octant, squares: &[Square]| {
            each(cell, octant, squares);
            Ok(())
        };
        self.walk(options, visit).unwrap();
    }
}

/// The complex of sorted words, without files.
fn complex_of(words: &[u64]) -> Complex {
    let options = options();
    let mesh = mesh_of(words, |_| false, &options);
    let vertices = |face| mesh.faces.vertices(face).iter().map(|&v| v as usize).collect();
    let indices = |cells: &[u32]| cells.iter().map(|&cell| cell as usize).collect();
    Complex {
        points: mesh.points.all.iter().map(|p| p.map(f64::from)).collect(),
        faces: (0..mesh.faces.count()).map(vertices).collect(),
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
    fn files_are_as_long_as_the_summary_states(
        words in random_words(3), is_wide in any::<bool>()
    ) {
        prop_assume!(!words.is_empty());
        let (dir, mesh) = on_disk(&leaf_set(vec![words]));
        let target = dir.path().join("case/constant/polyMesh");
        let label = if is_wide { Label::Bits64 } else { Label::Bits32 };
        let mut options = options();
        options.label = label;
        let summary = write(&whole(&mesh, &options), &target).unwrap();
        let size: u64 = fs::read_dir(&target).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
        prop_assert_eq!(summary.bytes, size);
    }
}
