//! The files of one directory `polyMesh`: all cells, or those of one processor.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use contract::octant::UNITS_PER_CELL;

use super::cell_files::{CellFiles, labels};
use super::faces::Square;
use super::lists::{self, Faces, List};
use super::own::Own;
use super::patches::Patches;
use super::points::Near;
use super::survey::{Domain, Model, Survey, owned, visit, visit_faces};
use super::walk::Around;
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

    /// What the header of `owner` and `neighbour` states.
    fn note(&self) -> String {
        let Self { points, cells, faces_internal, .. } = self;
        let faces = self.faces();
        format!("nPoints:{points} nCells:{cells} nFaces:{faces} nInternalFaces:{faces_internal}")
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
    let own = domain.0.map(|_| own(model, domain)).transpose()?;
    let counts = Counts {
        cells: u64::from(domain.count(model.tree.cells())),
        points: own.as_ref().map_or(model.points.count(), Own::count),
        faces_internal: boundary.internal,
        patches: patches.names.iter().cloned().zip(boundary.by_patch.iter().copied()).collect(),
        faces_between: boundary.by_processor.iter().map(|(&p, faces)| (p, faces.count())).collect(),
    };
    // The vertices of the faces are counted as they are written; there are at least four each.
    if 4 * counts.faces().max(counts.points / 4) > lists::label_max(model.options.foam.style.label)
    {
        return Err(narrow());
    }
    write_faces(model, patches, survey, domain, own.as_ref(), &counts, dir)?;
    match &own {
        None => write_points(model, 0..counts.points as u32, &counts, dir)?,
        Some(own) => {
            write_points(model, own.iter(), &counts, dir)?;
            if survey.has_addressing(model) {
                write_addressing(model, domain, own, &counts, dir)?;
            }
        }
    }
    write_boundary(model, patches, domain, &counts, dir)?;
    Ok(counts)
}

/// The points of the faces of a directory.
fn own(model: &Model, domain: Domain) -> Result<Own, ExportError> {
    let is_elsewhere = |across: Option<u32>| across.is_some_and(|c| domain.number(c).is_none());
    Own::new(model.points.count(), |mark| {
        let mut polygon = Vec::new();
        let cells = domain.cells(model.tree.cells());
        visit(
            model,
            model.points.near(),
            cells,
            |_| true,
            |_, around, squares| {
                for square in squares {
                    // A face between two cells of the directory is that of the cell on its low side.
                    let across = square.across.as_cell();
                    if across.is_none() || square.is_high || is_elsewhere(across) {
                        square.polygon(around, false, &mut polygon);
                        polygon.iter().for_each(|&number| mark(number));
                    }
                }
                Ok(())
            },
        )
    })
}

fn narrow() -> ExportError {
    ExportError::Request(
        "the mesh has more faces than 32-bit labels can number: choose --label 64".to_owned(),
    )
}

fn write_points(
    model: &Model,
    numbers: impl Iterator<Item = u32>,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let mut list =
        List::create(dir, model.options.foam.style, "vectorField", "points", "", counts.points)?;
    model.points.visit(numbers, &mut |point| {
        list.point(model.root.to_user(point.map(|c| i64::from(c) * UNITS_PER_CELL)))
    })?;
    Ok(list.finish()?)
}

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
fn write_faces(
    model: &Model,
    patches: &Patches,
    survey: &Survey,
    domain: Domain,
    own: Option<&Own>,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let (all, internal) = (counts.faces(), counts.faces_internal);
    let labels = |object: &str, note: &str, count: u64| labels(model, object, note, count, dir);
    let mut neighbours = labels("neighbour", &counts.note(), internal)?;
    let mut cells = CellFiles::create(model, counts.cells, dir)?;
    let has_addressing = own.is_some() && survey.has_addressing(model);
    let addressing = has_addressing.then(|| labels("faceProcAddressing", "", all)).transpose()?;
    let mut files = FaceFiles {
        faces: Faces::create(dir, model.options.foam.style, all)?,
        owner: labels("owner", &counts.note(), all)?,
        polygon: Vec::new(),
        vertices: Vec::new(),
        own,
        addressing,
    };
    let (mut of_cell, mut last, mut number) = (Vec::new(), None, 0);
    let numbers = domain.cells(model.tree.cells());
    visit(
        model,
        model.points.near(),
        numbers,
        |_| true,
        |cell, around, squares| {
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
        },
    )?;
    cells.finish()?;
    neighbours.finish()?;
    for patch in (0..patches.names.len()).filter(|&patch| counts.patches[patch].1 > 0) {
        write_patch(model, patches, survey, domain, patch, &mut files)?;
    }
    write_faces_between(model, survey, domain, &mut files)?;
    let FaceFiles { faces, owner, addressing, .. } = files;
    faces.finish()?;
    addressing.map_or(Ok(()), List::finish)?;
    Ok(owner.finish()?)
}

/// Writes the faces of a patch.
fn write_patch(
    model: &Model,
    patches: &Patches,
    survey: &Survey,
    domain: Domain,
    patch: usize,
    files: &mut FaceFiles,
) -> Result<(), ExportError> {
    let (mut last, mut number) = (None, 0);
    let numbers = domain.cells(model.tree.cells());
    let enter = |around: &Around<Near>| survey.may_touch(model, patches, patch, around);
    visit(model, model.points.near(), numbers, enter, |cell, around, squares| {
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
fn write_faces_between(
    model: &Model,
    survey: &Survey,
    domain: Domain,
    files: &mut FaceFiles,
) -> Result<(), ExportError> {
    for faces in survey.of(domain).by_processor.values() {
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
    let mut points = own.iter().map(i64::from);
    write("pointProcAddressing", counts.points, &mut points)?;
    let mut cells = domain.cells(model.tree.cells()).flatten().map(i64::from);
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
