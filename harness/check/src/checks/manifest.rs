//! The manifest agrees with the files and with the case.
//!
//! Section 8 of reference/DEFINITION.md: counts, digests, inputs and, if the mesh equals the reference, the
//! components and leaks. The check cannot detect wrong leaves, or two sets of leaves with equal digests. With a case, `sides` checks the
//! leaks and the ambiguous components, and `kept` the numbers of components.

use serde::Serialize;

use super::{Check, CheckResult, Pass, Subject, Terms, always, json, nothing};
use contract::lattice::Root;
use contract::manifest::{BySide, Components, Geometry, Leak, Manifest, Sides, Tree};

/// Name of the check.
pub const NAME: &str = "manifest";

pub(super) const CHECK: Check = Check { name: NAME, wanted: always, needs: nothing, run };

fn run(subject: &Subject, result: &mut CheckResult) {
    result.examined = 0;
    of_leaves("", subject.manifest, &subject.pass, result);
    of_inputs("", subject.manifest, &subject.inputs, result);
    of_leaks(subject.manifest, result);
    if let Some((base, pass)) = &subject.base {
        // A mesh with an engine's T0 beside it is a final one.
        same("", "tree", &subject.manifest.tree, &Tree::Final, result);
        same("T0: ", "tree", &base.manifest.tree, &Tree::Base, result);
        of_leaves("T0: ", &base.manifest, pass, result);
        of_inputs("T0: ", &base.manifest, &subject.inputs, result);
    }
    for (prefix, manifest) in [
        ("", Some(subject.manifest)),
        ("T0: ", subject.base.as_ref().map(|(base, _)| &base.manifest)),
    ] {
        // A mesh of another geometry, or one that is older than its geometry.
        if let (Some(case), Some(claimed)) = (subject.case, manifest.and_then(|m| m.geometry)) {
            same(prefix, "geometry", &claimed, &Geometry::of(&case.facets_lattice), result);
        }
    }
    // Of different leaves, `identical` reports the cause.
    if let (Some(mesh), Some(reference)) = (subject.mesh, subject.reference)
        && mesh.words == reference.words
    {
        of_reference(subject, &reference.manifest, result);
    }
}

/// The manifest describes the components as that of the equal reference does, if both count them. This is the only check of
/// the counts in a mesh whose T0 is not known, such as one made on several ranks.
fn of_reference(subject: &Subject, reference: &Manifest, result: &mut CheckResult) {
    let mesh = subject.manifest;
    let mut place = |field: &str, claimed: Option<[f64; 3]>, found: Option<[f64; 3]>| {
        let equal = match (claimed, found) {
            (Some(a), Some(b)) => subject.terms.same_place(a, b),
            (a, b) => a == b,
        };
        if !equal {
            result.report(format!(
                "{field}: {} in the manifest, but {} in the reference's",
                json(&claimed),
                json(&found)
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
    if let (Some(claimed), Some(found)) = (&mesh.leaks, &reference.leaks) {
        same("", "leaks", claimed, found, result);
    }
}

/// A leak opens between a coarser spacing and a finer one, and has a volume and a point in the root.
fn of_leaks(manifest: &Manifest, result: &mut CheckResult) {
    let Root { origin, edge } = manifest.root;
    for leak in manifest.leaks.iter().flatten() {
        let Leak { spacing_coarse, spacing_fine, volume, point } = *leak;
        let is_inside = |a: usize| (0.0..=edge).contains(&(point[a] - origin[a]));
        let opens = 0.0 < spacing_fine && spacing_fine < spacing_coarse;
        let is_region = 0.0 < volume && volume <= edge.powi(3) && (0..3).all(is_inside);
        if !(opens && is_region) {
            result.report(format!(
                "leaks: {} is not possible in the root {}",
                json(leak),
                json(&manifest.root)
            ));
        }
    }
}

/// The inputs in the manifest are those of the case.
fn of_inputs(prefix: &str, manifest: &Manifest, terms: &Terms, result: &mut CheckResult) {
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

fn of_leaves(prefix: &str, manifest: &Manifest, pass: &Pass, result: &mut CheckResult) {
    let Pass { tally, parts, .. } = pass;
    result.examined += tally.leaves;
    same(prefix, "leaves", &manifest.leaves, &tally.leaves, result);
    same(prefix, "leaves_by_level", &manifest.leaves_by_level, &tally.by_level, result);
    same(prefix, "leaves_by_side", &manifest.leaves_by_side, &tally.by_side, result);
    same(prefix, "digest", &manifest.digest, &tally.digest, result);
    let BySide { outside, inside, crossing } = tally.by_side;
    if manifest.sides == Sides::Unknown && outside < tally.leaves {
        result.report(format!(
            "{prefix}sides: unknown in the manifest, but of {} leaves {inside} are inside and {crossing} crossing by their words",
            tally.leaves
        ));
    }
    for (i, (claimed, found)) in manifest.octant_digests.iter().zip(&tally.octants).enumerate() {
        same(prefix, &format!("octant_digests[{i}]"), claimed, found, result);
    }
    for (claimed, &(leaves, digest)) in manifest.parts.iter().zip(parts) {
        same(prefix, &format!("leaves of {}", claimed.file), &claimed.leaves, &leaves, result);
        same(prefix, &format!("digest of {}", claimed.file), &claimed.digest, &digest, result);
    }
}

fn same<T: PartialEq + Serialize>(
    prefix: &str,
    field: &str,
    claimed: &T,
    found: &T,
    result: &mut CheckResult,
) {
    if claimed != found {
        result.report_with(|| {
            let [claimed, found] = [claimed, found].map(json);
            format!("{prefix}{field}: {claimed} in the manifest, but {found} in fact")
        });
    }
}
