//! The manifest agrees with the files and with the case.
//!
//! Section 8 of reference/DEFINITION.md: counts, digests, inputs and, if the mesh equals the reference, the
//! components and leaks. The check cannot detect wrong leaves, or two sets of leaves with equal digests. With a case, `sides` checks the
//! leaks and the ambiguous components, and `kept` the numbers of components.

use super::{CheckResult, Subject, json};
use contract::lattice::Root;
use contract::manifest::{BySide, ExtentBox, Geometry, Leak, Manifest, OCTANTS, Sides};
use serde_json::{Value, json};

/// Name of the check.
pub const NAME: &str = "manifest";

/// The manifest states all that other checks compare with a case. If it does not, nothing is wrong with it, but less is shown. Formats of
/// others state nothing of it.
pub(super) fn states_all(subject: &Subject, result: &mut CheckResult) {
    let [has, lacks] = optional_entries(subject.manifest);
    (result.examined, result.note) = (has.len() as u64, has.join(", "));
    let lacks = (!lacks.is_empty()).then(|| lacks.join(", "));
    result.requires(lacks.map(|them| format!("the manifest does not state {them}")));
}

/// Whether the case is known, and the manifest states any of what it may leave out.
pub(super) fn states_some(subject: &Subject) -> bool {
    subject.case.is_some() && !optional_entries(subject.manifest)[0].is_empty()
}

/// What a manifest may leave out: the keys that it has, and those that it lacks.
fn optional_entries(manifest: &Manifest) -> [Vec<&'static str>; 2] {
    let entries = stated(manifest);
    let all = ["geometry", "components", "components_ambiguous", "leaks"];
    let (has, lacks) = all.into_iter().partition(|key| entries.get(key).is_some());
    [has, lacks]
}

/// The inputs, by their keys. A mesh in the format of another program may lack all but the first two.
const INPUTS: &str =
    "tree root level_surface layer_cells_min keep keep_crossing boxes seeds enclosed";

/// A manifest with its owner's name.
type Owned<'a> = (&'a str, &'a Manifest);

/// The differences of these entries, one line each, with names for the owners of both manifests. An entry of a list has the list's key
/// and its number.
pub(crate) fn differing(
    keys: &[impl AsRef<str>],
    (owner_a, a): Owned,
    (owner_b, b): Owned,
) -> Vec<String> {
    let (a, b) = (stated(a), stated(b));
    let text = |value: Option<&Value>| value.map_or_else(|| "not stated".into(), Value::to_string);
    let line = |key: &str| {
        let [x, y] = [&a, &b].map(|entries| entries.pointer(&format!("/{key}")));
        (x != y).then(|| format!("{key}: {} in {owner_a}; {} in {owner_b}", text(x), text(y)))
    };
    keys.iter().filter_map(|key| line(key.as_ref())).collect()
}

/// The differences of inputs.
pub(crate) fn differing_inputs(a: Owned, b: Owned) -> Vec<String> {
    let geometry = a.1.geometry.is_some() && b.1.geometry.is_some();
    let keys: Vec<_> = INPUTS.split(' ').chain(geometry.then_some("geometry")).collect();
    differing(&keys, a, b)
}

/// The manifest as JSON, with boxes and seeds in the user's units, and places rounded to the lattice.
fn stated(manifest: &Manifest) -> Value {
    let root = &manifest.root;
    let user = |at: [i64; 3]| root.rounded(root.to_user(at));
    let mut rounded = manifest.clone();
    let enclosed = rounded.components.iter_mut().map(|components| &mut components.enclosed.example);
    let ambiguous = rounded.components_ambiguous.iter_mut().map(|ambiguous| &mut ambiguous.example);
    for place in enclosed.chain(ambiguous).flatten() {
        *place = root.quantise(*place).map_or(*place, user);
    }
    let mut stated = serde_json::to_value(rounded).expect("a manifest is representable in JSON");
    let extent = |b: &ExtentBox| json!({"min": user(b.min), "max": user(b.max), "level": b.level});
    stated["boxes"] = manifest.boxes.iter().map(extent).collect();
    stated["seeds"] = manifest.seeds.iter().map(|&seed| json!(user(seed))).collect();
    if manifest.lacks_inputs {
        let entries = stated.as_object_mut().expect("a manifest is an object");
        entries.retain(|key, _| !INPUTS.split(' ').skip(2).any(|of| of == key));
    }
    stated
}

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let (manifest, tally) = (subject.manifest, &subject.pass.tally);
    let claimed = ("the manifest", manifest);
    let mut keys =
        ["leaves", "leaves_by_level", "leaves_by_side", "digest"].map(str::to_owned).to_vec();
    keys.extend((0..OCTANTS).map(|octant| format!("octant_digests/{octant}")));
    keys.extend((0..manifest.parts.len()).map(|part| format!("parts/{part}")));
    let of_case = subject.case.map(|case| Geometry::of(&case.facets_lattice));
    let geometry = of_case.or(subject.inputs.geometry);
    let lacks_inputs = manifest.lacks_inputs;
    let inputs = Manifest { lacks_inputs, geometry, ..subject.inputs.clone() };
    let of_leaves = differing(&keys, claimed, ("fact", tally));
    let lines = of_leaves.into_iter().chain(differing_inputs(claimed, ("fact", &inputs)));
    lines.for_each(|line| result.report(line));
    let BySide { outside, inside, crossing } = tally.leaves_by_side;
    if manifest.sides == Sides::Unknown && outside < tally.leaves {
        result.report(format_args!(
            "sides: unknown in the manifest, but of {} leaves {inside} are inside and {crossing} crossing by their words",
            tally.leaves
        ));
    }
    possible_leaks(manifest, result);
    // Of different leaves, `identical` reports the cause. This is the only check of the counts in a mesh whose T0 is not known, such as one
    // made on several ranks.
    if let (Some(mesh), Some(reference)) = (subject.mesh, subject.reference)
        && mesh.words == reference.words
    {
        let expected = ("the reference", &reference.manifest);
        let keys = COMPONENTS.into_iter().chain(["components_ambiguous", "leaks"]);
        let missing = components(manifest, expected, &keys.collect::<Vec<_>>(), result);
        // Another program may state less; the same one states on ranks what it states alone.
        let why = format!("not stated, but by the reference: {missing}");
        match subject.promises.is_empty() {
            _ if missing.is_empty() => {}
            true => result.report(why),
            false => result.note = why,
        }
    }
}

/// The entries about components of T0.
pub(super) const COMPONENTS: [&str; 3] =
    ["components/outside", "components/inside", "components/enclosed"];

/// The manifest has these entries about components as another one, as far as that one has them. Returns those that it lacks.
pub(super) fn components(
    manifest: &Manifest,
    (owner, other): Owned,
    keys: &[&str],
    result: &mut CheckResult,
) -> String {
    let [ours, others] = [manifest, other].map(stated);
    let has = |of: &Value, key: &str| of.pointer(&format!("/{key}")).is_some();
    let (found, missing): (Vec<&str>, Vec<&str>) =
        keys.iter().copied().filter(|key| has(&others, key)).partition(|key| has(&ours, key));
    let lines = differing(&found, ("the manifest", manifest), (owner, other));
    lines.into_iter().for_each(|line| result.report(line));
    missing.join(", ")
}

/// A leak opens between a coarser spacing and a finer one, and has a volume and a point in the root.
fn possible_leaks(manifest: &Manifest, result: &mut CheckResult) {
    let Root { origin, edge } = manifest.root;
    for leak in manifest.leaks.iter().flatten() {
        let Leak { spacing_coarse, spacing_fine, volume, point } = *leak;
        let is_inside = |a: usize| (0.0..=edge).contains(&(point[a] - origin[a]));
        let opens = 0.0 < spacing_fine && spacing_fine < spacing_coarse;
        let is_region = 0.0 < volume && volume <= edge.powi(3) && (0..3).all(is_inside);
        if !(opens && is_region) {
            let (leak, root) = (json(leak), json(&manifest.root));
            result.report(format_args!("leaks: {leak} is not possible in the root {root}"));
        }
    }
}
