//! Why a leaf has its size and its side, and which splits of a mesh are needless or missing.
//!
//! - [`gradation`]: T0 (section 3 of reference/DEFINITION.md), and the leaves that force an octant to split (section 6);
//! - [`answer`]: the answer about a point, with a chain of such leaves to a cause in T0; [`least`]: the audit of a whole mesh.
//!
//! **Invariant of the search.** The sources of level l are the leaves of level l at the start of its step of the sweep,
//! so their parents are split by T0, by the extra layer, or by a step of a deeper level. A chain therefore goes to ever
//! finer levels, and every question about an octant is answered from finer octants in its neighbourhood. A split in the mesh counts
//! only if it is required itself, so needless splits require nothing.

use std::cell::RefCell;

use contract::case::Case;
use contract::manifest::{self, Geometry, Manifest};
use contract::tree::Tree;
use rustc_hash::FxHashMap;

use crate::checks::manifest::differing_inputs;
use crate::checks::truth::Truth;

pub mod answer;
mod gradation;
pub mod least;

/// The body of the case from which a mesh was made: its facets, and T0 with the sides of its leaves.
///
/// # Errors
/// One sentence, if the case is not that of the mesh, or if its T0 is too large.
pub fn body(case: &Case, of_mesh: &Manifest) -> Result<Truth, String> {
    let geometry = Some(Geometry::of(&case.facets_lattice));
    let inputs = Manifest { geometry, ..case.manifest(of_mesh.tree, String::new()) };
    let mut differing = differing_inputs(("the mesh", of_mesh), ("the case", &inputs));
    if of_mesh.sides == manifest::Sides::Unknown {
        differing.push("the sides of the mesh are unknown".to_owned());
    }
    if !differing.is_empty() {
        return Err(format!(
            "the mesh was made from other inputs than the case ({}); give the case file from which it was made",
            differing.join("; ")
        ));
    }
    let most = Truth::LEAVES_MAX;
    let too_large = || format!("T0 of the case has more than {most} leaves: omit --case");
    Truth::of(case, &inputs).ok_or_else(too_large)
}

/// A mesh with the inputs that explain it.
pub struct Mesh<'a> {
    tree: &'a Tree,
    pub(crate) inputs: Manifest,
    /// The facets and T0, if the case is known.
    body: Option<&'a Truth>,
    /// Whether the leaves are those of T0, which precedes gradation.
    is_base: bool,
    /// Deepest level of a leaf that can force an octant to split; no search goes deeper, because only needless splits do.
    level_deepest: u8,
    /// Answers to questions that were asked before.
    known: RefCell<FxHashMap<u64, bool>>,
}

impl<'a> Mesh<'a> {
    /// A mesh of this body. Without it, facets are not known.
    pub fn of(manifest: &Manifest, tree: &'a Tree, body: Option<&'a Truth>) -> Self {
        let mut inputs = manifest.clone();
        let is_base = inputs.tree == manifest::Tree::Base;
        if is_base {
            (inputs.keep, inputs.keep_crossing) = (manifest::Keep::All, true);
        }
        let level_deepest = inputs.level_deepest();
        Self { tree, inputs, body, is_base, level_deepest, known: RefCell::default() }
    }

    /// Whether it is known where the surface is: from the facets, or from the crossing leaves of the mesh.
    pub(crate) fn knows_surface(&self) -> bool {
        self.body.is_some() || self.inputs.keep_crossing
    }
}
