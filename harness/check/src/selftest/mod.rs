//! Tests of the checks: correct meshes are corrupted, and the check that is responsible for a corruption must
//! report it.
//!
//! A corruption that the responsible check misses is a gap in that check, even if another check reports it,
//! because the next corruption may be in the domain of that check only. A finding on an uncorrupted mesh is a
//! false alarm and fails the self test, too.

use std::fmt;
use std::fs;
use std::path::Path;

use crate::audit::{self, AuditOptions};
use crate::checks::{self, CheckResult, Subject};
use contract::case::Case;
use contract::leafset::{self, LeafSet};

mod base;
mod edit;
mod files;
mod grading;
mod kept;
mod leaves;
mod manifests;
mod mutant;
pub mod scale;
mod sides;
mod table;

pub use mutant::{Mutant, Mutation};

/// The built-in cases, by name, as case files: every corruption applies to at least one of them.
pub const CASES: [(&str, &str); 6] = [
    ("outside", include_str!("../../../selftest-cases/outside.toml")),
    ("inside", include_str!("../../../selftest-cases/inside.toml")),
    ("all", include_str!("../../../selftest-cases/all.toml")),
    ("boxes", include_str!("../../../selftest-cases/boxes.toml")),
    ("enclosed", include_str!("../../../selftest-cases/enclosed.toml")),
    ("seeds", include_str!("../../../selftest-cases/seeds.toml")),
];

/// All corruptions.
pub fn catalogue() -> Vec<Mutant> {
    [
        leaves::MUTANTS,
        sides::MUTANTS,
        kept::MUTANTS,
        base::MUTANTS,
        grading::MUTANTS,
        manifests::MUTANTS,
        files::MUTANTS,
    ]
    .concat()
}

/// A correct mesh with its case and T0: the starting point of corruptions.
#[derive(Clone, Debug)]
pub struct SelftestCase {
    /// The case.
    pub case: Case,
    /// The final mesh.
    pub mesh: LeafSet,
    /// The base tree T0.
    pub base: LeafSet,
}

/// The result of one trial: a corruption of one mesh.
#[derive(Clone, Debug)]
pub struct Kill {
    /// Name of the corruption.
    pub mutant: &'static str,
    /// Name of the case.
    pub case: String,
    /// The check that must report it.
    pub expected: &'static str,
    /// Checks that reported it.
    pub caught_by: Vec<&'static str>,
    /// Whether the audit must report it, too, because the leaves alone show it.
    pub audit_expected: bool,
    /// Checks of the audit that reported it.
    pub audit_caught_by: Vec<&'static str>,
    /// First finding of the check that must report it.
    pub finding: Option<String>,
}

impl Kill {
    /// Whether the expected check reported it, in the audit as well if that is expected.
    pub fn killed(&self) -> bool {
        let audited = !self.audit_expected || self.audit_caught_by.contains(&self.expected);
        self.caught_by.contains(&self.expected) && audited
    }
}

/// The result of the self test.
#[derive(Clone, Debug, Default)]
pub struct SelftestReport {
    /// One entry per corruption and mesh to which it applies.
    pub kills: Vec<Kill>,
    /// Findings on correct meshes, which are false alarms.
    pub alarms: Vec<String>,
    /// Corruptions that applied to no mesh.
    pub unused: Vec<&'static str>,
    /// Corruptions that were not tried, with the reason.
    pub left_out: Vec<(&'static str, String)>,
}

impl SelftestReport {
    /// Whether every corruption applied and was reported, and there were no false alarms.
    pub fn holds(&self) -> bool {
        let alarmed = !self.alarms.is_empty() || !self.unused.is_empty() || self.kills.is_empty();
        !alarmed && self.kills.iter().all(Kill::killed)
    }

    /// Number of trials in which the audit reported a finding.
    pub fn found_by_audit(&self) -> usize {
        self.kills.iter().filter(|kill| !kill.audit_caught_by.is_empty()).count()
    }
}

impl fmt::Display for SelftestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        table::write(self, f)
    }
}

/// Applies every corruption to every mesh to which it applies. `scratch` is an existing empty directory.
///
/// # Errors
/// If a file in `scratch` cannot be written or read.
pub fn run(cases: &[SelftestCase], scratch: &Path) -> std::io::Result<SelftestReport> {
    let mut report = SelftestReport::default();
    let cases: Vec<SelftestCase> = cases.iter().map(edit::in_parts).collect();
    for correct in &cases {
        let unchanged = Mutation::of(correct);
        let examined = examine(correct, &unchanged, &scratch.join("unchanged"))?;
        let results = examined.checks.into_iter().chain(examined.audit);
        let alarms = results.filter(|r| !r.holds());
        report.alarms.extend(alarms.map(|r| format!("{}: {r}", correct.case.name)));
    }
    for mutant in catalogue() {
        let kills = report.kills.len();
        for correct in &cases {
            if let Some(mutation) = (mutant.make)(correct) {
                let examined = examine(correct, &mutation, &scratch.join("mutant"))?;
                report.kills.push(kill(&mutant, correct, &examined));
            }
        }
        if report.kills.len() == kills {
            report.unused.push(mutant.name);
        }
    }
    Ok(report)
}

/// The results of checks and audit for one mutation.
struct Examined {
    checks: Vec<CheckResult>,
    audit: Vec<CheckResult>,
}

/// Writes a mutation into `dir`, checks and audits it, and removes `dir`.
fn examine(correct: &SelftestCase, mutation: &Mutation, dir: &Path) -> std::io::Result<Examined> {
    fs::create_dir(dir)?;
    mutation.mesh.write(dir)?;
    if let Some(tamper) = mutation.tamper {
        tamper(dir)?;
    }
    let checks = match leafset::read(dir) {
        Err(e) => vec![CheckResult::unreadable(&e)],
        Ok(mesh) => {
            let subject = Subject::new(&correct.case, &mesh).with_base(&mutation.base);
            checks::all(&subject.with_reference(&correct.mesh))
        }
    };
    let audit = audit::audit(dir, &AuditOptions::default()).checks;
    fs::remove_dir_all(dir)?;
    Ok(Examined { checks, audit })
}

fn kill(mutant: &Mutant, correct: &SelftestCase, examined: &Examined) -> Kill {
    let failed = |results: &[CheckResult]| -> Vec<&'static str> {
        results.iter().filter(|r| !r.holds()).map(|r| r.name).collect()
    };
    let expected = examined.checks.iter().find(|r| r.name == mutant.expected);
    Kill {
        mutant: mutant.name,
        case: correct.case.name.clone(),
        expected: mutant.expected,
        caught_by: failed(&examined.checks),
        audit_expected: mutant.audit,
        audit_caught_by: failed(&examined.audit),
        finding: expected.and_then(|r| r.findings.first()).map(|f| f.detail.clone()),
    }
}
