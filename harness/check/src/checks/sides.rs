//! One side per component, and the side that rays find.
//!
//! Section 4 of reference/DEFINITION.md. With T0: components of its leaves over faces are found by
//! union-find, each is decided by the harness's own exact rays, and every leaf must have its
//! component's side; the ambiguous components must be counted as the manifest counts them; every
//! leaf of the mesh must have the side of the T0 leaf it lies in. Without T0: no outside leaf
//! shares part of a face with an inside one, and no leaf has a side that is deleted. Misses: a body
//! whose rays agree on what is wrong, as a leaky one's may; the oracles are for that.

use super::components::{self, Component};
use super::contact::{self, Contacts};
use super::{CheckResult, Subject, Terms, crossing, identical};
use contract::leafset::LeafSet;
use contract::manifest::Ambiguous;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::tree::{Handle, Kind, Tree};
use contract::word::{self, Side};

const NAME: &str = "sides";

/// Checks the mesh against T0 and T0 against rays, or the mesh alone.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = check_tree(subject.tree(), &subject.terms);
    result.examined = subject.mesh.words.len() as u64;
    if let Some(base) = subject.base {
        let words = subject.sound(&base.words);
        inherited(subject, &words, &mut result);
        let components = components::find(&words, &Parity::new(&subject.case.facets_lattice));
        labelled(&components, &words, &subject.terms, &mut result);
        for (whose, set) in [("", subject.mesh), ("T0: ", base)] {
            ambiguous(whose, set, &components, &subject.terms, &mut result);
        }
        let undecided = components.iter().filter(|c| c.ambiguous).count();
        result.note = format!("{} components, {undecided} ambiguous", components.len());
    }
    result
}

/// What can be said of the leaves alone.
pub fn check_tree(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    unwanted(tree, tree.root(), Octant::ROOT, terms, &mut result);
    let inside = 1 << Side::Inside as u8;
    let matters = |kind: Kind, _: u8| kind == Side::Outside as Kind;
    Contacts { tree, sought: inside, matters: &matters }.visit(&mut |outside, _, across| {
        if across & inside != 0 {
            let leaf = terms.root.describe(&outside);
            result
                .find_with(|| format!("an inside leaf shares a face with the outside leaf {leaf}"));
        }
    });
    result
}

/// No leaf has a side that is deleted.
fn unwanted(tree: &Tree, at: Handle, octant: Octant, terms: &Terms, result: &mut CheckResult) {
    let wanted =
        (0..3).filter(|&k| terms.keeps(k)).fold(contract::tree::HOLES, |all, k| all | 1 << k);
    let foreign = tree.kinds(at) & !wanted;
    if foreign == 0 {
        return;
    }
    if at.is_node() {
        for d in 0..8 {
            unwanted(tree, tree.child(at, d, octant.level), octant.child(d), terms, result);
        }
    } else {
        result.find_with(|| {
            let (side, leaf) = (contact::name(foreign), terms.root.describe(&octant));
            format!("{side} leaves are deleted, but here is one: {leaf}")
        });
    }
}

/// Every leaf has the side of the T0 leaf it lies in.
fn inherited(subject: &Subject, base: &[u64], result: &mut CheckResult) {
    for &w in &subject.sound(&subject.mesh.words) {
        if let Some(from) = crossing::enclosing(base, w)
            && w & 3 != from & 3
        {
            let (side, root) = (word::side(from), &subject.terms.root);
            result.find_with(|| {
                format!("in a T0 leaf that is {side} lies a {}", identical::tell(w, root))
            });
        }
    }
}

/// Every leaf of T0 has its component's side.
fn labelled(components: &[Component], words: &[u64], terms: &Terms, result: &mut CheckResult) {
    for component in components {
        for &i in &component.leaves {
            if word::side(words[i as usize]) != component.side {
                let (side, count) = (component.side, component.leaves.len());
                result.find_with(|| {
                    let leaf = identical::tell(words[i as usize], &terms.root);
                    format!("rays find a component of {count} leaves to be {side}; of it, T0 has the {leaf}")
                });
            }
        }
    }
}

/// The manifest counts ambiguous components as rays do, and places its example in one of them.
fn ambiguous(
    whose: &str,
    set: &LeafSet,
    components: &[Component],
    terms: &Terms,
    result: &mut CheckResult,
) {
    let Ambiguous { count, example } = set.manifest.components_ambiguous;
    let found: Vec<_> = components.iter().filter(|c| c.ambiguous).collect();
    if count != found.len() as u64 {
        let total = found.len();
        result.find(format!(
            "{whose}the manifest has {count} ambiguous components, rays find {total}"
        ));
    }
    let near = |c: &&Component| {
        let at = terms.root.to_user(c.first.centre());
        // Exact on the lattice; in user units within rounding.
        example.is_some_and(|e| (0..3).all(|a| (e[a] - at[a]).abs() <= 1e-9 * terms.root.edge))
    };
    let placed = if found.is_empty() { example.is_none() } else { found.iter().any(near) };
    if !placed {
        result
            .find(format!("{whose}the example of an ambiguous component, {example:?}, is in none"));
    }
}
