//! The mesh equals another one, leaf by leaf.
//!
//! Section 1 of reference/DEFINITION.md: the mesh is a function of the inputs only, so the mesh of the
//! reference is the only correct one. The check cannot detect an error that both programs make; the other
//! checks do.

use super::{CheckResult, Subject};
use contract::lattice::Root;
use contract::word;
use std::fmt;

/// Name of the check.
pub const NAME: &str = "identical";

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    if let (Some(mesh), Some(reference)) = (subject.mesh, subject.reference) {
        *result = compare(&mesh.words, &reference.words, &subject.terms.root);
    }
}

/// Compares two sorted sequences of words. The total is the number of leaves in only one of them, and the one
/// listed finding is the first difference.
pub fn compare(mesh: &[u64], reference: &[u64], root: &Root) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    result.examined = mesh.len() as u64;
    if mesh == reference {
        return result;
    }
    let first = mesh.iter().zip(reference).take_while(|(a, b)| a == b).count();
    let [has, wanted] = [mesh, reference].map(|words| Named(words.get(first).copied(), *root));
    result.report(format_args!("first difference: the mesh has {has}; it should have {wanted}"));
    let lacking = |a: &[u64], b: &[u64]| a.iter().filter(|&w| b.binary_search(w).is_err()).count();
    let (mesh, reference) = (&mesh[first..], &reference[first..]);
    let differing = lacking(mesh, reference) + lacking(reference, mesh);
    // Words that are not sorted are not found.
    result.findings_total = result.findings_total.max(differing as u64);
    result
}

/// A word of a mesh in a root as text, whether or not it is a leaf, if the mesh has any more.
pub(crate) struct Named(pub Option<u64>, pub Root);

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(word) = self.0 else { return f.write_str("no more leaves") };
        match word::check(word) {
            Ok(()) => write!(f, "{} leaf: {}", word::side(word), self.1.place(word::octant(word))),
            Err(why) => write!(f, "the word {word:#018x}: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: Root = Root { origin: [0.0; 3], edge: 8.0 };

    #[test]
    fn the_first_difference_names_both_leaves_and_all_differences_are_counted() {
        let fine: Vec<u64> = (0..8)
            .map(|d| word::encode(contract::octant::Octant::ROOT.child(d), word::Side::Outside))
            .collect();
        let mut coarse = fine.clone();
        coarse[3] |= 1;
        assert!(compare(&fine, &fine, &ROOT).holds());
        let result = compare(&coarse, &fine, &ROOT);
        assert_eq!(result.findings_total, 2);
        let detail = &result.findings[0];
        assert!(detail.contains("mesh has inside leaf: octant 3 (level 1)"), "{detail}");
        assert!(detail.contains("it should have outside leaf: octant 3 (level 1)"), "{detail}");
        assert_eq!(compare(&fine[..7], &fine, &ROOT).findings_total, 1);
    }
}
