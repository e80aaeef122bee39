//! Every layer is at least n cells thick, at every level.
//!
//! Section 7 of reference/DEFINITION.md: the Chebyshev distance of a leaf of level l + 1 or finer from a leaf
//! of level l - 1 or coarser is at least n cells of level l, for every l coarser than the surface level D and, if
//! `keep` is `all`, for every l. Every leaf less than n - 1 cells of level D from a crossing leaf of level D has
//! at least level D. If crossing leaves are deleted, leaves adjacent to one have at least level D: by the extra layer
//! of section 6 for n < 3, and by the layers themselves for larger n. The check detects neither layers that are too
//! thick nor, without the case, missing layers around deleted crossing leaves. With n = 1, touching leaves of
//! every level are 2:1 balanced. Of the definition `balance` checks it, so that an imbalance is reported once; of a promise of layers this check does.

use super::clearance::{ALL_AXES, Clearance, Required, check_gap};
use super::spacing::Crossed;
use super::{CheckResult, Subject, UNKNOWN_INPUTS, contact, several_levels, some_leaves};
use contract::manifest::{Keep, Manifest};
use contract::octant::{Octant, edge_of};
use contract::tree::{DELETED, Handle, Kind, Kinds, Tree};
use contract::word::Side;

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let terms = &subject.terms;
    if terms.lacks_inputs {
        return result.lacks(UNKNOWN_INPUTS);
    }
    let tree = subject.tree_with_deleted();
    let is_balance = terms.layer_cells_min == 1 && subject.promises.definition;
    let crossed = Crossed::of(subject).filter(|_| !subject.promises.definition);
    // Such a promise says nothing about the sides of leaves.
    let labelled = crossed.map(|crossed| crossed.labelled(tree));
    let tree = labelled.as_ref().unwrap_or(tree);
    if !is_balance {
        check_layers(tree, terms, result);
    }
    check_surface_layer(tree, terms, result);
    let has_extra = !terms.keep_crossing && tree.kinds(tree.root) & CROSSING_OR_DELETED != 0;
    let none = is_balance && !has_extra;
    let why = || "with n = 1 the layers are the 2:1 balance, which `balance` checks".to_owned();
    let missing = some_leaves(subject.tree_with_deleted()).or_else(|| none.then(why));
    result.requires(missing.or_else(|| several_levels(tree)));
}

fn check_layers(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let n = i64::from(terms.layer_cells_min);
    let margin = |level: u8| {
        let layers = terms.keep == Keep::All || level < terms.level_surface;
        // A finer box may look through a thin deleted body: what remains of layers of one cell is that touching leaves are balanced.
        if layers { Some(n * edge_of(level)) } else { (n == 1).then_some(1) }
    };
    let what = &format!("a layer is thinner than {n} cell{}", if n == 1 { "" } else { "s" });
    check_gap(tree, (&terms.root, what), margin, &ALL_AXES, 1, result);
}

/// Minimum distance between a crossing or deleted leaf of this level and any leaf coarser than the surface level,
/// in level-19 cells.
fn surface_margin(terms: &Manifest, kind: Kind, level: u8) -> i64 {
    let layer = i64::from(terms.layer_cells_min) - 1;
    // One cell at least, if crossing leaves are deleted.
    let extra = i64::from(!terms.keep_crossing);
    // A deleted leaf may have been refined before it was deleted, so only adjacent leaves are constrained.
    let has_layer = kind != DELETED && level == terms.level_surface;
    let cells = if has_layer { layer.max(extra) } else { extra };
    cells * edge_of(level)
}

const CROSSING_OR_DELETED: Kinds = 1 << Side::Crossing as u8 | 1 << DELETED;

/// No leaf near a crossing leaf is coarser than the surface level. Of crossing leaves that are coarser themselves, `spacing` reports.
fn check_surface_layer(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let surface = terms.level_surface;
    let requires = |handle: Handle, level: u8| {
        let is_source = tree.kinds(handle) & CROSSING_OR_DELETED != 0;
        let (kind, of_level, by_itself) = match handle.as_leaf().filter(|_| is_source) {
            Some(kind) if level >= surface => (kind, level, true),
            None if is_source && handle.is_node() => (Side::Crossing as Kind, surface, false),
            _ => return None,
        };
        let margin = surface_margin(terms, kind, of_level);
        (margin > 0).then_some(Required { margin, by_itself })
    };
    let report = &|[leaf, _, coarse]: [Octant; 3], result: &mut CheckResult| {
        let (_, kind) = tree.locate(leaf.corner).expect("the octant is a leaf");
        let cells = surface_margin(terms, kind, leaf.level) / edge_of(leaf.level);
        let (what, [leaf, coarse]) =
            (contact::name(1 << kind), [leaf, coarse].map(|octant| terms.root.place(octant)));
        result.report(format_args!(
            "a leaf less than {cells} cells from the {what} leaf {leaf} is coarser than the surface level: {coarse}"
        ));
    };
    Clearance { tree, requires, bound: surface, directions: &ALL_AXES, report }.check(result);
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::Root;
    use contract::testing::{graded_words, words_of};
    use contract::tree::Builder;
    use contract::word;
    use proptest::prelude::*;

    fn terms(n: u32, level_surface: u8, keep: Keep, keep_crossing: bool) -> Manifest {
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        Manifest {
            root,
            level_surface,
            layer_cells_min: n,
            keep,
            keep_crossing,
            ..Manifest::default()
        }
    }

    /// Whether a layer is too thin, literally by the definition and over all pairs of leaves.
    fn is_thin(words: &[u64], terms: &Manifest) -> bool {
        let n = i64::from(terms.layer_cells_min);
        let leaves: Vec<_> = words.iter().map(|&w| (word::octant(w), word::side(w))).collect();
        let all = terms.keep == Keep::All;
        leaves.iter().any(|(fine, side)| {
            leaves.iter().any(|(coarse, _)| {
                let distance = fine.distance(coarse);
                let mut levels = coarse.level + 1..fine.level;
                let layer = levels.any(|l| {
                    let layers = all || l < terms.level_surface;
                    layers && distance < n * edge_of(l) || n == 1 && distance == 0
                });
                let surface = terms.level_surface;
                let at_surface = *side == Side::Crossing && fine.level == surface;
                let surface_layer = distance < (n - 1) * edge_of(surface)
                    || !terms.keep_crossing && distance < edge_of(surface);
                layer || at_surface && coarse.level < surface && surface_layer
            })
        })
    }

    /// Leaves of level 2, and in one octant of level 3, the surface's: the first of them is crossing or deleted, and one cell
    /// away from a coarser leaf.
    fn checked(tree: &Tree, terms: &Manifest) -> CheckResult {
        let mut result = CheckResult::new("layer");
        check_layers(tree, terms, &mut result);
        check_surface_layer(tree, terms, &mut result);
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
                builder.push_leaf(word::key_of(octant.corner), octant.level, kind);
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
        let of_surface = |level| {
            surface_margin(&terms(5, level, Keep::Outside, true), Side::Crossing as Kind, 3)
        };
        assert_eq!([of_surface(2), of_surface(3)], [0, 4 * edge_of(3)]);
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
