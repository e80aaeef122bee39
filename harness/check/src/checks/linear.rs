//! Every word is a leaf, each part is sorted, and no two leaves overlap.
//!
//! Sections 7 and 8 of reference/DEFINITION.md. Misses: gaps, which are for `complete`; a side that
//! is wrong but exists, which is for `sides` and `crossing`.

use super::{CheckResult, Subject, identical};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::tree::{Builder, Refusal};

const NAME: &str = "linear";

/// Checks the mesh, and T0 where it is given.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    for (whose, set) in [("", Some(subject.mesh)), ("T0: ", subject.base)] {
        if let Some(set) = set {
            one_set(set, whose, &subject.terms.root, &mut result);
        }
    }
    result
}

fn one_set(set: &LeafSet, whose: &str, root: &Root, result: &mut CheckResult) {
    for (part, words) in set.manifest.parts.iter().zip(&set.parts) {
        for pair in words.windows(2).filter(|pair| pair[0] >= pair[1]) {
            unsorted(&format!("{whose}{}", part.file), pair[0], pair[1], root, result);
        }
    }
    let (mut builder, mut last) = (Builder::default(), 0);
    for &w in &set.words {
        match builder.push(w) {
            Ok(()) => last = w,
            Err(why) => refused(whose, why, w, last, root, result),
        }
    }
    result.examined += set.words.len() as u64;
}

/// Reports a word that does not come after the one before it in its part.
pub fn unsorted(part: &str, before: u64, word: u64, root: &Root, result: &mut CheckResult) {
    result.find_with(|| {
        let (before, word) = (identical::tell(before, root), identical::tell(word, root));
        format!("{part} is not sorted: after {before} comes {word}")
    });
}

/// Reports a word that is no leaf or overlaps the last good one before it.
pub fn refused(
    whose: &str,
    why: Refusal,
    word: u64,
    last: u64,
    root: &Root,
    result: &mut CheckResult,
) {
    result.find_with(|| {
        let told = identical::tell(word, root);
        match why {
            Refusal::Fault(_) => format!("{whose}not a leaf: {told}"),
            Refusal::Overlap => {
                format!("{whose}two leaves overlap: {told} and {}", identical::tell(last, root))
            }
        }
    });
}
