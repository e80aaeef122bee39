//! Tests of exported meshes as complexes of polyhedra, in memory and as files.

mod cells;
mod directories;
mod round_trip;
mod whole;

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::path::Path;

use contract::case::Case;
use contract::import::{self, Format, Request};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use contract::testing::{leaf_set, random_words, words_with_sides};
use contract::word::{self, Side};
use proptest::prelude::*;

use super::faces::Square;
use super::points::{Near, Point};
use super::walk::Around;
use super::*;
use crate::options::{Foam, Label, Style};
use crate::testing::Unwatched;

/// Faces with their points, and the cells on both sides of each.
#[derive(Debug, Default)]
struct Complex {
    points: Vec<[f64; 3]>,
    faces: Vec<Vec<usize>>,
    owner: Vec<usize>,
    neighbour: Vec<usize>,
}

fn options<'a>(style: Style) -> Options<'a> {
    let foam = Foam { style, ..Foam::default() };
    Options { jobs: NonZero::<usize>::MIN, watch: &Unwatched, foam }
}

const ASCII: Style = Style { is_ascii: true, label: Label::Bits32 };

fn on_disk(set: &LeafSet) -> (tempfile::TempDir, Mesh) {
    let dir = tempfile::tempdir().unwrap();
    set.create(&dir.path().join("mesh")).unwrap();
    let mesh = Mesh::open(&dir.path().join("mesh")).unwrap();
    (dir, mesh)
}

/// The numbers in an ASCII file after its dictionary, those in parentheses in one list.
fn numbers(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let (_, body) = text.split_once("}\n").unwrap();
    let lines = body.lines().map(|line| line.replace(['(', ')'], " "));
    let parse = |line: String| line.split_whitespace().map(|n| n.parse().unwrap()).collect();
    lines.map(parse).filter(|list: &Vec<f64>| !list.is_empty()).collect()
}

fn complex_in(dir: &Path) -> Complex {
    let list = |name: &str| {
        let numbers = numbers(&dir.join(name));
        assert_eq!(numbers.len() - 1, numbers[0][0] as usize, "{name}");
        numbers.into_iter().skip(1)
    };
    let labels = |name: &str| list(name).map(|n| n[0] as usize).collect();
    let face = |n: Vec<f64>| {
        assert_eq!(n.len() - 1, n[0] as usize);
        n[1..].iter().map(|&v| v as usize).collect()
    };
    Complex {
        points: list("points").map(|n| n.try_into().unwrap()).collect(),
        faces: list("faces").map(face).collect(),
        owner: labels("owner"),
        neighbour: labels("neighbour"),
    }
}

/// Sorted words as cells, without those that are cut.
fn model_of<'a>(
    words: &[u64],
    is_cut: impl Fn(u64) -> bool,
    options: &'a Options<'a>,
) -> Model<'a> {
    let mut builder = Builder::default();
    for &w in words {
        let (octant, side) = (word::octant(w), (w & 3) as u8);
        let kind = if is_cut(w) { DELETED } else { side };
        builder.push_leaf(word::key_of(octant.corner), octant.level, kind).unwrap();
    }
    let tree = Tree::new(&builder.finish());
    Model {
        points: corners::points(&tree, options).unwrap(),
        tree,
        ranks: None,
        root: Root { origin: [0.0; 3], edge: 1.0 },
        has_sides: true,
        options,
    }
}

impl Model<'_> {
    fn all_points(&self) -> Vec<Point> {
        let mut points = Vec::new();
        let add = &mut |point| {
            points.push(point);
            Ok::<(), ()>(())
        };
        self.points.visit(0..self.points.count() as u32, add).unwrap();
        points
    }

    fn visit_all(&self, mut each: impl FnMut(u32, &Around<Near>, &[Square])) {
        let all = std::iter::once(0..self.tree.cells());
        let each = |cell, around: &Around<Near>, squares: &[Square]| {
            each(cell, around, squares);
            Ok(())
        };
        survey::visit(self, self.points.near(), all, each).unwrap();
    }
}

/// The complex of sorted words, without files. Faces are in the order of their owners.
fn complex_of(words: &[u64]) -> Complex {
    let options = options(ASCII);
    let model = model_of(words, |_| false, &options);
    let points = model.all_points().into_iter().map(|p| p.map(f64::from)).collect();
    let mut complex = Complex { points, ..Complex::default() };
    let (mut boundary, mut polygon) = (Vec::new(), Vec::new());
    model.visit_all(|cell, around, squares| {
        for square in squares {
            square.polygon(around, !square.is_high, &mut polygon);
            let vertices = polygon.iter().map(|&number| number as usize).collect();
            match square.across.as_cell() {
                Some(_) if !square.is_high => {}
                Some(across) => {
                    complex.faces.push(vertices);
                    complex.owner.push(cell as usize);
                    complex.neighbour.push(across as usize);
                }
                None => boundary.push((cell as usize, vertices)),
            }
        }
    });
    for (cell, vertices) in boundary {
        complex.faces.push(vertices);
        complex.owner.push(cell);
    }
    complex
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
