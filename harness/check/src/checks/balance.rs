//! 2:1 balance: leaves that touch in a face, an edge or a corner differ by at most one level, deleted crossing
//! leaves included.
//!
//! Section 7 of reference/DEFINITION.md (the paper's 4:1 rule: at most one hanging node per edge, which is
//! counted as well). The check cannot detect needless refinement. If crossing leaves are deleted and T0 is
//! unknown, it cannot detect imbalance between a deleted leaf and its neighbours.

use std::fmt::Write;

use super::gap::Gap;
use super::{CheckResult, Subject, hanging};
use contract::lattice::Root;
use contract::tree::Tree;

const NAME: &str = "balance";

/// Checks the mesh and counts hanging nodes.
pub fn check(subject: &Subject) -> CheckResult {
    let tree = subject.tree_with_deleted();
    let mut result = check_tree(tree, &subject.terms.root);
    result.examined = subject.mesh.words.len() as u64;
    let counts = hanging::count(tree);
    if let Some(edge) = &counts.worst {
        result.report(format!(
            "more than one hanging node on an edge of {}",
            subject.terms.root.describe(edge)
        ));
    }
    let [none, one, more] = counts.edges;
    let _ = write!(result.note, "leaf edges with 0, 1, more hanging nodes: {none}, {one}, {more}");
    result
}

/// Checks the balance of a tree.
pub fn check_tree(tree: &Tree, root: &Root) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    // Distances are integers: octants less than one cell apart touch.
    Gap { tree, root, margin: &|_| Some(1), what: "touching leaves differ by two levels or more" }
        .check(&mut result);
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::octant::Octant;
    use contract::testing::{graded_words, octants_of, random_words, words_of};
    use contract::word;
    use proptest::prelude::*;

    const ROOT: Root = Root { origin: [0.0; 3], edge: 1.0 };

    /// Whether any two leaves touch and differ by two levels, by comparison of all pairs.
    fn unbalanced(words: &[u64]) -> bool {
        let leaves: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
        let touch = |a: &Octant, b: &Octant| a.distance(b) == 0;
        leaves.iter().any(|a| leaves.iter().any(|b| a.level + 2 <= b.level && touch(a, b)))
    }

    proptest! {
        #[test]
        fn the_check_agrees_with_a_comparison_of_all_pairs(words in prop_oneof![random_words(4), graded_words(5)]) {
            let tree = Tree::of_words(&words);
            prop_assert_eq!(check_tree(&tree, &ROOT).holds(), !unbalanced(&words));
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
