//! A corruption: its name, the check meant for it, and how it is made.

use std::path::Path;

use super::Specimen;
use contract::leafset::LeafSet;

/// A way to corrupt a correct mesh.
#[derive(Clone, Copy, Debug)]
pub struct Mutant {
    /// What is done.
    pub name: &'static str,
    /// The check that must report it.
    pub meant: &'static str,
    /// Whether the audit's check of that name must report it too.
    pub audit: bool,
    /// Makes the corruption, or nothing where it does not apply.
    pub make: fn(&Specimen) -> Option<Mutation>,
}

/// A corrupted mesh.
#[derive(Clone, Debug)]
pub struct Mutation {
    /// The mesh as it is to be written.
    pub mesh: LeafSet,
    /// The T0 that goes with it.
    pub base: LeafSet,
    /// What is done to the files afterwards.
    pub tamper: Option<fn(&Path) -> std::io::Result<()>>,
}

impl Mutation {
    /// Nothing corrupted yet.
    pub fn of(specimen: &Specimen) -> Self {
        Self { mesh: specimen.mesh.clone(), base: specimen.base.clone(), tamper: None }
    }

    /// Other leaves, with a manifest true to them: no check is to be helped by a digest.
    pub(super) fn with_words(specimen: &Specimen, words: Vec<u64>) -> Self {
        let mesh = super::surgery::with_words(&specimen.mesh, words);
        Self { mesh, ..Self::of(specimen) }
    }

    /// The same mesh, its files tampered with.
    pub(super) fn tampered(specimen: &Specimen, tamper: fn(&Path) -> std::io::Result<()>) -> Self {
        Self { tamper: Some(tamper), ..Self::of(specimen) }
    }
}

/// Seen by the leaves alone: the audit must report it too.
pub(super) const fn audited(
    name: &'static str,
    meant: &'static str,
    make: fn(&Specimen) -> Option<Mutation>,
) -> Mutant {
    Mutant { name, meant, audit: true, make }
}

/// Seen only with the case, T0 or another mesh.
pub(super) const fn informed(
    name: &'static str,
    meant: &'static str,
    make: fn(&Specimen) -> Option<Mutation>,
) -> Mutant {
    Mutant { name, meant, audit: false, make }
}
