//! The cells of one directory, their faces at its boundary, and a walk over all its faces.

use std::collections::BTreeMap;

use contract::lattice::Root;

use super::faces::{self, Square};
use super::patches::Patches;
use super::points::Points;
use super::processors::Distribution;
use super::tree::{Around, Tree, walk};
use crate::error::ExportError;
use crate::options::Options;

/// What all directories of an export have in common.
pub struct Model<'a> {
    /// The cells.
    pub tree: Tree,
    /// Their words.
    pub words: Vec<u64>,
    /// The rank that wrote each cell; none if there is only one.
    pub ranks: Vec<u32>,
    /// The points of all cells.
    pub points: Points,
    /// The root.
    pub root: Root,
    /// Whether the words hold sides.
    pub has_sides: bool,
    /// The options of the export.
    pub options: &'a Options<'a>,
}

/// A face at a boundary.
pub struct Face {
    /// Its cell.
    pub cell: u32,
    /// The cell on another processor, if the boundary is one between processors.
    pub across: u32,
    /// The face.
    pub square: Square,
}

/// The cells of a directory.
#[derive(Clone, Copy)]
pub struct Domain<'a>(pub Option<(&'a Distribution, u32)>);

impl<'a> Domain<'a> {
    /// The cells, ascending, of `all` in the mesh.
    pub fn cells(self, all: u32) -> Box<dyn Iterator<Item = u32> + 'a> {
        match self.0 {
            None => Box::new(0..all),
            Some((distribution, processor)) => {
                Box::new(distribution.cells(processor).iter().copied())
            }
        }
    }

    /// Number of a cell in this directory, or else its processor.
    pub fn number(self, cell: u32) -> Result<u32, u32> {
        let Some((distribution, here)) = self.0 else { return Ok(cell) };
        let (processor, number) = distribution.place(cell);
        if processor == here { Ok(number) } else { Err(processor) }
    }
}

/// The faces of a directory at its boundary, and the number of others.
pub struct Boundary {
    /// Number of faces between two cells of the directory.
    pub internal: u64,
    /// The faces of each patch of the mesh.
    pub by_patch: Vec<Vec<Face>>,
    /// The faces at the cells of each other processor.
    pub by_processor: BTreeMap<u32, Vec<Face>>,
    /// The points of these cells, if they are not all cells.
    pub points: Option<Points>,
}

/// Visits the cells of a directory with their squares.
///
/// # Errors
/// The first error of `visit`, or the user's interrupt.
pub fn visit(
    model: &Model,
    domain: Domain,
    mut visit: impl FnMut(u32, &Around, &mut Vec<Square>) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut squares = Vec::new();
    let mut until_look = 0u32;
    walk(&model.tree, domain.cells(model.tree.cells()), &mut |cell, around| {
        if until_look == 0 {
            until_look = 1 << 14;
            model.options.check()?;
        }
        until_look -= 1;
        squares.clear();
        faces::squares(&model.tree, around, &mut squares);
        visit(cell, around, &mut squares)
    })
}

/// Collects the faces at the boundary, and counts the others.
///
/// # Errors
/// If the user interrupts.
pub fn survey(
    model: &Model,
    patches: &mut Patches,
    domain: Domain,
) -> Result<Boundary, ExportError> {
    let mut boundary = Boundary {
        internal: 0,
        by_patch: patches.names.iter().map(|_| Vec::new()).collect(),
        by_processor: BTreeMap::new(),
        points: domain.0.map(|_| Points::default()),
    };
    let mut polygon = Vec::new();
    visit(model, domain, |cell, _, squares| {
        for &square in squares.iter() {
            let across = square.across.as_cell().map(|across| (across, domain.number(across)));
            // The cell across, which owns the face, counts it and adds its points.
            if !square.is_high && matches!(across, Some((_, Ok(_)))) {
                continue;
            }
            if let Some(points) = &mut boundary.points {
                square.polygon(&model.points, false, &mut polygon);
                polygon.iter().for_each(|&(point, _)| points.insert(point));
            }
            let faces = match across {
                Some((_, Ok(_))) => {
                    boundary.internal += 1;
                    continue;
                }
                Some((_, Err(processor))) => boundary.by_processor.entry(processor).or_default(),
                None => &mut boundary.by_patch[patches.of(&square)],
            };
            faces.push(Face { cell, across: across.map_or(cell, |(across, _)| across), square });
        }
        Ok(())
    })?;
    // Both processors list the faces between them in the order that they would have in the whole mesh.
    for faces in boundary.by_processor.values_mut() {
        faces.sort_unstable_by_key(|f| (f.cell.min(f.across), f.cell.max(f.across)));
    }
    boundary.points.iter_mut().for_each(Points::number);
    Ok(boundary)
}
