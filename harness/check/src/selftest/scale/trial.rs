//! One trial: a corruption is planted in a mesh, and the result is audited.

use super::distributed::{DistributedMesh, Window};
use super::global::GlobalChange;
use super::plant::{self, Plan};
use crate::audit::{self, AuditOptions};
use crate::checks::CheckResult;
use crate::diff;
use crate::selftest::{Kill, Mutant};
use contract::digest::mix;
use contract::leafset;
use std::fs;
use std::io;
use std::path::Path;

/// Number of windows that are tried before a corruption is left out.
const WINDOWS: u64 = 100;
/// Name of the comparison with the original mesh, after the check in `harness verify`.
const IDENTICAL: &str = "identical";

/// A corruption of a mesh.
pub(super) struct Trial<'a> {
    pub(super) original: &'a DistributedMesh,
    pub(super) mutant: &'a Mutant,
    pub(super) seed: u64,
    /// Directory for the corrupted mesh, which exists only during the trial.
    pub(super) dir: &'a Path,
}

/// The outcome of a trial.
#[derive(Debug)]
pub(super) enum Outcome {
    /// The corruption was planted and audited.
    Planted(Kill),
    /// The corruption was left out, with the reason.
    LeftOut(String),
}

impl Trial<'_> {
    /// Runs the trial.
    pub(super) fn run(&self) -> io::Result<Outcome> {
        if let Some(change) = GlobalChange::named(self.mutant.name, self.original)? {
            let planted = match change {
                Some(change) => plant::apply_globally(self.original, &change, self.dir)?,
                None => false,
            };
            return if planted { self.examine() } else { Ok(self.not_applicable("this mesh")) };
        }
        match self.find_window()? {
            None => Ok(self.not_applicable(&format!("{WINDOWS} windows of this mesh"))),
            Some((_, Plan::Nothing)) => {
                Ok(Outcome::LeftOut("it changes T0 only, which is not part of a mesh".to_owned()))
            }
            Some((window, plan)) => {
                plan.apply(self.original, &window, self.dir)?;
                self.examine()
            }
        }
    }

    fn not_applicable(&self, subject: &str) -> Outcome {
        let without_base = if self.original.has_base() {
            ""
        } else {
            "; some corruptions need T0, which is unknown here"
        };
        Outcome::LeftOut(format!("it does not apply to {subject}{without_base}"))
    }

    /// The first window, in an order that depends on the seed, to which the corruption applies.
    fn find_window(&self) -> io::Result<Option<(Window, Plan)>> {
        for attempt in 0..WINDOWS {
            let index = mix(self.seed.wrapping_mul(WINDOWS) + attempt) as u64
                % self.original.leaves().max(1);
            let Some(window) = self.original.window(index)? else { continue };
            if let Some(mutation) = (self.mutant.make)(&window.correct) {
                let plan = Plan::of(&window, mutation);
                return Ok(Some((window, plan)));
            }
        }
        Ok(None)
    }

    /// Audits the corrupted mesh and, if the leaves alone do not show the corruption, compares it with the
    /// original.
    fn examine(&self) -> io::Result<Outcome> {
        let audited = audit::audit(self.dir, &AuditOptions::default()).checks;
        let failed: Vec<&CheckResult> = audited.iter().filter(|c| !c.holds()).collect();
        let audit_caught_by: Vec<&'static str> = failed.iter().map(|c| c.name).collect();
        let mut caught_by = audit_caught_by.clone();
        let mut finding = failed.iter().find(|c| c.name == self.mutant.expected);
        finding = finding.or(failed.first());
        // The directory no longer exists when the finding is printed.
        let directory = format!("{}/", self.dir.display());
        let first = finding.and_then(|c| c.findings.first());
        let mut finding = first.map(|f| f.detail.replace(&directory, ""));
        if !self.mutant.audit
            && let Some(difference) = self.difference()
        {
            caught_by.push(IDENTICAL);
            finding = finding.or(Some(difference));
        }
        fs::remove_dir_all(self.dir)?;
        Ok(Outcome::Planted(Kill {
            mutant: self.mutant.name,
            case: self.original.name().to_owned(),
            expected: if self.mutant.audit { self.mutant.expected } else { IDENTICAL },
            caught_by,
            audit_expected: self.mutant.audit,
            audit_caught_by,
            finding,
        }))
    }

    /// The first difference from the original by the manifests alone.
    fn difference(&self) -> Option<String> {
        let manifest = leafset::read_manifest(self.dir).ok()?;
        let differs = diff::manifests(self.original.manifest(), &manifest);
        let octants = differs.octants.len();
        let digests = (octants > 0)
            .then(|| format!("the digests of {octants} of 512 level-3 octants differ"));
        differs.fields.into_iter().next().or(digests)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::catalogue;
    use crate::selftest::scale::Source;
    use contract::manifest::Manifest;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn a_manifest_differs_in_a_field_or_in_the_digests_of_octants() {
        let place = tempfile::tempdir().unwrap();
        let mesh = place.path().join("given");
        fs::create_dir(&mesh).unwrap();
        leaf_set(vec![words_of(|o| o.level < 3)]).write(&mesh).unwrap();
        let source = Source { name: "given".into(), mesh, base: None };
        let original = DistributedMesh::new(&source, place.path()).unwrap();
        let dir = place.path().join("changed");
        fs::create_dir(&dir).unwrap();
        let difference = |change: fn(&mut Manifest)| {
            let mut manifest = original.manifest().clone();
            change(&mut manifest);
            manifest.write(&dir).unwrap();
            Trial { original: &original, mutant: &catalogue()[0], seed: 0, dir: &dir }.difference()
        };
        assert_eq!(difference(|_| ()), None);
        let digests = difference(|m| m.octant_digests[5..7].iter_mut().for_each(|d| d.0 ^= 1));
        assert_eq!(digests.as_deref(), Some("the digests of 2 of 512 level-3 octants differ"));
        let field = difference(|m| (m.leaves, m.octant_digests[5].0) = (7, 1));
        assert_eq!(field.as_deref(), Some("leaves: 512 in A; 7 in B"));
    }
}
