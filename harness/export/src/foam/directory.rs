//! A directory `polyMesh` with all cells, or those of one processor: how much of everything it has.

use std::path::Path;

use super::lists::label_max;
use super::own::Own;
use super::patches::Patches;
use super::survey::{Domain, Model, Survey, visit};
use crate::error::ExportError;

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
    pub fn note(&self) -> String {
        let Self { points, cells, faces_internal, .. } = self;
        let faces = self.faces();
        format!("nPoints:{points} nCells:{cells} nFaces:{faces} nInternalFaces:{faces_internal}")
    }
}

/// What is known of a directory before it is written.
pub struct Directory<'a> {
    /// All cells.
    pub model: &'a Model<'a>,
    /// The patches of the whole mesh.
    pub patches: &'a Patches,
    /// The faces of the whole mesh.
    pub survey: &'a Survey,
    /// The cells of the directory.
    pub domain: Domain<'a>,
    /// Its points, if it has not all cells.
    pub own: Option<Own>,
    /// Numbers of everything.
    pub counts: Counts,
    /// The directory, which exists.
    pub path: &'a Path,
}

impl<'a> Directory<'a> {
    /// Finds the points of a directory, and counts everything.
    ///
    /// # Errors
    /// If labels are too narrow, or if the user interrupts.
    pub fn new(
        model: &'a Model<'a>,
        patches: &'a Patches,
        survey: &'a Survey,
        domain: Domain<'a>,
        path: &'a Path,
    ) -> Result<Self, ExportError> {
        let boundary = survey.of(domain);
        let own = domain.0.map(|_| own(model, domain)).transpose()?;
        let between = boundary.by_processor.iter();
        let counts = Counts {
            cells: u64::from(domain.count(model.tree.cells())),
            points: own.as_ref().map_or(model.points.count(), Own::count),
            faces_internal: boundary.internal,
            patches: patches.names.iter().cloned().zip(boundary.by_patch.iter().copied()).collect(),
            faces_between: between.map(|(&p, faces)| (p, faces.count())).collect(),
        };
        // The vertices of the faces are counted as they are written; there are at least four each.
        let labels = 4 * counts.faces().max(counts.points / 4);
        if labels > label_max(model.options.foam.style.label) {
            return Err(narrow());
        }
        Ok(Self { model, patches, survey, domain, own, counts, path })
    }

    /// Whether the directory states which part of the whole mesh it has.
    pub fn has_addressing(&self) -> bool {
        self.own.is_some() && self.survey.has_addressing(self.model)
    }
}

/// The points of the faces of a directory.
fn own(model: &Model, domain: Domain) -> Result<Own, ExportError> {
    let is_elsewhere = |across: Option<u32>| across.is_some_and(|c| domain.number(c).is_none());
    Own::new(model.points.count(), |mark| {
        let mut polygon = Vec::new();
        let cells = domain.cells(model.tree.cells());
        visit(model, model.points.near(), cells, |_, around, squares| {
            for square in squares {
                // A face between two cells of the directory is that of the cell on its low side.
                let across = square.across.as_cell();
                if across.is_none() || square.is_high || is_elsewhere(across) {
                    square.polygon(around, false, &mut polygon);
                    polygon.iter().for_each(|&number| mark(number));
                }
            }
            Ok(())
        })
    })
}

/// The error of labels that are too narrow.
pub fn narrow() -> ExportError {
    ExportError::Request(
        "the mesh has more faces than 32-bit labels can number: choose --label 64".to_owned(),
    )
}
