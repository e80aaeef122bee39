//! The manifest agrees with the files and with the case.
//!
//! Section 8 of reference/DEFINITION.md: counts, digests, inputs and, if the mesh equals the reference, the
//! components and leaks. The check cannot detect wrong leaves, or two sets of leaves with equal digests. With a case, `sides` checks the
//! leaks and the ambiguous components, and `kept` the numbers of components.

use serde::Serialize;

use super::{Check, CheckResult, Pass, Subject, always, json, nothing};
use crate::inputs::INPUTS;
use contract::lattice::Root;
use contract::manifest::{BySide, Components, Geometry, Leak, Manifest, Sides, Tree};

/// Name of the check.
pub const NAME: &str = "manifest";

pub(super) const CHECK: Check = Check { name: NAME, wanted: always, needs: nothing, run };

fn run(subject: &Subject, result: &mut CheckResult) {
    result.examined = 0;
    for (prefix, manifest, pass) in subject.meshes() {
        of_mesh(prefix, manifest, pass, subject, result);
    }
    of_leaks(subject.manifest, result);
    if let Some((base, _)) = &subject.base {
        // A mesh with an engine's T0 beside it is a final one.
        same("", "tree", &subject.manifest.tree, &Tree::Final, result);
        same("T0: ", "tree", &base.manifest.tree, &Tree::Base, result);
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
    let (a, b) = (&mesh.components_ambiguous, &reference.components_ambiguous);
    same("", "components_ambiguous.count", &a.count, &b.count, result);
    same_place(("", "an ambiguous", "the reference's"), (a.example, b.example), mesh, result);
    if let (Some(claimed), Some(found)) = (&mesh.components, &reference.components) {
        same_components("", claimed, found, mesh, result);
    }
    if let (Some(claimed), Some(found)) = (&mesh.leaks, &reference.leaks) {
        same("", "leaks", claimed, found, result);
    }
}

/// A manifest counts these components, and places an enclosed one where the first is.
pub(super) fn same_components(
    prefix: &str,
    claimed: &Components,
    found: &Components,
    inputs: &Manifest,
    result: &mut CheckResult,
) {
    let (a, b) = (&claimed.enclosed, &found.enclosed);
    let numbers = [
        ("outside components", claimed.outside, found.outside),
        ("inside components", claimed.inside, found.inside),
        ("enclosed components", a.count, b.count),
        ("leaves of T0 in enclosed components", a.leaves, b.leaves),
    ];
    for (what, claimed, found) in numbers.into_iter().filter(|(_, claimed, found)| claimed != found)
    {
        result.report(format!("{prefix}the manifest counts {claimed} {what}, and T0 has {found}"));
    }
    same_place((prefix, "an enclosed", "the first"), (a.example, b.example), inputs, result);
}

/// Whether a manifest places a component where one is.
fn same_place(
    (prefix, what, which): (&str, &str, &str),
    (claimed, found): (Option<[f64; 3]>, Option<[f64; 3]>),
    inputs: &Manifest,
    result: &mut CheckResult,
) {
    let agree = match (claimed, found) {
        (Some(a), Some(b)) => inputs.same_place(a, b),
        (a, b) => a.is_none() && b.is_none(),
    };
    if !agree {
        let [claimed, found] = [claimed, found].map(|at| json(&at));
        result.report(format!(
            "{prefix}the manifest places {what} component at {claimed}, and {which} one is at {found}"
        ));
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

/// The manifest has the counts and digests of the leaves, and the inputs and facets of the case.
fn of_mesh(
    prefix: &str,
    manifest: &Manifest,
    pass: &Pass,
    subject: &Subject,
    result: &mut CheckResult,
) {
    let Pass { tally, parts, .. } = pass;
    result.examined += tally.leaves;
    let entries = |m: &Manifest| serde_json::to_value(m).expect("JSON");
    let [claimed, of_leaves, inputs] = [manifest, tally, &subject.inputs].map(entries);
    for key in ["leaves", "leaves_by_level", "leaves_by_side", "digest"] {
        same(prefix, key, &claimed[key], &of_leaves[key], result);
    }
    for key in INPUTS {
        same(prefix, key, &claimed[key], &inputs[key], result);
    }
    let BySide { outside, inside, crossing } = tally.leaves_by_side;
    if manifest.sides == Sides::Unknown && outside < tally.leaves {
        result.report(format!(
            "{prefix}sides: unknown in the manifest, but of {} leaves {inside} are inside and {crossing} crossing by their words",
            tally.leaves
        ));
    }
    for (i, (claimed, found)) in
        manifest.octant_digests.iter().zip(&tally.octant_digests).enumerate()
    {
        same(prefix, &format!("octant_digests[{i}]"), claimed, found, result);
    }
    for (claimed, &(leaves, digest)) in manifest.parts.iter().zip(parts) {
        same(prefix, &format!("leaves of {}", claimed.file), &claimed.leaves, &leaves, result);
        same(prefix, &format!("digest of {}", claimed.file), &claimed.digest, &digest, result);
    }
    // A mesh of another geometry, or one that is older than its geometry.
    if let (Some(case), Some(claimed)) = (subject.case, manifest.geometry) {
        same(prefix, "geometry", &claimed, &Geometry::of(&case.facets_lattice), result);
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
