//! Meshes on disk, read leaf by leaf in Morton order.

use std::ops::Deref;
use std::path::Path;

use contract::case::Case;
use contract::digest::Digest;
use contract::lattice::Root;
use contract::manifest::{Geometry, Sides};
use contract::mesh::{self, Order};
use contract::word;

use crate::leaf::Leaf;
use crate::selection::Selection;
use contract::failure::Failure;

/// A mesh on disk, opened for reading.
#[derive(Debug)]
pub struct Mesh(mesh::Mesh);

/// Asks whether to continue; its error ends a visit.
pub type Check<'a> = &'a dyn Fn() -> Result<(), Failure>;

impl Deref for Mesh {
    type Target = mesh::Mesh;

    fn deref(&self) -> &mesh::Mesh {
        &self.0
    }
}

impl Mesh {
    /// Opens a leaf-set directory. If it has the tree alone, that is its only part.
    ///
    /// # Errors
    /// If the directory is not a leaf set.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        Ok(Self(mesh::Mesh::open(path)?))
    }

    /// Refuses a case that was not meshed here, by its root, its surface level and its facets.
    ///
    /// # Errors
    /// If the mesh cannot be one of the case.
    pub fn require_case(&self, case: &Case) -> Result<(), Failure> {
        let stated = |root: Root, level: u8, geometry: Option<Geometry>| {
            let Root { origin: [x, y, z], edge } = root;
            let facets = geometry.map_or(String::new(), |Geometry { facets, digest }| {
                format!(", with {facets} facets of the digest {digest}")
            });
            format!("a root of edge {edge} at ({x}, {y}, {z}) and surface level {level}{facets}")
        };
        let geometry = self.manifest.geometry;
        let of_mesh = stated(self.manifest.root, self.manifest.level_surface, geometry);
        let geometry = geometry.map(|_| Geometry::of(&case.facets_lattice));
        let of_case = stated(case.root, case.level_surface, geometry);
        if of_mesh == of_case {
            return Ok(());
        }
        Err(Failure::input(format!(
            "the mesh is not of the case {}: the mesh has {of_mesh}, the case {of_case}; give the case that was meshed",
            case.name
        )))
    }

    /// Makes sure that the sides of the leaves are known.
    ///
    /// # Errors
    /// If they are not.
    pub fn require_sides(&self) -> Result<(), Failure> {
        match self.manifest.sides {
            Sides::Known => Ok(()),
            Sides::Unknown => Err(Failure::input(
                "the sides of this mesh are unknown, and this needs them: only .vtu and polyMesh can be written without",
            )),
        }
    }

    /// Whether the rank of each leaf is known: words have a file for each rank, and a tree has none.
    pub fn has_ranks(&self) -> bool {
        self.tree_file.is_none()
    }

    /// The error of a request that needs them.
    pub fn ranks_unknown(&self) -> Failure {
        Failure::input(
            "the ranks of a mesh that has only a tree are unknown: mesh with --write words",
        )
    }

    /// Number of selected leaves, which is not 0.
    ///
    /// # Errors
    /// If no leaf is selected, if the mesh cannot be read, and those of `check`.
    pub(crate) fn count(&self, selection: &Selection, check: Check<'_>) -> Result<u64, Failure> {
        let mut leaves = 0;
        match *selection == Selection::default() {
            true => leaves = self.len(),
            false => self.visit(selection, check, &mut |_| {
                leaves += 1;
                Ok(())
            })?,
        }
        if leaves == 0 { Err(self.nothing_selected()) } else { Ok(leaves) }
    }

    /// The error of an export without leaves.
    pub(crate) fn nothing_selected(&self) -> Failure {
        let why = match self.is_empty() {
            true => "the mesh has no leaves",
            false => "no leaf satisfies all conditions of the selection: remove one of them",
        };
        Failure::input(why.to_owned())
    }

    /// Visits the selected leaves in Morton order. All leaves are read once, and `check` is called from time to time.
    ///
    /// # Errors
    /// If a part cannot be read or is not a sequence of leaves, or if the leaves do not have the digest in the manifest; or the first error
    /// of `check` or `visit`, which ends the traversal.
    pub fn visit(
        &self,
        selection: &Selection,
        check: Check<'_>,
        visit: &mut dyn FnMut(Leaf) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (mut order, mut index, mut digest) = (Order::default(), 0u64, Digest::default());
        let mut one = |word: u64, rank: u32| {
            if index.is_multiple_of(CHECKED) {
                check()?;
            }
            if let Some(why) = order.fault(word) {
                return Err(self.not_linear(why).into());
            }
            let leaf = Leaf { octant: word::octant(word), side: word::side(word), rank, index };
            index += 1;
            digest.add(word);
            if selection.has(&leaf) { visit(leaf) } else { Ok(()) }
        };
        let mut visited = Ok(());
        self.stream(&mut |part, words| {
            visited = words.iter().try_for_each(|&word| one(word, part as u32));
            visited.is_ok()
        })?;
        visited?;
        let stated = self.manifest.digest;
        let why = format!(
            "its leaves have the digest {digest}, and its manifest states {stated}: run harness audit on it"
        );
        if digest == stated { Ok(()) } else { Err(Failure::input(why)) }
    }
}

/// Leaves between two checks.
const CHECKED: u64 = 1 << 16;

#[cfg(test)]
mod tests;
