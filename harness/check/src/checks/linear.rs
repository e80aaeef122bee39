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
