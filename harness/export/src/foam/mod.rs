//! OpenFOAM meshes (`constant/polyMesh`), for all cells or in one directory per processor.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! Cells and tree are kept in memory, about 20 bytes per cell, and 5 more for each thread that writes the directory of a processor; the
//! files are written cell by cell.
//!
//! - [`tree`]: the cells and what is across their faces; [`faces`]: the faces and their vertices; [`points`]: the numbers of points;
//! - [`regions`], [`patches`], [`processors`];
//! - [`survey`](mod@survey): the boundary of a directory; [`poly_mesh`]: its files; [`lists`]: OpenFOAM's syntax; [`notes`]: what the user should know.

pub mod faces;
pub mod lists;
pub mod notes;
pub mod patches;
pub mod points;
pub mod poly_mesh;
pub mod processors;
pub mod regions;
pub mod survey;
#[cfg(test)]
mod tests;
pub mod tree;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use contract::files::{Staging, nearest_directory};
use contract::manifest::Sides;
use contract::word;

use crate::error::ExportError;
use crate::leaf::Leaf;
use crate::mesh::Mesh;
use crate::options;
use crate::options::{Options, Processors, Summary};
use crate::ordered::in_order;
use crate::pieces::nothing_selected;
use crate::selection::Selection;
use patches::Patches;
use points::Points;
use poly_mesh::Counts;
use processors::Distribution;
use regions::{Regions, Size};
use survey::{Domain, Model, survey, visit};
use tree::{Builder, CELLS_MAX};

/// Writes the selected leaves as `path`, which is a case's `constant/polyMesh`, or as one
/// `processorN/constant/polyMesh` per processor in the same case. Directories appear under their names when all are complete.
///
/// # Errors
/// If the mesh cannot be read, if a directory exists and is not empty, if a file cannot be written, or if the options contradict the mesh.
pub fn write(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, ExportError> {
    let mut model = read(mesh, selection, options)?;
    let regions = connect(&mut model, options.foam.regions)?;
    let distribution = distribute(&model, mesh, options.foam.processors)?;
    let targets = targets(path, distribution.as_ref().map(Distribution::processors))?;
    let mut patches = Patches::new(options.foam.case, *selection != Selection::default())
        .map_err(ExportError::Request)?;

    let survey = survey(&model, &mut patches, distribution.as_ref())?;

    let named = |error| ExportError::write(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let make = |processor: usize| {
        let dir = staging.path().join(processor.to_string());
        fs::create_dir(&dir).map_err(named)?;
        let domain = Domain(distribution.as_ref().map(|of_cells| (of_cells, processor as u32)));
        poly_mesh::write(&model, &patches, &survey, domain, &dir).map_err(|error| match error {
            ExportError::Write(error) => named(error),
            error => error,
        })
    };
    let (mut counts, mut done) = (Vec::new(), 0);
    in_order(targets.len(), options.jobs, make, |_, of_directory: Counts| {
        done += of_directory.cells;
        counts.push(of_directory);
        options.watch.progress(done, model.words.len() as u64);
        Ok(())
    })?;
    let (files, bytes) = sizes(staging.path()).map_err(named)?;
    options.check()?;
    staging.publish(|staged| {
        for (processor, target) in targets.iter().enumerate() {
            let place = || {
                fs::create_dir_all(target.parent().unwrap_or(target))?;
                fs::rename(staged.join(processor.to_string()), target)
            };
            place().map_err(|error| ExportError::write(target, error))?;
        }
        Ok::<(), ExportError>(())
    })?;
    let mut notes = notes::notes(&counts, &regions, options.foam.regions);
    if counts.len() > 1 && !survey.has_addressing(&model) {
        notes.push("no addressing for reconstructPar: 32-bit labels cannot number the faces of the whole mesh".to_owned());
    }
    Ok(Summary { leaves: model.words.len() as u64, files, bytes, notes })
}

/// Number and size of the files in the directories of a directory.
fn sizes(staging: &Path) -> io::Result<(u64, u64)> {
    let (mut files, mut bytes) = (0, 0);
    for dir in fs::read_dir(staging)? {
        for file in fs::read_dir(dir?.path())? {
            files += 1;
            bytes += file?.metadata()?.len();
        }
    }
    Ok((files, bytes))
}

/// The selected leaves as cells.
fn read<'a>(
    mesh: &Mesh,
    selection: &Selection,
    options: &'a Options<'a>,
) -> Result<Model<'a>, ExportError> {
    let root = mesh.manifest.root;
    if options.foam.case.is_some_and(|case| case.root != root) {
        return Err(ExportError::Request(
            "the mesh has another root than the case: give the case that was meshed".to_owned(),
        ));
    }
    let has_ranks = mesh.leaves_by_rank()?.len() > 1;
    let (mut builder, mut words, mut ranks) = (Builder::default(), Vec::new(), Vec::new());
    let mut visited = 0u64;
    mesh.visit(Mesh::ALL, &Selection::default(), &mut |leaf: Leaf| {
        visited += 1;
        if visited.is_multiple_of(1 << 16) {
            options.check()?;
        }
        let is_exported = selection.has(&leaf);
        if is_exported {
            words.push(word::encode(&word::Leaf { octant: leaf.octant, side: leaf.side }));
            ranks.extend(has_ranks.then_some(leaf.rank));
        }
        if words.len() as u64 > CELLS_MAX {
            return Err(ExportError::Request(format!(
                "a polyMesh can have {CELLS_MAX} cells here: select fewer leaves"
            )));
        }
        builder.push(&leaf.octant, is_exported);
        Ok(())
    })?;
    if words.is_empty() {
        return Err(nothing_selected(mesh));
    }
    Ok(Model {
        tree: builder.finish(),
        words,
        ranks,
        points: Points::default(),
        root,
        has_sides: mesh.manifest.sides == Sides::Known,
        options,
    })
}

/// Finds the regions, removes those that are not to be exported, and numbers the points.
fn connect(model: &mut Model, keep: options::Regions) -> Result<Vec<Size>, ExportError> {
    let mut regions = Regions::new(model.tree.cells());
    let mut points = Points::default();
    visit(model, Domain(None), |cell, around, squares| {
        for across in squares.iter().filter(|s| s.is_high).filter_map(|s| s.across.as_cell()) {
            regions.join(cell, across);
        }
        faces::insert_corners(&around.octant, squares, &mut points);
        Ok(())
    })?;
    let mut sizes = regions.sizes(&model.words);
    sizes.sort_by_key(|&(_, size)| std::cmp::Reverse(size));
    if keep == options::Regions::Largest && sizes.len() > 1 {
        let keep = regions.members(sizes[0].0);
        let mut kept = keep.iter();
        model.words.retain(|_| *kept.next().expect("a flag per cell"));
        let mut kept = keep.iter();
        model.ranks.retain(|_| *kept.next().expect("a flag per cell"));
        model.tree.retain(&keep);
        points = Points::default();
        visit(model, Domain(None), |_, around, squares| {
            faces::insert_corners(&around.octant, squares, &mut points);
            Ok(())
        })?;
    }
    points.number();
    model.points = points;
    Ok(sizes.into_iter().map(|(_, size)| size).collect())
}

/// The cells of each processor directory.
fn distribute(
    model: &Model,
    mesh: &Mesh,
    processors: Option<Processors>,
) -> Result<Option<Distribution>, ExportError> {
    let cells = model.tree.cells();
    let distribution = match processors {
        None => return Ok(None),
        Some(Processors::Equal(count)) if count <= cells => Distribution::equal(cells, count),
        Some(Processors::Equal(count)) => {
            return Err(ExportError::Request(format!(
                "{cells} cells are too few for {count} processors: choose fewer"
            )));
        }
        Some(Processors::Ranks) if !mesh.has_ranks() => return Err(mesh.ranks_unknown()),
        Some(Processors::Ranks) if model.ranks.is_empty() => Distribution::equal(cells, 1),
        Some(Processors::Ranks) => {
            Distribution::new(model.ranks.clone(), mesh.leaves_by_rank()?.len() as u32)
        }
    };
    match (0..distribution.processors()).find(|&p| distribution.cells(p).is_empty()) {
        None => Ok(Some(distribution)),
        Some(rank) => Err(ExportError::Request(format!(
            "rank {rank} has no cell that is exported, and OpenFOAM needs one on each processor: choose a number of processors"
        ))),
    }
}

/// The directories to write, none of which may exist with content.
fn targets(path: &Path, processors: Option<u32>) -> Result<Vec<PathBuf>, ExportError> {
    let exists = |path: &Path| {
        Err(ExportError::Request(format!(
            "{} exists: remove it, or choose another case",
            path.display()
        )))
    };
    let Some(count) = processors else {
        let has_content =
            path.exists() && fs::read_dir(path).map_or(true, |mut dir| dir.next().is_some());
        return if has_content { exists(path) } else { Ok(vec![path.to_owned()]) };
    };
    let case =
        path.parent().filter(|constant| constant.ends_with("constant")).and_then(Path::parent);
    let Some(case) = case else {
        return Err(ExportError::Request(format!(
            "{}: processor directories belong to a case: choose a path CASE/constant/polyMesh",
            path.display()
        )));
    };
    // Directories of another number of processors would make the solver refuse the case.
    for entry in fs::read_dir(case).into_iter().flatten() {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_processor = name.strip_prefix("processor").is_some_and(|n| n.parse::<u32>().is_ok());
        if is_processor {
            return exists(&entry.path());
        }
    }
    Ok((0..count).map(|n| case.join(format!("processor{n}")).join("constant/polyMesh")).collect())
}
