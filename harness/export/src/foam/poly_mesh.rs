//! The files of one directory `polyMesh`.

use std::fmt::Write as _;
use std::io::Write as _;

use contract::octant::UNITS_PER_CELL;

use super::cell_files::labels;
use super::directory::Directory;
use super::face_files;
use super::lists::{self, List};
use super::own::Own;
use crate::error::ExportError;
use crate::options::Style;

/// Writes the files of a directory.
///
/// # Errors
/// If a file cannot be written, if labels are too narrow, or if the user interrupts.
pub fn write(directory: &Directory) -> Result<(), ExportError> {
    face_files::write(directory)?;
    match &directory.own {
        None => write_points(directory, 0..directory.counts.points as u32)?,
        Some(own) => {
            write_points(directory, own.iter())?;
            if directory.has_addressing() {
                write_addressing(directory, own)?;
            }
        }
    }
    write_boundary(directory)
}

fn write_points(
    directory: &Directory,
    numbers: impl Iterator<Item = u32>,
) -> Result<(), ExportError> {
    let Directory { model, counts, path, .. } = directory;
    let mut list =
        List::create(path, model.options.foam.style, "vectorField", "points", "", counts.points)?;
    let mut visited = 0;
    model.points.visit(numbers, &mut |point| {
        model.options.check_at(visited)?;
        visited += 1;
        list.point(model.root.to_user(point.map(|c| i64::from(c) * UNITS_PER_CELL)))?;
        Ok::<_, ExportError>(())
    })?;
    Ok(list.finish()?)
}

/// Writes what reconstructPar needs besides the addressing of faces: the numbers that the points, cells and patches of a
/// processor have in the whole mesh.
fn write_addressing(directory: &Directory, own: &Own) -> Result<(), ExportError> {
    let Directory { model, domain, counts, path, .. } = directory;
    let write = |object: &str, count: u64, numbers: &mut dyn Iterator<Item = i64>| {
        let mut list = labels(model, object, "", count, path)?;
        for number in numbers {
            list.label(number)?;
        }
        list.finish()
    };
    let mut points = own.iter().map(i64::from);
    write("pointProcAddressing", counts.points, &mut points)?;
    let mut cells = domain.cells(model.tree.cells()).flatten().map(i64::from);
    write("cellProcAddressing", counts.cells, &mut cells)?;
    let (of_mesh, between) = (counts.patches.len(), counts.faces_between.len());
    let mut patches = (0..of_mesh as i64).chain(std::iter::repeat_n(-1, between));
    Ok(write("boundaryProcAddressing", (of_mesh + between) as u64, &mut patches)?)
}

fn write_boundary(directory: &Directory) -> Result<(), ExportError> {
    let Directory { model, patches, domain, counts, path, .. } = directory;
    let style = Style { is_ascii: true, ..model.options.foam.style };
    let mut text = lists::header(style, "polyBoundaryMesh", "boundary", "");
    let _ = writeln!(text, "{}\n(", counts.patches.len() + counts.faces_between.len());
    let mut start = counts.faces_internal;
    let mut entry = |name: String, kind: &str, faces: u64, more: &str| {
        let _ = writeln!(
            text,
            "    {name}\n    {{\n        type {kind};\n        nFaces {faces};\n        startFace {start};\n{more}    }}"
        );
        start += faces;
    };
    for (patch, (name, faces)) in counts.patches.iter().enumerate() {
        entry(name.clone(), patches.type_of(patch), *faces, "");
    }
    let here = domain.0.map_or(0, |(_, processor)| processor);
    for (there, faces) in &counts.faces_between {
        let more = format!(
            "        inGroups 1(processor);\n        matchTolerance 0.0001;\n        transform unknown;\n        \
             myProcNo {here};\n        neighbProcNo {there};\n"
        );
        entry(format!("procBoundary{here}to{there}"), "processor", *faces, &more);
    }
    text.push_str(")\n");
    let mut file = std::fs::File::create(path.join("boundary"))?;
    file.write_all(text.as_bytes())?;
    Ok(file.sync_all()?)
}
