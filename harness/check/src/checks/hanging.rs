//! Hanging nodes: corners of leaves that lie inside an edge of a coarser leaf.

use contract::octant::Octant;
use contract::tree::{GHOST, Handle, Hood, Kind, Tree, walk};

/// Leaf edges by the hanging nodes on them.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Edges with none, with one, and with more. An edge shared by leaves counts once for each.
    pub edges: [u64; 3],
    /// A leaf with an edge that has more than one.
    pub worst: Option<Octant>,
}

/// Counts over all edges of all leaves.
pub fn count(tree: &Tree) -> Counts {
    let mut counts = Counts::default();
    let mut leaf = |hood: &Hood, kind: Kind| {
        if kind == GHOST {
            // It may have been refined before it was deleted.
            return;
        }
        for axis in 0..3 {
            for corner in 0..4 {
                let nodes = on_edge(tree, hood, axis, [corner & 1, corner >> 1]);
                counts.edges[nodes.min(2) as usize] += 1;
                if nodes > 1 && counts.worst.is_none() {
                    counts.worst = Some(hood.octant);
                }
            }
        }
    };
    walk(tree, &mut |_| true, &mut leaf);
    counts
}

/// Hanging nodes on the edge along `axis` at the leaf's low (0) or high (1) side in the other two axes.
fn on_edge(tree: &Tree, hood: &Hood, axis: usize, at: [u8; 2]) -> u64 {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut around = [(Handle::HOLE, 0); 3];
    for (slot, away) in around.iter_mut().zip([[1, 0], [0, 1], [1, 1]]) {
        let mut by = [0; 3];
        by[u] = away[0] * (2 * i32::from(at[0]) - 1);
        by[v] = away[1] * (2 * i32::from(at[1]) - 1);
        // Within the neighbour, the edge runs along the side that faces the leaf.
        let facing = |a: usize, side: u8| u8::from((by[a] == 0) == (side == 1)) << a;
        *slot = (hood.place(by), facing(u, at[0]) | facing(v, at[1]));
    }
    along(tree, around, axis, hood.octant.level)
}

/// Nodes inside a stretch of edge around which lie these octants, each with the digit of its first
/// child along the edge.
fn along(tree: &Tree, around: [(Handle, u8); 3], axis: usize, level: u8) -> u64 {
    if !around.iter().any(|(at, _)| at.is_node()) {
        return 0;
    }
    let half = |which: u8| {
        let child =
            |(at, digit): (Handle, u8)| (tree.child(at, digit | which << axis, level), digit);
        along(tree, around.map(child), axis, level + 1)
    };
    // Between the halves is a node if a leaf has a corner there; where all that touches it was
    // deleted, there is none.
    let touched = around.iter().filter(|(at, _)| at.is_node()).any(|&(at, digit)| {
        let (low, high) = (digit, digit | 1 << axis);
        leaf_in_corner(tree, tree.child(at, low, level), high)
            || leaf_in_corner(tree, tree.child(at, high, level), low)
    });
    u64::from(touched) + half(0) + half(1)
}

/// Whether the corner of an octant, given as the digit of the child there, is a leaf's.
fn leaf_in_corner(tree: &Tree, mut at: Handle, digit: u8) -> bool {
    while at.is_node() {
        at = tree.child(at, digit, 0);
    }
    at.as_leaf().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_of};
    use contract::word;
    use proptest::prelude::*;

    #[test]
    fn a_refined_corner_hangs_one_node_on_each_edge_it_halves() {
        let tree =
            Tree::of_words(&words_of(|o| o.level == 0 || (o.level == 1 && o.corner == [0; 3])));
        let counts = count(&tree);
        // Three faces of the refined octant lie inside the root. Of their nine edges three lie
        // inside the root (three coarse leaves each), six in its faces (one coarse leaf each).
        assert_eq!(counts.edges, [12 * 15 - 15, 15, 0]);
        assert!(counts.worst.is_none());
    }

    proptest! {
        /// Agrees with collecting all corners and looking at each edge.
        #[test]
        fn agrees_with_all_corners(words in random_words(3)) {
            let mut corners = std::collections::BTreeSet::new();
            for &w in &words {
                let (low, high) = word::octant(w).bounds();
                corners.extend((0..8).map(|i| -> [i64; 3] {
                    std::array::from_fn(|a| if i >> a & 1 == 0 { low[a] } else { high[a] })
                }));
            }
            let mut want = [0; 3];
            for &w in &words {
                let (low, high) = word::octant(w).bounds();
                for axis in 0..3 {
                    for i in 0..4 {
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let inside = |c: &&[i64; 3]| low[axis] < c[axis] && c[axis] < high[axis]
                            && c[u] == [low, high][i & 1][u] && c[v] == [low, high][i >> 1][v];
                        want[corners.iter().filter(inside).count().min(2)] += 1;
                    }
                }
            }
            prop_assert_eq!(count(&Tree::of_words(&words)).edges, want);
        }
    }
}
