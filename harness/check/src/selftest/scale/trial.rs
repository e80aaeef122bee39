//! One corruption in one mesh: looked for a place, planted, audited.

use super::everywhere::Everywhere;
use super::plant::{self, Plan};
use super::whole::{Whole, Window};
use crate::audit::{self, AuditOptions};
use crate::checks::CheckResult;
use crate::diff;
use crate::selftest::{Kill, Mutant};
use contract::digest::mix;
use contract::leafset;
use std::fs;
use std::io;
use std::path::Path;

/// Places that are tried before a corruption is left out.
const PLACES: u64 = 100;
/// What the comparison with the untouched mesh is called: the check of that name in `harness verify`.
const IDENTICAL: &str = "identical";

/// What is to be tried.
pub(super) struct Trial<'a> {
    pub(super) whole: &'a Whole,
    pub(super) mutant: &'a Mutant,
    pub(super) seed: u64,
    /// Does not exist before or after.
    pub(super) dir: &'a Path,
}

/// What came of it.
#[derive(Debug)]
pub(super) enum Tried {
    /// It was planted.
    Planted(Kill),
    /// It was not, and why.
    LeftOut(String),
}

impl Trial<'_> {
    pub(super) fn run(&self) -> io::Result<Tried> {
        if let Some(change) = Everywhere::named(self.mutant.name, self.whole)? {
            let planted = match change {
                Some(change) => plant::everywhere(self.whole, &change, self.dir)?,
                None => false,
            };
            return if planted { self.examine() } else { Ok(self.nowhere("this mesh")) };
        }
        match self.place()? {
            None => Ok(self.nowhere(&format!("{PLACES} places of this mesh"))),
            Some((_, Plan::Nothing)) => {
                Ok(Tried::LeftOut("it corrupts T0 only, which a mesh does not hold".to_owned()))
            }
            Some((window, plan)) => {
                plan.carry_out(self.whole, &window, self.dir)?;
                self.examine()
            }
        }
    }

    fn nowhere(&self, places: &str) -> Tried {
        let without =
            if self.whole.has_base() { "" } else { "; some need T0, which is not known here" };
        Tried::LeftOut(format!("{places} offered no occasion for it{without}"))
    }

    /// The first place, in an order that the seed decides, where the corruption applies.
    fn place(&self) -> io::Result<Option<(Window, Plan)>> {
        for attempt in 0..PLACES {
            let index =
                mix(self.seed.wrapping_mul(PLACES) + attempt) as u64 % self.whole.leaves().max(1);
            let Some(window) = self.whole.window(index)? else { continue };
            if let Some(mutation) = (self.mutant.make)(&window.specimen) {
                let plan = Plan::of(&window, mutation);
                return Ok(Some((window, plan)));
            }
        }
        Ok(None)
    }

    /// Audits what was planted, and holds it against the untouched mesh where the audit alone cannot tell.
    fn examine(&self) -> io::Result<Tried> {
        let audited = audit::audit(self.dir, &AuditOptions::default()).checks;
        let failed: Vec<&CheckResult> = audited.iter().filter(|c| !c.holds()).collect();
        let audit_caught_by: Vec<&'static str> = failed.iter().map(|c| c.name).collect();
        let mut caught_by = audit_caught_by.clone();
        let mut finding = failed.iter().find(|c| c.name == self.mutant.meant);
        finding = finding.or(failed.first());
        // Where the trial's files were is nobody's concern any more.
        let place = format!("{}/", self.dir.display());
        let told = finding.and_then(|c| c.findings.first());
        let mut finding = told.map(|f| f.detail.replace(&place, ""));
        if let (false, Ok(manifest)) = (self.mutant.audit, leafset::read_manifest(self.dir)) {
            let differs = diff::manifests(self.whole.manifest(), &manifest);
            let octants = differs.octants.len();
            if !differs.fields.is_empty() || octants > 0 {
                caught_by.push(IDENTICAL);
                let digests = format!("the digests of {octants} of 512 level-3 octants differ");
                finding = finding.or(Some(differs.fields.first().cloned().unwrap_or(digests)));
            }
        }
        fs::remove_dir_all(self.dir)?;
        Ok(Tried::Planted(Kill {
            mutant: self.mutant.name,
            case: self.whole.name().to_owned(),
            meant: if self.mutant.audit { self.mutant.meant } else { IDENTICAL },
            caught_by,
            audit_meant: self.mutant.audit,
            audit_caught_by,
            finding,
        }))
    }
}
