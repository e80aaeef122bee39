//! A walk over all cells and their faces, and what it finds: the points, the boundary of every directory, and the numbers that its
//! faces have in the whole mesh.

use std::collections::BTreeMap;

use contract::lattice::Root;

use super::face_list::{Face, FaceList};
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
    /// The rank that wrote each cell, if there are several.
    pub ranks: Option<Distribution>,
    /// The points of all cells, which the survey finds.
    pub points: Points,
    /// The root.
    pub root: Root,
    /// Whether the sides of cells are known.
    pub has_sides: bool,
    /// The options of the export.
    pub options: &'a Options<'a>,
}

/// The cells of a directory.
#[derive(Clone, Copy)]
pub struct Domain<'a>(pub Option<(&'a Distribution, u32)>);

impl<'a> Domain<'a> {
    /// The cells, ascending, of `all` in the mesh.
    pub fn cells(self, all: u32) -> Box<dyn Iterator<Item = u32> + 'a> {
        match self.0 {
            None => Box::new(0..all),
            Some((distribution, processor)) => Box::new(distribution.cells(processor)),
        }
    }

    /// Number of the cells, of `all` in the mesh.
    pub fn count(self, all: u32) -> u32 {
        self.0.map_or(all, |(distribution, processor)| distribution.count(processor))
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
    /// The faces of each patch of the mesh, with their numbers there.
    pub by_patch: Vec<FaceList>,
    /// The faces at the cells of each other processor, in the same order as there: as faces of the cell with the lower number, in
    /// whichever directory that is, with their numbers in the whole mesh.
    pub by_processor: BTreeMap<u32, FaceList>,
}

/// All directories.
pub struct Survey {
    /// The boundary of each.
    boundaries: Vec<Boundary>,
    /// The cells that follow one of another directory, ascending, and the number of the first face that each owns.
    runs: Vec<(u32, u64)>,
    /// Number of the first face of each patch, and the number of all faces.
    starts: Vec<u64>,
}

impl Survey {
    /// Whether labels can hold the numbers of the whole mesh, so that each processor can state which part of it it has.
    pub fn has_addressing(&self, model: &Model) -> bool {
        let faces = self.starts[self.starts.len() - 1];
        faces.max(model.points.count()) < label_max(model.options.foam.style.label)
    }

    /// The number of the first face that a cell owns, if the cell before it is in another directory.
    pub fn first_face(&self, cell: u32) -> Option<u64> {
        let run = self.runs.binary_search_by_key(&cell, |&(first, _)| first);
        run.ok().map(|run| self.runs[run].1)
    }

    /// The boundary of a directory.
    pub fn of(&self, domain: Domain) -> &Boundary {
        &self.boundaries[domain.0.map_or(0, |(_, here)| here as usize)]
    }

    /// The number of the first face of a patch in the whole mesh.
    pub fn start(&self, patch: usize) -> u64 {
        self.starts[patch]
    }
}

/// Visits cells of a tree, given by ascending numbers, with their squares.
///
/// # Errors
/// The first error of `visit`, or the user's interrupt.
pub fn visit(
    tree: &Tree,
    cells: impl Iterator<Item = u32>,
    options: &Options<'_>,
    mut visit: impl FnMut(u32, &Around, &[Square]) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut squares = Vec::new();
    let mut until_look = 0u32;
    walk(tree, cells, &mut |cell, around| {
        if until_look == 0 {
            until_look = 1 << 14;
            options.check()?;
        }
        until_look -= 1;
        squares.clear();
        faces::squares(tree, around, &mut squares);
        visit(cell, around, &squares)
    })
}

/// Visits the faces of a list.
///
/// # Errors
/// As [`visit`].
pub fn visit_faces(
    model: &Model,
    faces: &FaceList,
    mut face: impl FnMut(&Face, &Square) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut next = faces.iter();
    let cells = faces.iter().map(|face| face.cell);
    visit(&model.tree, cells, model.options, |_, _, squares| {
        let of_cell = next.next().expect("a cell is visited once per face");
        face(&of_cell, &squares[of_cell.square])
    })
}

/// Replaces `owned` by the faces that a cell owns: the cell across and the index of the square. They are those on the cell's high sides, because the cell there
/// has the higher number, and are in the order of the mesh.
pub fn owned(squares: &[Square], owned: &mut Vec<(u32, usize)>) {
    owned.clear();
    let high = squares.iter().enumerate().filter(|(_, square)| square.is_high);
    owned.extend(high.filter_map(|(index, square)| Some((square.across.as_cell()?, index))));
    owned.sort_unstable();
}

/// Numbers the points, collects the faces at the boundary of every directory, and counts and numbers the others.
///
/// # Errors
/// If the user interrupts.
pub fn survey(
    model: &mut Model,
    patches: &mut Patches,
    distribution: Option<&Distribution>,
) -> Result<Survey, ExportError> {
    let directories = distribution.map_or(1, Distribution::processors);
    let place = |cell| distribution.map_or(0, |distribution| distribution.place(cell).0);
    let empty = || Boundary {
        by_patch: patches.names.iter().map(|_| FaceList::default()).collect(),
        ..Boundary::default()
    };
    let mut boundaries: Vec<Boundary> = (0..directories).map(|_| empty()).collect();
    let mut of_patches = vec![0; patches.names.len()];
    let (mut runs, mut last) = (Vec::new(), None);
    let (mut of_cell, mut number) = (Vec::new(), 0);
    let mut points = Points::default();
    visit(&model.tree, 0..model.tree.cells(), model.options, |cell, around, squares| {
        faces::insert_corners(&around.octant, squares, &mut points);
        let here = place(cell);
        if last.replace(here) != Some(here) {
            runs.push((cell, number));
        }
        owned(squares, &mut of_cell);
        for &(across, square) in &of_cell {
            let there = place(across);
            if here == there {
                boundaries[here as usize].internal += 1;
            } else {
                for (of, with) in [(here, there), (there, here)] {
                    let between = boundaries[of as usize].by_processor.entry(with).or_default();
                    between.push(Face { cell, square, number });
                }
            }
            number += 1;
        }
        let at_boundary = |(_, square): &(usize, &Square)| square.across.as_cell().is_none();
        for (index, square) in squares.iter().enumerate().filter(at_boundary) {
            let patch = patches.of(square);
            let face = Face { cell, square: index, number: of_patches[patch] };
            boundaries[here as usize].by_patch[patch].push(face);
            of_patches[patch] += 1;
        }
        Ok(())
    })?;
    points.number();
    model.points = points;
    // The patches follow the faces between cells.
    let mut starts = vec![number];
    for faces in of_patches {
        number += faces;
        starts.push(number);
    }
    Ok(Survey { boundaries, runs, starts })
}
