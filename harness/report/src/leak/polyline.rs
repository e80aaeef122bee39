//! The widest path of a leak as a VTK polyline with the free width at each point.

use check::leak::report::Passage;
use std::io::{self, Write};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataArray, DataSet, PolyDataPiece, Version, VertexNumbers,
    Vtk,
};

/// Writes the path as `.vtp`: one line with the point data `width`, and the cell data `narrowest_width`.
///
/// # Errors
/// If writing fails.
pub fn vtp(passage: &Passage, out: impl Write) -> io::Result<()> {
    let points = &passage.points;
    let scalars = |name: &str, data: Vec<f64>| {
        Attribute::DataArray(DataArray::scalars(name, 1).with_vec(data))
    };
    let piece = PolyDataPiece {
        points: points.iter().flat_map(|p| p.at).collect::<Vec<f64>>().into(),
        lines: Some(VertexNumbers::XML {
            connectivity: (0..points.len() as u64).collect(),
            offsets: vec![points.len() as u64],
        }),
        data: Attributes {
            point: vec![scalars("width", points.iter().map(|p| p.width).collect())],
            cell: vec![scalars("narrowest_width", vec![passage.narrowest.width])],
        },
        ..PolyDataPiece::default()
    };
    let line = Vtk {
        version: Version { major: 1, minor: 0 },
        title: "widest path".into(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    line.write_xml(out).map_err(|error| io::Error::other(format!("{error:?}")))
}
