//! OpenFOAM meshes (`constant/polyMesh`), for all cells or in one directory per processor.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! The files are written cell by cell. Only the tree of the cells and that of the points are kept, both with equal subtrees stored once, so
//! memory does not grow with the number of cells but with the detail of the surface: 18 MB for 50 million cells around an aircraft, 190 MB for 938
//! million. Directories of processors need the faces between them, 3 to 5 bytes each, and each thread a bit for every point near other
//! directories and 0.004 bytes for all others.
//!
//! - [`tree`]: the cells; [`walk`](mod@walk): what is across their faces; [`faces`]: the faces; [`points`]: the numbers of points; [`corners`]: where they are;
//! - [`regions`], [`patches`], [`solids`], [`processors`]; [`face_list`]: the faces between processors; [`own`]: the points of one;
//! - [`survey`](mod@survey): the numbers of faces in all directories; [`directory`]: what one has; [`poly_mesh`]: its files; [`face_files`]: those with the faces;
//!   [`cell_files`]: those with a label for each cell; [`lists`]: OpenFOAM's syntax; [`notes`]: what the user should know.

pub mod cell_files;
pub mod corners;
pub mod directory;
pub mod face_files;
pub mod face_list;
pub mod faces;
pub mod lists;
pub mod notes;
pub mod own;
pub mod patches;
pub mod points;
pub mod poly_mesh;
pub mod processors;
pub mod regions;
pub mod solids;
pub mod survey;
#[cfg(test)]
mod tests;
pub mod tree;
pub mod walk;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use contract::files::{Staging, nearest_directory};
use contract::manifest::Sides;
use contract::tree::{Builder, DELETED};
use contract::word;

use crate::error::ExportError;
use crate::leaf::Leaf;
use crate::mesh::Mesh;
use crate::options;
use crate::options::{Options, Processors, Summary};
use crate::ordered::in_order;
use crate::pieces::nothing_selected;
use crate::selection::Selection;
use directory::{Counts, Directory};
use patches::Patches;
use points::Points;
use processors::Distribution;
use regions::{Regions, Size, visit_retained};
use survey::{Domain, Model, survey};
use tree::{CELLS_MAX, Tree};

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
    model.points = corners::points(&model.tree, options)?;
    let distribution = distribute(&model, mesh, options.foam.processors)?;
    let targets = targets(path, distribution.as_ref().map(Distribution::processors))?;
    let patches = Patches::new(options.foam.case, *selection != Selection::default())
        .map_err(ExportError::Request)?;

    let survey = survey(&model, &patches, distribution.as_ref())?;

    let named = |error| ExportError::write(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let make = |processor: usize| {
        let dir = staging.path().join(processor.to_string());
        fs::create_dir(&dir).map_err(named)?;
        let domain = Domain(distribution.as_ref().map(|of_cells| (of_cells, processor as u32)));
        let write = || {
            let directory = Directory::new(&model, &patches, &survey, domain, &dir)?;
            poly_mesh::write(&directory).map(|()| directory.counts)
        };
        write().map_err(|error| match error {
            ExportError::Write(error) => named(error),
            error => error,
        })
    };
    let cells = u64::from(model.tree.cells());
    let (mut counts, mut done) = (Vec::new(), 0);
    in_order(targets.len(), options.jobs, make, |_, of_directory: Counts| {
        done += of_directory.cells;
        counts.push(of_directory);
        options.watch.progress(done, cells);
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
    notes.extend(notes::crossing(mesh, selection));
    if counts.len() > 1 && !survey.has_addressing(&model) {
        notes.push("no addressing for reconstructPar: 32-bit labels cannot number the faces of the whole mesh".to_owned());
    }
    Ok(Summary { leaves: cells, files, bytes, notes })
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
    let ranks = mesh.leaves_by_rank()?.len();
    let mut ranks = (ranks > 1).then(|| Distribution::new(ranks as u32));
    let (mut builder, mut visited, mut cells) = (Builder::default(), 0u64, 0);
    mesh.visit(Mesh::ALL, &Selection::default(), &mut |leaf: Leaf| {
        visited += 1;
        options.check_at(visited)?;
        let is_exported = selection.has(&leaf);
        cells += u64::from(is_exported);
        if cells > CELLS_MAX {
            return Err(ExportError::Request(format!(
                "a polyMesh can have {CELLS_MAX} cells here: select fewer leaves"
            )));
        }
        if let Some(ranks) = &mut ranks {
            ranks.push(leaf.rank, u32::from(is_exported));
        }
        let kind = if is_exported { leaf.side as u8 } else { DELETED };
        let pushed = builder.push_leaf(word::key_of(leaf.octant.corner), leaf.octant.level, kind);
        pushed.expect("the leaves of a visit ascend and do not overlap");
        Ok(())
    })?;
    if cells == 0 {
        return Err(nothing_selected(mesh));
    }
    Ok(Model {
        tree: Tree::new(&builder.finish()),
        ranks,
        points: Points::default(),
        root,
        has_sides: mesh.manifest.sides == Sides::Known,
        options,
    })
}

/// Finds the regions, and removes those that are not to be exported.
fn connect(model: &mut Model, keep: options::Regions) -> Result<Vec<Size>, ExportError> {
    let regions = Regions::new(&model.tree, model.options)?;
    let sizes = regions.sizes();
    if keep == options::Regions::Largest && sizes.len() > 1 {
        let retained = regions.retain(sizes[0].0);
        if let Some(ranks) = &mut model.ranks {
            *ranks = ranks.retain(|visit| visit_retained(&model.tree, &retained, visit));
        }
        model.tree = retained;
    }
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
        Some(Processors::Ranks) => {
            model.ranks.clone().unwrap_or_else(|| Distribution::equal(cells, 1))
        }
    };
    match (0..distribution.processors()).find(|&p| distribution.count(p) == 0) {
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
