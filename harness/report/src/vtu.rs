//! Leaf sets as VTK unstructured grids, for visualisation.
//!
//! Each leaf becomes one hexahedron with its level, side and part. Coinciding corners of leaves are one point; a hanging
//! node belongs to the finer cells only. The grid is held in memory, about 200 bytes per leaf: meshes for visualisation
//! are smaller than those of a billion cells.

use crate::write::replace;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::octant::CELLS_PER_EDGE;
use contract::word;
use std::io;
use std::path::Path;
use thiserror::Error;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, UnstructuredGridPiece,
    Version, VertexNumbers, Vtk,
};

/// Maximum number of leaves in one file.
pub const LEAVES_MAX: usize = 50_000_000;

/// Why a mesh was not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The mesh has more than [`LEAVES_MAX`] leaves.
    #[error(
        "the mesh has {0} leaves, more than the {LEAVES_MAX} that fit in one VTK file: export a coarser mesh"
    )]
    TooMany(usize),
    /// A word that does not encode a leaf.
    #[error("the leaf set has an invalid word ({0}): run harness audit on the directory")]
    Word(#[from] word::WordError),
    /// The file could not be written.
    #[error("{0}: choose another file")]
    Write(#[from] io::Error),
}

/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// Writes the mesh as `.vtu`.
///
/// # Errors
/// If the mesh has too many leaves or an invalid word, or if the file cannot be written.
pub fn vtu(mesh: &LeafSet, path: &Path) -> Result<(), ExportError> {
    let grid = grid(mesh)?;
    let invalid = |error| io::Error::other(format!("{error:?}"));
    Ok(replace(path, |out| grid.write_xml(out).map_err(invalid))?)
}

fn grid(mesh: &LeafSet) -> Result<Vtk, ExportError> {
    let leaves = mesh.words.len();
    if leaves > LEAVES_MAX {
        return Err(ExportError::TooMany(leaves));
    }
    let mut corners = Vec::with_capacity(8 * leaves);
    let (mut levels, mut sides, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for (part, words) in (0i32..).zip(&mesh.parts) {
        for &w in words {
            let octant = word::decode(w)?.octant;
            let (corner, edge) = (octant.corner, octant.edge());
            corners.extend(CORNERS.map(|c| packed([0, 1, 2].map(|a| corner[a] + edge * c[a]))));
            levels.push(i32::from(octant.level));
            sides.push((w & 3) as i32);
            parts.push(part);
        }
    }
    let mut points = corners.clone();
    points.sort_unstable();
    points.dedup();
    let index = |c: &u64| points.binary_search(c).expect("every corner is a point") as u64;
    let connectivity = corners.iter().map(index).collect();
    let scalars = |name: &str, data: Vec<i32>| {
        Attribute::DataArray(DataArray::scalars(name, 1).with_vec(data))
    };
    let piece = UnstructuredGridPiece {
        points: coordinates(&points, &mesh.manifest.root).into(),
        cells: Cells {
            cell_verts: VertexNumbers::XML {
                connectivity,
                offsets: (1..=leaves as u64).map(|i| 8 * i).collect(),
            },
            types: vec![CellType::Hexahedron; leaves],
        },
        data: Attributes {
            point: Vec::new(),
            cell: vec![scalars("level", levels), scalars("side", sides), scalars("part", parts)],
        },
    };
    Ok(Vtk {
        version: Version { major: 1, minor: 0 },
        title: "oct-tree mesh".into(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    })
}

/// A corner as one number, 20 bits per axis: lattice coordinates range from 0 to 2^19 inclusive.
fn packed(corner: [u32; 3]) -> u64 {
    corner.iter().rev().fold(0, |p, &c| p << 20 | u64::from(c))
}

/// Coordinates of packed corners in the units of the geometry, three per point.
fn coordinates(points: &[u64], root: &Root) -> Vec<f64> {
    let step = root.edge / f64::from(CELLS_PER_EDGE);
    let along = |p: u64, a: usize| root.origin[a] + (p >> (20 * a) & 0xf_ffff) as f64 * step;
    points.iter().flat_map(|&p| [along(p, 0), along(p, 1), along(p, 2)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_corners_have_the_coordinates_of_the_geometry() {
        let root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };
        let corners = [[0, 0, 0], [CELLS_PER_EDGE, 0, 0], [0, CELLS_PER_EDGE / 2, CELLS_PER_EDGE]];
        let coordinates = coordinates(&corners.map(packed), &root);
        assert_eq!(coordinates, [-1.0, 0.0, 2.0, 3.0, 0.0, 2.0, -1.0, 2.0, 6.0]);
    }
}
