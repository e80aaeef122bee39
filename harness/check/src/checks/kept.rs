//! The mesh has leaves in exactly those components of T0 that are kept, and the manifest counts the components.
//!
//! Section 5 of reference/DEFINITION.md. With the case: no leaf lies in a component that is deleted (enclosed, without a
//! seed, or on the side that is not wanted), every other component has leaves, and the manifest states the numbers
//! of components and of enclosed leaves (`complete` establishes that no part of a component is missing). Without it,
//! see [`alone`].

mod alone;

use super::components::Component;
use super::truth::Truth;
use super::{Check, CheckResult, Subject, Terms, for_definition, json, some_leaves};
use contract::manifest::{Components, EnclosedComponents, Sides};
use contract::octant::Octant;
use contract::tree::Tree;
use contract::word::{self, Side};

/// Name of the check.
pub const NAME: &str = "kept";

pub(super) const CHECK: Check = Check {
    name: NAME,
    wanted: for_definition,
    needs: |subject| if subject.truth().is_some() { None } else { some_leaves(subject) },
    run,
};

fn run(subject: &Subject, result: &mut CheckResult) {
    match subject.truth() {
        Some(truth) => with_truth(subject, truth, result),
        None if subject.terms.sides == Sides::Unknown => result.lacks(super::UNKNOWN_SIDES),
        None => alone::check(subject.tree(), &subject.inputs, subject.manifest, result),
    }
}

fn with_truth(subject: &Subject, truth: &Truth, result: &mut CheckResult) {
    result.examined = subject.examined_with(truth);
    for component in &truth.components {
        let leaves = component.leaves.iter().map(|&i| word::octant(truth.words[i as usize]));
        let example = leaves.clone().find(|leaf| has_leaves(subject.tree(), leaf));
        kept_or_deleted(component, example, &subject.terms, result);
    }
    let counts = count(&truth.components, &subject.inputs);
    let base = subject.base.as_ref().map(|(base, _)| &base.manifest);
    for (prefix, manifest) in [("", Some(subject.manifest)), ("T0: ", base)] {
        if let Some(counted) = manifest.and_then(|m| m.components.as_ref()) {
            same_counts(prefix, counted, &counts, &subject.terms, result);
        }
    }
    result.note = note(&counts);
    if subject.manifest.components.is_none() {
        result.note += "; the manifest does not count them";
    }
}

/// Whether a mesh has any leaf in an octant, or one that contains it.
fn has_leaves(tree: &Tree, octant: &Octant) -> bool {
    tree.at(octant) != contract::tree::Handle::HOLE
}

/// A component has leaves in the mesh iff it is kept.
fn kept_or_deleted(
    component: &Component,
    example: Option<Octant>,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let (side, first) = (component.side, &component.first);
    let wanted = terms.keeps(side as u8);
    let enclosed = component.enclosed && terms.deletes_enclosed();
    let why = match (enclosed, terms.seeds.is_empty()) {
        (true, _) => "is enclosed".to_owned(),
        (false, true) => format!("is {side}"),
        (false, false) => format!("{} a seed", if wanted { "has" } else { "does not have" }),
    };
    let total = component.leaves.len();
    match (wanted && !enclosed, example) {
        (false, Some(leaf)) => result.report_with(|| {
            let leaf = terms.root.describe(&leaf);
            format!(
                "a component of {total} leaves of T0 {why} and must be deleted, but the mesh has leaves in it, first in the leaf \
                 of T0 {leaf}"
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
fn count(components: &[Component], terms: &Terms) -> Components {
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
            "{prefix}the manifest places an enclosed component at {}, and the first one is at {}",
            json(&claimed),
            json(&expected)
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
