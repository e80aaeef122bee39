//! Every word is a leaf, each part is sorted, and no two leaves overlap.
//!
//! Sections 7 and 8 of reference/DEFINITION.md. The check does not detect holes (`complete` does), nor wrong
//! sides (`sides` and `crossing` do).

use super::{CheckResult, Subject, identical};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::tree::{Builder, Refusal};

const NAME: &str = "linear";

/// Checks the mesh and, if it is known, T0.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    for (prefix, set) in [("", Some(subject.mesh)), ("T0: ", subject.base)] {
        if let Some(set) = set {
            one_set(set, prefix, &subject.terms.root, &mut result);
        }
    }
    result
}

fn one_set(set: &LeafSet, prefix: &str, root: &Root, result: &mut CheckResult) {
    for (part, words) in set.manifest.parts.iter().zip(&set.parts) {
        for pair in words.windows(2).filter(|pair| pair[0] >= pair[1]) {
            unsorted(&format!("{prefix}{}", part.file), pair[0], pair[1], root, result);
        }
    }
    let (mut builder, mut last) = (Builder::default(), 0);
    for &w in &set.words {
        match builder.push(w) {
            Ok(()) => last = w,
            Err(why) => refused(prefix, why, w, last, root, result),
        }
    }
    result.examined += set.words.len() as u64;
}

/// Reports a word that is not greater than its predecessor in a part.
pub fn unsorted(part: &str, before: u64, word: u64, root: &Root, result: &mut CheckResult) {
    result.report_with(|| {
        let (before, word) = (identical::describe(before, root), identical::describe(word, root));
        format!("{part} is not sorted: {word} follows {before}")
    });
}

/// Reports a word that is not a leaf, or overlaps the last valid leaf.
pub fn refused(
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
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn the_leaves_of_the_mesh_and_of_the_base_tree_are_examined() {
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let (fine, coarse) = (words_of(|o| o.level < 2), words_of(|o| o.level < 1));
        let (mesh, mut base) = (leaf_set(vec![fine]), leaf_set(vec![coarse]));
        let result = check(&Subject::new(&case, &mesh).with_base(&base));
        assert_eq!((result.examined, result.findings_total), (64 + 8, 0));
        let spacing = crate::checks::spacing::check(&Subject::new(&case, &mesh).with_base(&base));
        assert_eq!(spacing.examined, 64 + 8);
        base.parts[0].swap(2, 3);
        let result = check(&Subject::new(&case, &mesh).with_base(&base));
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
