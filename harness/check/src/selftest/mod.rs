//! The checks put to the test: corruptions of a correct mesh, each of which the check meant for it
//! must report.
//!
//! A corruption that the check meant for it lets pass is a hole in that check, even where another one
//! notices: the next corruption may be seen by that check alone. A finding on a mesh that nobody
//! corrupted is a false alarm and fails the self test as well.

use std::fmt;
use std::fs;
use std::path::Path;

use crate::audit::{self, AuditOptions};
use crate::checks::{self, CheckResult, Subject};
use contract::case::Case;
use contract::leafset::{self, LeafSet};

mod base;
mod claims;
mod files;
mod grading;
mod leaves;
mod mutant;
pub mod scale;
mod sides;
mod surgery;
mod table;

pub use mutant::{Mutant, Mutation};

/// All corruptions there are.
pub fn catalogue() -> Vec<Mutant> {
    [
        leaves::MUTANTS,
        sides::MUTANTS,
        base::MUTANTS,
        grading::MUTANTS,
        claims::MUTANTS,
        files::MUTANTS,
    ]
    .concat()
}

/// A correct result: what corruptions start from.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// What was meshed.
    pub case: Case,
    /// Its final mesh.
    pub mesh: LeafSet,
    /// Its T0.
    pub base: LeafSet,
}

/// What became of one corruption.
#[derive(Clone, Debug)]
pub struct Kill {
    /// What was done to the mesh.
    pub mutant: &'static str,
    /// The case it was done to.
    pub case: String,
    /// The check meant for it.
    pub meant: &'static str,
    /// Checks that reported it.
    pub caught_by: Vec<&'static str>,
    /// Whether the audit, too, must report it: the leaves alone show it.
    pub audit_meant: bool,
    /// Checks of the audit that reported it.
    pub audit_caught_by: Vec<&'static str>,
    /// First finding of the check meant for it.
    pub finding: Option<String>,
}

impl Kill {
    /// Whether the check meant for it reported it, in the audit as well where that is meant.
    pub fn killed(&self) -> bool {
        let audited = !self.audit_meant || self.audit_caught_by.contains(&self.meant);
        self.caught_by.contains(&self.meant) && audited
    }
}

/// What the self test found.
#[derive(Clone, Debug, Default)]
pub struct SelftestReport {
    /// One for each corruption and specimen that it applies to.
    pub kills: Vec<Kill>,
    /// Findings on correct meshes: false alarms.
    pub alarms: Vec<String>,
    /// Corruptions that applied to no specimen.
    pub unused: Vec<&'static str>,
    /// Corruptions that were not tried, and why.
    pub left_out: Vec<(&'static str, String)>,
}

impl SelftestReport {
    /// Whether every corruption applied and was reported, and no correct mesh was.
    pub fn holds(&self) -> bool {
        self.alarms.is_empty() && self.unused.is_empty() && self.kills.iter().all(Kill::killed)
    }

    /// Trials in which the audit reported something.
    pub fn found_by_audit(&self) -> usize {
        self.kills.iter().filter(|kill| !kill.audit_caught_by.is_empty()).count()
    }
}

impl fmt::Display for SelftestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        table::write(self, f)
    }
}

/// Corrupts each specimen in every way that applies to it; `scratch` is an existing empty directory.
/// Each corruption must apply to at least one specimen.
pub fn run(specimens: &[Specimen], scratch: &Path) -> std::io::Result<SelftestReport> {
    let mut report = SelftestReport::default();
    let whole: Vec<Specimen> = specimens.iter().map(surgery::in_parts).collect();
    for specimen in &whole {
        let nothing = Mutation::of(specimen);
        let examined = examine(specimen, &nothing, &scratch.join("unharmed"))?;
        let results = examined.checks.into_iter().chain(examined.audit);
        let alarms = results.filter(|r| !r.holds());
        report.alarms.extend(alarms.map(|r| format!("{}: {r}", specimen.case.name)));
    }
    for mutant in catalogue() {
        let kills = report.kills.len();
        for specimen in &whole {
            if let Some(mutation) = (mutant.make)(specimen) {
                let examined = examine(specimen, &mutation, &scratch.join("mutant"))?;
                report.kills.push(kill(&mutant, specimen, &examined));
            }
        }
        if report.kills.len() == kills {
            report.unused.push(mutant.name);
        }
    }
    Ok(report)
}

/// What checks and audit say of one mutation.
struct Examined {
    checks: Vec<CheckResult>,
    audit: Vec<CheckResult>,
}

/// Writes a mutation into `dir`, has it checked, and removes it.
fn examine(specimen: &Specimen, mutation: &Mutation, dir: &Path) -> std::io::Result<Examined> {
    fs::create_dir(dir)?;
    mutation.mesh.write(dir)?;
    if let Some(tamper) = mutation.tamper {
        tamper(dir)?;
    }
    let checks = match leafset::read(dir) {
        Err(e) => vec![CheckResult::unreadable(&e)],
        Ok(mesh) => {
            let subject = Subject::new(&specimen.case, &mesh).with_base(&mutation.base);
            checks::all(&subject.with_reference(&specimen.mesh))
        }
    };
    let audit = audit::audit(dir, &AuditOptions::default()).checks;
    fs::remove_dir_all(dir)?;
    Ok(Examined { checks, audit })
}

fn kill(mutant: &Mutant, specimen: &Specimen, examined: &Examined) -> Kill {
    let failed = |results: &[CheckResult]| -> Vec<&'static str> {
        results.iter().filter(|r| !r.holds()).map(|r| r.name).collect()
    };
    let meant = examined.checks.iter().find(|r| r.name == mutant.meant);
    Kill {
        mutant: mutant.name,
        case: specimen.case.name.clone(),
        meant: mutant.meant,
        caught_by: failed(&examined.checks),
        audit_meant: mutant.audit,
        audit_caught_by: failed(&examined.audit),
        finding: meant.and_then(|r| r.findings.first()).map(|f| f.detail.clone()),
    }
}
