//! The mesh has leaves in exactly those components of T0 that are kept, and the manifest counts the components.
//!
//! Section 5 of reference/DEFINITION.md. With T0: no leaf lies in a component that is deleted (enclosed, without a
//! seed, or on the side that is not wanted), every other component has leaves, and the manifest states the numbers
//! of components and of enclosed leaves (`complete` establishes that no part of a component is missing). Without T0,
//! see [`check_tree`].

mod alone;

pub use alone::check_tree;

use super::components::Component;
use super::{CheckResult, Subject, Terms, crossing, identical, valid_leaves};
use contract::manifest::{Components, EnclosedComponents};
use contract::word::{self, Side};

/// Name of the check.
pub const NAME: &str = "kept";

/// Checks the mesh against the components of T0 or, without T0, by itself.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = match subject.components() {
        Some((words, components)) => with_base(subject, words, components),
        None => check_tree(subject.tree(), &subject.terms, &subject.mesh.manifest),
    };
    result.examined = subject.mesh.words.len() as u64;
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
            format!(
                "a component of {total} leaves of T0 {why} and must be deleted, but the mesh has leaves in it ({count}), \
                 first the {leaf}"
            )
        }),
        (true, None) => result.report_with(|| {
            let first = terms.root.describe(first);
            format!("a component of {total} leaves of T0 {why} and must be kept, but the mesh has no leaf in it: {first}")
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
