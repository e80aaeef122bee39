//! A corruption: its name, the check that must detect it, and what it changes.

use std::io;
use std::path::Path;

use super::SelftestCase;
use super::edit::with_words;
use contract::leafset::LeafSet;
use contract::manifest::Manifest;

/// A way to corrupt a correct mesh.
#[derive(Clone, Copy, Debug)]
pub struct Mutant {
    /// Description of the change.
    pub name: &'static str,
    /// The check that must report it.
    pub expected: &'static str,
    /// Whether the check of that name in the audit must report it, too.
    pub audit: bool,
    pub(super) change: Change,
}

/// In place of `audit`: the leaves alone show the corruption.
pub(super) const AUDITED: bool = true;
/// In place of `audit`: only the case, T0 or another mesh shows the corruption.
pub(super) const INFORMED: bool = false;

/// What a corruption changes. `None` if it does not apply.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// The leaves of the mesh, with a manifest that agrees with them: no check shall detect the change by a digest.
    Words(fn(&SelftestCase) -> Option<Vec<u64>>),
    /// The leaves of T0, likewise.
    Base(fn(&SelftestCase) -> Option<Vec<u64>>),
    /// Both, likewise.
    Both(fn(&SelftestCase) -> Option<[Vec<u64>; 2]>),
    /// The manifest of the mesh.
    Manifest(fn(&mut Manifest)),
    /// The files of the mesh.
    Files(fn(&Path) -> io::Result<()>),
    /// Anything.
    Sets(fn(&SelftestCase, &mut Mutation) -> Option<()>),
}

/// A corrupted mesh.
#[derive(Clone, Debug)]
pub struct Mutation {
    /// The mesh to write.
    pub mesh: LeafSet,
    /// Its T0.
    pub base: LeafSet,
    /// A change of the files after they were written.
    pub tamper: Option<fn(&Path) -> io::Result<()>>,
}

impl Mutation {
    /// The mesh without a change.
    pub fn of(correct: &SelftestCase) -> Self {
        Self { mesh: correct.mesh.clone(), base: correct.base.clone(), tamper: None }
    }
}

impl Mutant {
    /// The corrupted mesh; `None` if the corruption does not apply.
    pub fn make(&self, correct: &SelftestCase) -> Option<Mutation> {
        let mut made = Mutation::of(correct);
        match self.change {
            Change::Words(words) => made.mesh = with_words(&correct.mesh, words(correct)?),
            Change::Base(words) => made.base = with_words(&correct.base, words(correct)?),
            Change::Both(words) => {
                let [mesh, base] = words(correct)?;
                (made.mesh, made.base) =
                    (with_words(&correct.mesh, mesh), with_words(&correct.base, base));
            }
            Change::Manifest(edit) => edit(&mut made.mesh.manifest),
            Change::Files(tamper) => {
                // Both parts have enough leaves for the damage to have an effect.
                let are_enough = |part: &Vec<u64>| (2..1 << 20).contains(&part.len());
                correct.mesh.parts[1..].iter().all(are_enough).then_some(())?;
                made.tamper = Some(tamper);
            }
            Change::Sets(change) => change(correct, &mut made)?,
        }
        Some(made)
    }
}

macro_rules! rows {
    ($($function:ident: $change:ident($type:ty);)*) => {$(
        /// A row of the tables.
        pub(super) const fn $function(
            name: &'static str, expected: &'static str, audit: bool, change: $type,
        ) -> Mutant {
            Mutant { name, expected, audit, change: Change::$change(change) }
        }
    )*};
}

rows! {
    words: Words(fn(&SelftestCase) -> Option<Vec<u64>>);
    base: Base(fn(&SelftestCase) -> Option<Vec<u64>>);
    both: Both(fn(&SelftestCase) -> Option<[Vec<u64>; 2]>);
    sets: Sets(fn(&SelftestCase, &mut Mutation) -> Option<()>);
}
