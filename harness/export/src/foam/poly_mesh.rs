//! The files of one directory `polyMesh`: all cells, or those of one processor.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use contract::octant::UNITS_PER_CELL;

use super::cell_files::{CellFiles, labels};
use super::face_list::FaceList;
use super::faces::Square;
use super::lists::{self, Faces, List};
use super::patches::Patches;
use super::points::{Own, Point};
use super::survey::{Domain, Model, Survey, owned, visit, visit_faces};
use crate::error::ExportError;
use crate::options::Style;

/// Numbers of a directory's points, faces and cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Cells.
    pub cells: u64,
    /// Points.
    pub points: u64,
    /// Faces between two cells of the directory.
    pub faces_internal: u64,
    /// The patches of the whole mesh with their numbers of faces.
    pub patches: Vec<(String, u64)>,
    /// The other processors with the numbers of common faces.
    pub faces_between: Vec<(u32, u64)>,
}

impl Counts {
    /// All faces.
    pub fn faces(&self) -> u64 {
        let patches = self.patches.iter().map(|(_, faces)| faces);
        let between = self.faces_between.iter().map(|(_, faces)| faces);
        self.faces_internal + patches.chain(between).sum::<u64>()
    }

    /// What the header of `owner` and `neighbour` states. Its length does not depend on the number of points.
    fn note(&self) -> String {
        let Self { points, cells, faces_internal, .. } = self;
        let faces = self.faces();
        format!(
            "nPoints:{points:<20} nCells:{cells} nFaces:{faces} nInternalFaces:{faces_internal}"
        )
    }
}

/// Writes the files into an existing directory.
///
/// # Errors
/// If a file cannot be written, if labels are too narrow, or if the user interrupts.
pub fn write(
    model: &Model,
    patches: &Patches,
    survey: &Survey,
    domain: Domain,
    dir: &Path,
) -> Result<Counts, ExportError> {
    let boundary = survey.of(domain);
    let by_patch = boundary.by_patch.iter().map(FaceList::count);
    let mut counts = Counts {
        cells: u64::from(domain.count(model.tree.cells())),
        points: model.points.count(),
        faces_internal: boundary.internal,
        patches: patches.names.iter().cloned().zip(by_patch).collect(),
        faces_between: boundary.by_processor.iter().map(|(&p, faces)| (p, faces.count())).collect(),
    };
    // The vertices of the faces are counted as they are written; there are at least four each.
    if 4 * counts.faces().max(counts.points / 4) > lists::label_max(model.options.foam.style.label)
    {
        return Err(narrow());
    }
    let own = write_faces(model, domain, survey, &mut counts, dir)?;
    match &own {
        None => write_points(model, model.points.iter(), &counts, dir)?,
        Some(own) => {
            let points = own.points.iter().map(|&number| model.points.point(number.into()));
            write_points(model, points, &counts, dir)?;
            if survey.has_addressing(model) {
                write_addressing(model, domain, own, &counts, dir)?;
            }
        }
    }
    write_boundary(model, patches, domain, &counts, dir)?;
    Ok(counts)
}

fn narrow() -> ExportError {
    ExportError::Request(
        "the mesh has more faces than 32-bit labels can number: choose --label 64".to_owned(),
    )
}

fn write_points(
    model: &Model,
    points: impl Iterator<Item = Point>,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let mut list =
        List::create(dir, model.options.foam.style, "vectorField", "points", "", counts.points)?;
    for point in points {
        list.point(model.root.to_user(point.map(|c| i64::from(c) * UNITS_PER_CELL)))?;
    }
    Ok(list.finish()?)
}

/// The lists that are written face by face.
struct FaceFiles<'a> {
    model: &'a Model<'a>,
    faces: Faces,
    owner: List,
    polygon: Vec<(Point, u64)>,
    vertices: Vec<u64>,
    /// The points of a directory that has not all cells.
    own: Option<Own>,
    /// The numbers of its faces in the whole mesh.
    addressing: Option<List>,
}

impl FaceFiles<'_> {
    /// Adds the face with this number in the whole mesh. `is_turned` is whether the whole mesh has it the other way round.
    fn push(
        &mut self,
        owner: u32,
        square: &Square,
        number: u64,
        is_turned: bool,
    ) -> Result<(), ExportError> {
        // Normals point away from the owner. Between two cells that is the one on the low side, whose number is lower.
        square.polygon(&self.model.points, !square.is_high, &mut self.polygon);
        self.vertices.clear();
        match &mut self.own {
            None => self.vertices.extend(self.polygon.iter().map(|&(_, number)| number)),
            Some(own) => {
                self.vertices.extend(self.polygon.iter().map(|&(_, number)| own.number(number)));
            }
        }
        if let Some(addressing) = &mut self.addressing {
            // Counted from 1, so that every number has a sign.
            let number = number as i64 + 1;
            addressing.label(if is_turned { -number } else { number })?;
        }
        self.owner.label(i64::from(owner))?;
        if self.faces.push(&self.vertices)? { Ok(()) } else { Err(narrow()) }
    }
}

/// Writes the files of faces and cells, and returns the points of a directory that has not all cells; its number of points is known then.
fn write_faces(
    model: &Model,
    domain: Domain,
    survey: &Survey,
    counts: &mut Counts,
    dir: &Path,
) -> Result<Option<Own>, ExportError> {
    let (all, internal) = (counts.faces(), counts.faces_internal);
    let labels = |object: &str, note: &str, count: u64| labels(model, object, note, count, dir);
    let mut neighbours = labels("neighbour", &counts.note(), internal)?;
    let mut cells = CellFiles::create(model, counts.cells, dir)?;
    let own = domain.0.map(|_| Own::new(&model.points));
    let has_addressing = own.is_some() && survey.has_addressing(model);
    let addressing = has_addressing.then(|| labels("faceProcAddressing", "", all)).transpose()?;
    let mut files = FaceFiles {
        model,
        faces: Faces::create(dir, model.options.foam.style, all)?,
        owner: labels("owner", &counts.note(), all)?,
        polygon: Vec::new(),
        vertices: Vec::new(),
        own,
        addressing,
    };
    let (mut of_cell, mut number) = (Vec::new(), 0);
    let numbers = domain.cells(model.tree.cells());
    visit(&model.tree, numbers, model.options, |cell, around, squares| {
        cells.push(model, cell, around)?;
        number = survey.first_face(cell).unwrap_or(number);
        let owner = domain.number(cell).expect("only cells of the directory are visited");
        owned(squares, &mut of_cell);
        for &(across, square) in &of_cell {
            if let Some(neighbour) = domain.number(across) {
                neighbours.label(i64::from(neighbour))?;
                files.push(owner, &squares[square], number, false)?;
            }
            number += 1;
        }
        Ok(())
    })?;
    cells.finish()?;
    write_boundary_faces(survey, domain, &mut files)?;
    let FaceFiles { faces, owner, own, addressing, .. } = files;
    faces.finish()?;
    addressing.map_or(Ok(()), List::finish)?;
    counts.points = own.as_ref().map_or(counts.points, |own| own.points.len() as u64);
    neighbours.finish_with_note("labelList", "neighbour", &counts.note())?;
    owner.finish_with_note("labelList", "owner", &counts.note())?;
    Ok(own)
}

/// Writes the faces of the patches, and then those at other processors.
fn write_boundary_faces(
    survey: &Survey,
    domain: Domain,
    files: &mut FaceFiles,
) -> Result<(), ExportError> {
    let boundary = survey.of(domain);
    for (patch, faces) in boundary.by_patch.iter().enumerate() {
        visit_faces(files.model, faces, |face, square| {
            let owner =
                domain.number(face.cell).expect("a patch has faces of its directory's cells");
            files.push(owner, square, survey.start(patch) + face.number, false)
        })?;
    }
    for faces in boundary.by_processor.values() {
        visit_faces(files.model, faces, |face, square| {
            // Seen from the cell that the directory has.
            let is_turned = domain.number(face.cell).is_none();
            let cell = if is_turned { square.across.as_cell() } else { Some(face.cell) };
            let owner =
                cell.and_then(|cell| domain.number(cell)).expect("one of the cells is here");
            files.push(owner, &Square { is_high: !is_turned, ..*square }, face.number, is_turned)
        })?;
    }
    Ok(())
}

/// Writes what reconstructPar needs besides the addressing of faces: the numbers that the points, cells and patches of a
/// processor have in the whole mesh.
fn write_addressing(
    model: &Model,
    domain: Domain,
    own: &Own,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let write = |object: &str, count: u64, numbers: &mut dyn Iterator<Item = i64>| {
        write_labels(model, object, count, numbers, dir)
    };
    let mut points = own.points.iter().map(|&number| i64::from(number));
    write("pointProcAddressing", counts.points, &mut points)?;
    let mut cells = domain.cells(model.tree.cells()).map(i64::from);
    write("cellProcAddressing", counts.cells, &mut cells)?;
    let (of_mesh, between) = (counts.patches.len(), counts.faces_between.len());
    let mut patches = (0..of_mesh as i64).chain(std::iter::repeat_n(-1, between));
    write("boundaryProcAddressing", (of_mesh + between) as u64, &mut patches)
}

fn write_labels(
    model: &Model,
    object: &str,
    count: u64,
    numbers: &mut dyn Iterator<Item = i64>,
    dir: &Path,
) -> Result<(), ExportError> {
    let mut list = labels(model, object, "", count, dir)?;
    for number in numbers {
        list.label(number)?;
    }
    Ok(list.finish()?)
}

fn write_boundary(
    model: &Model,
    patches: &Patches,
    domain: Domain,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
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
    let mut file = std::fs::File::create(dir.join("boundary"))?;
    file.write_all(text.as_bytes())?;
    Ok(file.sync_all()?)
}
