//! Gradation wrong: for `balance` and `layer`.
//!
//! Corruptions of gradation are looked for: among all leaves that could be split, or octets that
//! could be merged although T0 does not need them, those whose change breaks exactly what the
//! corruption's name says.

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited, informed};
use super::surgery::{self, base_level, is, merge, octets, split};
use contract::manifest::Keep;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use contract::tree::{Hood, OFFSETS, Tree};
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    audited("two levels apart over a face", "balance", over_face),
    audited("two levels apart over an edge only", "balance", over_edge_only),
    audited("two levels apart over a corner only", "balance", over_corner_only),
    audited("leaf split twice", "balance", split_twice),
    audited("octant of balance merged", "balance", balance_merged),
    audited("layer too thin at one place of one level", "layer", layer_merged),
    audited("layer too thin all along one level", "layer", layer_missing),
    audited("layer around the surface too thin", "layer", insulation_merged),
    audited("a halo's worth of refinement missing along a plane", "layer", halo_missing),
    informed("extra layer around deleted leaves missing", "layer", extra_layer_missing),
];

/// Places across a face (1 coordinate away), an edge (2) or a corner (3).
fn coarser_places(hood: &Hood) -> [usize; 4] {
    let mut count = [0; 4];
    for (at, by) in hood.around.iter().zip(&OFFSETS) {
        let apart = by.iter().filter(|&&b| b != 0).count();
        count[apart] += usize::from(at.as_wide().is_some());
    }
    count
}

/// Splits a leaf whose coarser neighbours are as wanted: each is then two levels coarser.
fn split_where(s: &Specimen, wanted: impl Fn([usize; 4]) -> bool) -> Option<Mutation> {
    let tree = Tree::of_words(&s.mesh.words);
    let fit =
        |&w: &u64| word::level(w) < LEVEL_MAX && wanted(coarser_places(&surgery::hood(&tree, w)));
    let i = s.mesh.words.iter().position(fit)?;
    Some(Mutation::with_words(s, split(&s.mesh.words, i)))
}

fn over_face(s: &Specimen) -> Option<Mutation> {
    split_where(s, |coarser| coarser[1] > 0)
}

fn over_edge_only(s: &Specimen) -> Option<Mutation> {
    split_where(s, |coarser| coarser[1] == 0 && coarser[2] > 0)
}

fn over_corner_only(s: &Specimen) -> Option<Mutation> {
    split_where(s, |coarser| coarser[1] == 0 && coarser[2] == 0 && coarser[3] > 0)
        .or_else(|| corner_left_behind(s))
}

/// Merges an octet that touches finer leaves, all of them at its corners only.
fn corner_left_behind(s: &Specimen) -> Option<Mutation> {
    let words = &s.mesh.words;
    let fit = |&i: &usize| {
        let merged = word::octant(surgery::parent(words[i]));
        let finer = |w: &&u64| word::level(**w) > merged.level + 1;
        let touching = |w: &&u64| (0..3).all(|a| gap(&merged, &word::octant(**w), a) == 0);
        let mut near = words.iter().filter(|w| finer(w) && touching(w)).peekable();
        near.peek().is_some() && near.all(|&w| meet_in_corner(&merged, &word::octant(w)))
    };
    let i = graded_octets(s).into_iter().find(fit)?;
    Some(Mutation::with_words(s, merge(words, &[i])))
}

/// Whether two octants that touch do so in a point.
fn meet_in_corner(a: &Octant, b: &Octant) -> bool {
    let apart =
        |i: usize| a.corner[i] + a.edge() == b.corner[i] || b.corner[i] + b.edge() == a.corner[i];
    (0..3).all(apart)
}

fn split_twice(s: &Specimen) -> Option<Mutation> {
    // A neighbour of its own level is two levels coarser than its grandchildren. Two of the
    // grandchildren must touch it, so the neighbour is taken across the first child's low faces.
    let tree = Tree::of_words(&s.mesh.words);
    let fit = |&w: &u64| {
        let hood = surgery::hood(&tree, w);
        word::level(w) + 1 < LEVEL_MAX && hood.place([-1, 0, 0]).as_leaf().is_some()
    };
    let i = s.mesh.words.iter().position(fit)?;
    let once = split(&s.mesh.words, i);
    Some(Mutation::with_words(s, split(&once, i)))
}

/// Octets that gradation made: T0 is coarser there.
fn graded_octets(s: &Specimen) -> Vec<usize> {
    let base = Tree::of_words(&s.base.words);
    let graded = |&i: &usize| {
        let octant = word::octant(s.mesh.words[i]);
        base_level(&base, &octant) < octant.level
    };
    octets(&s.mesh.words).into_iter().filter(graded).collect()
}

/// Around a merged octet: the deepest leaf that touches it, and the deepest within n cells of the
/// octet's own level (before merging), in levels.
struct Around {
    touching: u8,
    within_layer: u8,
    insulates: bool,
}

/// What is near an octet, by looking at every leaf: slow, plain, and not the way the checks do it.
fn around(s: &Specimen, i: usize) -> Around {
    let words = &s.mesh.words;
    let merged = word::octant(surgery::parent(words[i]));
    let cell = i64::from(merged.edge() / 2);
    let n = i64::from(s.case.layer_cells_min);
    let surface = s.case.level_surface;
    let cell_surface = i64::from(CELLS_PER_EDGE >> surface);
    let mut found = Around { touching: 0, within_layer: 0, insulates: false };
    for &w in words {
        let leaf = word::octant(w);
        if merged.contains(&leaf) {
            continue;
        }
        let distance = (0..3).map(|a| gap(&merged, &leaf, a)).fold(0, i64::max);
        if distance == 0 {
            found.touching = found.touching.max(leaf.level);
        }
        if distance < n * cell {
            found.within_layer = found.within_layer.max(leaf.level);
        }
        let surrounded = is(w, Side::Crossing) && leaf.level == surface && merged.level < surface;
        found.insulates |= surrounded && distance < (n - 1) * cell_surface;
    }
    found
}

/// Distance of two octants along an axis, in level-19 cells.
fn gap(a: &Octant, b: &Octant, axis: usize) -> i64 {
    let ends = |o: &Octant| {
        let low = i64::from(o.corner[axis]);
        (low, low + i64::from(o.edge()))
    };
    let ((al, ah), (bl, bh)) = (ends(a), ends(b));
    (al - bh).max(bl - ah).max(0)
}

/// Merges an octet with such surroundings.
fn merge_where(s: &Specimen, wanted: impl Fn(u8, &Around) -> bool) -> Option<Mutation> {
    let words = &s.mesh.words;
    let fit = |&i: &usize| wanted(word::level(words[i]), &around(s, i));
    let i = graded_octets(s).into_iter().find(fit)?;
    Some(Mutation::with_words(s, merge(words, &[i])))
}

fn balance_merged(s: &Specimen) -> Option<Mutation> {
    merge_where(s, |level, around| around.touching > level)
}

/// Whether a layer of this level's cells is promised.
fn promised(s: &Specimen, level: u8) -> bool {
    s.case.keep == Keep::All || level < s.case.level_surface
}

fn layer_merged(s: &Specimen) -> Option<Mutation> {
    // Balanced all the same: nothing but the thickness is wrong.
    merge_where(s, |level, around| {
        promised(s, level) && around.touching <= level && around.within_layer > level
    })
}

fn insulation_merged(s: &Specimen) -> Option<Mutation> {
    merge_where(s, |level, around| level == s.case.level_surface && around.insulates)
}

/// Merges every graded octet of one level that touches nothing finer, at the first level where there
/// is one whose layer is wanted.
fn layer_missing(s: &Specimen) -> Option<Mutation> {
    let words = &s.mesh.words;
    let graded = graded_octets(s);
    let wanted = |&&i: &&usize| {
        let (level, around) = (word::level(words[i]), around(s, i));
        promised(s, level) && around.touching <= level && around.within_layer > level
    };
    let level = word::level(words[*graded.iter().find(wanted)?]);
    let of_level = |&i: &usize| word::level(words[i]) == level && around(s, i).touching <= level;
    let all: Vec<usize> = graded.into_iter().filter(of_level).collect();
    Some(Mutation::with_words(s, merge(words, &all)))
}

/// What a rank would miss that was not told of its neighbour's layer: every graded octet just above
/// the middle plane across z, merged.
fn halo_missing(s: &Specimen) -> Option<Mutation> {
    let words = &s.mesh.words;
    let at_plane = |&i: &usize| word::octant(words[i]).corner[2] == CELLS_PER_EDGE / 2;
    let halo: Vec<usize> = graded_octets(s).into_iter().filter(at_plane).collect();
    let thins = |&i: &usize| {
        let level = word::level(words[i]);
        promised(s, level) && around(s, i).within_layer > level
    };
    halo.iter().any(thins).then(|| Mutation::with_words(s, merge(words, &halo)))
}

/// Merges an octet of the surface's level that touches a deleted crossing leaf.
fn extra_layer_missing(s: &Specimen) -> Option<Mutation> {
    if s.case.keep_crossing {
        return None;
    }
    let words = &s.mesh.words;
    let touches = |&i: &usize| {
        let merged = word::octant(surgery::parent(words[i]));
        let touch = |w: &&u64| (0..3).all(|a| gap(&merged, &word::octant(**w), a) == 0);
        let mut crossing = s.base.words.iter().filter(|&&w| is(w, Side::Crossing));
        word::level(words[i]) == s.case.level_surface && crossing.any(|w| touch(&w))
    };
    let i = graded_octets(s).into_iter().find(touches)?;
    Some(Mutation::with_words(s, merge(words, &[i])))
}
