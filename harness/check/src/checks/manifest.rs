//! The manifest is true to the files and to the case.
//!
//! Section 8 of reference/DEFINITION.md: counts, digests, and what was asked for. Misses: whether
//! the leaves are right; a digest that collides. The ambiguous components are for `sides`.

use std::fmt::Debug;

use super::{CheckResult, Subject, Terms};
use contract::digest::Digest;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Tally, Tree};

const NAME: &str = "manifest";

/// Checks the mesh's manifest, and T0's where it is given.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let sets = [("", Some(subject.mesh), Tree::Final), ("T0: ", subject.base, Tree::Base)];
    for (whose, set, tree) in sets {
        if let Some(set) = set {
            same(whose, "tree", &set.manifest.tree, &tree, &mut result);
            against_terms(whose, &set.manifest, &subject.terms, &mut result);
            against_leaves(whose, set, &mut result);
        }
    }
    result
}

/// What the manifest says was asked for is what the case asks for.
fn against_terms(whose: &str, manifest: &Manifest, terms: &Terms, result: &mut CheckResult) {
    let claimed = Terms::of_manifest(manifest);
    same(whose, "root", &claimed.root, &terms.root, result);
    same(whose, "level_surface", &claimed.level_surface, &terms.level_surface, result);
    same(whose, "layer_cells_min", &claimed.layer_cells_min, &terms.layer_cells_min, result);
    same(whose, "keep", &claimed.keep, &terms.keep, result);
    same(whose, "keep_crossing", &claimed.keep_crossing, &terms.keep_crossing, result);
    same(whose, "boxes", &claimed.boxes, &terms.boxes, result);
}

fn against_leaves(whose: &str, set: &LeafSet, result: &mut CheckResult) {
    let parts: Vec<_> =
        set.parts.iter().map(|words| (words.len() as u64, Digest::of(words))).collect();
    against_tally(whose, &set.manifest, &Tally::of(&set.words), &parts, result);
}

/// What can be said of the leaves alone; `parts` holds each part's count and digest.
pub fn check_leaves(manifest: &Manifest, tally: &Tally, parts: &[(u64, Digest)]) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    against_tally("", manifest, tally, parts, &mut result);
    result
}

fn against_tally(
    whose: &str,
    manifest: &Manifest,
    tally: &Tally,
    parts: &[(u64, Digest)],
    result: &mut CheckResult,
) {
    result.examined += tally.leaves;
    same(whose, "leaves", &manifest.leaves, &tally.leaves, result);
    same(whose, "leaves_by_level", &manifest.leaves_by_level, &tally.by_level, result);
    same(whose, "leaves_by_side", &manifest.leaves_by_side, &tally.by_side, result);
    same(whose, "digest", &manifest.digest, &tally.digest, result);
    for (i, (claimed, found)) in manifest.octant_digests.iter().zip(&tally.octants).enumerate() {
        same(whose, &format!("octant_digests[{i}]"), claimed, found, result);
    }
    for (claimed, &(leaves, digest)) in manifest.parts.iter().zip(parts) {
        same(whose, &format!("leaves of {}", claimed.file), &claimed.leaves, &leaves, result);
        same(whose, &format!("digest of {}", claimed.file), &claimed.digest, &digest, result);
    }
}

fn same<T: PartialEq + Debug>(
    whose: &str,
    field: &str,
    claimed: &T,
    found: &T,
    result: &mut CheckResult,
) {
    if claimed != found {
        result.find_with(|| {
            format!("{whose}{field}: the manifest says {claimed:?}, it is {found:?}")
        });
    }
}
