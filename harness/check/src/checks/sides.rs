//! Each component has one side, and it is the side that seeds or, without seeds, rays determine.
//!
//! Section 4 of reference/DEFINITION.md. With T0: the components of its leaves (connected through faces) are
//! found by union-find, the seeds or the harness's own exact rays determine the side of each, and every leaf must
//! have the side of its component. The manifest must state the number of ambiguous components. Every leaf of the mesh
//! must have the side of the T0 leaf that contains it. Without T0: no outside leaf shares part of a face with
//! an inside leaf, and no leaf has a side that is deleted. The check cannot detect that all rays are wrong,
//! which is possible on a body that is not watertight; the oracles can.

use super::components::Component;
use super::contact::{self, Contacts};
use super::{CheckResult, Subject, Terms, crossing, identical};
use contract::leafset::LeafSet;
use contract::manifest::Ambiguous;
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Tree};
use contract::word::{self, Side};

const NAME: &str = "sides";

/// Checks the mesh against T0 and T0 against seeds or rays or, without T0, the mesh alone.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = check_tree(subject.tree(), &subject.terms);
    result.examined = subject.mesh.words.len() as u64;
    if let (Some(base), Some((words, components))) = (subject.base, subject.components()) {
        crossing::inherited(subject, words, &|w, base| w & 3 != base & 3, &mut result);
        labelled(components, words, &subject.terms, &mut result);
        for (prefix, set) in [("", subject.mesh), ("T0: ", base)] {
            ambiguous(prefix, set, components, &subject.terms, &mut result);
        }
        let undecided = components.iter().filter(|c| c.ambiguous).count();
        result.note = format!("{} components, {undecided} ambiguous", components.len());
    }
    result
}

/// Checks the sides of neighbours, from the leaves only.
pub fn check_tree(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    not_kept(tree, tree.root(), Octant::ROOT, terms, &mut result);
    let inside = 1 << Side::Inside as u8;
    let matters = |kind: Kind, _: u8| kind == Side::Outside as Kind;
    Contacts { tree, sought: inside, matters: &matters }.visit(&mut |outside, _, across| {
        if across & inside != 0 {
            let leaf = terms.root.describe(&outside);
            result.report_with(|| {
                format!("an inside leaf shares a face with the outside leaf {leaf}")
            });
        }
    });
    result
}

/// Reports leaves whose side is deleted.
fn not_kept(tree: &Tree, handle: Handle, octant: Octant, terms: &Terms, result: &mut CheckResult) {
    let kept = (0..3).filter(|&k| terms.keeps(k)).fold(HOLES, |all, k| all | 1 << k);
    let deleted = tree.kinds(handle) & !kept;
    if deleted == 0 {
        return;
    }
    if handle.is_node() {
        for d in 0..8 {
            not_kept(tree, tree.child(handle, d, octant.level), octant.child(d), terms, result);
        }
    } else {
        result.report_with(|| {
            let (side, leaf) = (contact::name(deleted), terms.root.describe(&octant));
            format!("{side} leaves are deleted, but one still exists: {leaf}")
        });
    }
}

/// Every leaf of T0 has the side of its component.
fn labelled(components: &[Component], words: &[u64], terms: &Terms, result: &mut CheckResult) {
    let judges = if terms.seeds.is_empty() { "rays" } else { "seeds" };
    for component in components {
        for &i in &component.leaves {
            if word::side(words[i as usize]) != component.side {
                let (side, count) = (component.side, component.leaves.len());
                result.report_with(|| {
                    let leaf = identical::describe(words[i as usize], &terms.root);
                    format!("{judges} show that a component of {count} leaves is {side}, but it contains the T0 {leaf}")
                });
            }
        }
    }
}

/// The manifest states the number of ambiguous components, and its example is in one of them.
fn ambiguous(
    prefix: &str,
    set: &LeafSet,
    components: &[Component],
    terms: &Terms,
    result: &mut CheckResult,
) {
    let Ambiguous { count, example } = set.manifest.components_ambiguous;
    let found: Vec<_> = components.iter().filter(|c| c.ambiguous).collect();
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
            "{prefix}the example {example:?} of an ambiguous component is in no such component"
        ));
    }
}
