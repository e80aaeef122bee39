//! The checks, one per file. The head of each file names the property of reference/DEFINITION.md that it
//! checks, and the errors that it cannot detect.
//!
//! A check never trusts the program under test. It derives what it needs from the case, from the leaves and, if
//! it is known, from the base tree T0, whose own correctness `spacing`, `crossing` and `sides` establish.

pub mod balance;
pub mod complete;
pub mod components;
pub mod contact;
pub mod crossing;
pub mod facets;
pub mod gap;
pub mod hanging;
pub mod identical;
pub mod kept;
pub mod layer;
pub mod linear;
pub mod manifest;
mod outcome;
mod premise;
mod promised;
mod region;
mod result;
pub mod sides;
pub mod spacing;
mod subject;
mod surface;
mod terms;
pub mod trail;

pub use outcome::Outcome;
pub use premise::with_premise;
pub use promised::promised;
pub use result::{CheckResult, FILES, FINDINGS_LISTED, Finding};
pub use subject::Subject;
pub(crate) use subject::valid_leaves;
pub use terms::Terms;

/// Runs all checks of the definition, in the order in which their findings are most helpful. `identical` is omitted
/// without a reference.
pub fn all(subject: &Subject) -> Vec<CheckResult> {
    let results = [
        manifest::check(subject),
        linear::check(subject),
        complete::check(subject),
        spacing::check(subject),
        crossing::check(subject),
        sides::check(subject),
        kept::check(subject),
        balance::check(subject),
        layer::check(subject),
    ];
    let (tree, base) = (subject.tree_with_deleted(), subject.tree_base());
    let noted = results.map(|result| with_premise(result, tree, base, &subject.terms));
    noted.into_iter().chain(identical::check(subject)).collect()
}
