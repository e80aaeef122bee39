//! An OpenFOAM mesh: the directory `constant/polyMesh` of a case.
//!
//! The faces of a leaf at finer leaves are split, and edges have the points of finer leaves, so a leaf becomes a polyhedron
//! and every cell is closed. `checkMesh -allTopology` verifies that. Cells are numbered in Morton order, which yields
//! OpenFOAM's upper-triangular order of faces: a cell on the high side of another has the higher number.
//!
//! All is held in arrays, with 200 bytes per cell at most: less than a third of what OpenFOAM needs to read the mesh.
//!
//! - `leaves`: the cells, a walk over them, and their squares; `faces`(mod@faces): all faces, and the invariants;
//! - [`Patches`]: the root's sides, the body or its solids, and the cut; `files`(mod@files): OpenFOAM's syntax.

mod faces;
mod files;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::HashMap;
use std::fs;
use std::path::Path;

use contract::case::Case;
use contract::failure::{Failure, Result, uninterrupted};
use contract::files::{Staging, nearest_directory};
use contract::number::numbered;
use contract::sets::Sets;
use contract::word;
use geometry::tree::{FacetTree, Point};

use crate::leaves::{Content, Leaves, Square};
use crate::options::{Export, Regions, Summary, require_new};
use crate::points::Points;
use faces::Faces;

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
/// If an invariant of the answer is violated: see `Faces::check_invariants`.
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary> {
    require_new(path)?;
    let of_mesh = read(export)?;
    let named = |error| Failure::at(path, error);
    let staging = Staging::inside(nearest_directory(path)).map_err(named)?;
    let dir = staging.path().join("polyMesh");
    fs::create_dir(&dir).map_err(named)?;
    // Every point is a vertex of a face.
    let is_wide = i32::try_from(of_mesh.faces.vertices.corners.len()).is_err();
    of_mesh.write(&export.mesh.manifest, is_wide, &dir).map_err(|failure| failure.of_file(path))?;
    let sizes = fs::read_dir(&dir).map_err(named)?.map(|file| Ok(file?.metadata()?.len()));
    let bytes = sizes.sum::<std::io::Result<u64>>().map_err(named)?;
    uninterrupted()?;
    staging.publish(|_| {
        let moved = fs::create_dir_all(path.parent().unwrap_or(path));
        moved.and_then(|()| fs::rename(&dir, path)).map_err(named)
    })?;
    let mut notes = of_mesh.notes(export.regions);
    if of_mesh.leaves.cells().any(word::is_crossing) {
        notes.push(CROSSED.to_owned());
    }
    Ok(Summary { leaves: of_mesh.leaves.count.into(), bytes, notes })
}

/// A warning about exported cells that the geometry crosses.
const CROSSED: &str = "warning: the geometry crosses cells of this mesh, and a flow passes through walls inside them: mesh with \
     keep_crossing = false for a solver";

/// The selected leaves as a mesh.
fn read(export: &Export<'_>) -> Result<Mesh> {
    let Export { mesh, case, regions, .. } = *export;
    case.iter().try_for_each(|case| mesh.require_case(case))?;
    let mut ranks = (mesh.parts.len() > 1).then(Vec::new);
    let leaves = Leaves::read(export, &mut |leaf, is_selected| {
        if let Some(ranks) = ranks.as_mut().filter(|_| is_selected) {
            ranks.push(leaf.rank);
        }
        true
    })?;
    export.require_some(leaves.count.into())?;
    Mesh::new(leaves, ranks, Patches::new(case, !export.is_of_all()), regions)
}

/// The first cell of the region of each cell, the number of regions, and which is the largest by volume, then the first.
fn regions(leaves: &Leaves) -> Result<(Vec<u32>, usize, u32)> {
    // Sets of cells, which are represented by their first cells.
    let mut sets = Sets::new(leaves.count as usize);
    leaves.walk(&mut |cell, _, squares| {
        let high = squares.iter().filter(|square| square.is_high);
        high.filter_map(|square| square.across.as_cell()).for_each(|to| sets.union(cell, to));
    })?;
    let of_cell: Vec<u32> = (0..leaves.count).map(|cell| sets.root(cell)).collect();
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
fn points(leaves: &Leaves) -> Result<Points> {
    let mut points = Points::default();
    leaves.walk(&mut |_, octant, squares| {
        let (low, edge) = (octant.corner, octant.edge());
        for digit in 0..8 {
            points.add(std::array::from_fn(|a| low[a] + edge * (digit >> a & 1)));
        }
        let of_boundary = squares.iter().filter(|square| square.across.as_cell().is_none());
        of_boundary.flat_map(|square| square.corners(true)).for_each(|at| _ = points.add(at));
    })?;
    Ok(points)
}

impl Mesh {
    /// The mesh of these cells, without the regions that are not to be exported.
    fn new(
        mut leaves: Leaves,
        mut ranks: Option<Vec<u32>>,
        patches: Patches,
        exported: Regions,
    ) -> Result<Self> {
        let (of_cell, regions, largest) = regions(&leaves)?;
        if exported == Regions::Largest && regions > 1 {
            let is_kept = |cell: u32| of_cell[cell as usize] == largest;
            leaves = leaves.retain(is_kept);
            if let Some(ranks) = &mut ranks {
                let mut cells = 0..;
                ranks.retain(|_| cells.next().is_some_and(is_kept));
            }
        }
        let points = points(&leaves)?;
        let faces = Faces::new(&leaves, &points, &patches)?;
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
        let is_solid = |name: &&str| !SIDES.contains(name) && *name != CUT;
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

/// Patches of the root's sides.
const SIDES: [&str; 6] = ["xMin", "xMax", "yMin", "yMax", "zMin", "zMax"];
/// Patch of the faces beyond which there is no leaf, of a body without named solids.
const BODY: &str = "body";
/// Patch of the faces beyond which there is a leaf that is not exported.
const CUT: &str = "cut";

/// The patches: `SIDES`, the solids of the body, and, if leaves were left out, the cut.
pub struct Patches {
    /// The names, unique.
    pub names: Vec<String>,
    has_cut: bool,
    /// Patch of each facet, if there are several.
    of_facet: Vec<usize>,
    facets: Option<FacetTree>,
}

impl Patches {
    /// The patches of a mesh. Without a case, its body is one patch.
    pub fn new(case: Option<&Case>, has_cut: bool) -> Self {
        let mut names = SIDES.map(str::to_owned).to_vec();
        let (mut of_facet, mut patch_of) = (Vec::new(), HashMap::new());
        for solid in case.iter().flat_map(|case| &case.solids).filter(|solid| solid.facets > 0) {
            let patch = *patch_of.entry(&solid.name).or_insert_with(|| {
                let name = patch_name(solid.name.as_deref().unwrap_or_default());
                names.push(numbered(&name, '_', |name| !names.contains(name)));
                names.len() - 1
            });
            of_facet.extend(std::iter::repeat_n(patch, solid.facets));
        }
        let several = case.filter(|_| names.len() > SIDES.len() + 1);
        let facets = several.map(|case| FacetTree::new(&case.facets_lattice));
        if names.len() == SIDES.len() {
            names.push(BODY.to_owned());
        }
        names.extend(has_cut.then(|| CUT.to_owned()));
        Self { names, has_cut, of_facet, facets }
    }

    /// The type of a patch.
    pub fn type_of(&self, patch: usize) -> &'static str {
        let is_body = patch >= SIDES.len() && !(self.has_cut && patch + 1 == self.names.len());
        if is_body { "wall" } else { "patch" }
    }

    /// The patch of a face that no cell is across.
    pub fn of(&self, square: &Square) -> usize {
        match square.across {
            Content::Outside => 2 * square.axis + usize::from(square.is_high),
            Content::Cut => self.names.len() - 1,
            _ => self.nearest(square),
        }
    }

    /// The patch of the solid with the facet nearest to the centre of a face.
    fn nearest(&self, square: &Square) -> usize {
        let Some(facets) = &self.facets else { return SIDES.len() };
        let centre = Point::from(square.centre().map(|c| c as f64));
        // Half a lattice unit more, for rounding.
        self.of_facet[facets.within(centre, facets.distance(centre) + 0.5)[0] as usize]
    }
}

/// The name of a solid as a patch: characters that OpenFOAM's words may not have become underscores. Another solid whose name becomes the
/// same has a number at its end. Cases give `proc.*` the values of boundaries between ranks.
fn patch_name(solid: &str) -> String {
    let allowed = |c: char| c.is_alphanumeric() || "_-.+:".contains(c);
    let name: String = solid.chars().map(|c| if allowed(c) { c } else { '_' }).collect();
    let is_taken = SIDES.contains(&&*name) || name == CUT || name.starts_with("proc");
    match name.as_str() {
        "" => BODY.to_owned(),
        _ if is_taken || !name.starts_with(|c: char| c.is_alphabetic() || c == '_') => {
            format!("{BODY}_{name}")
        }
        _ => name,
    }
}
