//! A walk over all cells and their faces, and what it finds: the boundary of every directory, and the numbers that its faces have in the
//! whole mesh.

use std::collections::BTreeMap;
use std::ops::Range;

use contract::lattice::Root;

use super::face_list::{Face, FaceList};
use super::faces::{self, Square};
use super::lists::label_max;
use super::patches::Patches;
use super::points::Points;
use super::processors::Distribution;
use super::solids::Solids;
use super::tree::Tree;
use super::walk::{Around, Follow, walk};
use crate::error::ExportError;
use crate::options::Options;

/// What all directories of an export have in common.
pub struct Model<'a> {
    /// The cells.
    pub tree: Tree,
    /// The rank that wrote each cell, if there are several.
    pub ranks: Option<Distribution>,
    /// The points of all cells.
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
    /// The cells, in ascending intervals, of `all` in the mesh.
    pub fn cells(self, all: u32) -> Box<dyn Iterator<Item = Range<u32>> + 'a> {
        match self.0 {
            None => Box::new(std::iter::once(0..all)),
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

/// The faces of a directory.
#[derive(Default)]
pub struct Boundary {
    /// Number of faces between two cells of the directory.
    pub internal: u64,
    /// Number of faces in each patch of the mesh.
    pub by_patch: Vec<u64>,
    /// The faces at the cells of each other processor, in the same order as there: as faces of the cell with the lower number, in
    /// whichever directory that is, with their numbers in the whole mesh.
    pub by_processor: BTreeMap<u32, FaceList>,
}

/// All directories.
pub struct Survey {
    /// The boundary of each.
    boundaries: Vec<Boundary>,
    /// Intervals of cells in the same directory.
    runs: Vec<Run>,
    /// Number of the first face of each patch, and the number of all faces.
    starts: Vec<u64>,
    solids: Solids,
}

/// Consecutive cells of a directory.
struct Run {
    /// The first.
    cell: u32,
    /// Number of the first face that it owns.
    face: u64,
    /// How many faces of each patch the cells before have.
    of_patches: Box<[u64]>,
}

impl Survey {
    /// Whether labels can hold the numbers of the whole mesh, so that each processor can state which part of it it has.
    pub fn has_addressing(&self, model: &Model) -> bool {
        let faces = self.starts[self.starts.len() - 1];
        faces.max(model.points.count()) < label_max(model.options.foam.style.label)
    }

    /// The run of a cell.
    pub fn run(&self, cell: u32) -> usize {
        self.runs.partition_point(|run| run.cell <= cell) - 1
    }

    /// The number of the first face that the cells of a run own.
    pub fn first_face(&self, run: usize) -> u64 {
        self.runs[run].face
    }

    /// The number in the whole mesh of the first face of a patch that the cells of a run have.
    pub fn first_of_patch(&self, run: usize, patch: usize) -> u64 {
        self.starts[patch] + self.runs[run].of_patches[patch]
    }

    /// The patch of a face that no cell is across.
    pub fn patch(&self, patches: &Patches, cell: u32, square: usize, of: &Square) -> usize {
        patches.of(of).unwrap_or_else(|| self.solids.patch(cell, square))
    }

    /// Whether an octant may have cells with faces in a patch.
    pub fn may_touch<P: Follow>(
        &self,
        model: &Model,
        patches: &Patches,
        patch: usize,
        around: &Around<P>,
    ) -> bool {
        patches.may_touch(patch, &model.tree, around)
            && (!patches.is_of_several(patch)
                || self.solids.may_have(&around.cells(&model.tree), patch))
    }

    /// The boundary of a directory.
    pub fn of(&self, domain: Domain) -> &Boundary {
        &self.boundaries[domain.0.map_or(0, |(_, here)| here as usize)]
    }
}

/// Visits the cells in ascending intervals with their squares.
///
/// # Errors
/// The first error of `visit`, or the user's interrupt.
pub fn visit<P: Follow>(
    model: &Model,
    more: P,
    cells: impl Iterator<Item = Range<u32>>,
    visit: impl FnMut(u32, &Around<P>, &[Square]) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    visit_some(model, more, cells, |_| true, visit)
}

/// The same except in octants that `enter` rejects.
///
/// # Errors
/// As [`visit`].
pub fn visit_some<P: Follow>(
    model: &Model,
    more: P,
    cells: impl Iterator<Item = Range<u32>>,
    enter: impl Fn(&Around<P>) -> bool,
    mut visit: impl FnMut(u32, &Around<P>, &[Square]) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut squares = Vec::new();
    let mut visited = 0;
    walk(&model.tree, more, cells, &enter, &mut |cell, around| {
        model.options.check_at(visited)?;
        visited += 1;
        squares.clear();
        faces::squares(&model.tree, around, &mut squares);
        visit(cell, around, &squares)
    })
}

/// Visits the faces of a list.
///
/// # Errors
/// As [`visit`].
pub fn visit_faces<P: Follow>(
    model: &Model,
    more: P,
    faces: &FaceList,
    mut face: impl FnMut(&Face, &Around<P>, &Square) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut next = faces.iter().peekable();
    let cells = faces.iter().map(|face| face.cell..face.cell + 1);
    visit(model, more, cells, |cell, around, squares| {
        while let Some(of_cell) = next.next_if(|next| next.cell == cell) {
            face(&of_cell, around, &squares[of_cell.square])?;
        }
        Ok(())
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

/// Counts the faces of every directory, and collects those between directories.
///
/// # Errors
/// If the user interrupts.
pub fn survey(
    model: &Model,
    patches: &Patches,
    distribution: Option<&Distribution>,
) -> Result<Survey, ExportError> {
    let directories = distribution.map_or(1, Distribution::processors);
    let place = |cell| distribution.map_or(0, |distribution| distribution.place(cell).0);
    let empty = || Boundary { by_patch: vec![0; patches.names.len()], ..Boundary::default() };
    let mut boundaries: Vec<Boundary> = (0..directories).map(|_| empty()).collect();
    let mut of_patches = vec![0; patches.names.len()];
    let (mut runs, mut last) = (Vec::new(), None);
    let (mut of_cell, mut number) = (Vec::new(), 0);
    let mut solids = Solids::default();
    visit(model, (), std::iter::once(0..model.tree.cells()), |cell, _, squares| {
        let here = place(cell);
        if last.replace(here) != Some(here) {
            runs.push(Run { cell, face: number, of_patches: of_patches.clone().into() });
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
            let patch = patches.of(square).unwrap_or_else(|| {
                let nearest = patches.nearest(square);
                solids.push(cell, index, nearest);
                nearest
            });
            boundaries[here as usize].by_patch[patch] += 1;
            of_patches[patch] += 1;
        }
        Ok(())
    })?;
    // The patches follow the faces between cells.
    let mut starts = vec![number];
    for faces in of_patches {
        number += faces;
        starts.push(number);
    }
    Ok(Survey { boundaries, runs, starts, solids })
}
