//! Tests of the checks: correct meshes are corrupted, and the check that is responsible for a corruption must
//! report it.
//!
//! A corruption that the responsible check misses is a gap in that check, even if another check reports it,
//! because the next corruption may be in the domain of that check only. A finding on an uncorrupted mesh is a
//! false alarm and fails the self test, too. The audit of the mesh with its case must report every corruption of the mesh.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;
use std::{fmt, fs};

use crate::audit;
use crate::checks::{self, CheckResult, Subject};
use crate::promises::Promises;
use contract::case::Case;
use contract::leafset::{self, LeafSet};
use contract::manifest::Tree;

mod files;
mod grading;
mod leaves;
mod mutant;
mod sides;

pub use mutant::{Mutant, Mutation};

/// The built-in cases, by name, as case files: every corruption applies to at least one of them.
pub fn cases() -> BTreeMap<String, String> {
    let text = |case: &toml::Value| toml::to_string(case).expect("a part of a TOML file");
    let cases: toml::Table = include_str!("cases.toml").parse().expect("a TOML file");
    cases.iter().map(|(name, case)| (name.clone(), text(case))).collect()
}

/// All corruptions.
pub fn catalogue() -> Vec<Mutant> {
    [leaves::MUTANTS, sides::MUTANTS, grading::MUTANTS, files::MUTANTS].concat()
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

impl SelftestCase {
    /// The final mesh or T0.
    pub fn set(&self, tree: Tree) -> &LeafSet {
        if tree == Tree::Base { &self.base } else { &self.mesh }
    }
}

/// The result of one trial: a corruption of one mesh.
#[derive(Clone, Debug)]
pub struct Kill {
    /// The corruption.
    pub mutant: Mutant,
    /// Name of the case.
    pub case: String,
    /// Checks that reported it.
    pub caught_by: Vec<&'static str>,
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
        let Mutant { expected, audit, .. } = self.mutant;
        let audited = !audit || self.audit_caught_by.contains(&expected);
        self.caught_by.contains(&expected) && audited && !self.whole_audit_missed
    }
}

/// The result of the self test.
#[derive(Clone, Debug, Default)]
pub struct SelftestReport {
    /// One entry per corruption and mesh to which it applies.
    pub kills: Vec<Kill>,
    /// Findings on correct meshes, which are false alarms.
    pub alarms: Vec<String>,
}

impl SelftestReport {
    /// Whether every corruption applied and was reported, and there were no false alarms.
    pub fn holds(&self) -> bool {
        self.unused().is_empty() && self.alarms.is_empty() && self.kills.iter().all(Kill::killed)
    }

    /// Corruptions that applied to no mesh.
    pub fn unused(&self) -> Vec<&'static str> {
        let tried: HashSet<&str> = self.kills.iter().map(|kill| kill.mutant.name).collect();
        let names = catalogue().into_iter().map(|mutant| mutant.name);
        names.filter(|name| !tried.contains(name)).collect()
    }
}

/// What survived, false alarms, what applies nowhere, and a summary.
impl fmt::Display for SelftestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let survivors: Vec<&Kill> = self.kills.iter().filter(|kill| !kill.killed()).collect();
        survivors.iter().try_for_each(|kill| writeln!(f, "SURVIVED: {kill:?}"))?;
        let what = "FALSE ALARM on a correct mesh";
        self.alarms.iter().try_for_each(|alarm| writeln!(f, "{what}: {alarm}"))?;
        let unused = self.unused();
        unused.iter().try_for_each(|name| writeln!(f, "applies to no case: {name}"))?;
        let corruptions = catalogue().len() - unused.len();
        let (survived, alarms) = (survivors.len(), self.alarms.len());
        write!(f, "{corruptions} corruptions in {} trials: ", self.kills.len())?;
        write!(f, "{survived} survived, {alarms} false alarms")
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
        for tree in [Tree::Final, Tree::Base] {
            let unchanged = Mutation::of(correct, tree);
            let examined = examine(correct, &unchanged, &scratch.join("unchanged"))?;
            let alarms = examined.iter().flatten().filter(|result| !result.holds());
            report.alarms.extend(alarms.map(|r| format!("{}: {r}", correct.case.name)));
        }
    }
    for mutant in catalogue() {
        for correct in &cases {
            if let Some(mutation) = mutant.make(correct) {
                let examined = examine(correct, &mutation, &scratch.join("mutant"))?;
                report.kills.push(kill(mutant, correct, &mutation, &examined));
            }
        }
    }
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
            let subject = Subject::new(&correct.case, mutation.tree, &mesh);
            checks::all(&subject.with_reference(correct.set(mutation.tree)))
        }
    };
    let definition = Promises::of_definition();
    let mut case = correct.case.clone();
    case.rules.tree = mutation.tree;
    let [audit, whole] =
        [None, Some(&case)].map(|case| audit::audit_against(dir, case, &definition).checks);
    fs::remove_dir_all(dir)?;
    Ok([checks, audit, whole])
}

fn kill(
    mutant: Mutant,
    correct: &SelftestCase,
    mutation: &Mutation,
    [checks, audit, whole]: &Examined,
) -> Kill {
    let failed = |results: &[CheckResult]| -> Vec<&'static str> {
        results.iter().filter(|r| !r.holds()).map(|r| r.name).collect()
    };
    let expected = checks.iter().find(|r| r.name == mutant.expected);
    let (before, after) = (correct.set(mutation.tree), &mutation.mesh);
    let is_changed = mutation.tamper.is_some()
        || (&before.manifest, &before.parts) != (&after.manifest, &after.parts);
    Kill {
        mutant,
        case: correct.case.name.clone(),
        caught_by: failed(checks),
        audit_caught_by: failed(audit),
        whole_audit_missed: is_changed && failed(whole).is_empty(),
        finding: expected.and_then(|r| r.findings.first()).cloned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A report in which every corruption was tried once and reported.
    fn correct() -> SelftestReport {
        let kill = |mutant: &Mutant| Kill {
            mutant: *mutant,
            case: "a case".to_owned(),
            caught_by: vec![mutant.expected],
            audit_caught_by: vec![mutant.expected],
            whole_audit_missed: false,
            finding: Some("a finding".to_owned()),
        };
        let kills = catalogue().iter().map(kill).collect();
        SelftestReport { kills, ..SelftestReport::default() }
    }

    #[test]
    fn every_corruption_has_a_name_of_its_own() {
        let names: HashSet<&str> = catalogue().iter().map(|mutant| mutant.name).collect();
        assert_eq!(names.len(), catalogue().len());
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
        assert!(report.holds());
        let unused = report.kills.pop().unwrap().mutant.name;
        let unused = report.kills.iter().position(|kill| kill.mutant.name == unused).unwrap();
        let unused = report.kills.remove(unused).mutant.name;
        assert_eq!(report.unused(), [unused]);
        assert!(!report.holds(), "a corruption applies to no case");
        report.kills[1].caught_by.clear();
        report.alarms.push("an alarm".to_owned());
        let trials = corruptions - 1;
        let counts = format!("{trials} corruptions in {trials} trials: 1 survived, 1 false alarms");
        let text = report.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("SURVIVED: Kill"), "{text}");
        let rest = [
            "FALSE ALARM on a correct mesh: an alarm",
            &format!("applies to no case: {unused}"),
            &counts,
        ];
        assert_eq!(lines[1..], rest);
    }
}
