//! What a front is like: its size, its gap to the wall, and how both cells and faces are distributed to ranks.

use std::collections::BTreeMap;
use std::fmt;

use contract::lattice::Root;
use contract::number::number;
use contract::octant::{LEVEL_MAX, Octant};
use serde::Serialize;

use super::front::Face;
use super::gap::Gap;
use super::polygons::Polygons;
use crate::mesh::Mesh;
use contract::failure::Failure;

/// Schema of the report as JSON.
pub const SCHEMA: &str = "octree-near-body/1";

/// A report on a front.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Number of faces.
    pub faces: u64,
    /// Their area, in the user's units.
    pub area: f64,
    /// Number of edges that belong to an odd number of faces: 0 if the front is closed.
    pub edges_open: u64,
    /// Faces by the level of their leaf.
    pub faces_by_level: [u64; LEVEL_MAX as usize + 1],
    /// The gap to the wall: `least`, the least distance of each face, and `centre`, that of its centre, in the user's units, and both in edges of
    /// the face's leaf, as `least_cells` and `centre_cells`. `None` without a case.
    pub gap: Option<BTreeMap<&'static str, Spread>>,
    /// The distribution of the mesh to ranks; `None` if they are unknown.
    pub ranks: Option<Ranks>,
}

/// Minimum, median, 95th percentile and maximum: of n sorted numbers, those at 0, (n - 1) / 2, 0.95 (n - 1), rounded, and n - 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The least number.
    pub min: f64,
    /// The median.
    pub median: f64,
    /// The 95th percentile.
    pub p95: f64,
    /// The greatest number.
    pub max: f64,
}

/// Cells and faces of every rank, and lambda: the maximum over the mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranks {
    /// Cells of each rank.
    pub cells: Vec<u64>,
    /// Faces of each rank.
    pub faces: Vec<u64>,
    /// Lambda by cells.
    pub lambda_cells: f64,
    /// Lambda by faces.
    pub lambda_faces: f64,
}

impl Report {
    /// A report on the front of a mesh; `gaps` are those of its faces, which are all or those of selected leaves.
    ///
    /// # Panics
    /// If an invariant of the report or of the surface is violated.
    ///
    /// # Errors
    /// If the mesh cannot be read.
    pub fn new(
        mesh: &Mesh,
        faces: &[Face],
        polygons: &Polygons,
        gaps: Option<&[Gap]>,
        is_whole: bool,
    ) -> Result<Self, Failure> {
        let root = &mesh.manifest.root;
        let area = |face: &Face| edge_of_level(root, face.level).powi(2);
        let mut faces_by_level = [0; LEVEL_MAX as usize + 1];
        for face in faces {
            faces_by_level[face.leaf_level as usize] += 1;
        }
        let cells = mesh.leaves_by_rank()?;
        let report = Self {
            schema: SCHEMA,
            faces: faces.len() as u64,
            area: faces.iter().map(area).sum(),
            edges_open: edges_open(polygons),
            faces_by_level,
            gap: gaps.and_then(|gaps| spreads(root, faces, gaps)),
            ranks: mesh.has_ranks().then(|| {
                let mut by_rank = vec![0; cells.len()];
                faces.iter().for_each(|face| by_rank[face.rank as usize] += 1);
                let (lambda_cells, lambda_faces) = (lambda(cells), lambda(&by_rank));
                Ranks { cells: cells.to_vec(), faces: by_rank, lambda_cells, lambda_faces }
            }),
        };
        report.check_invariants(mesh.len(), root);
        check_surface(faces, polygons, is_whole && report.edges_open == 0);
        Ok(report)
    }

    /// Asserts what the numbers of a report on a mesh of `cells` cells must satisfy.
    fn check_invariants(&self, cells: u64, root: &Root) {
        let Self { faces, area, .. } = *self;
        assert_eq!(self.faces_by_level.iter().sum::<u64>(), faces, "faces of all levels");
        let smallest = faces as f64 * edge_of_level(root, LEVEL_MAX).powi(2);
        let is_possible = area.is_finite() && area >= smallest * (1.0 - 1e-9);
        assert!(is_possible, "{faces} faces of area {area}");
        if let Some(ranks) = &self.ranks {
            assert_eq!(ranks.faces.iter().sum::<u64>(), faces, "faces of all ranks");
            assert_eq!(ranks.cells.iter().sum::<u64>(), cells, "cells of all ranks");
            let (lambdas, most) = ([ranks.lambda_cells, ranks.lambda_faces], ranks.cells.len());
            let are_possible =
                lambdas.iter().all(|l| (1.0 - 1e-9..=most as f64 + 1e-9).contains(l));
            assert!(are_possible, "lambda {lambdas:?} on {most} ranks");
        }
        let Some(gap) = &self.gap else { return };
        for Spread { min, median, p95, max } in gap.values() {
            assert!(
                [0.0, *min, *median, *p95, *max].is_sorted(),
                "gaps {min} {median} {p95} {max}"
            );
        }
        let [least, centre] =
            ["least", "centre"].map(|of| [gap[of].min, gap[of].median, gap[of].max]);
        let is_less = least.iter().zip(centre).all(|(least, centre)| *least <= centre);
        assert!(is_less, "the least distances {least:?} exceed those of the centres {centre:?}");
    }
}

/// Asserts that every polygon is the square of its face with points on its edges, that it faces the leaf, and that the areas of a closed front cancel.
fn check_surface(faces: &[Face], polygons: &Polygons, is_closed: bool) {
    assert_eq!(polygons.ends.len(), faces.len(), "a polygon for every face");
    let mut sum = [0i64; 3];
    for (face, corners) in faces.iter().zip(polygons.iter()) {
        let area = area(corners.iter().map(|&c| polygons.points[c as usize]));
        let edge = i64::from(face.edge());
        let mut expected = [0; 3];
        expected[usize::from(face.axis)] =
            if face.is_leaf_above { 2 * edge * edge } else { -2 * edge * edge };
        assert_eq!(area, expected, "twice the area of {face:?}");
        (0..3).for_each(|a| sum[a] += area[a]);
    }
    assert!(!is_closed || sum == [0; 3], "a closed front of areas that add up to {sum:?}");
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

/// Edge of the cells of a level, in the user's units.
pub fn edge_of_level(root: &Root, level: u8) -> f64 {
    root.edge * f64::from(Octant { corner: [0; 3], level }.edge()) / f64::from(Octant::ROOT.edge())
}

/// The spreads of the gaps by name; `None` without faces.
fn spreads(root: &Root, faces: &[Face], gaps: &[Gap]) -> Option<BTreeMap<&'static str, Spread>> {
    let spread = |distance: fn(&Gap) -> f64, in_cells: bool| {
        let unit = |face: &Face| if in_cells { edge_of_level(root, face.leaf_level) } else { 1.0 };
        Spread::of(gaps.iter().zip(faces).map(|(gap, face)| distance(gap) / unit(face)).collect())
    };
    Some(BTreeMap::from([
        ("least", spread(|gap| gap.least, false)?),
        ("least_cells", spread(|gap| gap.least, true)?),
        ("centre", spread(|gap| gap.centre, false)?),
        ("centre_cells", spread(|gap| gap.centre, true)?),
    ]))
}

impl Spread {
    fn of(mut numbers: Vec<f64>) -> Option<Self> {
        numbers.sort_unstable_by(f64::total_cmp);
        let last = numbers.len().checked_sub(1)?;
        let at = |fraction: f64| numbers[(last as f64 * fraction).round() as usize];
        Some(Self { min: at(0.0), median: numbers[last / 2], p95: at(0.95), max: at(1.0) })
    }
}

/// Maximum over mean; 1 if all are 0.
fn lambda(of_ranks: &[u64]) -> f64 {
    let (max, sum) = (of_ranks.iter().max().copied().unwrap_or(0), of_ranks.iter().sum::<u64>());
    if sum == 0 { 1.0 } else { max as f64 * of_ranks.len() as f64 / sum as f64 }
}

/// Number of edges that belong to an odd number of polygons.
fn edges_open(polygons: &Polygons) -> u64 {
    let mut edges = Vec::with_capacity(polygons.corners.len());
    for corners in polygons.iter() {
        let next = corners.iter().cycle().skip(1);
        edges.extend(corners.iter().zip(next).map(|(&a, &b)| (a.min(b), a.max(b))));
    }
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).count() as u64
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let closed = match self.edges_open {
            0 => "closed".to_owned(),
            open => format!("open at {open} edges"),
        };
        writeln!(f, "{} faces of area {}, {closed}", self.faces, number(self.area))?;
        for (level, count) in self.faces_by_level.iter().enumerate().filter(|(_, n)| **n > 0) {
            writeln!(f, "  level {level}: {count}")?;
        }
        if let Some(gap) = &self.gap {
            let [a, b, c, d] = ["min", "median", "95 %", "max"];
            writeln!(f, "{:<20} {a:>12} {b:>12} {c:>12} {d:>12}", "gap to the wall")?;
            let keys = ["least", "least_cells", "centre", "centre_cells"];
            let names = ["face", "face, in cells", "centre", "centre, in cells"];
            for (name, Spread { min, median, p95, max }) in names.iter().zip(keys.map(|k| gap[k])) {
                let [min, median, p95, max] = [min, median, p95, max].map(number);
                writeln!(f, "  {name:<18} {min:>12} {median:>12} {p95:>12} {max:>12}")?;
            }
        }
        match &self.ranks {
            None => writeln!(f, "the ranks of the cells are unknown"),
            Some(ranks) => writeln!(
                f,
                "ranks: {}; lambda {:.3} by cells, {:.3} by exposed faces",
                ranks.cells.len(),
                ranks.lambda_cells,
                ranks.lambda_faces
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::near_body::front::front;
    use crate::selection::Selection;
    use crate::testing::on_disk;
    use contract::testing::words_with_sides;
    use contract::word::Side;

    /// A report on the cells around a hole, and what it is made of.
    fn sample() -> (Report, Vec<Face>, Polygons, u64, Root) {
        let words = words_with_sides(
            |o| o.level < 2 || o.level < 3 && o.corner[0] == 0,
            |o| (o.ancestor(2).corner.map(|c| c >> 17) != [1, 2, 1]).then_some(Side::Outside),
        );
        let (_dir, mesh) = on_disk(&words, 3, |i| i / 20);
        let faces = front(&mesh, &Selection::default(), &|| Ok(())).unwrap();
        let polygons = Polygons::new(&faces);
        let gap = |i: usize| Gap { least: 0.5 + i as f64, centre: 0.6 + i as f64 };
        let gaps: Vec<Gap> = (0..faces.len()).map(gap).collect();
        let report = Report::new(&mesh, &faces, &polygons, Some(&gaps), true).unwrap();
        (report, faces, polygons, mesh.len(), mesh.manifest.root)
    }

    fn message(caught: Box<dyn std::any::Any + Send>) -> String {
        caught.downcast_ref::<String>().expect("a message with values").clone()
    }

    #[test]
    fn planted_wrong_numbers_are_noticed() {
        let noticed = |why: &str, change: &dyn Fn(&mut Report)| {
            let (mut report, _, _, cells, root) = sample();
            change(&mut report);
            let check = std::panic::AssertUnwindSafe(|| report.check_invariants(cells, &root));
            let message = message(std::panic::catch_unwind(check).unwrap_err());
            assert!(message.contains(why), "{message}");
        };
        noticed("faces of all levels", &|r| r.faces += 1);
        noticed("of area", &|r| r.area = f64::NAN);
        noticed("faces of all ranks", &|r| r.ranks.as_mut().unwrap().faces[1] += 1);
        noticed("cells of all ranks", &|r| r.ranks.as_mut().unwrap().cells[0] -= 1);
        noticed("lambda", &|r| r.ranks.as_mut().unwrap().lambda_faces = 0.9);
        noticed("gaps", &|r| r.gap.as_mut().unwrap().get_mut("least").unwrap().p95 = 1e9);
        noticed("exceed those of the centres", &|r| {
            r.gap.as_mut().unwrap().get_mut("centre").unwrap().min = 0.1
        });
    }

    #[test]
    fn planted_wrong_surfaces_are_noticed() {
        let noticed = |why: &str, change: &dyn Fn(&mut Vec<Face>, &mut Polygons)| {
            let (_, mut faces, mut polygons, ..) = sample();
            check_surface(&faces, &polygons, true);
            change(&mut faces, &mut polygons);
            let check = std::panic::AssertUnwindSafe(|| check_surface(&faces, &polygons, true));
            let message = message(std::panic::catch_unwind(check).unwrap_err());
            assert!(message.contains(why), "{message}");
        };
        noticed("a polygon for every face", &|faces, _| faces.truncate(3));
        noticed("twice the area", &|faces, _| faces[0].is_leaf_above ^= true);
        noticed("twice the area", &|_, polygons| polygons.corners.swap(0, 1));
        noticed("that add up to", &|faces, polygons| {
            faces.pop();
            polygons.ends.pop();
            polygons.corners.truncate(*polygons.ends.last().unwrap() as usize);
        });
    }
}
