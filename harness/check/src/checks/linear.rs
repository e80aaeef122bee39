//! Every word is a leaf, each part is sorted, and no two leaves overlap.
//!
//! Sections 7 and 8 of reference/DEFINITION.md. The check does not detect holes (`complete` does), nor wrong
//! sides (`sides` and `crossing` do).

use super::{Check, CheckResult, Subject, always, identical, nothing};
use contract::lattice::Root;
use contract::tree::Refusal;

pub(super) const CHECK: Check = Check { name: "linear", wanted: always, needs: nothing, run };

/// The pass over the leaves has found what there is to report.
fn run(subject: &Subject, result: &mut CheckResult) {
    *result = subject.pass.linear.clone();
    if let Some((_, base)) = &subject.base {
        result.append(&base.linear);
    }
}

/// Reports a word that is not greater than its predecessor in a part.
pub(super) fn unsorted(part: &str, before: u64, word: u64, root: &Root, result: &mut CheckResult) {
    result.report_with(|| {
        let (before, word) = (identical::describe(before, root), identical::describe(word, root));
        format!("{part} is not sorted: {word} follows {before}")
    });
}

/// Reports a word that is not a leaf, or overlaps the last valid leaf.
pub(super) fn refused(
    prefix: &str,
    why: Refusal,
    word: u64,
    last: u64,
    root: &Root,
    result: &mut CheckResult,
) {
    result.report_with(|| {
        let leaf = identical::describe(word, root);
        match why {
            Refusal::Fault(_) => format!("{prefix}not a leaf: {leaf}"),
            Refusal::Overlap => {
                format!(
                    "{prefix}two leaves overlap: {leaf} and {}",
                    identical::describe(last, root)
                )
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::leafset::LeafSet;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn the_leaves_of_the_mesh_and_of_the_base_tree_are_examined() {
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let (fine, coarse) = (words_of(|o| o.level < 2), words_of(|o| o.level < 1));
        let (mesh, mut base) = (leaf_set(vec![fine]), leaf_set(vec![coarse]));
        let check = |base: &LeafSet| {
            super::super::only(&Subject::new(&case, &mesh).with_base(base), &["linear"]).remove(0)
        };
        let result = check(&base);
        assert_eq!((result.examined, result.findings_total), (64 + 8, 0));
        base.parts[0].swap(2, 3);
        let result = check(&base);
        let [finding] = &result.findings[..] else { panic!("{result}") };
        let text = finding
            .detail
            .strip_prefix("T0: leaves-00000.npy is not sorted: outside leaf: octant 2 ");
        assert!(
            text.is_some_and(|rest| rest.contains("follows outside leaf: octant 3 ")),
            "{result}"
        );
    }
}
