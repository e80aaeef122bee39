//! Leaf sets as VTK unstructured grids, for looking at.
//!
//! One hexahedron per leaf, with its level, side and part. Corners that leaves share are one point; a
//! hanging node is a point of the finer cells only. All is held in memory, about 200 bytes per leaf:
//! meshes for looking at are not those of a billion cells.

use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::octant::CELLS_PER_EDGE;
use contract::word;
use std::fs::Permissions;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use thiserror::Error;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, UnstructuredGridPiece,
    Version, VertexNumbers, Vtk,
};

/// Most leaves that are exported.
pub const LEAVES_MAX: usize = 50_000_000;

/// Why a mesh was not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// More than is sensible in one file.
    #[error(
        "{0} leaves are more than the {LEAVES_MAX} that one VTK file takes: mesh it coarser to look at it"
    )]
    TooMany(usize),
    /// A word that is no leaf.
    #[error("a word is no leaf ({0}): run harness audit on the directory")]
    Word(#[from] word::WordError),
    /// The file could not be written.
    #[error("{path}: {why}: choose another file")]
    Write {
        /// The file.
        path: String,
        /// What went wrong.
        why: String,
    },
}

/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// Writes the mesh as `.vtu`: beside it first, then renamed.
///
/// # Errors
/// Too many leaves, words that are none, or a file that cannot be written.
pub fn vtu(mesh: &LeafSet, path: &Path) -> Result<(), ExportError> {
    let grid = grid(mesh)?;
    let fail = |why: &dyn std::fmt::Display| ExportError::Write {
        path: path.display().to_string(),
        why: why.to_string(),
    };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(|e| fail(&e))?;
    let mut out = BufWriter::new(&mut file);
    grid.write_xml(&mut out).map_err(|e| fail(&format!("{e:?}")))?;
    let finish = |mut out: BufWriter<_>| -> io::Result<()> { out.flush() };
    finish(out).map_err(|e| fail(&e))?;
    // A temporary file is its owner's alone; this one is to be looked at.
    let readable = Permissions::from_mode(0o644);
    file.as_file().set_permissions(readable).map_err(|e| fail(&e))?;
    file.as_file().sync_all().map_err(|e| fail(&e))?;
    file.persist(path).map_err(|e| fail(&e.error))?;
    Ok(())
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
            let (at, edge) = (octant.corner, octant.edge());
            corners.extend(CORNERS.map(|c| packed([0, 1, 2].map(|a| at[a] + edge * c[a]))));
            levels.push(i32::from(octant.level));
            sides.push((w & 3) as i32);
            parts.push(part);
        }
    }
    let mut points = corners.clone();
    points.sort_unstable();
    points.dedup();
    let number = |c: &u64| points.binary_search(c).map_or(0, |i| i as u64);
    let connectivity = corners.iter().map(number).collect();
    let scalars = |name: &str, data: Vec<i32>| {
        Attribute::DataArray(DataArray::scalars(name, 1).with_vec(data))
    };
    let piece = UnstructuredGridPiece {
        points: locate(&points, &mesh.manifest.root).into(),
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

/// A corner as one number; 20 bits per axis, as the far side of the root is a corner too.
fn packed(corner: [u32; 3]) -> u64 {
    corner.iter().rev().fold(0, |p, &c| p << 20 | u64::from(c))
}

/// Points in the geometry's units, three numbers each.
fn locate(points: &[u64], root: &Root) -> Vec<f64> {
    let step = root.edge / f64::from(CELLS_PER_EDGE);
    let at = |p: u64, a: usize| root.origin[a] + (p >> (20 * a) & 0xf_ffff) as f64 * step;
    points.iter().flat_map(|&p| [at(p, 0), at(p, 1), at(p, 2)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_packed_and_found_again() {
        let root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };
        let corners = [[0, 0, 0], [CELLS_PER_EDGE, 0, 0], [0, CELLS_PER_EDGE / 2, CELLS_PER_EDGE]];
        let at = locate(&corners.map(packed), &root);
        assert_eq!(at, [-1.0, 0.0, 2.0, 3.0, 0.0, 2.0, -1.0, 2.0, 6.0]);
    }
}
