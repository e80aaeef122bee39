//! The mesh as a complex of polyhedra: random trees with holes, as files, and every tree of two levels, in memory.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::path::Path;

use contract::import::{self, Format, Request};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::testing::{leaf_set, random_words, words_with_sides};
use contract::word::{self, Side};
use proptest::prelude::*;

use super::*;
use crate::options::{Foam, Label, Style, Watch};

/// Faces with their points, and the cells on both sides of each.
#[derive(Debug, Default)]
struct Complex {
    points: Vec<[f64; 3]>,
    faces: Vec<Vec<usize>>,
    owner: Vec<usize>,
    neighbour: Vec<usize>,
}

/// Nobody waits.
struct Unwatched;

impl Watch for Unwatched {
    fn progress(&self, _: u64, _: u64) {}

    fn is_interrupted(&self) -> bool {
        false
    }
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

/// The complex of sorted words, without files. Faces are in the order of their owners.
fn complex_of(words: &[u64]) -> Complex {
    let mut builder = Builder::default();
    words.iter().for_each(|&w| builder.push(&word::octant(w), true));
    let mut model = Model {
        tree: builder.finish(),
        words: words.to_vec(),
        ranks: Vec::new(),
        points: Points::default(),
        root: Root { origin: [0.0; 3], edge: 1.0 },
        has_sides: true,
        options: &options(ASCII),
    };
    connect(&mut model, options::Regions::All).unwrap();
    let points = model.points.iter().map(|p| p.map(f64::from)).collect();
    let mut complex = Complex { points, ..Complex::default() };
    let (mut boundary, mut polygon) = (Vec::new(), Vec::new());
    visit(&model, Domain(None), |cell, _, squares| {
        for square in squares {
            square.polygon(&model.points, !square.is_high, &mut polygon);
            let vertices = polygon.iter().map(|&(_, number)| number as usize).collect();
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
        Ok(())
    })
    .unwrap();
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn cells_of_any_tree_are_closed_and_joined_where_they_touch(words in random_words(3)) {
        prop_assume!(!words.is_empty());
        let (dir, mesh) = on_disk(&leaf_set(vec![words.clone()]));
        let target = dir.path().join("case/constant/polyMesh");
        let summary = write(&mesh, &Selection::default(), &target, &options(ASCII)).unwrap();
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

    #[test]
    fn the_import_returns_the_mesh_in_any_style(
        words in random_words(3), is_ascii in any::<bool>(), is_wide in any::<bool>(), parts in 1usize..4
    ) {
        prop_assume!(!words.is_empty());
        let dealt = (0..parts).map(|p| words.iter().copied().skip(p).step_by(parts).collect()).collect();
        let (dir, mesh) = on_disk(&leaf_set(dealt));
        let target = dir.path().join("case/constant/polyMesh");
        let label = if is_wide { Label::Bits64 } else { Label::Bits32 };
        let style = Style { is_ascii, label };
        let summary = write(&mesh, &Selection::default(), &target, &options(style)).unwrap();
        let size: u64 = fs::read_dir(&target).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
        prop_assert_eq!(summary.bytes, size);
        let request = Request { sides: Some("side".to_owned()), ..Request::default() };
        let cells = import::read(&dir.path().join("case"), Format::Openfoam, &request).unwrap();
        prop_assert_eq!(cells.words(&mesh.manifest.root).unwrap(), words);
        prop_assert_eq!(cells.levels.unwrap().len(), cells.sides.unwrap().len());
    }
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

/// The patches in `boundary`: name, number of faces, first face.
fn boundary_in(dir: &Path) -> Vec<(String, usize, usize)> {
    let text = fs::read_to_string(dir.join("boundary")).unwrap();
    let (_, list) = text.split_once("\n(\n").unwrap();
    let entries = list.trim_end().strip_suffix(')').unwrap().split_terminator("    }\n");
    let value = |entry: &str, key: &str| {
        let (_, rest) = entry.split_once(key).unwrap();
        rest.split_once(';').unwrap().0.trim().parse().unwrap()
    };
    let patch = |entry: &str| {
        let name = entry.trim_start().lines().next().unwrap().to_owned();
        (name, value(entry, "nFaces"), value(entry, "startFace"))
    };
    entries.map(patch).collect()
}

#[test]
fn patches_follow_the_internal_faces_and_lie_where_their_names_say() {
    let words =
        words_with_sides(|o| o.level < 2, |o| (o.corner != [0; 3]).then_some(Side::Outside));
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    let half = [[0; 3], [1 << 27, 1 << 27, 1 << 26]];
    let selection = Selection { clip: Some(half), ..Selection::default() };
    let target = dir.path().join("case/constant/polyMesh");
    write(&mesh, &selection, &target, &options(ASCII)).unwrap();
    let complex = complex_in(&target);
    let boundary = boundary_in(&target);
    let faces: Vec<_> = boundary.iter().map(|(name, faces, _)| (name.as_str(), *faces)).collect();
    let expected = [
        ("xMin", 7),
        ("xMax", 8),
        ("yMin", 7),
        ("yMax", 8),
        ("zMin", 15),
        ("zMax", 0),
        ("body", 3),
        ("cut", 16),
    ];
    assert_eq!(faces, expected);
    let mut next = complex.neighbour.len();
    for (name, faces, start) in &boundary {
        assert_eq!(*start, next);
        next += faces;
        let edge = mesh.manifest.root.edge;
        for vertices in &complex.faces[*start..next] {
            let on = |axis: usize, at: f64| vertices.iter().all(|&v| complex.points[v][axis] == at);
            match name.as_str() {
                "xMin" => assert!(on(0, 0.0)),
                "xMax" => assert!(on(0, edge)),
                "yMin" => assert!(on(1, 0.0)),
                "yMax" => assert!(on(1, edge)),
                "zMin" => assert!(on(2, 0.0)),
                "cut" => assert!(on(2, edge / 2.0)),
                _ => assert!((0..3).any(|axis| on(axis, edge / 4.0))),
            }
        }
    }
    assert_eq!(next, complex.faces.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn processors_have_their_cells_and_the_same_faces_between_them(
        words in random_words(3), parts in 2usize..5, run in 1usize..30, by_rank in any::<bool>()
    ) {
        prop_assume!(words.len() > 4 * 30);
        let dealt: Vec<Vec<u64>> = (0..parts)
            .map(|p| words.iter().enumerate().filter(|(i, _)| i / run % parts == p).map(|(_, &w)| w).collect())
            .collect();
        let (dir, mesh) = on_disk(&leaf_set(dealt));
        let case = dir.path().join("case");
        let processors = if by_rank { Processors::Ranks } else { Processors::Equal(parts as u32) };
        let mut options = options(ASCII);
        options.foam.processors = Some(processors);
        write(&mesh, &Selection::default(), &case.join("constant/polyMesh"), &options).unwrap();
        let dirs: Vec<_> = (0..parts).map(|p| case.join(format!("processor{p}/constant/polyMesh"))).collect();
        let mut cells = 0;
        let mut between = BTreeMap::new();
        for (here, dir) in dirs.iter().enumerate() {
            let complex = complex_in(dir);
            complex.assert_ordered();
            let count = complex.owner.iter().max().unwrap() + 1;
            complex.assert_closed(count);
            cells += count;
            for (name, faces, start) in boundary_in(dir) {
                if let Some((_, there)) = name.split_once("to") {
                    let there: usize = there.parse().unwrap();
                    let polygon = |face: usize| complex.faces[face].iter().map(|&v| complex.points[v]).collect();
                    let polygons: Vec<Vec<[f64; 3]>> = (start..start + faces).map(polygon).collect();
                    prop_assert!(between.insert((here, there), polygons).is_none());
                }
            }
        }
        prop_assert_eq!(cells, words.len());
        for (&(here, there), polygons) in &between {
            let opposite: Vec<Vec<[f64; 3]>> = polygons.iter().cloned().map(|mut polygon| {
                polygon[1..].reverse();
                polygon
            }).collect();
            prop_assert_eq!(&between[&(there, here)], &opposite);
        }
    }
}

#[test]
fn regions_that_no_face_connects_can_be_left_out() {
    // Two octants that touch in a corner: 64 small cells in one and a large cell in the other, which is the largest region.
    let words = words_with_sides(
        |o| o.level == 0 || o.level < 3 && o.ancestor(1).digit() == 0,
        |o| [0, 7].contains(&o.ancestor(1).digit()).then_some(Side::Outside),
    );
    let words: Vec<u64> = words.into_iter().filter(|&w| word::octant(w).corner != [0; 3]).collect();
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    let mut options = options(ASCII);
    for (regions, cells) in [(options::Regions::All, 64), (options::Regions::Largest, 1)] {
        options.foam.regions = regions;
        let target = dir.path().join(format!("{cells}/constant/polyMesh"));
        let summary = write(&mesh, &Selection::default(), &target, &options).unwrap();
        assert_eq!(summary.leaves, cells);
        assert!(
            summary.notes[1].starts_with("2 regions that no face connects, of 1, 63 cells"),
            "{:?}",
            summary.notes
        );
        complex_in(&target).assert_closed(cells as usize);
    }
}

#[test]
fn what_exists_is_not_replaced_and_what_fails_leaves_nothing() {
    let words = words_with_sides(|o| o.level < 2, |_| Some(Side::Outside));
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    let case = dir.path().join("case");
    let refused = |options: &Options<'_>, selection: &Selection| {
        let target = case.join("constant/polyMesh");
        write(&mesh, selection, &target, options).unwrap_err().to_string()
    };
    let everything = Selection::default();
    let mut parallel = options(ASCII);
    parallel.foam.processors = Some(Processors::Equal(65));
    assert!(refused(&parallel, &everything).contains("64 cells are too few for 65 processors"));
    let none = Selection { level_max: Some(1), ..Selection::default() };
    assert!(refused(&options(ASCII), &none).contains("no leaf is selected"));
    assert!(!case.exists());

    write(&mesh, &everything, &case.join("constant/polyMesh"), &options(ASCII)).unwrap();
    assert!(refused(&options(ASCII), &everything).contains("constant/polyMesh exists"));
    fs::create_dir(case.join("processor7")).unwrap();
    parallel.foam.processors = Some(Processors::Equal(2));
    assert!(refused(&parallel, &everything).contains("processor7 exists"));
    let names = |dir: &Path| {
        fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name()).collect::<BTreeSet<_>>()
    };
    assert_eq!(names(&case).len(), 2);

    let empty = dir.path().join("other/constant/polyMesh");
    fs::create_dir_all(&empty).unwrap();
    write(&mesh, &everything, &empty, &options(ASCII)).unwrap();
    assert_eq!(names(&empty).len(), 7);
}
