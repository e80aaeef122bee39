//! Why a leaf has its size and its side, and which splits of a mesh are needless or missing.
//!
//! - `gradation`: T0 (section 3 of reference/DEFINITION.md), and the leaves that force an octant to split (section 6);
//! - [`answer`]: the answer about a point, with a chain of such leaves to a cause in T0; [`Mesh::audit`]: the splits of a whole mesh.
//!
//! **Invariant of the search.** The sources of level l are the leaves of level l at the start of its step of the sweep,
//! so their parents are split by T0, by the extra layer, or by a step of a deeper level. A chain therefore goes to ever
//! finer levels, and every question about an octant is answered from finer octants in its neighbourhood. A split in the mesh counts
//! only if it is required itself, so needless splits require nothing.
//!
//! **Invariant of the audit.** Refinement is least: an octant is split if and only if a rule requires it. The recursion of
//! `gradation` decides this for every split octant and for every leaf, and a split that is not required itself justifies no other.
//! Whether a rule requires the split of an octant depends on finer leaves alone. So, from the deepest level upward, a mesh without
//! either fault has the splits of the definition where it has leaves; other checks compare these with T0. An octant within a needless
//! octant is needless, too; a leaf in a missing octant is counted once.

use std::cell::RefCell;

use contract::case::Case;
use contract::failure::{Failure, Result};
use contract::manifest::{self, Geometry, Manifest};
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Tree};
use rustc_hash::FxHashMap;

use crate::checks::clearance::Trail;
use crate::checks::manifest::differing_inputs;
use crate::checks::truth::Truth;

pub mod answer;
mod gradation;

/// The body of the case from which a mesh was made: its facets, and T0 with the sides of its leaves.
///
/// # Errors
/// One sentence, if the case is not that of the mesh, or if its T0 is too large.
pub fn body(case: &Case, of_mesh: &Manifest) -> Result<Truth> {
    let geometry = Some(Geometry::of(&case.facets_lattice));
    let inputs = Manifest { geometry, ..case.manifest(of_mesh.tree, String::new()) };
    let why = "the sides of the mesh are unknown, and the answer needs them";
    Failure::unless(of_mesh.sides == manifest::Sides::Known, why)?;
    let differing = differing_inputs(("the mesh", of_mesh), ("the case", &inputs)).join("; ");
    let why = format!(
        "the mesh was made from other inputs than the case ({differing}); give the case file from which it was made"
    );
    Failure::unless(differing.is_empty(), why)?;
    let why = format!("T0 of the case has more than {} leaves: omit --case", Truth::LEAVES_MAX);
    Truth::of(case, &inputs).ok_or(Failure::input(why))
}

/// A split that no rule requires.
pub const NEEDLESS: &str = "nothing requires the split of";
/// A leaf that a rule requires to be split.
pub const MISSING: &str = "a facet, a box, a layer or the balance requires the split of";

/// Is called with every octant that is examined and its fault, in Morton order.
type Visit<'v> = &'v mut dyn FnMut(Octant, Option<&'static str>);

/// A mesh with the inputs that explain it.
pub struct Mesh<'a> {
    tree: &'a Tree,
    pub(crate) inputs: Manifest,
    /// The facets and T0, if the case is known.
    body: Option<&'a Truth>,
    /// Deepest level of a leaf that can force an octant to split; no search goes deeper, because only needless splits do.
    level_deepest: u8,
    /// Answers to questions that were asked before.
    known: RefCell<FxHashMap<u64, bool>>,
    /// The levels of the sources in octants with children, as masks that are complete from a level on.
    sources: RefCell<FxHashMap<u64, (u8, u32)>>,
}

impl<'a> Mesh<'a> {
    /// A mesh of this body. Without it, facets are not known.
    pub fn of(manifest: &Manifest, tree: &'a Tree, body: Option<&'a Truth>) -> Self {
        let (inputs, level_deepest) = (manifest.of_leaves(), manifest.level_deepest());
        Self {
            tree,
            inputs,
            body,
            level_deepest,
            known: RefCell::default(),
            sources: RefCell::default(),
        }
    }

    /// Whether it is known where the surface is: from the facets, or from the crossing leaves of the mesh.
    pub(crate) fn knows_surface(&self) -> bool {
        self.body.is_some() || self.inputs.keep_crossing
    }

    /// Visits all octants of the mesh with their faults. What is found out about split octants is kept in memory. Panics if the surface is
    /// not known.
    pub fn audit(&self, visit: Visit) {
        assert!(self.knows_surface(), "splits are audited where the surface is known");
        self.audit_below(&Trail::new(self.tree), visit);
    }

    fn audit_below(&self, trail: &Trail, visit: Visit) {
        let (handle, octant) = (trail.around.centre(), trail.around.octant);
        if handle.is_node() {
            visit(octant, (!self.is_justified(&octant)).then_some(NEEDLESS));
            (0..8).for_each(|digit| self.audit_below(&trail.child(self.tree, digit), visit));
        } else if handle.as_leaf().is_some() {
            let is_missing = match self.has_nothing_finer(trail) {
                true => self.base_splits(&octant),
                false => self.is_forced(&octant, octant.level + 1),
            };
            visit(octant, is_missing.then_some(MISSING));
        }
    }

    /// Whether nothing within the reach of a layer or the balance can force the current leaf to split. True for most leaves, and quick.
    fn has_nothing_finer(&self, trail: &Trail) -> bool {
        let level = trail.around.octant.level;
        let wide = &trail.wide(self.layer_reach(level + 1).max(1)).around;
        let is_coarse = |&handle: &Handle| {
            let may_cross = self.has_deleted_crossing() && self.tree.kinds(handle) & HOLES != 0;
            self.tree.finest_level(handle, wide.octant.level) <= level && !may_cross
        };
        level >= self.level_deepest || wide.handles.iter().all(is_coarse)
    }
}
