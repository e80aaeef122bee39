//! What a front is like: its size, its gap to the wall, and how both cells and faces are distributed to ranks.

use std::fmt;

use contract::lattice::Root;
use contract::octant::{LEVEL_MAX, Octant};
use serde::Serialize;

use super::front::Face;
use super::gap::Gap;
use super::polygons::Polygons;
use crate::error::ExportError;
use crate::mesh::Mesh;

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
    /// The gap to the wall; `None` without a case.
    pub gap: Option<GapStatistics>,
    /// The distribution of the mesh to ranks; `None` if they are unknown.
    pub ranks: Option<Ranks>,
}

/// Statistics of the gap to the wall, over the faces.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GapStatistics {
    /// Least distance of each face, in the user's units.
    pub least: Spread,
    /// The same, in edges of the face's leaf.
    pub least_cells: Spread,
    /// Distance of each face's centre, in the user's units.
    pub centre: Spread,
    /// The same, in edges of the face's leaf.
    pub centre_cells: Spread,
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
    /// A report on the front of a mesh; `gaps` are those of its faces.
    ///
    /// # Errors
    /// If the mesh cannot be read.
    pub fn new(
        mesh: &Mesh,
        faces: &[Face],
        polygons: &Polygons,
        gaps: Option<&[Gap]>,
    ) -> Result<Self, ExportError> {
        let root = &mesh.manifest.root;
        let area = |face: &Face| edge_of_level(root, face.level).powi(2);
        let mut faces_by_level = [0; LEVEL_MAX as usize + 1];
        for face in faces {
            faces_by_level[face.leaf_level as usize] += 1;
        }
        let cells = mesh.leaves_by_rank()?;
        Ok(Self {
            schema: SCHEMA,
            faces: faces.len() as u64,
            area: faces.iter().map(area).sum(),
            edges_open: edges_open(polygons),
            faces_by_level,
            gap: gaps.and_then(|gaps| GapStatistics::of(root, faces, gaps)),
            ranks: mesh.has_ranks().then(|| Ranks::of(cells.to_vec(), faces)),
        })
    }
}

impl Ranks {
    fn of(cells: Vec<u64>, faces: &[Face]) -> Self {
        let mut by_rank = vec![0; cells.len()];
        faces.iter().for_each(|face| by_rank[face.rank as usize] += 1);
        let (lambda_cells, lambda_faces) = (lambda(&cells), lambda(&by_rank));
        Self { cells, faces: by_rank, lambda_cells, lambda_faces }
    }
}

/// Edge of the cells of a level, in the user's units.
pub fn edge_of_level(root: &Root, level: u8) -> f64 {
    root.edge * f64::from(Octant { corner: [0; 3], level }.edge()) / f64::from(Octant::ROOT.edge())
}

impl GapStatistics {
    /// `None` without faces.
    fn of(root: &Root, faces: &[Face], gaps: &[Gap]) -> Option<Self> {
        let in_cells = |distance: fn(&Gap) -> f64| {
            let cell = |face: &Face| edge_of_level(root, face.leaf_level);
            gaps.iter().zip(faces).map(|(gap, face)| distance(gap) / cell(face)).collect()
        };
        Some(Self {
            least: Spread::of(gaps.iter().map(|gap| gap.least).collect())?,
            least_cells: Spread::of(in_cells(|gap| gap.least))?,
            centre: Spread::of(gaps.iter().map(|gap| gap.centre).collect())?,
            centre_cells: Spread::of(in_cells(|gap| gap.centre))?,
        })
    }
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
        writeln!(f, "{} faces of area {:.6}, {closed}", self.faces, self.area)?;
        let levels = (0..).zip(self.faces_by_level).filter(|&(_, count)| count > 0);
        for (level, count) in levels {
            let level: u8 = level;
            writeln!(f, "  level {level}: {count}")?;
        }
        if let Some(gap) = &self.gap {
            writeln!(
                f,
                "gap to the wall      {:>12} {:>12} {:>12} {:>12}",
                "min", "median", "95 %", "max"
            )?;
            for (name, Spread { min, median, p95, max }) in [
                ("face", gap.least),
                ("face, in cells", gap.least_cells),
                ("centre", gap.centre),
                ("centre, in cells", gap.centre_cells),
            ] {
                writeln!(f, "  {name:<18} {min:>12.6} {median:>12.6} {p95:>12.6} {max:>12.6}")?;
            }
        }
        let Some(Ranks { cells, lambda_cells, lambda_faces, .. }) = &self.ranks else {
            return writeln!(f, "the ranks of the cells are unknown");
        };
        match cells.len() {
            1 => writeln!(f, "one rank, which has all cells and exposed faces"),
            ranks => writeln!(
                f,
                "{ranks} ranks: lambda {lambda_cells:.3} by cells, {lambda_faces:.3} by exposed faces"
            ),
        }
    }
}
