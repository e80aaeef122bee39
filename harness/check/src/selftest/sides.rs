//! Sides flipped: for `sides` and `crossing`.

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited, informed};
use super::surgery::{self, is, sided};
use contract::leafset::LeafSet;
use contract::manifest::{Ambiguous, Keep};
use contract::tree::Tree;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    informed("one outside leaf called inside", "sides", outside_called_inside),
    informed("one inside leaf called outside", "sides", inside_called_outside),
    audited("one leaf of the side that is deleted", "sides", unwanted),
    audited("one leaf of a component flipped", "sides", flipped_among_others),
    informed("one leaf flipped in mesh and T0", "sides", flipped_in_both),
    informed("a whole component flipped in mesh and T0", "sides", component_flipped),
    informed("inside and outside swapped throughout", "sides", swapped),
    informed("crossing leaf of the mesh called outside", "crossing", crossing_called_outside),
    informed("crossing leaf called outside in mesh and T0", "crossing", crossing_lost_in_both),
    informed("crossing leaf called inside in mesh and T0", "crossing", crossing_lost_to_inside),
    informed("leaf of the mesh called crossing", "crossing", called_crossing),
    informed("leaf called crossing in mesh and T0", "crossing", called_crossing_in_both),
    informed("an ambiguous component too many in the manifest", "sides", ambiguous_count),
    informed("an example of no ambiguous component", "sides", ambiguous_example),
];

/// The words with one that `wanted` holds for given another side.
fn relabelled(set: &LeafSet, to: Side, wanted: impl Fn(u64) -> bool) -> Option<(u64, Vec<u64>)> {
    let fit: Vec<usize> = (0..set.words.len()).filter(|&i| wanted(set.words[i])).collect();
    let &i = fit.get(fit.len() / 2)?;
    let mut words = set.words.clone();
    words[i] = sided(words[i], to);
    Some((set.words[i], words))
}

fn in_mesh(s: &Specimen, from: Side, to: Side) -> Option<Mutation> {
    let (_, words) = relabelled(&s.mesh, to, |w| is(w, from))?;
    Some(Mutation::with_words(s, words))
}

/// Relabels a leaf that mesh and T0 share, in both.
fn in_both(s: &Specimen, to: Side, wanted: impl Fn(u64) -> bool) -> Option<Mutation> {
    let shared = |w: u64| wanted(w) && s.base.words.binary_search(&w).is_ok();
    let (leaf, words) = relabelled(&s.mesh, to, shared)?;
    let (_, base) = relabelled(&s.base, to, |w| w == leaf)?;
    let mut mutation = Mutation::with_words(s, words);
    mutation.base = surgery::with_words(&s.base, base);
    Some(mutation)
}

fn outside_called_inside(s: &Specimen) -> Option<Mutation> {
    in_mesh(s, Side::Outside, Side::Inside)
}

fn inside_called_outside(s: &Specimen) -> Option<Mutation> {
    in_mesh(s, Side::Inside, Side::Outside)
}

fn unwanted(s: &Specimen) -> Option<Mutation> {
    match s.case.keep {
        Keep::Outside => in_mesh(s, Side::Outside, Side::Inside),
        Keep::Inside => in_mesh(s, Side::Inside, Side::Outside),
        Keep::All => None,
    }
}

fn flipped_among_others(s: &Specimen) -> Option<Mutation> {
    if s.case.keep != Keep::All {
        return None;
    }
    let tree = Tree::of_words(&s.mesh.words);
    let outside = 1 << Side::Outside as u8;
    // Surrounded by its own component, so that it shares faces with it.
    let deep = |w: u64| {
        let hood = surgery::hood(&tree, w);
        is(w, Side::Outside) && hood.around.iter().all(|&at| tree.kinds(at) & !outside == 0)
    };
    let (_, words) = relabelled(&s.mesh, Side::Inside, deep)?;
    Some(Mutation::with_words(s, words))
}

fn flipped_in_both(s: &Specimen) -> Option<Mutation> {
    in_both(s, Side::Inside, |w| is(w, Side::Outside))
}

fn swap(words: &[u64], wanted: impl Fn(u64) -> bool) -> Vec<u64> {
    let swap = |w: u64| if w & 3 < 2 && wanted(w) { w ^ 1 } else { w };
    words.iter().map(|&w| swap(w)).collect()
}

/// A mesh from which nothing is deleted, with the same leaves flipped as T0.
fn flipped(s: &Specimen, wanted: impl Fn(u64) -> bool) -> Option<Mutation> {
    if s.case.keep != Keep::All {
        return None;
    }
    let mut mutation = Mutation::with_words(s, swap(&s.mesh.words, &wanted));
    mutation.base = surgery::with_words(&s.base, swap(&s.base.words, &wanted));
    Some(mutation)
}

fn component_flipped(s: &Specimen) -> Option<Mutation> {
    let inside = |w: u64| is(w, Side::Inside);
    s.base.words.iter().any(|&w| inside(w)).then(|| flipped(s, inside)).flatten()
}

fn swapped(s: &Specimen) -> Option<Mutation> {
    flipped(s, |_| true)
}

fn crossing_called_outside(s: &Specimen) -> Option<Mutation> {
    in_mesh(s, Side::Crossing, Side::Outside)
}

fn crossing_lost_in_both(s: &Specimen) -> Option<Mutation> {
    in_both(s, Side::Outside, |w| is(w, Side::Crossing))
}

fn crossing_lost_to_inside(s: &Specimen) -> Option<Mutation> {
    in_both(s, Side::Inside, |w| is(w, Side::Crossing))
}

fn called_crossing(s: &Specimen) -> Option<Mutation> {
    let (_, words) = relabelled(&s.mesh, Side::Crossing, |w| !is(w, Side::Crossing))?;
    Some(Mutation::with_words(s, words))
}

fn called_crossing_in_both(s: &Specimen) -> Option<Mutation> {
    let surface = s.case.level_surface;
    in_both(s, Side::Crossing, |w| !is(w, Side::Crossing) && word::level(w) == surface)
}

fn ambiguous_count(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.components_ambiguous.count += 1;
    Some(mutation)
}

fn ambiguous_example(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let Ambiguous { example, .. } = &mut mutation.mesh.manifest.components_ambiguous;
    *example = Some(s.case.root.origin);
    Some(mutation)
}
