//! Wrong gradation, which the checks `balance` and `layer` must detect.
//!
//! Each corruption is found by a search among all leaves that can be split, or among all groups of siblings
//! that can be merged because T0 is coarser there. The search looks for a change that violates exactly the
//! property in the corruption's name.

use super::SelftestCase;
use super::mutant::{self, AUDITED, INFORMED, Mutant, merge, sibling_groups, split_first, words};
use contract::manifest::Keep;
use contract::neighbourhood::{Neighbourhood, OFFSETS};
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX};
use contract::tree::Tree;
use contract::word;

pub(super) const MUTANTS: &[Mutant] = &[
    words("two levels apart over a face", "balance", AUDITED, |s| {
        split_where(s, |coarser| coarser[1] > 0)
    }),
    words("two levels apart over an edge only", "balance", AUDITED, |s| {
        split_where(s, |coarser| coarser[1] == 0 && coarser[2] > 0)
    }),
    words("two levels apart over a corner only", "balance", AUDITED, |s| {
        split_where(s, |coarser| coarser[1] == 0 && coarser[2] == 0 && coarser[3] > 0)
    }),
    words("octant that balance requires merged", "balance", AUDITED, |s| {
        merge_where(s, |level, near| near.touching > level)
    }),
    words("layer too thin at one place of one level", "layer", AUDITED, |s| {
        merge_where(s, |level, near| {
            has_layer(s, level) && near.touching <= level && near.within_layer > level
        })
    }),
    words("layer around the surface too thin", "layer", AUDITED, |s| {
        merge_where(s, |level, near| level == s.case.level_surface && near.in_surface_layer)
    }),
    words("refinement missing along a plane, as for a lost halo", "layer", AUDITED, halo_missing),
    words("extra layer around deleted leaves missing", "layer", INFORMED, |s| {
        merge_where(s, |level, near| level == s.case.level_surface && near.touch_deleted)
    }),
    // Beside leaves that balance made, for instance: a reader may not rely on the layers of section 6 there.
    words("layer that only section 6 requires missing", "identical", INFORMED, |s| {
        merge_where(s, |level, near| {
            near.touching.max(near.within_layer) <= level && !near.in_surface_layer
        })
    }),
];

/// Number of coarser neighbours across faces (index 1), edges (2) and corners (3).
fn coarser_neighbours(neighbourhood: &Neighbourhood) -> [usize; 4] {
    let mut count = [0; 4];
    for (handle, offset) in neighbourhood.handles.iter().zip(OFFSETS.iter()) {
        let axes = offset.iter().filter(|&&o| o != 0).count();
        count[axes] += usize::from(handle.as_coarser_leaf().is_some());
    }
    count
}

/// Splits the first leaf whose numbers of coarser neighbours satisfy a predicate. They are then two levels coarser.
fn split_where(s: &SelftestCase, predicate: impl Fn([usize; 4]) -> bool) -> Option<Vec<u64>> {
    let tree = Tree::of_words(&s.mesh.words);
    let around = |w| Neighbourhood::of(&tree, word::octant(w));
    let fit = |w| word::level(w) < LEVEL_MAX && predicate(coarser_neighbours(&around(w)));
    split_first(&s.mesh.words, fit)
}

/// Groups of siblings that gradation made, because T0 is coarser there.
fn graded_siblings(s: &SelftestCase) -> Vec<usize> {
    let base = Tree::of_words(&s.base.words);
    let graded = |&i: &usize| {
        let octant = word::octant(s.mesh.words[i]);
        base.locate(octant.corner).map_or(0, |(leaf, _)| leaf.level) < octant.level
    };
    sibling_groups(&s.mesh.words).into_iter().filter(graded).collect()
}

/// The surroundings of siblings that are to be merged.
#[derive(Default)]
struct Surroundings {
    /// Level of the finest leaf that touches them.
    touching: u8,
    /// Level of the finest leaf within n cells of the siblings' level.
    within_layer: u8,
    /// Whether the siblings are in the layer around a crossing leaf, and their parent is coarser than the surface.
    in_surface_layer: bool,
    /// Whether they touch a deleted crossing leaf.
    touch_deleted: bool,
}

/// The surroundings of the siblings at index `i`, found among all leaves: slow, simple, and independent of the
/// checks.
fn surroundings(s: &SelftestCase, i: usize) -> Surroundings {
    let words = &s.mesh.words;
    let merged = word::octant(mutant::parent(words[i]));
    let cell = i64::from(merged.edge() / 2);
    let n = i64::from(s.case.layer_cells_min);
    let surface = s.case.level_surface;
    let cell_surface = i64::from(CELLS_PER_EDGE >> surface);
    let mut found = Surroundings::default();
    for &w in words {
        let leaf = word::octant(w);
        if merged.contains(&leaf) {
            continue;
        }
        let distance = merged.distance(&leaf);
        if distance == 0 {
            found.touching = found.touching.max(leaf.level);
        }
        if distance < n * cell {
            found.within_layer = found.within_layer.max(leaf.level);
        }
        let too_coarse = word::is_crossing(w) && leaf.level == surface && merged.level < surface;
        found.in_surface_layer |= too_coarse && distance < (n - 1) * cell_surface;
    }
    let touches = |&w: &u64| word::is_crossing(w) && merged.distance(&word::octant(w)) == 0;
    found.touch_deleted = !s.case.keep_crossing && s.base.words.iter().any(touches);
    found
}

/// Merges the first graded siblings whose level and surroundings satisfy a predicate.
fn merge_where(s: &SelftestCase, holds: impl Fn(u8, &Surroundings) -> bool) -> Option<Vec<u64>> {
    let fit = |&i: &usize| holds(word::level(s.mesh.words[i]), &surroundings(s, i));
    Some(merge(&s.mesh.words, &[graded_siblings(s).into_iter().find(fit)?]))
}

/// Whether the definition requires a layer of cells of this level that is not implied by the balance.
fn has_layer(s: &SelftestCase, level: u8) -> bool {
    s.case.layer_cells_min > 1 && (s.case.keep == Keep::All || level < s.case.level_surface)
}

/// Merges all graded siblings above the middle plane across z, as if a rank had not received its neighbour's layer.
fn halo_missing(s: &SelftestCase) -> Option<Vec<u64>> {
    let words = &s.mesh.words;
    let at_plane = |&i: &usize| word::octant(words[i]).corner[2] == CELLS_PER_EDGE / 2;
    let halo: Vec<usize> = graded_siblings(s).into_iter().filter(at_plane).collect();
    let thins = |&i: &usize| {
        let level = word::level(words[i]);
        has_layer(s, level) && surroundings(s, i).within_layer > level
    };
    halo.iter().any(thins).then(|| merge(words, &halo))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::octant::Octant;
    use contract::testing::{leaf_set, words_with_sides};
    use contract::word::Side;

    #[test]
    fn layers_exist_at_levels_coarser_than_the_surface_and_at_all_levels_if_all_is_kept() {
        let has = |n: u32, keep: &str| {
            let text = format!(
                "spacing_min = 2.0\nlayer_cells_min = {n}\nkeep = '{keep}'\n\
                 root = {{ origin = [0.0, 0.0, 0.0], edge = 8.0 }}\n"
            );
            let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
            let case = Case::from_parts(&text, vec![facet]).unwrap();
            let (mesh, base) = (leaf_set(vec![]), leaf_set(vec![]));
            let correct = SelftestCase { case, mesh, base };
            [1, 2, 3].map(|level| has_layer(&correct, level))
        };
        assert_eq!(has(2, "outside"), [true, false, false]);
        assert_eq!(has(2, "all"), [true; 3]);
        assert_eq!([has(1, "outside"), has(1, "all")], [[false; 3]; 2]);
    }

    /// The octants 0 and 5 are split in the mesh only, and a crossing leaf of T0 touches octant 5.
    #[test]
    fn the_extra_layer_is_removed_beside_a_crossing_leaf() {
        let text = "spacing_min = 2.0\nlayer_cells_min = 1\nkeep_crossing = false\n\
                    root = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[6.5, 4.5, 4.5], [7.5, 4.5, 4.5], [6.5, 5.5, 4.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let words = |split: &'static [&'static str]| {
            let crossing = |o: &Octant| o.path() == "7.1";
            words_with_sides(
                |o| o.level == 0 || split.contains(&&*o.path()),
                |o| Some(if crossing(o) { Side::Crossing } else { Side::Outside }),
            )
        };
        let (mesh, base) = (leaf_set(vec![words(&["0", "5", "7"])]), leaf_set(vec![words(&["7"])]));
        let missing = MUTANTS.iter().find(|m| m.name.starts_with("extra layer")).unwrap();
        let merged = missing.make(&SelftestCase { case, mesh, base }).unwrap().mesh.words;
        assert_eq!(merged, words(&["0", "7"]));
    }

    /// Octant 0.0 is two cells of level 3 away from a crossing leaf of that level, the surface's, and touches leaves of level 2.
    #[test]
    fn the_surroundings_of_an_octant_end_at_the_thickness_of_its_layers() {
        let around_with = |spacing: f64, crossing: &str, n: u32| {
            let text = format!(
                "spacing_min = {spacing:?}\nlayer_cells_min = {n}\nroot = {{ origin = [0.0, 0.0, 0.0], edge = 8.0 }}\n"
            );
            let facet = [[4.5, 0.5, 0.5], [4.6, 0.5, 0.5], [4.5, 0.6, 0.5]];
            let case = Case::from_parts(&text, vec![facet]).unwrap();
            let words = words_with_sides(
                |o| ["root", "0", "0.0", "1", "1.0"].contains(&&*o.path()),
                |o| Some(if o.path() == crossing { Side::Crossing } else { Side::Outside }),
            );
            let correct =
                SelftestCase { case, mesh: leaf_set(vec![words]), base: leaf_set(vec![]) };
            let Surroundings { touching, within_layer, in_surface_layer, .. } =
                surroundings(&correct, 0);
            (touching, within_layer, in_surface_layer)
        };
        // An octant of the surface's level is not too coarse.
        assert!(!around_with(2.0, "1.2", 4).2);
        let around = |n| around_with(1.0, "1.0.0", n);
        assert_eq!([around(2), around(3), around(4)], [(2, 2, false), (2, 3, false), (2, 3, true)]);
    }
}
