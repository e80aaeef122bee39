//! The checks, one per file, in one table. The head of each file names the property of reference/DEFINITION.md that it
//! checks, and the errors that it cannot detect.
//!
//! A check never trusts the program under test. It derives what it needs from the leaves and, if the case is known, from its
//! facets: the harness makes T0 itself, with the sides of its leaves ([`truth`]). A T0 of the program under test is a mesh of its own,
//! from which nothing is deleted.

pub mod balance;
pub(crate) mod clearance;
pub mod complete;
pub mod components;
pub mod contact;
pub mod crossing;
pub mod identical;
pub mod kept;
pub mod layer;
pub mod manifest;
mod pass;
mod region;
mod result;
pub mod sides;
pub mod spacing;
mod splits;
mod subject;
pub mod truth;

pub use result::{CheckResult, FILES, FINDINGS_LISTED, Outcome};
pub use subject::{CAPACITY, Subject};

use crate::promises::Promises;
use contract::tree::{Handle, Tree};
use serde::Serialize;

pub(crate) use pass::Pass;
pub(crate) use splits::NAME as SPLITS;

/// Why what needs sides is not checked.
const UNKNOWN_SIDES: &str = "the sides of the leaves are unknown";
/// Why what needs inputs is not checked.
const UNKNOWN_INPUTS: &str = "the inputs of the mesh are unknown without a case";
/// Why what needs facets is not checked.
const NO_GEOMETRY: &str = "the geometry is unknown without a case";
/// Why nothing can be wrong.
pub const NO_LEAVES: &str = "the mesh has no leaves";

/// A property of meshes.
pub struct Check {
    /// Its name in reports.
    pub name: &'static str,
    /// Whether a mesh that keeps these promises must have it.
    wanted: fn(&Promises, &Subject) -> bool,
    run: fn(&Subject, &mut CheckResult),
}

/// The check that the manifest states what others compare with a case.
const STATED: &str = "stated";
/// The check that words ascend and no leaves overlap: the pass over the leaves has found what there is to report.
const LINEAR: &str = "linear";

/// All checks, in the order in which findings are most helpful.
pub const CHECKS: [Check; 14] = [
    check(manifest::NAME, |_, _| true, manifest::run),
    check(STATED, |p, s| p.definition && manifest::states_some(s), manifest::states_all),
    check(LINEAR, |_, _| true, |s, result| result.clone_from(&s.pass.linear)),
    check("complete", |p, _| p.definition || p.complete, complete::run),
    check("spacing", |p, _| p.definition, spacing::run),
    check("surface", |p, _| !p.definition && p.surface.is_some(), spacing::surface),
    check("boxes", |p, _| !p.definition && p.boxes, spacing::boxes),
    check("crossing", |p, _| p.crossing, crossing::run),
    check("sides", |p, _| p.definition || p.sides.is_some(), sides::run),
    check("kept", |p, _| p.definition, kept::run),
    check("balance", |p, s| p.balance.is_some() || p.definition && s.is_final(), balance::run),
    check("layer", |p, s| p.layers || p.definition && s.is_final(), layer::run),
    // `identical` finds the same, by comparison.
    check(SPLITS, |p, s| p.definition && s.case.is_some() && s.reference.is_none(), splits::run),
    check(identical::NAME, |_, s| s.reference.is_some(), identical::run),
];

const fn check(
    name: &'static str,
    wanted: fn(&Promises, &Subject) -> bool,
    run: fn(&Subject, &mut CheckResult),
) -> Check {
    Check { name, wanted, run }
}

/// The checks that show nothing of a mesh but its form.
pub const FORMAL: [&str; 3] = [manifest::NAME, STATED, LINEAR];

/// Runs all checks that the subject must pass.
pub fn all(subject: &Subject) -> Vec<CheckResult> {
    let is_of_files = |c: &Check| FORMAL.contains(&c.name);
    let wanted = CHECKS.iter().filter(|check| (check.wanted)(&subject.promises, subject));
    // Counts and digests need no tree.
    let capacity = subject.capacity();
    let is_possible = capacity.as_ref().is_none_or(CheckResult::holds);
    let possible = wanted.filter(|check| is_possible || is_of_files(check));
    possible.map(|check| check.result(subject)).chain(capacity.clone()).collect()
}

impl Check {
    fn result(&self, subject: &Subject) -> CheckResult {
        let mut result = CheckResult::new(self.name);
        (self.run)(subject, &mut result);
        if result.was_run() && result.examined == 0 {
            result.examined = subject.pass.tally.leaves;
        }
        result.needs_objects(NO_LEAVES);
        result.check_invariants();
        result
    }
}

/// A value as manifests state it.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_else(|why| why.to_string())
}

/// Reports sides that are unknown, although they were promised or the case decides them; a mesh by itself may lack them.
fn unknown_sides(subject: &Subject, promised: bool, result: &mut CheckResult) {
    match promised || subject.case.is_some() {
        true => result.report(format_args!(
            "{UNKNOWN_SIDES} by its manifest or its array; of a mesh in another format, name an array that states them with --sides (in p4est: data)"
        )),
        false => result.lacks(UNKNOWN_SIDES),
    }
}

/// Why a check that compares leaves of several levels in this tree can find nothing.
fn several_levels(tree: &Tree) -> Option<String> {
    let level = tree.finest_level(tree.root, 0);
    let uniform = tree.coarsest_level(tree.root, 0) >= level;
    some_leaves(tree).or_else(|| uniform.then(|| format!("all leaves have level {level}")))
}

fn some_leaves(tree: &Tree) -> Option<String> {
    (tree.root == Handle::HOLE).then(|| NO_LEAVES.to_owned())
}
