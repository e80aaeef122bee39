//! The leaves that a component's vote asks are its first: coarsest, then by key, wherever its bricks
//! are cut. Components are found once more here, leaf by leaf.
#![allow(missing_docs)]

mod support;

use mesher::comm::Solo;
use mesher::lattice::Bounds;
use mesher::octant::{LEVEL_MAX, corner, edge, neighbour};
use mesher::partition::ownership::Ownership;
use mesher::sides::{components, global, nodes::Nodes, vote};
use mesher::voxelise::{BinnedFacets, Depth, SubtreeRoot, refine};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use support::{Small, config, leaky_on_rays, small, soup, thin};

/// Centroids of the first leaves of each component.
type Firsts = BTreeSet<Vec<[i64; 3]>>;

fn by_mesher(case: &Small) -> Firsts {
    let rules = case.mesher_case().rules(&Bounds::of(&case.facets)).expect("the case is good");
    let facets = rules
        .root
        .facets(case.facets.clone(), &Bounds::of(&case.facets), 0)
        .expect("near the root");
    let depth = Depth { surface: rules.level_surface, boxes: rules.boxes.clone() };
    let (tree, _) =
        refine(&BinnedFacets::new(&facets), &depth, &[SubtreeRoot { level: 0, code: 0 }]);
    tree.check_structure();
    let share = Ownership::solo();
    let nodes = Nodes::new(&tree, &share);
    let mut local = components::merge(&nodes, &share);
    let faces = std::mem::take(&mut local.faces);
    let merged = local.numbered();
    let labels = global::labels(&nodes, &tree, &share, faces, &merged, &Solo);
    let found = vote::candidates(&nodes, &tree, &merged.of, &labels, &share);
    found.into_values().map(|list| list.into_iter().map(|c| c.centroid()).collect()).collect()
}

fn leaf_by_leaf(case: &Small) -> Firsts {
    let words = case.solo(true);
    let level = |w: u64| (w >> 2 & 31) as u32;
    let mut up: Vec<usize> = (0..words.len()).collect();
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| *w & 3 != 2) {
        let l = level(w);
        let below = 3 * (LEVEL_MAX - l);
        for side in 0..6 {
            let Some(n) = neighbour(l, w >> 7 >> below, side / 2, side % 2 == 1) else { continue };
            // The leaf that holds the neighbour's minimum corner; a finer one finds this leaf itself.
            let j = words.partition_point(|v| v >> 7 <= n << below) - 1;
            if words[j] & 3 != 2 && level(words[j]) <= l {
                let (a, b) = (root_of(&up, i), root_of(&up, j));
                up[a.max(b)] = a.min(b);
            }
        }
    }
    let mut lists: BTreeMap<usize, Vec<(u32, u64)>> = BTreeMap::new();
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| *w & 3 != 2) {
        let l = level(w);
        lists.entry(root_of(&up, i)).or_default().push((l, w >> 7 >> (3 * (LEVEL_MAX - l))));
    }
    let firsts = |mut list: Vec<(u32, u64)>| {
        list.sort_unstable();
        list.truncate(vote::CANDIDATES);
        list.into_iter().map(|(l, code)| corner(l, code).map(|c| c + edge(l) / 2)).collect()
    };
    lists.into_values().map(firsts).collect()
}

fn root_of(up: &[usize], mut i: usize) -> usize {
    while up[i] != i {
        i = up[i];
    }
    i
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn are_the_first_of_each_component(
        case in prop_oneof![small(soup()), thin(), leaky_on_rays()],
    ) {
        prop_assert_eq!(by_mesher(&case), leaf_by_leaf(&case));
    }
}

/// There are as many as the definition says.
#[test]
fn are_thirty_two() {
    assert_eq!(vote::CANDIDATES, 32);
}
