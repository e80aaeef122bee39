//! The files of a directory that are written face by face or cell by cell.

use super::cell_files::{CellFiles, labels};
use super::directory::{Directory, narrow};
use super::faces::Square;
use super::lists::{Faces, List};
use super::own::Own;
use super::points::Near;
use super::survey::{owned, visit, visit_faces, visit_some};
use super::walk::Around;
use crate::error::ExportError;

/// The lists that are written face by face.
struct FaceFiles<'a> {
    faces: Faces,
    owner: List,
    polygon: Vec<u32>,
    vertices: Vec<u64>,
    /// The points of a directory that has not all cells.
    own: Option<&'a Own>,
    /// The numbers of its faces in the whole mesh.
    addressing: Option<List>,
}

impl FaceFiles<'_> {
    /// Adds the face with this number in the whole mesh. `is_turned` is whether the whole mesh has it the other way round.
    fn push(
        &mut self,
        owner: u32,
        (around, square): (&Around<Near>, &Square),
        number: u64,
        is_turned: bool,
    ) -> Result<(), ExportError> {
        // Normals point away from the owner. Between two cells that is the one on the low side, whose number is lower.
        square.polygon(around, square.is_high == is_turned, &mut self.polygon);
        self.vertices.clear();
        let number_here = |&point: &u32| u64::from(self.own.map_or(point, |own| own.rank(point)));
        self.vertices.extend(self.polygon.iter().map(number_here));
        if let Some(addressing) = &mut self.addressing {
            // Counted from 1, so that every number has a sign.
            let number = number as i64 + 1;
            addressing.label(if is_turned { -number } else { number })?;
        }
        self.owner.label(i64::from(owner))?;
        if self.faces.push(&self.vertices)? { Ok(()) } else { Err(narrow()) }
    }
}

/// Writes the files of faces and cells.
///
/// # Errors
/// If a file cannot be written, if labels are too narrow, or if the user interrupts.
pub fn write(directory: &Directory) -> Result<(), ExportError> {
    let Directory { model, patches, survey, domain, own, counts, path } = directory;
    let (all, internal) = (counts.faces(), counts.faces_internal);
    let labels = |object: &str, note: &str, count: u64| labels(model, object, note, count, path);
    let mut neighbours = labels("neighbour", &counts.note(), internal)?;
    let mut cells = CellFiles::create(model, counts.cells, path)?;
    let addressing =
        directory.has_addressing().then(|| labels("faceProcAddressing", "", all)).transpose()?;
    let mut files = FaceFiles {
        faces: Faces::create(path, model.options.foam.style, all)?,
        owner: labels("owner", &counts.note(), all)?,
        polygon: Vec::new(),
        vertices: Vec::new(),
        own: own.as_ref(),
        addressing,
    };
    let (mut of_cell, mut last, mut number) = (Vec::new(), None, 0);
    let numbers = domain.cells(model.tree.cells());
    visit(model, model.points.near(), numbers, |cell, around, squares| {
        cells.push(model, cell, around)?;
        let owner = domain.number(cell).expect("only cells of the directory are visited");
        let run = survey.run(cell);
        if last.replace(run) != Some(run) {
            number = survey.first_face(run);
        }
        owned(squares, &mut of_cell);
        for &(across, square) in &of_cell {
            if let Some(neighbour) = domain.number(across) {
                neighbours.label(i64::from(neighbour))?;
                files.push(owner, (around, &squares[square]), number, false)?;
            }
            number += 1;
        }
        Ok(())
    })?;
    cells.finish()?;
    neighbours.finish()?;
    for patch in (0..patches.names.len()).filter(|&patch| counts.patches[patch].1 > 0) {
        write_patch(directory, patch, &mut files)?;
    }
    write_between(directory, &mut files)?;
    let FaceFiles { faces, owner, addressing, .. } = files;
    faces.finish()?;
    addressing.map_or(Ok(()), List::finish)?;
    Ok(owner.finish()?)
}

/// Writes the faces of a patch.
fn write_patch(
    directory: &Directory,
    patch: usize,
    files: &mut FaceFiles,
) -> Result<(), ExportError> {
    let Directory { model, patches, survey, domain, .. } = directory;
    let (mut last, mut number) = (None, 0);
    let numbers = domain.cells(model.tree.cells());
    let enter = |around: &Around<Near>| survey.may_touch(model, patches, patch, around);
    visit_some(model, model.points.near(), numbers, enter, |cell, around, squares| {
        let owner = domain.number(cell).expect("only cells of the directory are visited");
        let run = survey.run(cell);
        if last.replace(run) != Some(run) {
            number = survey.first_of_patch(run, patch);
        }
        for (index, square) in squares.iter().enumerate() {
            if square.across.as_cell().is_none()
                && survey.patch(patches, cell, index, square) == patch
            {
                files.push(owner, (around, square), number, false)?;
                number += 1;
            }
        }
        Ok(())
    })
}

/// Writes the faces at other processors.
fn write_between(directory: &Directory, files: &mut FaceFiles) -> Result<(), ExportError> {
    let Directory { model, survey, domain, .. } = directory;
    for faces in survey.of(*domain).by_processor.values() {
        visit_faces(model, model.points.near(), faces, |face, around, square| {
            // Seen from the cell that the directory has.
            let is_turned = domain.number(face.cell).is_none();
            let cell = if is_turned { square.across.as_cell() } else { Some(face.cell) };
            let owner =
                cell.and_then(|cell| domain.number(cell)).expect("one of the cells is here");
            files.push(owner, (around, square), face.number, is_turned)
        })?;
    }
    Ok(())
}
