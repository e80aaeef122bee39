//! A front as files: triangles as binary STL, polygons as VTK's polygonal data.

use std::io::{self, Write};

use contract::lattice::Root;
use contract::octant::UNITS_PER_CELL;
use geometries::Facet;
use geometries::write_stl_binary;
use vtkio::model::{Attributes, PolyDataPiece, VertexNumbers};

use super::front::Face;
use super::gap::Gap;
use super::polygons::Polygons;
use super::report::edge_of_level;
use crate::polydata::{array, write};

/// Writes the polygons as triangles, whose normals point away from the body. Coordinates have single precision.
///
/// # Errors
/// If writing fails, if there are more than 2^32 triangles, or if single precision does not resolve one.
pub fn stl(root: &Root, faces: &[Face], polygons: &Polygons, out: impl Write) -> io::Result<()> {
    let single = |at: [i64; 3]| root.to_user(at).map(|c| c as f32);
    let point =
        |index: &u32| polygons.points[*index as usize].map(|c| i64::from(c) * UNITS_PER_CELL);
    let mut triangles: Vec<Facet> = Vec::with_capacity(2 * faces.len());
    for (face, corners) in faces.iter().zip(polygons.iter()) {
        let corner = |i: usize| single(point(&corners[i % corners.len()]));
        if corners.len() == 4 {
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|ids| ids.map(corner)));
            continue;
        }
        // A fan from a corner could have triangles without area.
        let half = i64::from(face.edge()) * UNITS_PER_CELL / 2;
        let middle = std::array::from_fn(|a| {
            let along = if a == face.axis as usize { 0 } else { half };
            i64::from(face.corner[a]) * UNITS_PER_CELL + along
        });
        triangles.extend((0..corners.len()).map(|i| [single(middle), corner(i), corner(i + 1)]));
    }
    if let Some([at, ..]) = triangles.iter().find(|[a, b, c]| a == b || b == c || c == a) {
        let why = format!(
            "the coordinates of an STL file have seven digits, which do not resolve the faces at {at:?}: move the body towards the \
             origin, or write a .vtp file"
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    }
    write_stl_binary(&triangles, out)
}

/// Writes the polygons, counterclockwise as seen from the mesh, with the cell data `level` and `side` of the leaf, its `spacing`, its `rank`
/// if ranks are known, and with gaps also `gap`, the least distance of the face, `gap_centre`, that of its centre, and `gap_cells`, the least distance in edges of
/// the leaf.
///
/// # Errors
/// If writing fails.
pub fn vtp(
    root: &Root,
    faces: &[Face],
    polygons: &Polygons,
    gaps: Option<&[Gap]>,
    has_ranks: bool,
    out: impl Write,
) -> io::Result<()> {
    let point = |at: &[u32; 3]| root.to_user(at.map(|c| i64::from(c) * UNITS_PER_CELL));
    let spacing = |face: &Face| edge_of_level(root, face.leaf_level);
    let mut cell = vec![
        array("level", faces.iter().map(|face| face.leaf_level).collect::<Vec<u8>>()),
        array("side", faces.iter().map(|face| face.side as u8).collect::<Vec<u8>>()),
        array("spacing", faces.iter().map(spacing).collect::<Vec<f64>>()),
    ];
    if has_ranks {
        cell.push(array("rank", faces.iter().map(|face| face.rank).collect::<Vec<u32>>()));
    }
    if let Some(gaps) = gaps {
        let cells = gaps.iter().zip(faces).map(|(gap, face)| gap.least / spacing(face));
        cell.push(array("gap_cells", cells.collect::<Vec<f64>>()));
        cell.push(array("gap_centre", gaps.iter().map(|gap| gap.centre).collect::<Vec<f64>>()));
        cell.push(array("gap", gaps.iter().map(|gap| gap.least).collect::<Vec<f64>>()));
    }
    let piece = PolyDataPiece {
        points: polygons.points.iter().flat_map(point).collect::<Vec<f64>>().into(),
        polys: Some(VertexNumbers::XML {
            connectivity: polygons.corners.iter().map(|&c| u64::from(c)).collect(),
            offsets: polygons.ends.clone(),
        }),
        data: Attributes { point: Vec::new(), cell },
        ..PolyDataPiece::default()
    };
    write("front towards the body", piece, out)
}
