//! Each leaf has its side: crossing iff a facet crosses the leaf of T0 that contains it, else the side of its component, which
//! seeds or, without seeds, rays determine.
//!
//! Section 4 of reference/DEFINITION.md. With the case: the components of T0's leaves (connected through faces) are
//! found by union-find, the seeds or the harness's own exact rays determine the side of each, and every leaf of the mesh and of
//! an engine's T0 must have the side of T0's leaf. The manifest must state the number of ambiguous components, and the leaks. Without the case:
//! no outside leaf shares part of a face with an inside leaf, and no leaf has a side that is deleted. The check cannot detect that
//! all rays are wrong, which is possible on a body that is not watertight; the oracles can. A promise of less than the
//! definition is judged beyond a band around the geometry ([`super::region`]).

use super::components::Component;
use super::contact;
use super::region::Survey;
use super::truth::Truth;
use super::{Check, CheckResult, Subject, json, some_leaves};
use contract::manifest::{Ambiguous, Manifest, Sides};
use contract::tree::{HOLES, Kind, Tree};
use contract::word::Side;

pub(super) const CHECK: Check = Check {
    name: "sides",
    wanted: |subject| subject.promises.definition || subject.promises.sides.is_some(),
    needs: |subject| match subject.truth() {
        Some(truth) => {
            truth.components.is_empty().then(|| "all leaves of T0 are crossing".to_owned())
        }
        None => some_leaves(subject).or_else(|| {
            let kinds = subject.tree().kinds(subject.tree().root()) & !HOLES;
            (kinds.count_ones() == 1).then(|| "all leaves have the same side".to_owned())
        }),
    },
    run,
};

fn run(subject: &Subject, result: &mut CheckResult) {
    if subject.terms.sides == Sides::Unknown {
        return super::unknown_sides(subject, subject.promises.sides.is_some(), result);
    }
    if !subject.promises.definition {
        return Survey::of(subject, result, Survey::check_sides);
    }
    let terms = &subject.terms;
    not_kept(subject.tree(), terms, result);
    of_neighbours(subject.tree(), terms, result);
    let Some(truth) = subject.truth() else { return };
    for (prefix, manifest, pass) in subject.meshes() {
        of_components(prefix, pass.tree(), truth, subject, result);
        ambiguous(prefix, manifest, &truth.components, terms, result);
    }
    stated_leaks(subject, truth, result);
}

/// The manifests state the leaks of T0, if they state any or none.
fn stated_leaks(subject: &Subject, truth: &Truth, result: &mut CheckResult) {
    let (Some(case), Some(facets)) = (subject.case, subject.facets()) else { return };
    let mut leaks = None;
    for (prefix, manifest, _) in subject.meshes() {
        let Some(stated) = &manifest.leaks else { continue };
        let find = || super::leaks::find(case, facets, &subject.inputs, truth);
        let leaks = leaks.get_or_insert_with(find);
        if stated != leaks {
            result.report(format!(
                "{prefix}the manifest states the leaks {}, but T0 has {}",
                json(stated),
                json(leaks)
            ));
        }
    }
}

/// Inside and outside leaves share no face.
fn of_neighbours(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let inside = 1 << Side::Inside as u8;
    contact::visit(tree, inside, &mut |outside, kind, across| {
        if kind == Side::Outside as Kind && across & inside != 0 {
            let leaf = terms.root.describe(&outside);
            result.report_with(|| {
                format!("an inside leaf shares a face with the outside leaf {leaf}")
            });
        }
    });
}

/// Leaves have the sides of the leaves of T0 that contain them.
fn of_components(
    prefix: &str,
    tree: &Tree,
    truth: &Truth,
    subject: &Subject,
    result: &mut CheckResult,
) {
    let judges = if subject.terms.seeds.is_empty() { "rays" } else { "seeds" };
    truth.compare(tree, &mut |found| {
        let Some(kind) = found.base.filter(|_| !found.is_hole()) else { return };
        let side = Truth::side(kind);
        if found.kinds == 1 << side as u8 {
            return;
        }
        result.report_with(|| {
            let (given, leaf) =
                (contact::name(found.kinds), subject.terms.root.describe(&found.octant));
            let why = match side {
                Side::Crossing => "a facet crosses its leaf of T0".to_owned(),
                _ => format!("{judges} show that its component is {side}"),
            };
            format!("{prefix}the leaf is {given}, but {why}: {leaf}")
        });
    });
}

/// Reports leaves whose side is deleted.
fn not_kept(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let kept = (0..3).filter(|&k| terms.keeps(k)).fold(HOLES, |all, k| all | 1 << k);
    tree.walk(&mut |octant, handle| {
        let deleted = tree.kinds(handle) & !kept;
        if deleted != 0 && !handle.is_node() {
            result.report_with(|| {
                let (side, leaf) = (contact::name(deleted), terms.root.describe(&octant));
                format!("{side} leaves are deleted, but one still exists: {leaf}")
            });
        }
        deleted != 0
    });
}

/// The manifest states the number of ambiguous components, and its example is in one of them.
fn ambiguous(
    prefix: &str,
    manifest: &Manifest,
    components: &[Component],
    terms: &Manifest,
    result: &mut CheckResult,
) {
    let Ambiguous { count, example } = manifest.components_ambiguous;
    let found: Vec<_> = components.iter().filter(|c| c.is_ambiguous()).collect();
    if count != found.len() as u64 {
        let total = found.len();
        result.report(format!(
            "{prefix}the manifest counts {count} ambiguous components, but there are {total}"
        ));
    }
    let near = |c: &&Component| {
        let centre = terms.root.to_user(c.first.centre());
        example.is_some_and(|e| terms.same_place(e, centre))
    };
    let placed = if found.is_empty() { example.is_none() } else { found.iter().any(near) };
    if !placed {
        result.report(format!(
            "{prefix}the example {} of an ambiguous component is in no such component",
            json(&example)
        ));
    }
}
