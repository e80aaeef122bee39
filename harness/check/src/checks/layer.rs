//! Every layer is at least n cells thick, at every level.
//!
//! Section 7 of reference/DEFINITION.md: the Chebyshev distance of a leaf of level l + 1 or finer from a leaf
//! of level l - 1 or coarser is at least n cells of level l, for every l coarser than the surface level D and, if
//! `keep` is `all`, for every l. Every leaf less than n - 1 cells of level D from a crossing leaf of level D has
//! at least level D. If crossing leaves are deleted, leaves adjacent to one have at least level D: by the extra layer
//! of section 6 for n < 3, and by the layers themselves for larger n. The check detects neither layers that are too
//! thick nor, without T0, missing layers around deleted crossing leaves. With n = 1, the minimum distance is that of the
//! 2:1 balance, which `balance` checks: an imbalance is one violation and is reported once.

use super::gap::{ALL_AXES, Gap};
use super::surface::Crossed;
use super::trail::Trail;
use super::{Check, CheckResult, Subject, Terms, contact, several_levels, some_leaves};
use contract::manifest::{Keep, Tree as MeshKind};
use contract::octant::CELLS_PER_EDGE;
use contract::tree::{DELETED, Kind, Kinds, Region, Tree};
use contract::word::Side;

pub(super) const CHECK: Check = Check {
    name: "layer",
    wanted: |subject| {
        subject.promises.layers
            || subject.promises.definition && subject.manifest.tree == MeshKind::Final
    },
    needs: |subject| {
        let tree = subject.tree_with_deleted();
        let is_crossed = tree.kinds(tree.root()) & CROSSING_OR_DELETED != 0;
        let has_extra_layer = !subject.terms.keep_crossing && is_crossed;
        let none = subject.terms.layer_cells_min == 1 && !has_extra_layer;
        let why = || "with n = 1 the layers are the 2:1 balance, which `balance` checks".to_owned();
        some_leaves(subject).or_else(|| none.then(why)).or_else(|| several_levels(subject))
    },
    run,
};

fn run(subject: &Subject, result: &mut CheckResult) {
    let terms = &subject.terms;
    match subject.facets().filter(|_| !subject.promises.definition) {
        // Such a promise says nothing about the sides of leaves.
        Some(facets) => {
            let crossed = Crossed::new(facets, terms, subject.promises.surface);
            check_tree(&crossed.labelled(subject.tree()), terms, result);
        }
        None => check_tree(subject.tree_with_deleted(), terms, result),
    }
}

fn check_tree(tree: &Tree, terms: &Terms, result: &mut CheckResult) {
    let n = i64::from(terms.layer_cells_min);
    let margin = |level: u8| {
        let required = terms.keep == Keep::All || level < terms.level_surface;
        required.then(|| n * cell(level))
    };
    if n > 1 {
        let what = &format!("a layer is thinner than {n} cells");
        Gap { tree, root: &terms.root, margin: &margin, directions: &ALL_AXES, levels: 1, what }
            .check(result);
    }
    SurfaceLayer { tree, terms }.check_children(&mut Trail::new(tree), result);
}

/// Edge of a cell of this level, in level-19 cells.
fn cell(level: u8) -> i64 {
    i64::from(CELLS_PER_EDGE >> level)
}

impl Terms {
    /// Minimum distance between a crossing or deleted leaf of this level and any leaf coarser than the surface level,
    /// in level-19 cells.
    fn surface_margin(&self, kind: Kind, level: u8) -> i64 {
        let layer = i64::from(self.layer_cells_min) - 1;
        // One cell at least, if crossing leaves are deleted.
        let extra = i64::from(!self.keep_crossing);
        let cells = match kind {
            // The leaf may have been refined before it was deleted, so only adjacent leaves are constrained.
            DELETED => extra,
            _ if level == self.level_surface => layer.max(extra),
            _ => extra,
        };
        cells * cell(level)
    }
}

const CROSSING_OR_DELETED: Kinds = 1 << Side::Crossing as u8 | 1 << DELETED;

/// Requires that no leaf near a crossing leaf is coarser than the surface level.
struct SurfaceLayer<'a> {
    tree: &'a Tree,
    terms: &'a Terms,
}

impl SurfaceLayer<'_> {
    /// Checks the children of the current octant. One search around all selected children comes first; it usually finds
    /// nothing.
    fn check_children(&self, trail: &mut Trail, result: &mut CheckResult) {
        let (tree, surface) = (self.tree, self.terms.level_surface);
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        let margin_max = self.terms.surface_margin(Side::Crossing as Kind, surface);
        let selected =
            trail.select_children(tree, |child| tree.kinds(child) & CROSSING_OR_DELETED != 0);
        if selected == 0 || margin_max == 0 {
            return;
        }
        let region = Region::around_children(&octant, selected, margin_max);
        if trail.coarsest_nearby(tree, margin_max, &region, surface) >= surface {
            return;
        }
        for digit in (0..8).filter(|d| selected >> d & 1 == 1) {
            let child = tree.child(handle, digit, octant.level);
            trail.descend(tree, digit);
            match child.as_leaf() {
                Some(kind) if octant.level + 1 >= surface => self.check_leaf(trail, kind, result),
                // `spacing` reports crossing leaves coarser than the surface.
                Some(_) => {}
                None => self.check_children(trail, result),
            }
            trail.ascend();
        }
    }

    /// Reports a leaf coarser than the surface level within the margin of the current leaf.
    fn check_leaf(&self, trail: &Trail, kind: Kind, result: &mut CheckResult) {
        let (octant, surface) = (trail.current().octant, self.terms.level_surface);
        let margin = self.terms.surface_margin(kind, octant.level);
        let found = trail.search(self.tree, margin, &Region::around(&octant, margin), surface);
        if let Some(coarse) = found.leaf(self.tree) {
            result.report_with(|| {
                let (what, cells) = (contact::name(1 << kind), margin / cell(octant.level));
                let (leaf, coarse) =
                    (self.terms.root.describe(&octant), self.terms.root.describe(&coarse));
                format!(
                    "a leaf less than {cells} cells from the {what} leaf {leaf} is coarser than the surface level: {coarse}"
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::Root;
    use contract::manifest::Enclosed;
    use contract::octant::Octant;
    use contract::testing::{graded_words, words_of};
    use contract::tree::Builder;
    use contract::word;
    use proptest::prelude::*;

    fn terms(n: u32, level_surface: u8, keep: Keep, keep_crossing: bool) -> Terms {
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        Terms {
            root,
            level_surface,
            layer_cells_min: n,
            keep,
            keep_crossing,
            boxes: Vec::new(),
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
            sides: Default::default(),
        }
    }

    /// Whether a layer is too thin, literally by the definition and over all pairs of leaves.
    fn is_thin(words: &[u64], terms: &Terms) -> bool {
        let n = i64::from(terms.layer_cells_min);
        let leaves: Vec<_> = words.iter().map(|&w| (word::octant(w), word::side(w))).collect();
        let all = terms.keep == Keep::All;
        leaves.iter().any(|(fine, side)| {
            leaves.iter().any(|(coarse, _)| {
                let distance = fine.distance(coarse);
                let levels = coarse.level + 1..fine.level;
                let required = |l: &u8| n > 1 && (all || *l < terms.level_surface);
                let layer = levels.filter(required).any(|l| distance < n * cell(l));
                let surface = terms.level_surface;
                let at_surface = *side == Side::Crossing && fine.level == surface;
                let surface_layer = distance < (n - 1) * cell(surface)
                    || !terms.keep_crossing && distance < cell(surface);
                layer || at_surface && coarse.level < surface && surface_layer
            })
        })
    }

    /// Leaves of level 2, and in one octant of level 3, the surface's: the first of them is crossing or deleted, and one cell
    /// away from a coarser leaf.
    fn checked(tree: &Tree, terms: &Terms) -> CheckResult {
        let mut result = CheckResult::new("layer");
        check_tree(tree, terms, &mut result);
        result
    }

    #[test]
    fn a_deleted_leaf_requires_only_its_neighbours_to_be_fine() {
        let findings = |kind, digit, n, keep_crossing| {
            let split = |o: &Octant| o.level < 2 || o.corner == [0; 3] && o.level == 2;
            let mut builder = Builder::default();
            for octant in words_of(split).into_iter().map(word::octant) {
                let is_it = octant.level == 3 && octant.digit() == digit;
                let kind = if is_it { kind } else { Side::Outside as Kind };
                builder.push_leaf(word::key_of(octant.corner), octant.level, kind).unwrap();
            }
            let terms = terms(n, 3, Keep::Outside, keep_crossing);
            checked(&builder.finish(), &terms).findings_total
        };
        const CROSSING: Kind = Side::Crossing as Kind;
        for n in 1..=4 {
            assert_eq!(findings(DELETED, 0, n, false), 0, "{n}");
            assert_eq!(findings(DELETED, 7, n, false), 1, "{n}");
            assert_eq!(findings(CROSSING, 0, n, true), u64::from(n > 2), "{n}");
            assert_eq!(findings(CROSSING, 7, n, true), u64::from(n > 1), "{n}");
        }
    }

    /// A leaf of level 3, one finer than the surface, and three of its cells away from leaves of level 1.
    #[test]
    fn a_crossing_leaf_finer_than_the_surface_requires_only_its_neighbours_to_be_fine() {
        let split = |o: &Octant| o.corner == [0; 3] && o.level < 3;
        let findings = |side| {
            let words = contract::testing::words_with_sides(split, |o| {
                Some(if o.corner == [0; 3] { side } else { Side::Outside })
            });
            let result = checked(&Tree::of_words(&words), &terms(5, 2, Keep::Outside, true));
            result.findings_total
        };
        assert_eq!(findings(Side::Crossing), findings(Side::Outside));
        // The margin of a crossing leaf of the surface's level.
        let of_surface =
            |level| terms(5, level, Keep::Outside, true).surface_margin(Side::Crossing as Kind, 3);
        assert_eq!([of_surface(2), of_surface(3)], [0, 4 * cell(3)]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn the_check_agrees_with_a_comparison_of_all_pairs(words in graded_words(4), n in 1u32..=6, surface in 0u8..=4,
                                 all in any::<bool>(), keep_crossing in any::<bool>()) {
            let keep = if all { Keep::All } else { Keep::Outside };
            let terms = terms(n, surface, keep, keep_crossing);
            // Crossing leaves finer than the surface require the extra layer only, which `is_thin` does not model.
            let at_surface = |w: &&u64| word::side(**w) != Side::Crossing || word::level(**w) == surface;
            let words: Vec<u64> = words.iter().filter(at_surface).copied().collect();
            let result = checked(&Tree::of_words(&words), &terms);
            prop_assert_eq!(result.holds(), !is_thin(&words, &terms), "{}", result);
        }
    }
}
