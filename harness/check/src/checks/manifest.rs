//! The manifest agrees with the files and with the case.
//!
//! Section 8 of reference/DEFINITION.md: counts, digests, inputs and, if the mesh equals the reference, the
//! components. The check cannot detect wrong leaves, or two sets of leaves with equal digests. `sides` checks the
//! ambiguous components and `kept` the numbers of components.

use std::fmt::Debug;

use super::{CheckResult, Subject, Terms};
use contract::digest::Digest;
use contract::leafset::LeafSet;
use contract::manifest::{Components, Manifest, Tally, Tree};

const NAME: &str = "manifest";

/// Checks the manifest of the mesh and, if it is known, that of T0.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let sets = [("", Some(subject.mesh), Tree::Final), ("T0: ", subject.base, Tree::Base)];
    for (prefix, set, tree) in sets {
        if let Some(set) = set {
            same(prefix, "tree", &set.manifest.tree, &tree, &mut result);
            against_terms(prefix, &set.manifest, &subject.terms, &mut result);
            against_leaves(prefix, set, &mut result);
        }
    }
    // Of different leaves, `identical` reports the cause.
    if let Some(reference) = subject.reference.filter(|r| r.words == subject.mesh.words) {
        against_reference(subject, &reference.manifest, &mut result);
    }
    result
}

/// The manifest describes the components as that of the equal reference does, if both count them. This is the only check of
/// the counts in a mesh whose T0 is not known, such as one made on several ranks.
fn against_reference(subject: &Subject, reference: &Manifest, result: &mut CheckResult) {
    let mesh = &subject.mesh.manifest;
    let mut place = |field: &str, claimed: Option<[f64; 3]>, found: Option<[f64; 3]>| {
        let equal = match (claimed, found) {
            (Some(a), Some(b)) => subject.terms.same_place(a, b),
            (a, b) => a == b,
        };
        if !equal {
            result.report(format!(
                "{field}: {claimed:?} in the manifest, but {found:?} in the reference's"
            ));
        }
    };
    let (a, b) = (&mesh.components_ambiguous, &reference.components_ambiguous);
    place("example of an ambiguous component", a.example, b.example);
    if let (Some(a), Some(b)) = (&mesh.components, &reference.components) {
        place("example of an enclosed component", a.enclosed.example, b.enclosed.example);
        let counts = |c: &Components| [c.outside, c.inside, c.enclosed.count, c.enclosed.leaves];
        same(
            "",
            "components (outside, inside, enclosed, their leaves)",
            &counts(a),
            &counts(b),
            result,
        );
    }
    same("", "components_ambiguous.count", &a.count, &b.count, result);
}

/// The inputs in the manifest are those of the case.
fn against_terms(prefix: &str, manifest: &Manifest, terms: &Terms, result: &mut CheckResult) {
    let claimed = Terms::of_manifest(manifest);
    same(prefix, "root", &claimed.root, &terms.root, result);
    same(prefix, "level_surface", &claimed.level_surface, &terms.level_surface, result);
    same(prefix, "layer_cells_min", &claimed.layer_cells_min, &terms.layer_cells_min, result);
    same(prefix, "keep", &claimed.keep, &terms.keep, result);
    same(prefix, "keep_crossing", &claimed.keep_crossing, &terms.keep_crossing, result);
    same(prefix, "boxes", &claimed.boxes, &terms.boxes, result);
    same(prefix, "seeds", &claimed.seeds, &terms.seeds, result);
    same(prefix, "enclosed", &claimed.enclosed, &terms.enclosed, result);
}

fn against_leaves(prefix: &str, set: &LeafSet, result: &mut CheckResult) {
    let parts: Vec<_> =
        set.parts.iter().map(|words| (words.len() as u64, Digest::of(words))).collect();
    against_tally(prefix, &set.manifest, &Tally::of(&set.words), &parts, result);
}

/// Checks the inputs in the manifest only.
pub fn check_terms(manifest: &Manifest, terms: &Terms, result: &mut CheckResult) {
    against_terms("", manifest, terms, result);
}

/// Checks the counts and digests only. `parts` are the number of leaves and the digest of each part.
pub fn check_leaves(manifest: &Manifest, tally: &Tally, parts: &[(u64, Digest)]) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    against_tally("", manifest, tally, parts, &mut result);
    result
}

fn against_tally(
    prefix: &str,
    manifest: &Manifest,
    tally: &Tally,
    parts: &[(u64, Digest)],
    result: &mut CheckResult,
) {
    result.examined += tally.leaves;
    same(prefix, "leaves", &manifest.leaves, &tally.leaves, result);
    same(prefix, "leaves_by_level", &manifest.leaves_by_level, &tally.by_level, result);
    same(prefix, "leaves_by_side", &manifest.leaves_by_side, &tally.by_side, result);
    same(prefix, "digest", &manifest.digest, &tally.digest, result);
    for (i, (claimed, found)) in manifest.octant_digests.iter().zip(&tally.octants).enumerate() {
        same(prefix, &format!("octant_digests[{i}]"), claimed, found, result);
    }
    for (claimed, &(leaves, digest)) in manifest.parts.iter().zip(parts) {
        same(prefix, &format!("leaves of {}", claimed.file), &claimed.leaves, &leaves, result);
        same(prefix, &format!("digest of {}", claimed.file), &claimed.digest, &digest, result);
    }
}

fn same<T: PartialEq + Debug>(
    prefix: &str,
    field: &str,
    claimed: &T,
    found: &T,
    result: &mut CheckResult,
) {
    if claimed != found {
        result.report_with(|| {
            format!("{prefix}{field}: {claimed:?} in the manifest, but {found:?} in fact")
        });
    }
}
