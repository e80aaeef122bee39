//! The mesh has leaves in exactly those components of T0 that are kept, and the manifest counts the components.
//!
//! Section 5 of reference/DEFINITION.md. With the case: no leaf lies in a component that is deleted (enclosed, without a
//! seed, or on the side that is not wanted), every other component has leaves, and the manifest states the numbers
//! of components and of enclosed leaves (`complete` establishes that no part of a component is missing). Without it,
//! see [`alone`].

mod alone;

use super::components::Component;
use super::manifest::{COMPONENTS, components};
use super::{Check, CheckResult, Subject, some_leaves};
use contract::manifest::{Components, EnclosedComponents, Manifest, Sides};
use contract::tree::Handle;
use contract::word::{self, Side};

pub(super) const CHECK: Check =
    Check { name: "kept", wanted: |subject| subject.promises.definition, run };

fn run(subject: &Subject, result: &mut CheckResult) {
    let Some(truth) = subject.truth() else {
        if subject.terms.sides == Sides::Unknown {
            return result.lacks(super::UNKNOWN_SIDES);
        }
        alone::check(subject.tree(), &subject.inputs, subject.manifest, result);
        return result.requires(some_leaves(subject));
    };
    result.examined = subject.examined_with(truth);
    let terms = &subject.terms;
    // A component has leaves in the mesh iff it is kept.
    for &Component { side, first, ref leaves, enclosed, .. } in &truth.components {
        let mut octants = leaves.iter().map(|&i| word::octant(truth.words[i as usize]));
        let example = octants.find(|leaf| subject.tree().at(leaf) != Handle::HOLE);
        let enclosed = enclosed && terms.deletes_enclosed();
        let (what, octant) = match (terms.keeps(side as u8) && !enclosed, example) {
            (false, Some(leaf)) => ("deleted, but the mesh has leaves in it, first in", leaf),
            (true, None) => ("kept, but the mesh has no leaf in it:", first),
            _ => continue,
        };
        let why = if enclosed { "enclosed".to_owned() } else { side.to_string() };
        let (total, octant) = (leaves.len(), terms.root.place(octant));
        result.report(format_args!(
            "a component of {total} leaves of T0 is {why} and must be {what} {octant}"
        ));
    }
    let counts = Some(count(&truth.components, &subject.inputs));
    let expected = Manifest { components: counts, ..subject.inputs.clone() };
    components(subject.manifest, ("T0", &expected), &COMPONENTS, result);
}

/// The components by side, as a manifest states them.
fn count(components: &[Component], terms: &Manifest) -> Components {
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
