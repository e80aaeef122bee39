//! Hanging nodes: corners of leaves in the interior of an edge of a coarser leaf.

use contract::octant::Octant;
use contract::tree::{DELETED, Handle, Kind, Neighbourhood, Tree, walk};

/// Leaf edges by their number of hanging nodes.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Number of edges with none, with one, and with more. An edge of several leaves is counted once for each.
    pub edges: [u64; 3],
    /// The first leaf that has an edge with more than one.
    pub worst: Option<Octant>,
}

/// Counts over all edges of all leaves.
pub fn count(tree: &Tree) -> Counts {
    let mut counts = Counts::default();
    let mut leaf = |neighbourhood: &Neighbourhood, kind: Kind| {
        if kind == DELETED {
            // Its level is a lower bound only.
            return;
        }
        for axis in 0..3 {
            for corner in 0..4 {
                let nodes = on_edge(tree, neighbourhood, axis, [corner & 1, corner >> 1]);
                counts.edges[nodes.min(2) as usize] += 1;
                if nodes > 1 && counts.worst.is_none() {
                    counts.worst = Some(neighbourhood.octant);
                }
            }
        }
    };
    walk(tree, &mut leaf);
    counts
}

/// Number of hanging nodes on the edge along `axis` that lies on the low (0) or high (1) side of the leaf in
/// the other two axes.
fn on_edge(tree: &Tree, neighbourhood: &Neighbourhood, axis: usize, sides: [u8; 2]) -> u64 {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut neighbours = [(Handle::HOLE, 0); 3];
    for (neighbour, across) in neighbours.iter_mut().zip([[1, 0], [0, 1], [1, 1]]) {
        let mut offset = [0; 3];
        offset[u] = across[0] * (2 * i32::from(sides[0]) - 1);
        offset[v] = across[1] * (2 * i32::from(sides[1]) - 1);
        // The edge is on the side of the neighbour that faces the leaf.
        let facing = |a: usize, side: u8| u8::from((offset[a] == 0) == (side == 1)) << a;
        *neighbour = (neighbourhood.at_offset(offset), facing(u, sides[0]) | facing(v, sides[1]));
    }
    along(tree, neighbours, axis)
}

/// Number of nodes in the interior of part of an edge. Each of the three octants around it is given with the
/// digit of its first child along the edge.
fn along(tree: &Tree, octants: [(Handle, u8); 3], axis: usize) -> u64 {
    if !octants.iter().any(|(handle, _)| handle.is_node()) {
        return 0;
    }
    // Which children are leaves does not depend on the level, so any level serves.
    let half = |which: u8| {
        let child =
            |(handle, digit): (Handle, u8)| (tree.child(handle, digit | which << axis, 0), digit);
        along(tree, octants.map(child), axis)
    };
    // The midpoint is a node if it is a corner of a leaf. It is none if all leaves around it were deleted.
    let is_node = octants.iter().filter(|(handle, _)| handle.is_node()).any(|&(handle, digit)| {
        let (low, high) = (digit, digit | 1 << axis);
        has_leaf_in_corner(tree, tree.child(handle, low, 0), high)
            || has_leaf_in_corner(tree, tree.child(handle, high, 0), low)
    });
    u64::from(is_node) + half(0) + half(1)
}

/// Whether a corner of an octant is a corner of a leaf. The corner is given by the digit of the child in it.
fn has_leaf_in_corner(tree: &Tree, mut handle: Handle, digit: u8) -> bool {
    while handle.is_node() {
        handle = tree.child(handle, digit, 0);
    }
    handle.as_leaf().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_of};
    use contract::word;
    use proptest::prelude::*;

    #[test]
    fn a_refined_corner_adds_one_hanging_node_to_each_edge_that_it_bisects() {
        let tree =
            Tree::of_words(&words_of(|o| o.level == 0 || (o.level == 1 && o.corner == [0; 3])));
        let counts = count(&tree);
        // Three faces of the refined octant are in the interior of the root. Of their nine edges, three are in
        // the interior of the root (three coarse leaves each) and six in its faces (one coarse leaf each).
        assert_eq!(counts.edges, [12 * 15 - 15, 15, 0]);
        assert!(counts.worst.is_none());
    }

    proptest! {
        #[test]
        fn counts_agree_with_a_search_among_all_corners(words in random_words(3)) {
            let mut corners = std::collections::BTreeSet::new();
            for &w in &words {
                let (low, high) = word::octant(w).bounds();
                corners.extend((0..8).map(|i| -> [i64; 3] {
                    std::array::from_fn(|a| if i >> a & 1 == 0 { low[a] } else { high[a] })
                }));
            }
            let mut expected = [0; 3];
            for &w in &words {
                let (low, high) = word::octant(w).bounds();
                for axis in 0..3 {
                    for i in 0..4 {
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let inside = |c: &&[i64; 3]| low[axis] < c[axis] && c[axis] < high[axis]
                            && c[u] == [low, high][i & 1][u] && c[v] == [low, high][i >> 1][v];
                        expected[corners.iter().filter(inside).count().min(2)] += 1;
                    }
                }
            }
            prop_assert_eq!(count(&Tree::of_words(&words)).edges, expected);
        }
    }
}
