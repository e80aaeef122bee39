//! Tests of the checks: correct meshes are corrupted, and the check that is responsible for a corruption must
//! report it.
//!
//! A corruption that the responsible check misses is a gap in that check, even if another check reports it,
//! because the next corruption may be in the domain of that check only. A finding on an uncorrupted mesh is a
//! false alarm and fails the self test, too. The audit of the mesh with its case must report every corruption of the mesh.
//!
//! Invariants of a report: every corruption of the catalogue was tried or applies to no mesh, and no other was; the expected
//! check has a finding iff it reported the corruption.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::Path;

use crate::audit;
use crate::checks::{self, CheckResult, Subject};
use crate::promises::Promises;
use contract::case::Case;
use contract::leafset::{self, LeafSet};

mod base;
mod files;
mod grading;
mod leaves;
mod mutant;
mod sides;

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
    [leaves::MUTANTS, sides::MUTANTS, base::MUTANTS, grading::MUTANTS, files::MUTANTS].concat()
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
    /// Whether the audit with the case misses it, although the mesh on disk is another one.
    pub whole_audit_missed: bool,
    /// First finding of the check that must report it.
    pub finding: Option<String>,
}

impl Kill {
    /// Whether the expected check reported it, in the audit as well if that is expected. An audit with the case must report any
    /// corruption of the mesh.
    pub fn killed(&self) -> bool {
        let audited = !self.audit_expected || self.audit_caught_by.contains(&self.expected);
        self.caught_by.contains(&self.expected) && audited && !self.whole_audit_missed
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
}

impl SelftestReport {
    /// Whether every corruption applied and was reported, and there were no false alarms.
    pub fn holds(&self) -> bool {
        let is_idle = self.kills.is_empty() || !self.unused.is_empty();
        !is_idle && self.alarms.is_empty() && self.kills.iter().all(Kill::killed)
    }

    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        for mutant in catalogue() {
            let mut trials = self.kills.iter().filter(|kill| kill.mutant == mutant.name).peekable();
            let is_unused = self.unused.contains(&mutant.name);
            assert!(
                trials.peek().is_some() != is_unused,
                "{} was tried, or it applies nowhere",
                mutant.name
            );
            for kill in trials {
                assert_eq!(kill.expected, mutant.expected, "the check for {}", mutant.name);
                let by_expected = kill.caught_by.contains(&kill.expected);
                assert_eq!(kill.finding.is_some(), by_expected, "the finding for {}", mutant.name);
            }
        }
        let names: Vec<&str> = catalogue().iter().map(|mutant| mutant.name).collect();
        let known = |name: &&str| names.contains(name);
        assert!(
            self.kills.iter().map(|kill| &kill.mutant).all(known),
            "a corruption of no catalogue"
        );
        assert!(self.unused.iter().all(known), "a corruption of no catalogue: {:?}", self.unused);
    }
}

/// What survived, false alarms, what applies nowhere, and a summary.
impl fmt::Display for SelftestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let survivors: Vec<&Kill> = self.kills.iter().filter(|kill| !kill.killed()).collect();
        survivors.iter().try_for_each(|kill| writeln!(f, "SURVIVED: {kill:?}"))?;
        for alarm in &self.alarms {
            writeln!(f, "FALSE ALARM on a correct mesh: {alarm}")?;
        }
        self.unused.iter().try_for_each(|name| writeln!(f, "applies to no case: {name}"))?;
        let names: BTreeSet<_> = self.kills.iter().map(|k| k.mutant).collect();
        let (corruptions, trials, alarms) = (names.len(), self.kills.len(), self.alarms.len());
        write!(
            f,
            "{corruptions} corruptions in {trials} trials: {} survived, {alarms} false alarms",
            survivors.len()
        )
    }
}

/// Applies every corruption to every mesh to which it applies. `scratch` is an existing empty directory.
///
/// # Errors
/// If a file in `scratch` cannot be written or read.
pub fn run(cases: &[SelftestCase], scratch: &Path) -> std::io::Result<SelftestReport> {
    let mut report = SelftestReport::default();
    let cases: Vec<SelftestCase> = cases.iter().map(mutant::in_parts).collect();
    for correct in &cases {
        let unchanged = Mutation::of(correct);
        let examined = examine(correct, &unchanged, &scratch.join("unchanged"))?;
        let alarms = examined.iter().flatten().filter(|result| !result.holds());
        report.alarms.extend(alarms.map(|r| format!("{}: {r}", correct.case.name)));
    }
    for mutant in catalogue() {
        let kills = report.kills.len();
        for correct in &cases {
            if let Some(mutation) = mutant.make(correct) {
                let examined = examine(correct, &mutation, &scratch.join("mutant"))?;
                report.kills.push(kill(&mutant, correct, &mutation, &examined));
            }
        }
        if report.kills.len() == kills {
            report.unused.push(mutant.name);
        }
    }
    report.check_invariants();
    Ok(report)
}

/// The results of the checks, of the audit, and of the audit with the case.
type Examined = [Vec<CheckResult>; 3];

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
    let audit = audit::audit(dir).checks;
    let definition = Promises::of_definition();
    let whole = audit::audit_against(dir, Some(&correct.case), &definition).checks;
    fs::remove_dir_all(dir)?;
    Ok([checks, audit, whole])
}

fn kill(
    mutant: &Mutant,
    correct: &SelftestCase,
    mutation: &Mutation,
    [checks, audit, whole]: &Examined,
) -> Kill {
    let failed = |results: &[CheckResult]| -> Vec<&'static str> {
        results.iter().filter(|r| !r.holds()).map(|r| r.name).collect()
    };
    let expected = checks.iter().find(|r| r.name == mutant.expected);
    let (before, after) = (&correct.mesh, &mutation.mesh);
    let is_of_mesh = mutation.tamper.is_some()
        || (&before.manifest, &before.parts) != (&after.manifest, &after.parts);
    Kill {
        mutant: mutant.name,
        case: correct.case.name.clone(),
        expected: mutant.expected,
        caught_by: failed(checks),
        audit_expected: mutant.audit,
        audit_caught_by: failed(audit),
        whole_audit_missed: is_of_mesh && failed(whole).is_empty(),
        finding: expected.and_then(|r| r.findings.first()).cloned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A report in which every corruption was tried once and reported.
    fn correct() -> SelftestReport {
        let kill = |mutant: &Mutant| Kill {
            mutant: mutant.name,
            case: "a case".to_owned(),
            expected: mutant.expected,
            caught_by: vec![mutant.expected],
            audit_expected: mutant.audit,
            audit_caught_by: vec![mutant.expected],
            whole_audit_missed: false,
            finding: Some("a finding".to_owned()),
        };
        let kills = catalogue().iter().map(kill).collect();
        SelftestReport { kills, ..SelftestReport::default() }
    }

    #[test]
    fn a_report_that_contradicts_itself_is_a_bug() {
        correct().check_invariants();
        assert!(correct().holds());
        let faults: [fn(&mut SelftestReport); 6] = [
            |r| drop(r.kills.pop()),
            |r| r.unused.push(r.kills[0].mutant),
            |r| r.kills[0].expected = "files",
            |r| r.kills[0].caught_by.clear(),
            |r| r.kills[0].finding = None,
            |r| r.unused.push("another"),
        ];
        for (i, fault) in faults.iter().enumerate() {
            let mut wrong = correct();
            fault(&mut wrong);
            let seen = std::panic::catch_unwind(|| wrong.check_invariants());
            assert!(seen.is_err(), "fault {i}");
        }
    }

    #[test]
    fn a_corruption_that_the_audit_with_the_case_misses_survives() {
        let mut report = correct();
        report.kills[0].whole_audit_missed = true;
        assert!(!report.holds() && report.to_string().starts_with("SURVIVED: Kill"));
    }

    #[test]
    fn a_report_lists_survivors_and_alarms_and_counts_corruptions_and_trials() {
        let mut report = correct();
        let corruptions = report.kills.len();
        report.kills.push(report.kills[0].clone());
        let counts = format!("{corruptions} corruptions in {} trials", corruptions + 1);
        assert_eq!(report.to_string(), format!("{counts}: 0 survived, 0 false alarms"));
        report.kills[1].caught_by.clear();
        report.alarms.push("an alarm".to_owned());
        report.unused.push("unused");
        let (text, counts) = (report.to_string(), format!("{counts}: 1 survived, 1 false alarms"));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("SURVIVED: Kill"), "{text}");
        let rest =
            ["FALSE ALARM on a correct mesh: an alarm", "applies to no case: unused", &counts];
        assert_eq!(lines[1..], rest);
    }
}
