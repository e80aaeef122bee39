//! The widest paths of leaks as VTK polylines with the free width at each point.

use geometry::leak::report::Passage;
use std::io::{self, Write};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataArray, DataSet, PolyDataPiece, Version, VertexNumbers,
    Vtk,
};

/// Writes paths as `.vtp`: a line each, with the point data `width` and the cell data `narrowest_width`.
///
/// # Errors
/// If writing fails.
pub fn vtp(passages: &[&Passage], out: impl Write) -> io::Result<()> {
    let points = || passages.iter().flat_map(|passage| &passage.points);
    let scalars = |name: &str, data: Vec<f64>| {
        Attribute::DataArray(DataArray::scalars(name, 1).with_vec(data))
    };
    let mut end = 0;
    let ends = passages.iter().map(|passage| {
        end += passage.points.len() as u64;
        end
    });
    let offsets: Vec<u64> = ends.collect();
    let widths = passages.iter().map(|passage| passage.narrowest.width).collect();
    let piece = PolyDataPiece {
        points: points().flat_map(|p| p.at).collect::<Vec<f64>>().into(),
        lines: Some(VertexNumbers::XML { connectivity: (0..end).collect(), offsets }),
        data: Attributes {
            point: vec![scalars("width", points().map(|p| p.width).collect())],
            cell: vec![scalars("narrowest_width", widths)],
        },
        ..PolyDataPiece::default()
    };
    let lines = Vtk {
        version: Version { major: 1, minor: 0 },
        title: "widest paths".into(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    lines.write_xml(out).map_err(|error| io::Error::other(format!("{error:?}")))
}
