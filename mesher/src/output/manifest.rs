//! The manifest of a mesh, `mesh.json`, and what it has in common with the report of the run: the mesh in numbers.

use crate::input::lattice::Rules;
use crate::mesh::Mesh;
use crate::output::write::{Output, TREE, part_name};
use crate::sides::leaks::Leak;
use crate::sides::{Ambiguous, Summary};
use bricks::digest::{Digests, hex};
use bricks::octant::LEVEL_MAX;
use ranks::Comm;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::iter::once;

/// The sides of leaves, in the order of their numbers.
pub const SIDES: [&str; 3] = ["outside", "inside", "crossing"];

/// A mesh in numbers: its rules, its leaves and its components. Boxes and seeds are in lattice units, everything else is in the
/// geometry's unit.
#[derive(Clone, Debug, Serialize)]
pub struct MeshEntry {
    program: &'static str,
    tree: &'static str,
    /// The rules.
    #[serde(flatten)]
    pub rules: Rules,
    geometry: Value,
    /// What is closed at a coarser spacing, and open at that of the mesh.
    pub leaks: Vec<Leak>,
    /// Leaves of the mesh.
    pub leaves: u64,
    /// Leaves by level, 0 to 19.
    pub leaves_by_level: Vec<u64>,
    /// Leaves by side.
    pub leaves_by_side: BTreeMap<&'static str, u64>,
    /// The components of the base tree.
    pub components: Summary,
    components_ambiguous: Ambiguous,
    /// The mesh's digest.
    pub digest: String,
}

impl MeshEntry {
    /// The mesh with these numbers of leaves on all ranks, by level and side.
    pub fn new(mesh: &Mesh, by_level: &[[u64; 3]], digests: &Digests) -> Self {
        let Mesh { rules, sides, .. } = mesh;
        let leaves = by_level.as_flattened().iter().sum();
        let by_level = &by_level[..=LEVEL_MAX as usize];
        let by_side = [0, 1, 2].map(|side| by_level.iter().map(|l| l[side]).sum());
        Self {
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            tree: if mesh.is_base { "base" } else { "final" },
            rules: rules.clone(),
            geometry: json!({ "facets": mesh.facets.total, "digest": hex(mesh.facets.digest) }),
            leaks: mesh.leaks.0.clone(),
            leaves,
            leaves_by_level: by_level.iter().map(|l| l.iter().sum()).collect(),
            leaves_by_side: SIDES.into_iter().zip(by_side).collect(),
            components: sides.summary,
            components_ambiguous: sides.summary.ambiguous,
            digest: hex(digests.whole()),
        }
    }
}

/// A part: its number of leaves and its digest.
pub type Part = (u64, u128);

/// The digests by octant and the parts of the mesh, gathered from all ranks. Collective.
pub fn gather(leaves: u64, mine: &Digests, comm: &dyn Comm) -> (Digests, Vec<Part>) {
    let words = |number: u64, digest: u128| [number, (digest >> 64) as u64, digest as u64];
    let read = |&[n, high, low]: &[u64; 3]| (n, u128::from(high) << 64 | u128::from(low));
    // The leaves of a rank lie in few of the octants.
    let octants = (0..).zip(&mine.octants).filter(|(_, d)| **d != 0).map(|(i, d)| words(i, *d));
    let mine: Vec<[u64; 3]> = once(words(leaves, mine.whole())).chain(octants).collect();
    let (mut digests, mut parts) = (Digests::default(), Vec::new());
    for (_, theirs) in comm.all_gather(mine.as_flattened()).messages() {
        let mut theirs = theirs.as_chunks().0.iter().map(read);
        parts.extend(theirs.next());
        digests.merge(theirs.map(|(octant, digest)| (octant as usize, digest)));
    }
    (digests, parts)
}

/// Contents of `mesh.json`: a mesh with these digests and parts; parts and tree are named as far as `output` has them.
pub fn manifest(output: &Output, mesh: &MeshEntry, digests: &Digests, parts: &[Part]) -> Value {
    let part = |(rank, &(leaves, digest)): (usize, &Part)| json!({ "file": part_name(rank), "leaves": leaves, "digest": hex(digest) });
    let parts = parts.iter().enumerate().filter(|_| output.words).map(part);
    let mut manifest = json!(mesh);
    manifest["schema"] = "octree-leaf-set/1".into();
    manifest["octant_digests"] = digests.octants.iter().map(|&d| hex(d)).collect();
    manifest["parts"] = parts.collect();
    if output.tree {
        manifest["hyper_tree_grid"] = TREE.into();
    }
    manifest
}
