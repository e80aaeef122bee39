//! An OpenFOAM mesh: the directory `constant/polyMesh` of a case.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! All is held in arrays, with 200 bytes per cell at most: less than a third of what OpenFOAM needs to read the mesh.
//!
//! - [`leaves`](crate::leaves): the cells, a walk over them, and their squares; [`faces`](mod@faces): all faces, and the invariants;
//! - [`patches`]; [`files`](mod@files): OpenFOAM's syntax.

mod faces;
mod files;
mod patches;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::fs;
use std::path::Path;

use contract::failure::Failure;
use contract::files::{Staging, nearest_directory};
use contract::sets::Sets;
use contract::word::{self, Side};

use crate::leaves::Leaves;
use crate::options::{Export, Options, Regions, Summary, require_new};
use crate::points::Points;
use faces::Faces;
use patches::{Patches, SIDES};

/// A mesh for OpenFOAM.
pub struct Mesh {
    leaves: Leaves,
    points: Points,
    faces: Faces,
    patches: Patches,
    /// The rank that wrote each cell, if there are several.
    ranks: Option<Vec<u32>>,
    /// Number of regions of the selected leaves, of which only the largest may have been kept.
    regions: usize,
}

/// Writes the selected leaves as `path`, which is a case's `constant/polyMesh`. It appears under its name when it is complete.
///
/// # Errors
/// If the mesh cannot be read, if the directory exists and is not empty, if a file cannot be written, or if the options contradict the mesh.
///
/// # Panics
/// If an invariant of the answer is violated: see [`Faces::check_invariants`].
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary, Failure> {
    let of_mesh = read(export)?;
    require_new(path)?;
    let named = |error| Failure::at(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let dir = staging.path().join("polyMesh");
    fs::create_dir(&dir).map_err(named)?;
    of_mesh.write(export, &dir).map_err(|failure| failure.of_file(path))?;
    let mut bytes = 0;
    for file in fs::read_dir(&dir).map_err(named)? {
        bytes += file.and_then(|file| file.metadata()).map_err(named)?.len();
    }
    export.options.check()?;
    staging.publish(|_| {
        let moved = fs::create_dir_all(path.parent().unwrap_or(path));
        moved.and_then(|()| fs::rename(&dir, path)).map_err(named)
    })?;
    let mut notes = of_mesh.notes(export.options.regions);
    let is_selected = export.selection.side.is_none_or(|side| side == Side::Crossing);
    if is_selected && export.mesh.manifest.leaves_by_side.crossing > 0 {
        notes.push(CROSSED.to_owned());
    }
    Ok(Summary { leaves: of_mesh.leaves.count().into(), bytes, notes })
}

/// A warning about exported cells that the geometry crosses.
const CROSSED: &str = "warning: the geometry crosses cells of this mesh, and a flow passes through walls inside them: mesh with \
     keep_crossing = false for a solver";

/// The selected leaves as a mesh.
fn read(export: &Export<'_>) -> Result<Mesh, Failure> {
    let Export { mesh, options, .. } = *export;
    options.case.iter().try_for_each(|case| mesh.require_case(case))?;
    let mut ranks = (mesh.parts.len() > 1).then(Vec::new);
    let leaves = Leaves::read(export, &mut |leaf, is_selected| {
        if let Some(ranks) = ranks.as_mut().filter(|_| is_selected) {
            ranks.push(leaf.rank);
        }
        true
    })?;
    export.require_some(leaves.count().into())?;
    let patches = Patches::new(options.case, !export.is_of_all());
    Mesh::new(leaves, ranks, patches, options)
}

/// The first cell of the region of each cell, the number of regions, and which is the largest by volume, then the first.
fn regions(leaves: &Leaves, options: &Options) -> Result<(Vec<u32>, usize, u32), Failure> {
    // Sets of cells, which are represented by their first cells.
    let mut sets = Sets::new(leaves.count() as usize);
    leaves.walk(options, &mut |cell, _, squares| {
        let high = squares.iter().filter(|square| square.is_high);
        for across in high.filter_map(|square| square.across.as_cell()) {
            sets.union(cell, across);
        }
        Ok(())
    })?;
    let of_cell: Vec<u32> = (0..leaves.count()).map(|cell| sets.root(cell)).collect();
    let mut volumes = vec![0; of_cell.len()];
    for (&set, word) in of_cell.iter().zip(leaves.cells()) {
        volumes[set as usize] += word::span(word::level(word));
    }
    let count = volumes.iter().filter(|&&volume| volume > 0).count();
    let largest = (0..).zip(volumes).min_by_key(|&(_, volume)| Reverse(volume));
    Ok((of_cell, count, largest.map_or(0, |(cell, _)| cell)))
}

/// The points of cells: their corners, and those of the squares into which their faces are split where cells are missing. They are
/// numbered as the cells need them, so those of a cell are close together.
fn points(leaves: &Leaves, options: &Options) -> Result<Points, Failure> {
    let mut points = Points::default();
    leaves.walk(options, &mut |_, octant, squares| {
        let (low, edge) = (octant.corner, octant.edge());
        for digit in 0..8 {
            points.add(std::array::from_fn(|a| low[a] + edge * (digit >> a & 1)));
        }
        let of_boundary = squares.iter().filter(|square| square.across.as_cell().is_none());
        for corner in of_boundary.flat_map(|square| square.corners(true)) {
            points.add(corner);
        }
        Ok(())
    })?;
    Ok(points)
}

impl Mesh {
    /// The mesh of these cells, without the regions that are not to be exported.
    fn new(
        mut leaves: Leaves,
        mut ranks: Option<Vec<u32>>,
        patches: Patches,
        options: &Options<'_>,
    ) -> Result<Self, Failure> {
        let (of_cell, regions, largest) = regions(&leaves, options)?;
        if options.regions == Regions::Largest && regions > 1 {
            let is_kept = |cell: u32| of_cell[cell as usize] == largest;
            leaves = leaves.retain(is_kept);
            if let Some(ranks) = &mut ranks {
                let mut cells = 0..;
                ranks.retain(|_| cells.next().is_some_and(is_kept));
            }
        }
        let points = points(&leaves, options)?;
        let faces = Faces::new(&leaves, &points, &patches, options)?;
        faces.check_invariants(&leaves, &points);
        Ok(Self { leaves, points, faces, patches, ranks, regions })
    }

    /// What the user should know: patches, solids without faces, regions.
    fn notes(&self, exported: Regions) -> Vec<String> {
        let faces = self.faces.starts.windows(2).map(|ends| ends[1] - ends[0]);
        let (with, without): (Vec<_>, Vec<_>) =
            self.patches.names.iter().zip(faces).partition(|(_, faces)| *faces > 0);
        let with: Vec<_> = with.iter().map(|(name, faces)| format!("{name} {faces}")).collect();
        let mut notes = vec![format!("faces of each patch: {}", with.join(", "))];
        let is_solid = |name: &&str| !SIDES.contains(name) && *name != patches::CUT;
        let without = without.iter().map(|(name, _)| name.as_str()).filter(is_solid);
        let without = without.collect::<Vec<_>>().join(", ");
        if !without.is_empty() {
            notes.push(format!(
                "warning: patches without faces, which are no walls of this mesh: {without}"
            ));
        }
        if self.regions > 1 {
            let outcome = match exported {
                Regions::All => "most solvers accept one: --regions largest leaves out the others",
                Regions::Largest => "only the largest was exported",
            };
            notes.push(format!("{} regions that no face connects: {outcome}", self.regions));
        }
        notes
    }
}
