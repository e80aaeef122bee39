//! A corruption: its name, the check that must detect it, and a function that makes it.

use std::path::Path;

use super::SelftestCase;
use contract::leafset::LeafSet;

/// A way to corrupt a correct mesh.
#[derive(Clone, Copy, Debug)]
pub struct Mutant {
    /// Description of the change.
    pub name: &'static str,
    /// The check that must report it.
    pub expected: &'static str,
    /// Whether the check of that name in the audit must report it, too.
    pub audit: bool,
    /// Makes the corruption; `None` if it does not apply.
    pub make: fn(&SelftestCase) -> Option<Mutation>,
}

/// A corrupted mesh.
#[derive(Clone, Debug)]
pub struct Mutation {
    /// The mesh to write.
    pub mesh: LeafSet,
    /// Its T0.
    pub base: LeafSet,
    /// A change of the files after they were written.
    pub tamper: Option<fn(&Path) -> std::io::Result<()>>,
}

impl Mutation {
    /// The mesh without a change.
    pub fn of(correct: &SelftestCase) -> Self {
        Self { mesh: correct.mesh.clone(), base: correct.base.clone(), tamper: None }
    }

    /// Other leaves, with a manifest that agrees with them: no check shall detect the change by a digest.
    pub(super) fn with_words(correct: &SelftestCase, words: Vec<u64>) -> Self {
        let mesh = super::edit::with_words(&correct.mesh, words);
        Self { mesh, ..Self::of(correct) }
    }

    /// The same mesh with changed files.
    pub(super) fn tampered(
        correct: &SelftestCase,
        tamper: fn(&Path) -> std::io::Result<()>,
    ) -> Self {
        Self { tamper: Some(tamper), ..Self::of(correct) }
    }
}

/// A corruption that the leaves alone show: the audit must report it, too.
pub(super) const fn audited(
    name: &'static str,
    expected: &'static str,
    make: fn(&SelftestCase) -> Option<Mutation>,
) -> Mutant {
    Mutant { name, expected, audit: true, make }
}

/// A corruption that only the case, T0 or another mesh shows.
pub(super) const fn informed(
    name: &'static str,
    expected: &'static str,
    make: fn(&SelftestCase) -> Option<Mutation>,
) -> Mutant {
    Mutant { name, expected, audit: false, make }
}
