//! The XML of a `.vtu` file.

use std::fmt::Write;

use contract::digest::Digest;
use contract::lattice::Root;
use contract::manifest::Sides;

use crate::mesh::Mesh;

/// The arrays of a piece, in the order in which they are written: section in the XML, name, and VTK's name of the type. Ranks or sides
/// are missing if they are unknown.
const ARRAYS: [(&str, &str, &str); 9] = [
    ("Points", "Points", "Float64"),
    ("Cells", "connectivity", "Int64"),
    ("Cells", "offsets", "Int64"),
    ("Cells", "types", "UInt8"),
    ("CellData", "level", "UInt8"),
    ("CellData", "rank", "UInt32"),
    ("CellData", "spacing", "Float64"),
    ("CellData", "id", "Int64"),
    ("CellData", "side", "UInt8"),
];

/// What a file states about itself before it has leaves.
#[derive(Clone, Copy, Debug)]
pub struct Content {
    /// The root of the mesh.
    pub root: Root,
    /// Whether cells have ranks.
    pub with_ranks: bool,
    /// Whether cells have sides.
    pub with_sides: bool,
}

/// Place and size of a piece in its file.
#[derive(Clone, Debug)]
pub struct Place {
    /// Number of points.
    pub points: u64,
    /// Number of cells.
    pub cells: u64,
    /// Position of each array in the appended data, in the order of [`ARRAYS`].
    pub offsets: Vec<u64>,
}

impl Place {
    /// A place whose XML is as long as any.
    pub fn longest() -> Self {
        Self { points: u64::MAX, cells: u64::MAX, offsets: vec![u64::MAX; ARRAYS.len()] }
    }
}

impl Content {
    /// What files of this mesh state.
    pub fn of(mesh: &Mesh) -> Self {
        Self {
            root: mesh.manifest.root,
            with_ranks: mesh.has_ranks(),
            with_sides: mesh.manifest.sides == Sides::Known,
        }
    }

    /// The file up to the appended data, with the digest of its leaves, filled up with blanks to `length` bytes.
    pub fn header(&self, places: &[Place], digest: Digest, length: usize) -> String {
        let Root { origin: [x, y, z], edge } = self.root;
        // VTK reads text as the codes of its characters.
        let codes = digest.to_string().bytes().fold(String::new(), |mut codes, byte| {
            let _ = write!(codes, "{byte} ");
            codes
        });
        let mut xml = format!(
            "<?xml version=\"1.0\"?>\n<!-- Written by harness export. -->\n\
             <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
             compressor=\"vtkZLibDataCompressor\">\n  <UnstructuredGrid>\n    <FieldData>\n      \
             <DataArray type=\"Float64\" Name=\"root\" NumberOfComponents=\"4\" NumberOfTuples=\"1\" format=\"ascii\">\
             {x:?} {y:?} {z:?} {edge:?}</DataArray>\n      \
             <DataArray type=\"String\" Name=\"digest\" NumberOfTuples=\"1\" format=\"ascii\">{codes}0</DataArray>\n    \
             </FieldData>\n"
        );
        for place in places {
            self.piece(place, &mut xml);
        }
        let end = "  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _";
        let blanks = length.saturating_sub(xml.len() + end.len());
        xml + &" ".repeat(blanks) + end
    }

    fn piece(&self, Place { points, cells, offsets }: &Place, xml: &mut String) {
        let is_known = |name: &str| match name {
            "rank" => self.with_ranks,
            "side" => self.with_sides,
            _ => true,
        };
        *xml += &format!("    <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n");
        let arrays = ARRAYS.iter().filter(|(_, name, _)| is_known(name)).zip(offsets);
        let arrays: Vec<_> = arrays.collect();
        for arrays in arrays.chunk_by(|(a, _), (b, _)| a.0 == b.0) {
            let section = arrays[0].0.0;
            let (scalars, components) = match section {
                "CellData" => (" Scalars=\"level\"", ""),
                "Points" => ("", " NumberOfComponents=\"3\""),
                _ => ("", ""),
            };
            *xml += &format!("      <{section}{scalars}>\n");
            for ((_, name, kind), offset) in arrays {
                *xml += &format!(
                    "        <DataArray type=\"{kind}\" Name=\"{name}\"{components} format=\"appended\" offset=\"{offset}\"/>\n"
                );
            }
            *xml += &format!("      </{section}>\n");
        }
        *xml += "    </Piece>\n";
    }
}
