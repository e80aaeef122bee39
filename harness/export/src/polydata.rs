//! VTK's polygonal data: polylines and polygons with values.

use geometry::leak::report::Passage;
use std::io::{self, Write};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataArray, DataSet, IOBuffer, PolyDataPiece, Version,
    VertexNumbers, Vtk,
};

/// Writes the widest paths of leaks as `.vtp`: a line each, with the point data `width`, the free width there, and the cell data
/// `narrowest_width`.
///
/// # Errors
/// If writing fails.
pub fn paths(passages: &[&Passage], out: impl Write) -> io::Result<()> {
    let points = || passages.iter().flat_map(|passage| &passage.points);
    let mut end = 0;
    let ends = passages.iter().map(|passage| {
        end += passage.points.len() as u64;
        end
    });
    let offsets: Vec<u64> = ends.collect();
    let widths: Vec<f64> = passages.iter().map(|passage| passage.narrowest.width).collect();
    let piece = PolyDataPiece {
        points: points().flat_map(|p| p.at).collect::<Vec<f64>>().into(),
        lines: Some(VertexNumbers::XML { connectivity: (0..end).collect(), offsets }),
        data: Attributes {
            point: vec![array("width", points().map(|p| p.width).collect::<Vec<f64>>())],
            cell: vec![array("narrowest_width", widths)],
        },
        ..PolyDataPiece::default()
    };
    write("widest paths", piece, out)
}

/// One value for each point or cell.
pub(crate) fn array(name: &str, values: impl Into<IOBuffer>) -> Attribute {
    Attribute::DataArray(DataArray { data: values.into(), ..DataArray::scalars(name, 1) })
}

/// Writes a file of one piece.
pub(crate) fn write(title: &str, piece: PolyDataPiece, mut out: impl Write) -> io::Result<()> {
    let file = Vtk {
        version: Version { major: 1, minor: 0 },
        title: title.into(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    // The errors of vtkio do not say what the system said.
    let mut bytes = Vec::new();
    file.write_xml(&mut bytes).map_err(|error| io::Error::other(format!("{error:?}")))?;
    out.write_all(&bytes)
}
