//! Wrong sides, which the checks `sides` and `crossing` must detect.

use super::SelftestCase;
use super::edit::{self, has_side, with_side};
use super::leaves::middle;
use super::mutant::{Mutant, Mutation, audited, informed};
use contract::leafset::LeafSet;
use contract::manifest::{Ambiguous, Keep};
use contract::tree::Tree;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    informed("one outside leaf labelled inside", "sides", outside_labelled_inside),
    informed("one inside leaf labelled outside", "sides", inside_labelled_outside),
    audited("one leaf of the side that is deleted", "sides", not_kept),
    audited("one leaf of a component flipped", "sides", flipped_among_others),
    informed("one leaf flipped in mesh and T0", "sides", flipped_in_both),
    informed("a whole component flipped in mesh and T0", "sides", component_flipped),
    informed("inside and outside swapped everywhere", "sides", swapped),
    informed("crossing leaf of the mesh labelled outside", "crossing", crossing_labelled_outside),
    informed("crossing leaf labelled outside in mesh and T0", "crossing", crossing_lost_in_both),
    informed("crossing leaf labelled inside in mesh and T0", "crossing", crossing_lost_to_inside),
    informed("leaf of the mesh labelled crossing", "crossing", labelled_crossing),
    informed("leaf labelled crossing in mesh and T0", "crossing", labelled_crossing_in_both),
    informed("one ambiguous component too many in the manifest", "sides", ambiguous_count),
    informed("wrong example of an ambiguous component", "sides", ambiguous_example),
];

/// The words with another side for one leaf that satisfies a predicate, and that leaf.
fn relabelled(set: &LeafSet, to: Side, predicate: impl Fn(u64) -> bool) -> Option<(u64, Vec<u64>)> {
    let i = middle(&set.words, predicate)?;
    let mut words = set.words.clone();
    words[i] = with_side(words[i], to);
    Some((set.words[i], words))
}

fn in_mesh(s: &SelftestCase, from: Side, to: Side) -> Option<Mutation> {
    let (_, words) = relabelled(&s.mesh, to, |w| has_side(w, from))?;
    Some(Mutation::with_words(s, words))
}

/// Relabels a common leaf of mesh and T0 in both.
fn in_both(s: &SelftestCase, to: Side, predicate: impl Fn(u64) -> bool) -> Option<Mutation> {
    let common = |w: u64| predicate(w) && s.base.words.binary_search(&w).is_ok();
    let (leaf, words) = relabelled(&s.mesh, to, common)?;
    let (_, base) = relabelled(&s.base, to, |w| w == leaf)?;
    let mut mutation = Mutation::with_words(s, words);
    mutation.base = edit::with_words(&s.base, base);
    Some(mutation)
}

fn outside_labelled_inside(s: &SelftestCase) -> Option<Mutation> {
    in_mesh(s, Side::Outside, Side::Inside)
}

fn inside_labelled_outside(s: &SelftestCase) -> Option<Mutation> {
    in_mesh(s, Side::Inside, Side::Outside)
}

fn not_kept(s: &SelftestCase) -> Option<Mutation> {
    match s.case.keep {
        Keep::Outside => in_mesh(s, Side::Outside, Side::Inside),
        Keep::Inside => in_mesh(s, Side::Inside, Side::Outside),
        Keep::All => None,
    }
}

fn flipped_among_others(s: &SelftestCase) -> Option<Mutation> {
    if s.case.keep != Keep::All {
        return None;
    }
    let tree = Tree::of_words(&s.mesh.words);
    let outside = 1 << Side::Outside as u8;
    // Leaves of the same component surround it.
    let deep = |w: u64| {
        let neighbourhood = edit::neighbourhood(&tree, w);
        has_side(w, Side::Outside)
            && neighbourhood.handles.iter().all(|&h| tree.kinds(h) & !outside == 0)
    };
    let (_, words) = relabelled(&s.mesh, Side::Inside, deep)?;
    Some(Mutation::with_words(s, words))
}

fn flipped_in_both(s: &SelftestCase) -> Option<Mutation> {
    in_both(s, Side::Inside, |w| has_side(w, Side::Outside))
}

/// The words with inside and outside swapped where a predicate holds.
fn swap(words: &[u64], predicate: impl Fn(u64) -> bool) -> Vec<u64> {
    let swap = |w: u64| if w & 3 < 2 && predicate(w) { w ^ 1 } else { w };
    words.iter().map(|&w| swap(w)).collect()
}

/// Swaps inside and outside in mesh and T0, if nothing is deleted and not all leaves are crossing.
fn flipped(s: &SelftestCase, predicate: impl Fn(u64) -> bool) -> Option<Mutation> {
    let words = swap(&s.mesh.words, &predicate);
    if s.case.keep != Keep::All || words == s.mesh.words {
        return None;
    }
    let mut mutation = Mutation::with_words(s, words);
    mutation.base = edit::with_words(&s.base, swap(&s.base.words, &predicate));
    Some(mutation)
}

fn component_flipped(s: &SelftestCase) -> Option<Mutation> {
    let inside = |w: u64| has_side(w, Side::Inside);
    s.base.words.iter().any(|&w| inside(w)).then(|| flipped(s, inside)).flatten()
}

fn swapped(s: &SelftestCase) -> Option<Mutation> {
    flipped(s, |_| true)
}

fn crossing_labelled_outside(s: &SelftestCase) -> Option<Mutation> {
    in_mesh(s, Side::Crossing, Side::Outside)
}

fn crossing_lost_in_both(s: &SelftestCase) -> Option<Mutation> {
    in_both(s, Side::Outside, |w| has_side(w, Side::Crossing))
}

fn crossing_lost_to_inside(s: &SelftestCase) -> Option<Mutation> {
    in_both(s, Side::Inside, |w| has_side(w, Side::Crossing))
}

fn labelled_crossing(s: &SelftestCase) -> Option<Mutation> {
    let (_, words) = relabelled(&s.mesh, Side::Crossing, |w| !has_side(w, Side::Crossing))?;
    Some(Mutation::with_words(s, words))
}

fn labelled_crossing_in_both(s: &SelftestCase) -> Option<Mutation> {
    let surface = s.case.level_surface;
    in_both(s, Side::Crossing, |w| !has_side(w, Side::Crossing) && word::level(w) == surface)
}

fn ambiguous_count(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.components_ambiguous.count += 1;
    Some(mutation)
}

fn ambiguous_example(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let Ambiguous { example, .. } = &mut mutation.mesh.manifest.components_ambiguous;
    *example = Some(s.case.root.origin);
    Some(mutation)
}
