//! The mesh that the checks examine, final or T0, with everything that they may use.

use std::cell::OnceCell;
use std::rc::Rc;

use super::truth::{Found, Truth};
use super::{CheckResult, Pass};
use crate::promises::Promises;
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Sides, Tree as Kind};
use contract::tree::{Builder, DELETED, HOLES, Kind as LeafKind, Tree};
use contract::word::{self, Side};

/// Name of the check that the tree of the mesh and T0 fit their limits.
pub const CAPACITY: &str = "capacity";

/// A mesh, with its case and a reference if they are known. What needs much time is found when a check first needs it.
pub struct Subject<'a> {
    /// The manifest of the mesh.
    pub manifest: &'a Manifest,
    /// The case, if it is known.
    pub case: Option<&'a Case>,
    /// The inputs of the case or, without one, of the manifest; and the tree that the mesh must be.
    pub inputs: Manifest,
    /// The inputs as far as they concern the leaves: T0 precedes deletion.
    pub terms: Manifest,
    /// What the mesh must keep.
    pub promises: Promises,
    /// The mesh in memory, if it is there.
    pub mesh: Option<&'a LeafSet>,
    /// The mesh that `mesh` must equal.
    pub reference: Option<&'a LeafSet>,
    pub(crate) pass: Pass,
    truth: Rc<OnceCell<Option<Truth>>>,
    with_deleted: OnceCell<Tree>,
}

impl<'a> Subject<'a> {
    /// A mesh in memory that must be this tree, of a case if it is known.
    pub fn new(case: impl Into<Option<&'a Case>>, tree: Kind, mesh: &'a LeafSet) -> Self {
        Self { mesh: Some(mesh), ..Self::of(&mesh.manifest, tree, Pass::of(mesh), case.into()) }
    }

    /// A mesh by the pass over its leaves.
    pub(crate) fn of(stated: &'a Manifest, tree: Kind, pass: Pass, case: Option<&'a Case>) -> Self {
        let inputs = case.map_or(stated, |case| &case.rules);
        let inputs = Manifest { tree, sides: stated.sides, ..inputs.clone() };
        let (manifest, terms, promises) = (stated, inputs.of_leaves(), Promises::of_definition());
        let (mesh, reference, truth, with_deleted) = Default::default();
        Self { manifest, case, terms, inputs, promises, mesh, reference, pass, truth, with_deleted }
    }

    /// The subject with the T0 that the harness makes for another mesh of the same case.
    pub fn sharing_truth(self, other: &Self) -> Self {
        Self { truth: other.truth.clone(), ..self }
    }

    /// The subject with the mesh that it must equal.
    pub fn with_reference(self, reference: &'a LeafSet) -> Self {
        Self { reference: Some(reference), ..self }
    }

    /// The subject, which must keep these promises instead of the definition.
    pub fn promising(self, promises: &Promises) -> Self {
        Self { promises: promises.clone(), ..self }
    }

    /// The mesh as a tree.
    pub fn tree(&self) -> &Tree {
        self.pass.tree.as_ref().expect("without a tree, no check of it runs")
    }

    /// A finding if the tree of the mesh exceeds its limit, so that no check of it can run. Without T0, checks show what the leaves alone show.
    pub(super) fn capacity(&self) -> Option<CheckResult> {
        let mut result = CheckResult::new(CAPACITY);
        if self.pass.tree.is_none() {
            let why = "and was not checked; increase the limit";
            result.report(format_args!("a tree has more distinct octants than the limit {why}"));
        } else if self.case.is_some() && !self.promises.is_empty() && self.truth().is_none() {
            let why = "so the other checks compare the mesh with the inputs of the case, but not with its facets";
            result
                .lacks(format!("T0 of the case has more than {} leaves, {why}", Truth::LEAVES_MAX));
        }
        (!result.holds() || !result.was_run()).then_some(result)
    }

    /// The mesh together with the deleted crossing leaves of T0, if the case is known. If gradation may have refined
    /// them before they were deleted (because a box is finer than the surface), their kind is [`DELETED`]. A mesh whose sides
    /// are unknown gets those of T0.
    pub fn tree_with_deleted(&self) -> &Tree {
        let unknown = self.terms.sides == Sides::Unknown;
        let Some(truth) = self.truth().filter(|_| !self.terms.keep_crossing || unknown) else {
            return self.tree();
        };
        self.with_deleted.get_or_init(|| {
            let crossing = Side::Crossing as LeafKind;
            let deleted = if self.terms.has_box_finer_than_surface() { DELETED } else { crossing };
            let mut builder = Builder::default();
            truth.leaves(self.tree(), &mut |Found { octant, kinds, base }| {
                let kind = match kinds {
                    HOLES if base == Some(crossing) && !self.terms.keep_crossing => deleted,
                    HOLES => return,
                    _ if unknown => base.map_or(Side::Outside, Truth::side) as LeafKind,
                    kind => kind.trailing_zeros() as LeafKind,
                };
                builder.push_leaf(word::key_of(octant.corner), octant.level, kind);
            });
            builder.finish()
        })
    }

    /// T0 of the case with the sides of its leaves; `None` without a case, or if it is too large.
    pub fn truth(&self) -> Option<&Truth> {
        let case = self.case?;
        self.truth.get_or_init(|| Truth::of(case, &self.inputs)).as_ref()
    }

    /// Whether the mesh must be the tree after gradation.
    pub(super) fn is_final(&self) -> bool {
        self.inputs.tree == Kind::Final
    }

    /// What a check that compares the mesh with T0 examines: its leaves or, if there are none, those of T0.
    pub(super) fn examined_with(&self, truth: &Truth) -> u64 {
        let leaves = self.pass.tally.leaves;
        if leaves > 0 { leaves } else { truth.words.len() as u64 }
    }
}
