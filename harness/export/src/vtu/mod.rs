//! Cells as VTK's unstructured grid, in one `.vtu` file.
//!
//! Each leaf is a hexahedron. The mesh is written in pieces of at most [`PIECE`] leaves, so memory does not depend on the size of
//! the mesh: about 60 MB.
//!
//! - `piece`: the arrays of a piece, compressed.

mod piece;

use std::fmt::Write as _;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use contract::digest::Digest;
use contract::files;
use contract::lattice::Root;
use contract::manifest::Sides;

use crate::options::{Export, Summary};
use contract::failure::{Failure, Result, progress, uninterrupted};
use piece::{Encoder, Piece};

/// Maximum number of leaves in a piece.
pub const PIECE: usize = 1 << 19;

/// What follows the data.
const END: &str = "\n  </AppendedData>\n</VTKFile>\n";

/// An array: its section in the XML, name, and VTK's name of the type.
type Array = (&'static str, &'static str, &'static str);

/// The arrays of a piece, in the order in which they are written. Ranks or sides are missing if they are unknown.
const ARRAYS: [Array; 9] = [
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

/// Writes the file. The XML precedes the data that it describes. Its place is reserved for as many pieces as there will be, and it is
/// written last.
///
/// # Errors
/// If no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary> {
    let (mesh, leaves) = (export.mesh, export.count()?);
    let is_known = |(_, name, _): &Array| match *name {
        "rank" => mesh.tree_file.is_none(),
        "side" => mesh.manifest.sides == Sides::Known,
        _ => true,
    };
    let arrays: Vec<Array> = ARRAYS.into_iter().filter(is_known).collect();
    let offsets = vec![u64::MAX; arrays.len()];
    let longest = Piece { points: u64::MAX, cells: u64::MAX, offsets, bytes: Vec::new() };
    let root = &mesh.manifest.root;
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, |file| {
        let (mut pieces, mut data_bytes) = (Vec::new(), 0);
        let longest = vec![longest; leaves.div_ceil(PIECE as u64) as usize];
        let header_bytes = header(root, &arrays, &longest, Digest::default(), 0).len();
        file.seek(SeekFrom::Start(header_bytes as u64)).map_err(named)?;
        let mut encoder = Encoder::default();
        let mut flush = |encoder: &mut Encoder| {
            let mut piece = encoder.encode(root, &arrays);
            // The user's interrupt waits for a flush to end, so none may have much to flush.
            file.write_all(&piece.bytes).and_then(|()| file.sync_data()).map_err(named)?;
            piece.offsets.iter_mut().for_each(|offset| *offset += data_bytes);
            data_bytes += piece.bytes.len() as u64;
            pieces.push(Piece { bytes: Vec::new(), ..piece });
            progress(&format!("{} %", 100 * encoder.cells / leaves));
            uninterrupted()
        };
        export.selection.visit(mesh, &mut |leaf| {
            if encoder.leaves.len() == PIECE {
                flush(&mut encoder)?;
            }
            encoder.leaves.push(leaf);
            export.require_resolved(leaf.octant.level)
        })?;
        flush(&mut encoder)?;
        assert_eq!(encoder.cells, leaves, "cells written and leaves selected");
        let header = header(root, &arrays, &pieces, encoder.digest, header_bytes);
        file.write_all(END.as_bytes()).map_err(named)?;
        file.seek(SeekFrom::Start(0)).map_err(named)?;
        file.write_all(header.as_bytes()).and_then(|()| file.sync_all()).map_err(named)?;
        uninterrupted()
    })?;
    Ok(Summary { leaves, bytes, notes: Vec::new() })
}

/// The file up to the appended data, filled up with blanks to that many bytes.
fn header(root: &Root, arrays: &[Array], pieces: &[Piece], digest: Digest, bytes: usize) -> String {
    let Root { origin: [x, y, z], edge } = root;
    // VTK reads text as the codes of its characters.
    let codes: String = digest.to_string().bytes().map(|byte| format!("{byte} ")).collect();
    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<!-- Written by harness export. -->\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
         compressor=\"vtkZLibDataCompressor\">\n  <UnstructuredGrid>\n    <FieldData>\n      \
         <DataArray type=\"Float64\" Name=\"root\" NumberOfComponents=\"4\" NumberOfTuples=\"1\" format=\"ascii\">\
         {x:?} {y:?} {z:?} {edge:?}</DataArray>\n      \
         <DataArray type=\"String\" Name=\"digest\" NumberOfTuples=\"1\" format=\"ascii\">{codes}0</DataArray>\n    \
         </FieldData>\n"
    );
    pieces.iter().for_each(|piece| describe(arrays, piece, &mut xml));
    let end = "  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _";
    let blanks = bytes.saturating_sub(xml.len() + end.len());
    xml + &" ".repeat(blanks) + end
}

/// Appends the description of a piece.
fn describe(arrays: &[Array], piece: &Piece, xml: &mut String) {
    let Piece { points, cells, offsets, .. } = piece;
    *xml += &format!("    <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n");
    let arrays: Vec<_> = arrays.iter().zip(offsets).collect();
    for arrays in arrays.chunk_by(|(a, _), (b, _)| a.0 == b.0) {
        let section = arrays[0].0.0;
        let (scalars, components) = match section {
            "CellData" => (" Scalars=\"level\"", ""),
            "Points" => ("", " NumberOfComponents=\"3\""),
            _ => ("", ""),
        };
        *xml += &format!("      <{section}{scalars}>\n");
        for ((_, name, kind), offset) in arrays {
            let _ = writeln!(
                xml,
                "        <DataArray type=\"{kind}\" Name=\"{name}\"{components} format=\"appended\" offset=\"{offset}\"/>"
            );
        }
        *xml += &format!("      </{section}>\n");
    }
    *xml += "    </Piece>\n";
}
