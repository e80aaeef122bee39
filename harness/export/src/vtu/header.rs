//! The XML of `.vtu` and `.pvtu` files.

use std::fmt::Write;

use contract::digest::Digest;
use contract::lattice::Root;

/// The line that marks files of this program, which it may replace.
pub const MARK: &str = "<!-- Written by harness export. -->\n";

/// An array of a piece.
#[derive(Debug)]
pub struct Array {
    /// Its section in the XML.
    section: &'static str,
    /// Its name.
    name: &'static str,
    /// VTK's name of its type.
    kind: &'static str,
}

const fn array(section: &'static str, name: &'static str, kind: &'static str) -> Array {
    Array { section, name, kind }
}

/// The arrays of a piece, in the order in which they are written. Ranks or sides are missing if they are unknown.
const ARRAYS: [Array; 9] = [
    array("Points", "Points", "Float64"),
    array("Cells", "connectivity", "Int64"),
    array("Cells", "offsets", "Int64"),
    array("Cells", "types", "UInt8"),
    array("CellData", "level", "UInt8"),
    array("CellData", "rank", "UInt32"),
    array("CellData", "spacing", "Float64"),
    array("CellData", "id", "Int64"),
    array("CellData", "side", "UInt8"),
];

/// What a file states about itself.
#[derive(Clone, Copy, Debug)]
pub struct Content {
    /// The root of the mesh.
    pub root: Root,
    /// Whether cells have ranks.
    pub with_ranks: bool,
    /// Whether cells have sides.
    pub with_sides: bool,
    /// Digest of the leaves in the file.
    pub digest: Digest,
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
    fn arrays(&self) -> impl Iterator<Item = &'static Array> {
        let Self { with_ranks, with_sides, .. } = *self;
        ARRAYS.iter().filter(move |array| match array.name {
            "rank" => with_ranks,
            "side" => with_sides,
            _ => true,
        })
    }

    /// A `.vtu` file up to the appended data, filled up with blanks to `length` bytes.
    pub fn vtu(&self, places: &[Place], length: usize) -> String {
        let mut xml = self.start("UnstructuredGrid", "");
        for Place { points, cells, offsets } in places {
            let counts = format!("NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\"");
            xml += &format!("    <Piece {counts}>\n");
            xml += &self.sections("", |index| {
                format!(" format=\"appended\" offset=\"{}\"", offsets[index])
            });
            xml += "    </Piece>\n";
        }
        let end = "  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _";
        let blanks = length.saturating_sub(xml.len() + end.len());
        xml + &" ".repeat(blanks) + end
    }

    /// A `.pvtu` file with the pieces in these files, whose names are relative to its directory.
    pub fn pvtu(&self, files: &[String]) -> String {
        let mut xml = self.start("PUnstructuredGrid", " GhostLevel=\"0\"");
        xml += &self.sections("P", |_| String::new());
        for file in files {
            xml += &format!("    <Piece Source=\"{}\"/>\n", escaped(file));
        }
        xml + "  </PUnstructuredGrid>\n</VTKFile>\n"
    }

    fn start(&self, grid: &str, attributes: &str) -> String {
        let Root { origin: [x, y, z], edge } = self.root;
        // VTK reads text as the codes of its characters.
        let digest = self.digest.to_string().bytes().fold(String::new(), |mut codes, byte| {
            let _ = write!(codes, "{byte} ");
            codes
        });
        format!(
            "<?xml version=\"1.0\"?>\n{MARK}\
             <VTKFile type=\"{grid}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
             compressor=\"vtkZLibDataCompressor\">\n  <{grid}{attributes}>\n    <FieldData>\n      \
             <DataArray type=\"Float64\" Name=\"root\" NumberOfComponents=\"4\" NumberOfTuples=\"1\" format=\"ascii\">\
             {x:?} {y:?} {z:?} {edge:?}</DataArray>\n      \
             <DataArray type=\"String\" Name=\"digest\" NumberOfTuples=\"1\" format=\"ascii\">{digest}0</DataArray>\n    \
             </FieldData>\n"
        )
    }

    /// The arrays in their sections; `attributes` returns further attributes of an array.
    fn sections(&self, prefix: &str, attributes: impl Fn(usize) -> String) -> String {
        let mut xml = String::new();
        for section in ["Points", "Cells", "CellData"] {
            // The cells of parts are not described in the file that names the parts.
            if section == "Cells" && prefix == "P" {
                continue;
            }
            let scalars = if section == "CellData" { " Scalars=\"level\"" } else { "" };
            xml += &format!("      <{prefix}{section}{scalars}>\n");
            for (index, array) in self.arrays().enumerate() {
                if array.section == section {
                    let Array { name, kind, .. } = array;
                    let components =
                        if section == "Points" { " NumberOfComponents=\"3\"" } else { "" };
                    let attributes = attributes(index);
                    xml += &format!(
                        "        <{prefix}DataArray type=\"{kind}\" Name=\"{name}\"{components}{attributes}/>\n"
                    );
                }
            }
            xml += &format!("      </{prefix}{section}>\n");
        }
        xml
    }
}

/// Text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
