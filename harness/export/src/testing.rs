//! Meshes on disk, for tests.

use crate::options::{Export, Regions};
use crate::selection::Selection;
use contract::failure::Result;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::Manifest;
use contract::mesh::Mesh;
use std::path::Path;
use tempfile::TempDir;

/// The unit cube.
const UNIT: Root = Root { origin: [0.0; 3], edge: 1.0 };

/// A script that is not expected.
fn no_script(_: &str, _: &Path, _: &Path) -> Result<()> {
    unreachable!("no other format asks for it")
}

/// An export of the selected leaves of a mesh.
pub fn export<'a>(mesh: &'a Mesh, selection: &'a Selection) -> Export<'a> {
    Export { mesh, selection, case: None, regions: Regions::default(), script: no_script }
}

/// An export of all leaves of a mesh.
pub fn whole(mesh: &Mesh) -> Export<'_> {
    const ALL: &Selection =
        &Selection { clip: None, level_max: None, side: None, rank: None, slice: None };
    export(mesh, ALL)
}

/// A mesh of these parts in a directory, which lasts as long as the first value.
pub fn stored(parts: Vec<Vec<u64>>, root: Root) -> (TempDir, Mesh) {
    let empty = Manifest::without_leaves(root, "test".to_owned());
    let dir = tempfile::tempdir().unwrap();
    LeafSet::new(empty, Vec::new()).with_parts(parts).write(dir.path()).unwrap();
    let mesh = Mesh::open(dir.path()).unwrap();
    (dir, mesh)
}

/// A mesh in the unit cube. The leaf with index i is in the part `part(i)`, modulo their number.
pub fn on_disk(words: &[u64], parts: usize, part: impl Fn(usize) -> usize) -> (TempDir, Mesh) {
    in_root(words, parts, part, UNIT)
}

/// The same in another root.
pub fn in_root(
    words: &[u64],
    parts: usize,
    part: impl Fn(usize) -> usize,
    root: Root,
) -> (TempDir, Mesh) {
    let mut by_part = vec![Vec::new(); parts];
    words.iter().enumerate().for_each(|(i, &w)| by_part[part(i) % parts].push(w));
    stored(by_part, root)
}
