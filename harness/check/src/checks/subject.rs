//! The mesh that the checks examine, with everything that they may use.

use std::cell::OnceCell;

use super::Terms;
use super::components::{self, Component};
use super::facets::Facets;
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::tree::{Builder, DELETED, Tree};
use contract::word::{self, Side};

/// A mesh and its case, with T0 and a reference if they are known. Trees are built when a check first needs them.
pub struct Subject<'a> {
    /// The case.
    pub case: &'a Case,
    /// The requirements of the case.
    pub terms: Terms,
    /// The final mesh.
    pub mesh: &'a LeafSet,
    /// T0: all leaves with their sides.
    pub base: Option<&'a LeafSet>,
    /// The mesh that `mesh` must equal.
    pub reference: Option<&'a LeafSet>,
    tree: OnceCell<Tree>,
    tree_base: OnceCell<Tree>,
    tree_with_deleted: OnceCell<Tree>,
    components: OnceCell<(Vec<u64>, Vec<Component>)>,
    facets: OnceCell<Facets>,
}

impl<'a> Subject<'a> {
    /// The mesh of a case.
    pub fn new(case: &'a Case, mesh: &'a LeafSet) -> Self {
        Self {
            case,
            terms: Terms::of_case(case),
            mesh,
            base: None,
            reference: None,
            tree: OnceCell::new(),
            tree_base: OnceCell::new(),
            tree_with_deleted: OnceCell::new(),
            components: OnceCell::new(),
            facets: OnceCell::new(),
        }
    }

    /// The subject, which has none yet, with its base tree.
    pub fn with_base(self, base: &'a LeafSet) -> Self {
        debug_assert!(self.base.is_none(), "what was found out with another base tree is kept");
        Self { base: Some(base), ..self }
    }

    /// The subject with the mesh that it must equal.
    pub fn with_reference(self, reference: &'a LeafSet) -> Self {
        Self { reference: Some(reference), ..self }
    }

    /// The final mesh as a tree.
    pub fn tree(&self) -> &Tree {
        self.tree.get_or_init(|| Tree::of_words(&self.mesh.words))
    }

    /// T0 as a tree, if it is known.
    pub fn tree_base(&self) -> Option<&Tree> {
        self.base.map(|b| self.tree_base.get_or_init(|| Tree::of_words(&b.words)))
    }

    /// The final mesh together with the deleted crossing leaves of T0, if T0 is known. If gradation may have
    /// refined them before they were deleted (because a box is finer than the surface), their kind is
    /// [`DELETED`].
    pub fn tree_with_deleted(&self) -> &Tree {
        let Some(base) = self.base.filter(|_| !self.terms.keep_crossing) else {
            return self.tree();
        };
        self.tree_with_deleted.get_or_init(|| {
            let crossing = Side::Crossing as u8;
            let kind = if self.terms.has_box_finer_than_surface() { DELETED } else { crossing };
            let deleted = base.words.iter().filter(|&&w| (w & 3) as u8 == crossing);
            let mut all: Vec<_> = self.mesh.words.iter().map(|&w| (w, (w & 3) as u8)).collect();
            all.extend(deleted.map(|&w| (w, kind)));
            all.sort_unstable();
            let mut builder = Builder::default();
            for (w, kind) in all.into_iter().filter(|&(w, _)| word::fault(w).is_none()) {
                // `linear` and `complete` report overlaps.
                let _ = builder.push_leaf(word::key(w), word::level(w), kind);
            }
            builder.finish()
        })
    }

    /// The valid leaves of T0 and their components, if T0 is known.
    pub(super) fn components(&self) -> Option<(&[u64], &[Component])> {
        let base = self.base?;
        let (words, found) = self.components.get_or_init(|| {
            let words = valid_leaves(&base.words);
            let found = components::find(&words, &self.terms, &self.case.facets_lattice);
            (words, found)
        });
        Some((words, found))
    }

    /// The case's facets, prepared for crossing tests.
    pub(super) fn facets(&self) -> &Facets {
        self.facets.get_or_init(|| Facets::new(&self.case.facets_lattice))
    }
}

/// The sorted words that are leaves and overlap no earlier one. A check that needs a linear mesh continues with
/// these; `linear` reports the others.
pub(crate) fn valid_leaves(words: &[u64]) -> Vec<u64> {
    let mut builder = Builder::default();
    words.iter().copied().filter(|&w| builder.push(w).is_ok()).collect()
}
