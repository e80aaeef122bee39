//! An OpenFOAM mesh: the directory `constant/polyMesh` of a case.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! All is held in arrays, with 200 bytes per cell at most: less than a third of what OpenFOAM needs to read the mesh.
//!
//! - [`leaves`](crate::leaves): the cells, and a walk over them; [`squares`](crate::squares): their faces; [`points`]: the points; [`faces`](mod@faces): all faces, and the invariants;
//! - [`regions`], [`patches`]; [`files`](mod@files): OpenFOAM's syntax.

mod faces;
mod files;
mod patches;
mod points;
mod regions;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::Path;

use contract::files::{Staging, nearest_directory};
use contract::lattice::Root;
use contract::manifest::Sides;
use contract::word::Side;

use crate::leaves::Leaves;
use crate::mesh;
use crate::options::{self, Options, Summary};
use crate::selection::Selection;
use contract::failure::Failure;
use faces::Faces;

use patches::{Patches, SIDES};
use points::Points;
use regions::Regions;

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
    /// Number of regions of the selected leaves, of which only the largest may have been kept.
    regions: usize,
    options: &'a Options<'a>,
}

/// Writes the selected leaves as `path`, which is a case's `constant/polyMesh`. It appears under its name when it is complete.
///
/// # Errors
/// If the mesh cannot be read, if the directory exists and is not empty, if a file cannot be written, or if the options contradict the mesh.
///
/// # Panics
/// If an invariant of the answer is violated: see [`Faces::check_invariants`].
pub fn write(
    mesh: &mesh::Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let of_mesh = read(mesh, selection, options)?;
    let has_content = fs::read_dir(path).map_or(path.exists(), |mut dir| dir.next().is_some());
    if has_content {
        let why = format!("{} exists: remove it, or choose another case", path.display());
        return Err(Failure::input(why));
    }
    let named = |error| Failure::at(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let dir = staging.path().join("polyMesh");
    fs::create_dir(&dir).map_err(named)?;
    of_mesh.write(&dir).map_err(|failure| failure.of_file(path))?;
    let (mut files, mut bytes) = (0, 0);
    for file in fs::read_dir(&dir).map_err(named)? {
        files += 1;
        bytes += file.and_then(|file| file.metadata()).map_err(named)?.len();
    }
    options.check()?;
    staging.publish(|_| {
        let moved = fs::create_dir_all(path.parent().unwrap_or(path));
        moved.and_then(|()| fs::rename(&dir, path)).map_err(named)
    })?;
    let mut notes = of_mesh.notes();
    let is_selected = selection.side.is_none_or(|side| side == Side::Crossing);
    if is_selected && mesh.manifest.leaves_by_side.crossing > 0 {
        notes.push(CROSSED.to_owned());
    }
    Ok(Summary { leaves: of_mesh.leaves.count().into(), files, bytes, notes })
}

/// A warning about exported cells that the geometry crosses.
const CROSSED: &str = "warning: the geometry crosses cells of this mesh, and a flow passes through walls inside them: mesh with \
     keep_crossing = false for a solver";

/// The selected leaves as a mesh.
fn read<'a>(
    mesh: &mesh::Mesh,
    selection: &Selection,
    options: &'a Options<'a>,
) -> Result<Mesh<'a>, Failure> {
    let root = mesh.manifest.root;
    options.case.iter().try_for_each(|case| mesh.require_case(case))?;
    let mut ranks = (mesh.parts.len() > 1).then(Vec::new);
    let leaves = Leaves::read(mesh, selection, options, &mut |leaf, is_selected| {
        if let Some(ranks) = ranks.as_mut().filter(|_| is_selected) {
            ranks.push(leaf.rank);
        }
        true
    })?;
    if leaves.count() == 0 {
        return Err(mesh.nothing_selected());
    }
    let patches = Patches::new(options.case, *selection != Selection::default());
    let patches = patches.map_err(Failure::input)?;
    let has_sides = mesh.manifest.sides == Sides::Known;
    build(leaves, Mesh { has_sides, ..Mesh::empty(patches, ranks, root, options) })
}

/// Leaves out the regions that are not to be exported, and finds points and faces.
fn build<'a>(mut leaves: Leaves, mut mesh: Mesh<'a>) -> Result<Mesh<'a>, Failure> {
    let regions = Regions::new(&leaves, mesh.options)?;
    mesh.regions = regions.count;
    if mesh.options.regions == options::Regions::Largest && regions.count > 1 {
        leaves = leaves.retain(|cell| regions.is_in_largest(cell));
        if let Some(ranks) = &mut mesh.ranks {
            let mut cells = 0..;
            ranks.retain(|_| cells.next().is_some_and(|cell| regions.is_in_largest(cell)));
        }
    }
    mesh.points = Points::new(&leaves, mesh.options)?;
    mesh.faces = Faces::new(&leaves, &mesh.points, &mesh.patches, mesh.options)?;
    mesh.faces.check_invariants(&leaves, &mesh.points);
    mesh.leaves = leaves;
    Ok(mesh)
}

impl<'a> Mesh<'a> {
    fn empty(
        patches: Patches,
        ranks: Option<Vec<u32>>,
        root: Root,
        options: &'a Options<'a>,
    ) -> Self {
        let (leaves, points, faces) = Default::default();
        Self { leaves, points, faces, patches, ranks, root, has_sides: true, regions: 0, options }
    }

    /// What the user should know: patches, solids without faces, regions.
    fn notes(&self) -> Vec<String> {
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
            let outcome = match self.options.regions {
                options::Regions::All => {
                    "most solvers accept one: --regions largest leaves out the others"
                }
                options::Regions::Largest => "only the largest was exported",
            };
            notes.push(format!("{} regions that no face connects: {outcome}", self.regions));
        }
        notes
    }
}
