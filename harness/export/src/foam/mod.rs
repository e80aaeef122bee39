//! OpenFOAM meshes (`constant/polyMesh`), for all cells or in one directory per processor.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! All is held in arrays, with 200 bytes per cell at most: less than a third of what OpenFOAM needs to read the mesh.
//!
//! - [`leaves`]: the cells, and a walk over them; [`squares`]: their faces; [`points`]: the points; [`faces`](mod@faces): all faces, and the invariants;
//! - [`regions`], [`patches`]; [`directory`]: the part of each processor; [`lists`]: OpenFOAM's syntax; [`notes`]: what the user should know.

mod directory;
mod faces;
mod leaves;
mod lists;
mod notes;
mod patches;
mod points;
mod regions;
mod squares;
#[cfg(test)]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::thread;

use contract::files::{Staging, nearest_directory};
use contract::lattice::Root;
use contract::manifest::Sides;
use contract::octant::Octant;
use contract::word;

use crate::mesh;
use crate::options;
use crate::options::{Options, Processors, Summary};
use crate::selection::Selection;
use contract::failure::Failure;
use directory::{Directory, directories};
use faces::Faces;
use leaves::{CELLS_MAX, CUT, Leaves};
use patches::Patches;
use points::Points;
use regions::{Regions, Size};

/// A mesh for OpenFOAM.
pub struct Mesh<'a> {
    leaves: Leaves,
    points: Points,
    faces: Faces,
    patches: Patches,
    /// The rank that wrote each cell, if there are several.
    ranks: Option<Vec<u32>>,
    root: Root,
    /// Whether the sides of cells are known.
    has_sides: bool,
    options: &'a Options<'a>,
}

/// Writes the selected leaves as `path`, which is a case's `constant/polyMesh`, or as one
/// `processorN/constant/polyMesh` per processor in the same case. Directories appear under their names when all are complete.
///
/// # Errors
/// If the mesh cannot be read, if a directory exists and is not empty, if a file cannot be written, or if the options contradict the mesh.
///
/// # Panics
/// If an invariant of the answer is violated: see [`Faces::check_invariants`] and `check_parts`.
pub fn write(
    mesh: &mesh::Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let has_ranks = mesh.has_ranks();
    let (of_mesh, regions) = read(mesh, selection, options)?;
    let processors = distribute(&of_mesh, options.foam.processors, || {
        has_ranks.then_some(()).ok_or_else(|| mesh.ranks_unknown())
    })?;
    let is_distributed = processors.is_some();
    let processors = processors.unwrap_or_else(|| vec![0; of_mesh.leaves.count() as usize]);
    let parts = directories(&of_mesh, &processors);
    check_parts(&of_mesh, &parts);
    let numbers = numbers(&processors);
    let targets = targets(path, is_distributed.then_some(parts.len()))?;

    let named = |error| Failure::at(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let make = |part: usize| {
        let dir = staging.path().join(part.to_string());
        fs::create_dir(&dir).map_err(named)?;
        parts[part]
            .write(&of_mesh, &numbers, is_distributed, &dir)
            .map_err(|failure| failure.of_file(path))
    };
    let cells = u64::from(of_mesh.leaves.count());
    let (mut done, all) = (0, (0..targets.len()).collect::<Vec<_>>());
    for some in all.chunks(options.jobs.get()) {
        thread::scope(|scope| {
            let make = &make;
            let threads: Vec<_> =
                some.iter().map(|&part| scope.spawn(move || make(part))).collect();
            threads.into_iter().try_for_each(|thread| thread.join().expect("it does not panic"))
        })?;
        done += some.iter().map(|&part| parts[part].cells.len() as u64).sum::<u64>();
        options.watch.progress(done, cells);
    }
    let (files, bytes) = sizes(staging.path()).map_err(named)?;
    options.check()?;
    staging.publish(|staged| {
        for (part, target) in targets.iter().enumerate() {
            let place = || {
                fs::create_dir_all(target.parent().unwrap_or(target))?;
                fs::rename(staged.join(part.to_string()), target)
            };
            place().map_err(|error| Failure::at(target, error))?;
        }
        Ok::<(), Failure>(())
    })?;
    let mut notes = notes::notes(&of_mesh, &parts, &regions);
    notes.extend(notes::crossing(mesh, selection));
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

/// The selected leaves as a mesh, and all regions of them, of which only the largest may have been kept.
fn read<'a>(
    mesh: &mesh::Mesh,
    selection: &Selection,
    options: &'a Options<'a>,
) -> Result<(Mesh<'a>, Vec<Size>), Failure> {
    let root = mesh.manifest.root;
    options.foam.case.iter().try_for_each(|case| mesh.require_case(case))?;
    let mut ranks = (mesh.leaves_by_rank()?.len() > 1).then(Vec::new);
    let (mut words, mut cells) = (Vec::new(), 0);
    mesh.visit(&Selection::default(), &|| options.check(), &mut |leaf| {
        let is_exported = selection.has(&leaf);
        cells += u64::from(is_exported);
        if cells > CELLS_MAX {
            return Err(Failure::input(format!(
                "a polyMesh can have {CELLS_MAX} cells here: select fewer leaves"
            )));
        }
        if let Some(ranks) = &mut ranks {
            ranks.extend(is_exported.then_some(leaf.rank));
        }
        let Octant { corner, level } = leaf.octant;
        let side = if is_exported { leaf.side as u64 } else { CUT };
        words.push(word::key_of(corner) << 7 | u64::from(level) << 2 | side);
        Ok(())
    })?;
    if cells == 0 {
        return Err(mesh.nothing_selected());
    }
    let patches = Patches::new(options.foam.case, *selection != Selection::default());
    let (leaves, patches) = (Leaves::new(words), patches.map_err(Failure::input)?);
    let has_sides = mesh.manifest.sides == Sides::Known;
    build(leaves, Mesh { has_sides, ..Mesh::empty(patches, ranks, root, options) })
}

/// Leaves out the regions that are not to be exported, and finds points and faces.
fn build<'a>(mut leaves: Leaves, mut mesh: Mesh<'a>) -> Result<(Mesh<'a>, Vec<Size>), Failure> {
    let regions = Regions::new(&leaves, mesh.options)?;
    if mesh.options.foam.regions == options::Regions::Largest && regions.sizes.len() > 1 {
        let is_kept = |cell: u32| regions.of_cell[cell as usize] == regions.sizes[0].0;
        leaves = leaves.retain(is_kept);
        if let Some(ranks) = &mut mesh.ranks {
            let mut cells = 0..;
            ranks.retain(|_| cells.next().is_some_and(is_kept));
        }
    }
    mesh.points = Points::new(&leaves, mesh.options)?;
    mesh.faces = Faces::new(&leaves, &mesh.points, &mesh.patches, mesh.options)?;
    mesh.faces.check_invariants(&leaves, &mesh.points);
    mesh.leaves = leaves;
    Ok((mesh, regions.sizes.into_iter().map(|(_, size)| size).collect()))
}

impl<'a> Mesh<'a> {
    fn empty(
        patches: Patches,
        ranks: Option<Vec<u32>>,
        root: Root,
        options: &'a Options<'a>,
    ) -> Self {
        let (leaves, points, faces) = Default::default();
        Self { leaves, points, faces, patches, ranks, root, has_sides: true, options }
    }

    /// Whether labels can hold the numbers of the whole mesh, so that each processor can state which part of it it has.
    fn has_addressing(&self) -> bool {
        let most = self.faces.count().max(self.points.count() as usize);
        (most as u64) < lists::label_max(self.options.foam.label)
    }
}

/// The processor of each cell.
fn distribute(
    mesh: &Mesh,
    processors: Option<Processors>,
    require_ranks: impl FnOnce() -> Result<(), Failure>,
) -> Result<Option<Vec<u32>>, Failure> {
    let cells = u64::from(mesh.leaves.count());
    let of_cells = match processors {
        None => return Ok(None),
        Some(Processors::Equal(count)) if u64::from(count) > cells => {
            return Err(Failure::input(format!(
                "{cells} cells are too few for {count} processors: choose fewer"
            )));
        }
        // Intervals of the curve.
        Some(Processors::Equal(count)) => {
            (0..cells).map(|cell| (cell * u64::from(count) / cells) as u32).collect()
        }
        Some(Processors::Ranks) => {
            require_ranks()?;
            mesh.ranks.clone().unwrap_or_else(|| vec![0; cells as usize])
        }
    };
    let mut counts = Vec::new();
    for &rank in &of_cells {
        counts.resize(counts.len().max(rank as usize + 1), 0u32);
        counts[rank as usize] += 1;
    }
    match counts.iter().position(|&count| count == 0) {
        None => Ok(Some(of_cells)),
        Some(rank) => Err(Failure::input(format!(
            "rank {rank} has no cell that is exported, and OpenFOAM needs one on each processor: choose a number of processors"
        ))),
    }
}

/// The number of each cell on its processor.
fn numbers(processors: &[u32]) -> Vec<u32> {
    let mut next = vec![0; processors.iter().max().map_or(0, |last| *last as usize + 1)];
    let number = |&processor: &u32| {
        let number: u32 = next[processor as usize];
        next[processor as usize] += 1;
        number
    };
    processors.iter().map(number).collect()
}

/// Asserts that the directories together have every cell once, every face between two processors twice, in the same order on both, and every other face once.
fn check_parts(mesh: &Mesh, parts: &[Directory]) {
    let cells: usize = parts.iter().map(|part| part.cells.len()).sum();
    assert_eq!(cells, mesh.leaves.count() as usize, "cells of all directories");
    let own =
        |part: &Directory| part.internal.len() + part.patches.iter().map(Vec::len).sum::<usize>();
    let between = |part: &Directory| part.between.values().map(Vec::len).sum::<usize>();
    let faces: usize = parts.iter().map(|part| 2 * own(part) + between(part)).sum();
    assert_eq!(
        faces,
        2 * mesh.faces.count(),
        "faces of all directories, those within one counted twice"
    );
    for (here, part) in parts.iter().enumerate() {
        for (&there, faces) in &part.between {
            let opposite = parts[there as usize].between.get(&(here as u32));
            assert_eq!(opposite, Some(faces), "faces between processors {here} and {there}");
        }
    }
}

/// The directories to write, none of which may exist with content.
fn targets(path: &Path, processors: Option<usize>) -> Result<Vec<PathBuf>, Failure> {
    let exists = |path: &Path| {
        Err(Failure::input(format!("{} exists: remove it, or choose another case", path.display())))
    };
    let Some(count) = processors else {
        let has_content =
            path.exists() && fs::read_dir(path).map_or(true, |mut dir| dir.next().is_some());
        return if has_content { exists(path) } else { Ok(vec![path.to_owned()]) };
    };
    let case =
        path.parent().filter(|constant| constant.ends_with("constant")).and_then(Path::parent);
    let Some(case) = case else {
        return Err(Failure::input(format!(
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

/// The error of labels that are too narrow.
fn narrow() -> Failure {
    Failure::input(
        "the mesh has more faces than 32-bit labels can number: choose --label 64".to_owned(),
    )
}
