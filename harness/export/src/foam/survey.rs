//! A walk over all cells and their faces, and what it finds of every directory: its boundary, and the numbers that its faces have in
//! the whole mesh.

use std::collections::BTreeMap;

use contract::lattice::Root;

use super::faces::{self, Square};
use super::lists::label_max;
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

/// A face at the boundary of a directory.
#[derive(Clone, Copy)]
pub struct Face {
    /// Its cell.
    pub cell: u32,
    /// The face.
    pub square: Square,
    /// Its number in the whole mesh.
    pub number: u64,
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

    /// Number of a cell in this directory, if it is there.
    pub fn number(self, cell: u32) -> Option<u32> {
        let Some((distribution, here)) = self.0 else { return Some(cell) };
        let (processor, number) = distribution.place(cell);
        (processor == here).then_some(number)
    }
}

/// The faces of a directory at its boundary, and the number of others.
#[derive(Default)]
pub struct Boundary {
    /// Number of faces between two cells of the directory.
    pub internal: u64,
    /// The faces of each patch of the mesh.
    pub by_patch: Vec<Vec<Face>>,
    /// The faces at the cells of each other processor, in the same order as there.
    pub by_processor: BTreeMap<u32, Vec<Face>>,
}

/// All directories.
pub struct Survey {
    /// The boundary of each.
    pub boundaries: Vec<Boundary>,
    /// The cells that follow one of another directory, ascending, and the number of the first face that each owns.
    runs: Vec<(u32, u64)>,
    /// Number of faces of the whole mesh.
    faces: u64,
}

impl Survey {
    /// Whether labels can hold the numbers of the whole mesh, so that each processor can state which part of it it has.
    pub fn has_addressing(&self, model: &Model) -> bool {
        self.faces.max(model.points.count()) < label_max(model.options.foam.style.label)
    }

    /// The number of the first face that a cell owns, if the cell before it is in another directory.
    pub fn first_face(&self, cell: u32) -> Option<u64> {
        let run = self.runs.binary_search_by_key(&cell, |&(first, _)| first);
        run.ok().map(|run| self.runs[run].1)
    }
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

/// Replaces `owned` by the faces that a cell owns, each with the cell across: those on its high sides, because that cell
/// has the higher number. They are in the order of the mesh.
pub fn owned(squares: &[Square], owned: &mut Vec<(u32, Square)>) {
    owned.clear();
    let high = squares.iter().filter(|s| s.is_high);
    owned.extend(high.filter_map(|square| Some((square.across.as_cell()?, *square))));
    owned.sort_unstable_by_key(|&(across, _)| across);
}

/// Collects the faces at the boundary of every directory, and counts and numbers the others.
///
/// # Errors
/// If the user interrupts.
pub fn survey(
    model: &Model,
    patches: &mut Patches,
    distribution: Option<&Distribution>,
) -> Result<Survey, ExportError> {
    let directories = distribution.map_or(1, Distribution::processors);
    let place = |cell| distribution.map_or(0, |distribution| distribution.place(cell).0);
    let empty = || Boundary {
        by_patch: patches.names.iter().map(|_| Vec::new()).collect(),
        ..Boundary::default()
    };
    let mut boundaries: Vec<Boundary> = (0..directories).map(|_| empty()).collect();
    let mut of_patches = vec![0; patches.names.len()];
    let (mut runs, mut last) = (Vec::new(), None);
    let (mut of_cell, mut number) = (Vec::new(), 0);
    visit(model, Domain(None), |cell, _, squares| {
        let here = place(cell);
        if last.replace(here) != Some(here) {
            runs.push((cell, number));
        }
        owned(squares, &mut of_cell);
        for &(across, square) in &of_cell {
            let there = place(across);
            let mut add = |here: u32, there: u32, face: Face| {
                boundaries[here as usize].by_processor.entry(there).or_default().push(face);
            };
            if here == there {
                boundaries[here as usize].internal += 1;
            } else {
                add(here, there, Face { cell, square, number });
                let seen_from_there = Square { is_high: false, ..square };
                add(there, here, Face { cell: across, square: seen_from_there, number });
            }
            number += 1;
        }
        for &square in squares.iter().filter(|square| square.across.as_cell().is_none()) {
            let patch = patches.of(&square);
            let face = Face { cell, square, number: of_patches[patch] };
            boundaries[here as usize].by_patch[patch].push(face);
            of_patches[patch] += 1;
        }
        Ok(())
    })?;
    // The patches follow the faces between cells.
    for (patch, faces) in of_patches.into_iter().enumerate() {
        for boundary in &mut boundaries {
            boundary.by_patch[patch].iter_mut().for_each(|face| face.number += number);
        }
        number += faces;
    }
    Ok(Survey { boundaries, runs, faces: number })
}
