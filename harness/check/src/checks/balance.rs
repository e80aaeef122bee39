//! 2:1 balance: leaves that touch in a face, an edge or a corner differ by at most one level, deleted crossing
//! leaves included.
//!
//! Section 7 of reference/DEFINITION.md; the paper's 4:1 rule, at most one hanging node per edge, follows. The check cannot detect needless refinement. If crossing leaves are deleted and T0 is
//! unknown, it cannot detect imbalance between a deleted leaf and its neighbours.

use super::clearance::{ALL_AXES, check_gap};
use super::{CheckResult, Subject, several_levels};
use crate::promises::Touching;
use contract::lattice::Root;
use contract::tree::Tree;

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let (tree, required) = match subject.promises.balance {
        Some(touching) => (subject.tree(), (touching, subject.promises.levels())),
        None => (subject.tree_with_deleted(), (Touching::Corner, 1)),
    };
    touching_leaves(tree, &subject.terms.root, required, result);
    result.requires(several_levels(tree));
}

/// Leaves that touch in this way differ by at most `levels` levels.
fn touching_leaves(
    tree: &Tree,
    root: &Root,
    (touching, levels): (Touching, u8),
    result: &mut CheckResult,
) {
    let (how, directions): (_, &[[i64; 3]]) = match touching {
        Touching::Corner => ("touch", &ALL_AXES),
        Touching::Edge => ("share part of an edge or face", &[[1, 1, 0], [0, 1, 1], [1, 0, 1]]),
        Touching::Face => ("share part of a face", &[[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    };
    let what = &format!("leaves that {how} differ by {} levels or more", levels + 1);
    // Distances are integers: octants less than one cell apart touch.
    check_gap(tree, (root, what), |_| Some(1), directions, levels, result);
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::octant::Octant;
    use contract::testing::{graded_words, octants_of, random_words, words_of};
    use contract::word;
    use proptest::prelude::*;

    fn check_touching(tree: &Tree, root: &Root, touching: Touching, levels: u8) -> CheckResult {
        let mut result = CheckResult::new("balance");
        touching_leaves(tree, root, (touching, levels), &mut result);
        result
    }

    fn check_tree(tree: &Tree, root: &Root) -> CheckResult {
        check_touching(tree, root, Touching::Corner, 1)
    }

    const ROOT: Root = Root { origin: [0.0; 3], edge: 1.0 };

    /// Whether any two leaves touch and differ by two levels, by comparison of all pairs.
    fn unbalanced(words: &[u64]) -> bool {
        differs(words, 2, 1)
    }

    /// Whether two leaves differ by this many levels and touch in a set of at least `dimensions` - 1 dimensions.
    fn differs(words: &[u64], levels: u8, dimensions: usize) -> bool {
        let leaves: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
        let touch = |a: &Octant, b: &Octant| {
            let ((a_low, a_high), (b_low, b_high)) = (a.bounds(), b.bounds());
            let overlap = |i: usize| a_low[i].max(b_low[i]) < a_high[i].min(b_high[i]);
            a.distance(b) == 0 && (0..3).filter(|&i| overlap(i)).count() + 1 >= dimensions
        };
        leaves.iter().any(|a| leaves.iter().any(|b| a.level + levels <= b.level && touch(a, b)))
    }

    proptest! {
        #[test]
        fn the_check_agrees_with_a_comparison_of_all_pairs(words in prop_oneof![random_words(4), graded_words(5)]) {
            let tree = Tree::of_words(&words);
            prop_assert_eq!(check_tree(&tree, &ROOT).holds(), !unbalanced(&words));
        }

        #[test]
        fn every_ratio_and_way_of_touching_agrees_with_a_comparison_of_all_pairs(
            words in prop_oneof![random_words(4), graded_words(5)], levels in 1u8..=3,
        ) {
            let tree = Tree::of_words(&words);
            for (touching, dimensions) in [(Touching::Corner, 1), (Touching::Edge, 2), (Touching::Face, 3)] {
                let result = check_touching(&tree, &ROOT, touching, levels);
                prop_assert_eq!(result.holds(), !differs(&words, levels + 1, dimensions), "{:?}: {}", touching, result);
            }
        }
    }

    /// Each octant of level 3 in turn is the only one of its level that is refined, so that all 26 directions
    /// occur.
    #[test]
    fn a_single_fine_octant_is_unbalanced_iff_it_touches_a_coarse_leaf() {
        for fine in octants_of(&words_of(|o| o.level < 3)).into_iter().filter(|o| o.level == 3) {
            let words = words_of(|o| o.contains(&fine));
            let result = check_tree(&Tree::of_words(&words), &ROOT);
            assert_eq!(result.holds(), !unbalanced(&words), "{fine}");
        }
    }
}
