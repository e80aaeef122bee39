//! The files of one directory `polyMesh`: all cells, or those of one processor.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use contract::octant::UNITS_PER_CELL;
use contract::word;

use super::faces::Square;
use super::lists::{self, Faces, List};
use super::patches::Patches;
use super::points::{Point, Points};
use super::survey::{Boundary, Domain, Face, Model, survey, visit};
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
}

/// Writes the files into an existing directory.
///
/// # Errors
/// If a file cannot be written, if labels are too narrow, or if the user interrupts.
pub fn write(
    model: &Model,
    patches: &mut Patches,
    domain: Domain,
    dir: &Path,
) -> Result<Counts, ExportError> {
    let boundary = survey(model, patches, domain)?;
    let size = |faces: &Vec<Face>| faces.len() as u64;
    let counts = Counts {
        cells: domain.cells(model.tree.cells()).count() as u64,
        points: boundary.points.as_ref().unwrap_or(&model.points).count(),
        faces_internal: boundary.internal,
        patches: patches.names.iter().cloned().zip(boundary.by_patch.iter().map(size)).collect(),
        faces_between: boundary.by_processor.iter().map(|(&p, faces)| (p, size(faces))).collect(),
    };
    // The vertices of the faces are counted as they are written; there are at least four each.
    if 4 * counts.faces().max(counts.points / 4) > lists::label_max(model.options.foam.style.label)
    {
        return Err(narrow());
    }
    write_points(model, boundary.points.as_ref().unwrap_or(&model.points), dir)?;
    write_faces(model, domain, &boundary, &counts, dir)?;
    write_cells(model, domain, &counts, dir)?;
    write_boundary(model, patches, domain, &counts, dir)?;
    Ok(counts)
}

fn narrow() -> ExportError {
    ExportError::Request(
        "the mesh has more faces than 32-bit labels can number: choose --label 64".to_owned(),
    )
}

fn write_points(model: &Model, points: &Points, dir: &Path) -> Result<(), ExportError> {
    let mut list =
        List::create(dir, model.options.foam.style, "vectorField", "points", "", points.count())?;
    for point in points.iter() {
        list.point(model.root.to_user(point.map(|c| i64::from(c) * UNITS_PER_CELL)))?;
    }
    Ok(list.finish()?)
}

/// The lists that are written face by face.
struct FaceFiles<'a> {
    faces: Faces,
    owner: List,
    polygon: Vec<(Point, u64)>,
    vertices: Vec<u64>,
    all: &'a Points,
    own: Option<&'a Points>,
}

impl FaceFiles<'_> {
    fn push(&mut self, owner: u32, square: &Square) -> Result<(), ExportError> {
        // Normals point away from the owner. Between two cells that is the one on the low side, whose number is lower.
        square.polygon(self.all, !square.is_high, &mut self.polygon);
        self.vertices.clear();
        let number = |&(point, number): &(Point, u64)| match self.own {
            None => number,
            Some(own) => own.find(point).expect("the survey has added all points"),
        };
        self.vertices.extend(self.polygon.iter().map(number));
        self.owner.label(u64::from(owner))?;
        if self.faces.push(&self.vertices)? { Ok(()) } else { Err(narrow()) }
    }
}

fn write_faces(
    model: &Model,
    domain: Domain,
    boundary: &Boundary,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let (style, all) = (model.options.foam.style, counts.faces());
    let Counts { points, cells, faces_internal: internal, .. } = counts;
    let note = format!("nPoints:{points} nCells:{cells} nFaces:{all} nInternalFaces:{internal}");
    let mut neighbours = List::create(dir, style, "labelList", "neighbour", &note, *internal)?;
    let mut files = FaceFiles {
        faces: Faces::create(dir, style, all)?,
        owner: List::create(dir, style, "labelList", "owner", &note, all)?,
        polygon: Vec::new(),
        vertices: Vec::new(),
        all: &model.points,
        own: boundary.points.as_ref(),
    };
    let number = |cell: u32| domain.number(cell);
    let mut internal: Vec<(u32, Square)> = Vec::new();
    visit(model, domain, |cell, _, squares| {
        let Ok(owner) = number(cell) else {
            unreachable!("only cells of the directory are visited")
        };
        internal.clear();
        internal.extend(
            squares
                .iter()
                .filter(|s| s.is_high)
                .filter_map(|square| Some((number(square.across.as_cell()?).ok()?, *square))),
        );
        internal.sort_unstable_by_key(|&(neighbour, _)| neighbour);
        for (neighbour, square) in &internal {
            neighbours.label(u64::from(*neighbour))?;
            files.push(owner, square)?;
        }
        Ok(())
    })?;
    for face in boundary.by_patch.iter().chain(boundary.by_processor.values()).flatten() {
        let Ok(owner) = number(face.cell) else {
            unreachable!("a face has a cell of its directory")
        };
        files.push(owner, &face.square)?;
    }
    neighbours.finish()?;
    files.owner.finish()?;
    Ok(files.faces.finish()?)
}

/// Writes the level of each cell, and its side and rank where they are known.
fn write_cells(
    model: &Model,
    domain: Domain,
    counts: &Counts,
    dir: &Path,
) -> Result<(), ExportError> {
    let write = |object: &str, label: &dyn Fn(usize) -> u64| -> Result<(), ExportError> {
        let mut list =
            List::create(dir, model.options.foam.style, "labelList", object, "", counts.cells)?;
        for cell in domain.cells(model.tree.cells()) {
            list.label(label(cell as usize))?;
        }
        Ok(list.finish()?)
    };
    write("cellLevel", &|cell| u64::from(word::level(model.words[cell])))?;
    if model.has_sides {
        write("side", &|cell| model.words[cell] & 3)?;
    }
    if !model.ranks.is_empty() {
        write("rank", &|cell| u64::from(model.ranks[cell]))?;
    }
    Ok(())
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
