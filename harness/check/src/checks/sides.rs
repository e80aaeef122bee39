//! Each leaf has its side: crossing iff a facet crosses the leaf of T0 that contains it, else the side of its component, which
//! seeds or, without seeds, rays determine.
//!
//! Section 4 of reference/DEFINITION.md. With the case: the components of T0's leaves (connected through faces) are
//! found by union-find, the seeds or the harness's own exact rays determine the side of each, and every leaf of the mesh must have
//! the side of T0's leaf. What the manifest states of ambiguous components and leaks must be true. Without the case:
//! no outside leaf shares part of a face with an inside leaf, and no leaf has a side that is deleted. The check cannot detect that
//! all rays are wrong, which is possible on a body that is not watertight; the oracles can. A promise of less than the
//! definition is judged beyond a band around the geometry (`super::region`).

use super::components::{self, Component};
use super::region::Survey;
use super::truth::Truth;
use super::{CheckResult, Subject, contact, some_leaves};
use crate::oracle::is_closed;
use contract::case::Case;
use contract::manifest::{Ambiguous, Keep, Leak, Manifest, Sides};
use contract::octant::LEVEL_MAX;
use contract::tree::{HOLES, Tree};
use contract::word::{self, Side};

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    if subject.terms.sides == Sides::Unknown {
        return super::unknown_sides(subject, subject.promises.sides.is_some(), result);
    }
    if !subject.promises.definition {
        return Survey::of(subject, result, Survey::check_sides);
    }
    let terms = &subject.terms;
    not_kept(subject.tree(), terms, result);
    of_neighbours(subject.tree(), terms, result);
    let Some(truth) = subject.truth() else {
        let kinds = subject.tree().kinds(subject.tree().root) & !HOLES;
        let alike = || (kinds.count_ones() == 1).then(|| "all leaves have one side".to_owned());
        return result.requires(some_leaves(subject.tree_with_deleted()).or_else(alike));
    };
    let judges = if terms.seeds.is_empty() { "rays" } else { "seeds" };
    truth.compare(subject.tree(), &mut |found| {
        let Some(side) = found.base.map(Truth::side) else { return };
        if [HOLES, 1 << side as u8].contains(&found.kinds) {
            return;
        }
        let (given, leaf) = (contact::name(found.kinds), terms.root.place(found.octant));
        let why = match side {
            Side::Crossing => "a facet crosses its leaf of T0".to_owned(),
            _ => format!("{judges} show that its component is {side}"),
        };
        result.report(format_args!("the leaf is {given}, but {why}: {leaf}"));
    });
    let manifest = subject.manifest;
    let components_ambiguous = manifest.components_ambiguous.map(|a| ambiguous(a, truth, terms));
    let leaks = manifest.leaks.as_ref().map(|_| leaks(subject, truth));
    let expected = Manifest { components_ambiguous, leaks, ..terms.clone() };
    let keys = ["components_ambiguous", "leaks"];
    super::manifest::components(manifest, ("T0", &expected), &keys, result);
}

/// Inside and outside leaves share no face.
fn of_neighbours(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let [outside, inside] = [Side::Outside, Side::Inside].map(|side| 1 << side as u8);
    contact::visit(tree, outside, inside, &mut |outside, _, across| {
        if across & inside != 0 {
            let at = terms.root.place(outside);
            result.report(format_args!("an inside leaf shares a face with the outside leaf {at}"));
        }
    });
}

/// Reports leaves whose side is deleted.
fn not_kept(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let kept = (0..3).filter(|&k| terms.keeps(k)).fold(HOLES, |all, k| all | 1 << k);
    let deleted = |handle| tree.kinds(handle) & !kept;
    tree.walk_where(|_, handle| deleted(handle) != 0, &mut |octant, handle| {
        let (side, leaf) = (contact::name(deleted(handle)), terms.root.place(octant));
        result.report(format_args!("{side} leaves are deleted, but one still exists: {leaf}"));
    });
}

/// The ambiguous components of T0, with the example that is claimed if it is one.
fn ambiguous(claimed: Ambiguous, truth: &Truth, terms: &Manifest) -> Ambiguous {
    let found: Vec<_> = truth.components.iter().filter(|c| c.is_ambiguous()).collect();
    let places = || found.iter().map(|c| terms.root.to_user(c.first.centre()));
    let is_claimed = |at: &[f64; 3]| claimed.example.is_some_and(|it| terms.same_place(it, *at));
    let example = places().find(is_claimed).or_else(|| places().next());
    Ambiguous { count: found.len() as u64, example }
}

/// The leaks of a case with this T0: regions that are closed at a coarser spacing and open at that of the mesh.
fn leaks(subject: &Subject, truth: &Truth) -> Vec<Leak> {
    let case = subject.case.expect("T0 is that of a case");
    let terms = &subject.inputs;
    if !terms.seeds.is_empty() && is_closed(&case.facets_lattice) {
        return Vec::new();
    }
    let levels = (1..=2).filter_map(|k| terms.level_surface.checked_sub(k));
    levels.flat_map(|level| between(case, terms, truth, level)).collect()
}

/// The leaks between T0 cut at a level, and T0.
fn between(case: &Case, terms: &Manifest, truth: &Truth, level: u8) -> Vec<Leak> {
    let mut cut = Manifest { level_surface: level, ..terms.clone() };
    cut.boxes.iter_mut().for_each(|b| b.level = b.level.min(level));
    let make = |terms: &Manifest| Truth::of(case, terms).expect("cut, T0 has no more leaves");
    let mut coarse = make(&cut);
    let seeded = components::seeded_leaves(&coarse.words, terms);
    if seeded.keys().any(|&leaf| word::is_crossing(coarse.words[leaf as usize])) {
        coarse = make(&Manifest { seeds: Vec::new(), ..cut });
    }
    let root = &terms.root;
    let leak = |component: &Component| {
        let levels = component.leaves.iter().map(|&i| word::level(coarse.words[i as usize]));
        let cells: u64 = levels.map(word::span).sum();
        Leak {
            spacing_coarse: root.edge_of(level),
            spacing_fine: root.edge_of(terms.level_surface),
            volume: cells as f64 * root.edge_of(LEVEL_MAX).powi(3),
            point: root.to_user(component.first.centre()),
        }
    };
    let is_flow_inside = terms.keep == Keep::Inside && !terms.seeds.is_empty();
    let has_leaked = |component: &&Component| {
        // All leaves of T0 within a leaf that no facet crosses have one side.
        let fine = truth.component_at(&component.first).map(|fine| fine.side);
        let leaks = match (component.side, fine) {
            (Side::Inside, Some(Side::Outside)) => !is_flow_inside,
            (Side::Outside, Some(Side::Inside)) => terms.keep == Keep::Inside,
            _ => false,
        };
        leaks && components::seed_in(&component.leaves, &seeded).is_none()
    };
    let mut leaked: Vec<&Component> = coarse.components.iter().filter(has_leaked).collect();
    leaked.sort_by_key(|component| (component.first.level, word::key_of(component.first.corner)));
    leaked.into_iter().map(leak).collect()
}
