//! OpenFOAM meshes (`constant/polyMesh`), ASCII or binary, as blockMesh, snappyHexMesh and refineMesh write them.
//!
//! A cell is given by its faces, of which a hanging node makes some polygons with more than four vertices, and splits others
//! in four. It is a cube if its points fill a cube's bounds and its faces enclose the cube's volume. `cellLevel`, if the
//! directory has it, must agree with the edges. The format states no root: see [`super::root`].

mod file;
mod lists;

use super::cells::Cells;
use super::{ImportError, Request, TOLERANCE, side};
use file::FoamFile;
use std::path::{Path, PathBuf};

/// The directory with the mesh: the given one, or the one below it in a case or in `constant`.
pub fn poly_mesh(path: &Path) -> Option<PathBuf> {
    let below = ["", "polyMesh", "constant/polyMesh"].map(|place| path.join(place));
    below
        .into_iter()
        .find(|place| ["points", "points.gz"].iter().any(|name| place.join(name).is_file()))
}

/// Reads a mesh. Sides come from a list of labels in the same directory, named by the request.
///
/// # Errors
/// If a file cannot be read or is damaged, or if a cell is not a cube.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    let directory = poly_mesh(path).ok_or_else(|| {
        ImportError::content(
            "has no polyMesh: give a case, its directory constant, or polyMesh, and reconstruct a decomposed mesh",
        )
    })?;
    let open = |name: &str| FoamFile::open(&directory.join(name));
    let points = open("points")?.points()?;
    let (ends, vertices) = open("faces")?.faces(points.len())?;
    // A cell has at least four faces, and a face at most two cells.
    let owners = open("owner")?.indices(ends.len(), ends.len() / 2 + 1)?;
    let count = owners.iter().max().map_or(0, |&last| last + 1);
    let neighbours = open("neighbour")?.indices(ends.len(), count)?;
    if owners.len() != ends.len() || neighbours.len() > ends.len() {
        let (owners, neighbours, faces) = (owners.len(), neighbours.len(), ends.len());
        return Err(ImportError::content(format!(
            "has {faces} faces with {owners} owners and {neighbours} neighbours: its files belong to different meshes"
        )));
    }
    let faces = Faces {
        points: &points,
        ends: &ends,
        vertices: &vertices,
        owners: &owners,
        neighbours: &neighbours,
    };
    let mut cells = faces.cubes(count)?;
    let per_cell = |name: &str| -> Result<Vec<i64>, ImportError> {
        let mut file = open(name)?;
        let labels = file.labels(count)?;
        match labels.len() == count {
            true => Ok(labels),
            false => Err(file.error(format!("has {} labels for {count} cells", labels.len()))),
        }
    };
    cells.levels =
        directory.join("cellLevel").is_file().then(|| per_cell("cellLevel")).transpose()?;
    if let Some(name) = &request.sides {
        let codes = per_cell(name)?;
        let sides = codes.iter().enumerate().map(|(i, &code)| side(code as f64, i));
        cells.sides = Some(sides.collect::<Result<_, _>>()?);
    }
    Ok(cells)
}

/// The faces of a mesh.
struct Faces<'a> {
    points: &'a [[f64; 3]],
    /// End of each face in `vertices`.
    ends: &'a [usize],
    /// Indices of points.
    vertices: &'a [usize],
    /// The cell from which each face points away.
    owners: &'a [usize],
    /// The cell on the other side of the first faces.
    neighbours: &'a [usize],
}

/// Bounds of a cell, and the volume that its faces enclose.
#[derive(Clone, Copy)]
struct Shape {
    low: [f64; 3],
    high: [f64; 3],
    volume: f64,
}

impl Faces<'_> {
    /// Visits every face of every cell: cell, vertices, and 1 if they turn around the outward normal or -1 otherwise.
    fn visit(&self, mut visit: impl FnMut(usize, &[usize], f64)) {
        let mut begin = 0;
        for (face, &end) in self.ends.iter().enumerate() {
            let vertices = &self.vertices[begin..end];
            visit(self.owners[face], vertices, 1.0);
            if let Some(&neighbour) = self.neighbours.get(face) {
                visit(neighbour, vertices, -1.0);
            }
            begin = end;
        }
    }

    /// The cells, all of which must be cubes.
    fn cubes(&self, count: usize) -> Result<Cells, ImportError> {
        let (low, high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut shapes = vec![Shape { low, high, volume: 0.0 }; count];
        self.visit(|cell, vertices, _| {
            for &vertex in vertices {
                for axis in 0..3 {
                    shapes[cell].low[axis] = shapes[cell].low[axis].min(self.points[vertex][axis]);
                    shapes[cell].high[axis] =
                        shapes[cell].high[axis].max(self.points[vertex][axis]);
                }
            }
        });
        // Volumes relative to a corner of the cell keep the digits that coordinates far from the origin would lose.
        self.visit(|cell, vertices, sign| {
            let low = shapes[cell].low;
            let at = |i: usize| [0, 1, 2].map(|a| self.points[vertices[i]][a] - low[a]);
            for i in 2..vertices.len() {
                shapes[cell].volume += sign * determinant(at(0), at(i - 1), at(i)) / 6.0;
            }
        });
        let mut cells = Cells::default();
        for (i, shape) in shapes.iter().enumerate() {
            cells.push(
                shape.low,
                shape.edge().map_err(|why| {
                    ImportError::content(format!(
                        "cell {i} (corner {:?}) is not a cube: {why}",
                        shape.low
                    ))
                })?,
            );
        }
        Ok(cells)
    }
}

impl Shape {
    /// The edge of a cube.
    fn edge(&self) -> Result<f64, String> {
        let extent = [0, 1, 2].map(|a| self.high[a] - self.low[a]);
        let edge = (extent[0] + extent[1] + extent[2]) / 3.0;
        // Written so that NaN, of a cell without faces, is an error.
        if !extent.iter().all(|e| (e - edge).abs() <= TOLERANCE * edge) {
            return Err(format!("its bounds have the edges {extent:?}"));
        }
        let part = self.volume / edge.powi(3);
        match (part - 1.0).abs() <= 3.0 * TOLERANCE {
            true => Ok(edge),
            false => Err(format!("its faces enclose {part:.3} of the volume of its bounds")),
        }
    }
}

/// The determinant of three vectors: six times the signed volume of the tetrahedron that they span.
fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}
