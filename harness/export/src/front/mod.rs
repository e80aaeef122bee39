//! The surface that a mesh hands over to a near-body mesher: the faces at which its cells end at crossing leaves, deleted or not, as
//! polygons for VTK (`.vtp`) or triangles (`.stl`), whose normals point away from the body.
//!
//! A leaf on a side (not crossing) borders leaves of its own side and crossing leaves only, because a component is kept or deleted as
//! a whole. Where it borders neither the root's boundary nor a leaf on a side, a crossing leaf was deleted, or is there. Such
//! a face is exposed. A face that is exposed in part is divided into quarters, and these again, until each is exposed or
//! not; so no two squares of the front overlap, and a whole face is one square whatever the crossing leaves are like.
//!
//! Polygons are the same squares, so that they fit together: where a large square borders smaller ones, their corners on its edges become
//! corners of its polygon, as in a mesh of polyhedra. Then every edge belongs to an even number of polygons, except where the front ends at the
//! root's boundary or at the limits of a selection.
//!
//! Invariants, which are executed before a file has its name: every polygon is the square of its face with points on its edges, and faces the
//! leaf; the areas of a closed front cancel.

#[cfg(test)]
mod tests;

use std::io::{BufWriter, Write};
use std::path::Path;

use contract::failure::{Failure, Result, uninterrupted};
use contract::files::fill_atomically;
use contract::lattice::Root;
use contract::number::number;
use contract::octant::edge_of;
use contract::word::{self, Side};
use geometries::{Facet, write_stl_binary};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataArray, DataSet, IOBuffer, PolyDataPiece, Version,
    VertexNumbers, Vtk,
};

use crate::leaves::{Content, Leaves, Square};
use crate::options::{Export, Summary, require_new};
use crate::points::{Points, Polygons, edges, to_user};

/// A square of the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The square; its level is that of the leaf, or deeper if only part of the leaf's face is exposed.
    pub square: Square,
    /// The word of the leaf, which is not crossing.
    pub leaf: u64,
}

impl Face {
    /// The four corners in level-19 cells, counterclockwise as seen from the leaf.
    fn corners(&self) -> [[u32; 3]; 4] {
        self.square.corners(!self.square.is_high)
    }
}

/// A front.
struct Front {
    root: Root,
    faces: Vec<Face>,
    /// The corners of all squares.
    points: Points,
    /// The polygon of each face, counterclockwise as seen from the leaf.
    polygons: Polygons,
}

/// The faces of the selected leaves that belong to the front.
///
/// # Errors
/// If the mesh is not a linear oct-tree or cannot be read, or if the user interrupts.
fn front(export: &Export<'_>) -> Result<Vec<Face>> {
    // Without crossing leaves, exposed faces are those at holes.
    let leaves = Leaves::read(export, &mut |leaf, _| leaf.side != Side::Crossing)?;
    let (mut faces, mut words) = (Vec::new(), leaves.cells());
    leaves.walk(&mut |_, _, squares| {
        let leaf = words.next().expect("cells are visited in the order of their words");
        let exposed = squares.iter().filter(|square| square.across == Content::Hole);
        faces.extend(exposed.map(|&square| Face { square, leaf }));
    })?;
    Ok(faces)
}

/// Writes the polygons, with the cell data `level` and `side` of the leaf, and its `spacing`.
///
/// # Errors
/// If the mesh cannot be read or has no such faces, if the file cannot be written, or if the user interrupts.
pub fn vtp(export: &Export<'_>, path: &Path) -> Result<Summary> {
    write(export, path, &|Front { root, faces, points, polygons }, out| {
        let points = points.all.iter().flat_map(|at| to_user(at, root));
        let spacing = |face: &Face| root.edge_of(word::level(face.leaf));
        let cell = vec![
            array("level", faces.iter().map(|face| word::level(face.leaf)).collect::<Vec<u8>>()),
            array("side", faces.iter().map(|face| (face.leaf & 3) as u8).collect::<Vec<u8>>()),
            array("spacing", faces.iter().map(spacing).collect::<Vec<f64>>()),
        ];
        let piece = PolyDataPiece {
            points: points.collect::<Vec<f64>>().into(),
            polys: Some(VertexNumbers::XML {
                connectivity: polygons.corners.iter().map(|&c| u64::from(c)).collect(),
                offsets: polygons.ends.clone(),
            }),
            data: Attributes { point: Vec::new(), cell },
            ..PolyDataPiece::default()
        };
        let file = Vtk {
            version: Version { major: 1, minor: 0 },
            title: "front towards the body".into(),
            byte_order: ByteOrder::LittleEndian,
            data: DataSet::inline(piece),
            file_path: None,
        };
        // The errors of vtkio do not say what the system said.
        let mut bytes = Vec::new();
        file.write_xml(&mut bytes).map_err(|error| Failure::input(format!("{error:?}")))?;
        Ok(out.write_all(&bytes)?)
    })
}

/// One value for each point or cell.
fn array(name: &str, values: impl Into<IOBuffer>) -> Attribute {
    Attribute::DataArray(DataArray { data: values.into(), ..DataArray::scalars(name, 1) })
}

/// Writes the polygons as triangles. Coordinates have single precision.
///
/// # Errors
/// As [`vtp`], and if the file exists, if there are more than 2^32 triangles, or if single precision moves a corner by more than a hundredth of a face.
pub fn stl(export: &Export<'_>, path: &Path) -> Result<Summary> {
    // Nothing in a surface shows whether it is an export or the body that was meshed.
    require_new(path)?;
    write(export, path, &|front, out| Ok(write_stl_binary(&triangles(front)?, out)?))
}

/// Writes the content of a file that shows a front.
type Fill<'a> = &'a dyn Fn(&Front, &mut dyn Write) -> Result<()>;

/// Finds the front, and writes the file that `fill` makes of it.
fn write(export: &Export<'_>, path: &Path, fill: Fill) -> Result<Summary> {
    export.mesh.require_sides()?;
    let faces = front(export)?;
    let why = "no selected cell borders a crossing cell, deleted or not, so there is no surface";
    Failure::unless(!faces.is_empty(), why)?;
    let front = Front::new(export.mesh.manifest.root, faces);
    let open = front.edges_open();
    front.check_invariants(export.is_of_all() && open == 0);
    let edges = front.faces.iter().map(|face| front.root.edge_of(face.square.level));
    let area: f64 = edges.map(|edge| edge.powi(2)).sum();
    let bytes = fill_atomically(path, |file| {
        let mut out = BufWriter::new(file);
        fill(&front, &mut out).map_err(|failure| failure.of_file(path))?;
        out.flush().map_err(|error| Failure::at(path, error))?;
        uninterrupted()
    })?;
    let closed = match open {
        0 => "closed".to_owned(),
        _ => format!(
            "open at {open} edges, where it reaches the root's boundary or a selection or an imported part ends"
        ),
    };
    let notes = vec![format!("a surface of area {}, {closed}", number(area))];
    Ok(Summary { leaves: front.faces.len() as u64, bytes, notes })
}

/// The polygons as triangles.
fn triangles(Front { root, faces, points, polygons }: &Front) -> Result<Vec<Facet>> {
    let point = |index: u32| to_user(&points.all[index as usize], root).map(|c| c as f32);
    let finest = faces.iter().map(|face| root.edge_of(face.square.level)).fold(f64::MAX, f64::min);
    let is_moved = |c: &f64| (c - f64::from(*c as f32)).abs() > finest / 100.0;
    let mut places = points.all.iter().map(|at| to_user(at, root));
    if let Some(at) = places.find(|at| at.iter().any(is_moved)) {
        return Err(Failure::input(format_args!(
            "the coordinates of an STL file have seven digits, which do not resolve the faces at {at:?}: move the body towards the \
             origin, or write a .vtp file"
        )));
    }
    let mut triangles: Vec<Facet> = Vec::with_capacity(2 * faces.len());
    for (face, corners) in faces.iter().zip(polygons.iter()) {
        let corner = |i: usize| point(corners[i % corners.len()]);
        if corners.len() == 4 {
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|ids| ids.map(corner)));
            continue;
        }
        // A fan from a corner could have triangles without area.
        let middle = root.to_user(face.square.centre()).map(|c| c as f32);
        triangles.extend((0..corners.len()).map(|i| [middle, corner(i), corner(i + 1)]));
    }
    Ok(triangles)
}

impl Front {
    /// The front with these faces.
    fn new(root: Root, faces: Vec<Face>) -> Self {
        let (mut points, mut polygons) = (Points::default(), Polygons::default());
        faces.iter().flat_map(Face::corners).for_each(|corner| _ = points.add(corner));
        faces.iter().for_each(|face| polygons.push(&points, face.corners()));
        Self { root, faces, points, polygons }
    }

    /// Number of edges that belong to an odd number of polygons: 0 if the front is closed.
    fn edges_open(&self) -> u64 {
        let edges = self.polygons.iter().flat_map(edges);
        let mut edges: Vec<_> = edges.map(|(a, b)| (a.min(b), a.max(b))).collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).count() as u64
    }

    /// Asserts the invariants.
    ///
    /// # Panics
    /// If one is violated.
    fn check_invariants(&self, is_closed: bool) {
        assert_eq!(self.polygons.ends.len(), self.faces.len(), "a polygon for every face");
        let mut sum = [0i64; 3];
        for (face, corners) in self.faces.iter().zip(self.polygons.iter()) {
            let area = self.points.area(corners);
            let twice = 2 * edge_of(face.square.level).pow(2);
            let mut expected = [0; 3];
            expected[face.square.axis] = if face.square.is_high { -twice } else { twice };
            assert_eq!(area, expected, "twice the area of {face:?}");
            (0..3).for_each(|a| sum[a] += area[a]);
        }
        assert!(!is_closed || sum == [0; 3], "a closed front of areas that add up to {sum:?}");
    }
}
