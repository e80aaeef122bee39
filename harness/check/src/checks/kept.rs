//! The mesh has leaves in exactly those components of T0 that are kept, and the manifest counts the components.
//!
//! Section 5 of reference/DEFINITION.md. With T0: no leaf lies in a component that is deleted (enclosed, without a
//! seed, or on the side that is not wanted), every other component has leaves, and the manifest states the numbers
//! of components and of enclosed leaves (`complete` establishes that no part of a component is missing). Without T0,
//! from the components of the mesh itself: if enclosed components are deleted, either all outside components have a
//! face on the root's boundary or none has; every seed lies in a leaf of flow, and every component of flow has a
//! seed; and each side has as many components as the manifest counts. Refinement connects and separates nothing, so
//! these components are those of T0. Without T0 and without counts in the manifest, the check cannot detect that a
//! whole component is missing.
//!
//! The audit checks neither the connection of leaves nor their number of components, only the places of the seeds
//! and of the example, and whether the counts in the manifest are possible.

use super::components::{self, Component};
use super::{CheckResult, Subject, Terms, crossing, identical, valid_leaves};
use contract::manifest::{Components, EnclosedComponents, Manifest, Tree as Kind};
use contract::octant::{Octant, UNITS_PER_CELL};
use contract::tree::Tree;
use contract::word::{self, Side};

/// Name of the check.
pub const NAME: &str = "kept";

/// Checks the mesh against the components of T0 or, without T0, by itself.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = match subject.components() {
        Some((words, components)) => with_base(subject, words, components),
        None => alone(subject),
    };
    result.examined = subject.mesh.words.len() as u64;
    result
}

/// Checks the places of seeds and of the example in a tree, and whether the counts in its manifest are possible.
pub fn check_tree(tree: &Tree, terms: &Terms, manifest: &Manifest) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    seeds_in_flow(tree, terms, &mut result);
    if let Some(counted) = &manifest.components {
        possible(tree, counted, manifest.tree, terms, &mut result);
    }
    result
}

fn with_base(subject: &Subject, words: &[u64], components: &[Component]) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let found = leaves_by_component(subject, words, components);
    for (component, (count, example)) in components.iter().zip(found) {
        kept_or_deleted(component, count, example, &subject.terms, &mut result);
    }
    let counts = count(components, &subject.terms);
    let sets = [("", Some(subject.mesh)), ("T0: ", subject.base)];
    for (prefix, manifest) in sets.map(|(prefix, set)| (prefix, set.map(|set| &set.manifest))) {
        if let Some(counted) = manifest.and_then(|m| m.components.as_ref()) {
            same_counts(prefix, counted, &counts, &subject.terms, &mut result);
        }
    }
    result.note = note(&counts);
    if subject.mesh.manifest.components.is_none() {
        result.note += "; the manifest does not count them";
    }
    result
}

/// For each component, the number of the mesh's leaves in it and the first of them.
fn leaves_by_component(
    subject: &Subject,
    words: &[u64],
    components: &[Component],
) -> Vec<(u64, Option<u64>)> {
    let mut component_of = vec![None; words.len()];
    for (c, component) in components.iter().enumerate() {
        component.leaves.iter().for_each(|&i| component_of[i as usize] = Some(c));
    }
    let mut found = vec![(0, None); components.len()];
    for leaf in valid_leaves(&subject.mesh.words) {
        if let Some(c) = crossing::enclosing(words, leaf).and_then(|i| component_of[i]) {
            let (count, first) = &mut found[c];
            *count += 1;
            first.get_or_insert(leaf);
        }
    }
    found
}

/// A component has leaves in the mesh iff it is kept.
fn kept_or_deleted(
    component: &Component,
    count: u64,
    example: Option<u64>,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let (side, first) = (component.side, &component.first);
    let wanted = terms.keeps(side as u8);
    let why = match (component.enclosed, terms.seeds.is_empty()) {
        (true, _) => "is enclosed".to_owned(),
        (false, true) => format!("is {side}"),
        (false, false) => format!("{} a seed", if wanted { "has" } else { "does not have" }),
    };
    let total = component.leaves.len();
    match (wanted && !component.enclosed, example) {
        (false, Some(leaf)) => result.report_with(|| {
            let leaf = identical::describe(leaf, &terms.root);
            format!("a component of {total} leaves of T0 {why} and is deleted, but {count} leaves lie in it, first the {leaf}")
        }),
        (true, None) => result.report_with(|| {
            let first = terms.root.describe(first);
            format!("a component of {total} leaves of T0 {why} and is kept, but the mesh has no leaf in it: {first}")
        }),
        _ => {}
    }
}

/// The components by side, as a manifest states them.
pub fn count(components: &[Component], terms: &Terms) -> Components {
    let of_side = |side| components.iter().filter(|c| c.side == side).count() as u64;
    let enclosed = || components.iter().filter(|c| c.enclosed);
    let first = enclosed().map(|c| c.first).min_by_key(|o| (o.level, word::key_of(o.corner)));
    Components {
        outside: of_side(Side::Outside),
        inside: of_side(Side::Inside),
        enclosed: EnclosedComponents {
            count: enclosed().count() as u64,
            leaves: enclosed().map(|c| c.leaves.len() as u64).sum(),
            example: first.map(|octant| terms.root.to_user(octant.centre())),
        },
    }
}

fn same_counts(
    prefix: &str,
    counted: &Components,
    found: &Components,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let (a, b) = (counted, found);
    let numbers = [
        ("outside components", a.outside, b.outside),
        ("inside components", a.inside, b.inside),
        ("enclosed components", a.enclosed.count, b.enclosed.count),
        ("leaves of T0 in enclosed components", a.enclosed.leaves, b.enclosed.leaves),
    ];
    for (what, counted, found) in numbers.into_iter().filter(|(_, counted, found)| counted != found)
    {
        result.report(format!("{prefix}the manifest counts {counted} {what}, and T0 has {found}"));
    }
    let (claimed, expected) = (a.enclosed.example, b.enclosed.example);
    let agree = match (claimed, expected) {
        (Some(x), Some(y)) => terms.same_place(x, y),
        (x, y) => x.is_none() && y.is_none(),
    };
    if !agree {
        result.report(format!(
            "{prefix}the manifest places an enclosed component at {claimed:?}, and the first one is at {expected:?}"
        ));
    }
}

/// The components by side and the enclosed ones, as text.
fn note(counts: &Components) -> String {
    let Components { outside, inside, enclosed } = counts;
    let mut text = format!("components of T0: {outside} outside, {inside} inside");
    if let EnclosedComponents { count, leaves, example: Some(at) } = enclosed {
        text += &format!(
            "; the far field does not reach {count} of those outside, which are deleted with their {leaves} leaves, \
             for example at {at:?}"
        );
    }
    text
}

/// Checks the mesh by itself.
fn alone(subject: &Subject) -> CheckResult {
    let (terms, manifest) = (&subject.terms, &subject.mesh.manifest);
    let mut result = check_tree(subject.tree(), terms, manifest);
    let words = valid_leaves(&subject.mesh.words);
    let groups = components::groups(&words);
    let side = |group: &Vec<u32>| word::side(words[group[0] as usize]);
    let describe = |group: &Vec<u32>| identical::describe(words[group[0] as usize], &terms.root);
    let of_side = |side_: Side| groups.iter().filter(move |group| side(group) == side_);
    if terms.deletes_enclosed() {
        let (far, enclosed): (Vec<_>, Vec<_>) =
            of_side(Side::Outside).partition(|group| components::touches_boundary(&words, group));
        for group in enclosed.iter().filter(|_| !far.is_empty()) {
            let (count, leaf) = (group.len(), describe(group));
            result.report_with(|| {
                format!(
                    "enclosed components are deleted, but {count} outside leaves form one: no face on the root's \
                     boundary, although other outside leaves have one; the first is the {leaf}"
                )
            });
        }
    }
    if !terms.seeds.is_empty() {
        let seeded = components::seeded_leaves(&words, terms);
        for group in of_side(terms.side_of_flow()) {
            if !group.iter().any(|i| seeded.binary_search(i).is_ok()) {
                let (count, leaf) = (group.len(), describe(group));
                result.report_with(|| {
                    format!("no seed lies in a component of {count} leaves of flow, the first of which is the {leaf}")
                });
            }
        }
    }
    if let Some(counted) = &manifest.components {
        for (side, expected) in kept_counts(counted, terms) {
            let found = of_side(side).count() as u64;
            if found != expected {
                result.report(format!(
                    "the manifest leaves {expected} {side} components, and the mesh has {found}"
                ));
            }
        }
    }
    result
}

/// The sides that are kept, with the numbers of components that a manifest leaves of them.
fn kept_counts(counted: &Components, terms: &Terms) -> Vec<(Side, u64)> {
    let outside = counted.outside.saturating_sub(counted.enclosed.count);
    let all = [(Side::Outside, outside), (Side::Inside, counted.inside)];
    all.into_iter().filter(|(side, _)| terms.keeps(*side as u8)).collect()
}

/// Every seed lies in a leaf of flow.
fn seeds_in_flow(tree: &Tree, terms: &Terms, result: &mut CheckResult) {
    let flow = terms.side_of_flow();
    for (i, &seed) in terms.seeds.iter().enumerate() {
        if !components::in_root(seed) {
            result.report(format!("seed {i} at {seed:?} on the lattice lies outside the root"));
            continue;
        }
        let found = tree.locate(seed.map(|q| (q / UNITS_PER_CELL) as u32));
        if found.is_none_or(|(_, kind)| kind != flow as u8) {
            let at = terms.root.to_user(seed);
            let found = match found {
                Some((leaf, kind)) => {
                    format!(
                        "in the {} leaf {}",
                        super::contact::name(1 << kind),
                        terms.root.describe(&leaf)
                    )
                }
                None => "in no leaf".to_owned(),
            };
            result.report(format!(
                "seed {i} at {at:?} lies {found}, and not in a leaf that is {flow}"
            ));
        }
    }
}

/// Whether the counts in a manifest can be right, and the example lies in a leaf that is deleted.
fn possible(
    tree: &Tree,
    counted: &Components,
    kind: Kind,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let EnclosedComponents { count, leaves, example } = counted.enclosed;
    let none = count == 0 && leaves == 0 && example.is_none();
    // The far field is another outside component.
    let some = terms.deletes_enclosed()
        && 0 < count
        && count < counted.outside
        && count <= leaves
        && example.is_some_and(|at| deleted_at(tree, at, kind, terms));
    if !none && !some {
        result.report(format!(
            "{count} of {} outside components cannot be enclosed with {leaves} leaves of T0 and one at {example:?}",
            counted.outside
        ));
    }
    let kinds = tree.kinds(tree.root());
    let sides = match kind {
        Kind::Final => kept_counts(counted, terms),
        Kind::Base => vec![(Side::Outside, counted.outside), (Side::Inside, counted.inside)],
    };
    for (side, expected) in sides {
        if (expected > 0) != (kinds & 1 << side as u8 != 0) {
            let leaves = if expected > 0 { "no leaf is" } else { "leaves are" };
            result.report(format!(
                "the manifest leaves {expected} {side} components, but {leaves} {side}"
            ));
        }
    }
}

/// Whether a point lies in a leaf that was deleted from a final mesh, or that is outside in T0.
fn deleted_at(tree: &Tree, at: [f64; 3], kind: Kind, terms: &Terms) -> bool {
    let Some(point) = terms.root.quantise_seed(at) else { return false };
    let found = tree.locate(point.map(|q| (q / UNITS_PER_CELL) as u32));
    match kind {
        Kind::Final => found.is_none(),
        Kind::Base => found.is_some_and(|(leaf, side): (Octant, u8)| {
            side == Side::Outside as u8 && terms.same_place(at, terms.root.to_user(leaf.centre()))
        }),
    }
}
