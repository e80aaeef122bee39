//! The candidates of a component's vote are its first leaves, by level and Morton code. This test finds the
//! components independently, leaf by leaf.

use crate::support::{Small, config, cuboid, leaky_on_rays, small, soup, thin};
use bricks::octant::{LEVEL_MAX, corner, edge, neighbour};
use mesher::input::lattice::{Bounds, Enclosed, Keep, Root};
use mesher::partition::curve;
use mesher::partition::ownership::Ownership;
use mesher::refine::voxelise::{BinnedFacets, refine};
use mesher::sides::{Base, components, global, nodes::Nodes, vote};
use proptest::prelude::*;
use ranks::Solo;
use std::collections::{BTreeMap, BTreeSet};

/// Centroids of the first leaves of each component.
type Firsts = BTreeSet<Vec<[i64; 3]>>;

fn by_mesher(case: &Small) -> Firsts {
    let rules = case.mesher_case().rules(&Bounds::of(&case.facets)).expect("the case is good");
    let facets = rules
        .root
        .facets(case.facets.clone(), &Bounds::of(&case.facets), 0)
        .expect("near the root");
    let (tree, _) = refine(&BinnedFacets::new(&facets), &rules, &[curve::ALL]);
    tree.check_structure();
    let ownership = Ownership::solo();
    let base =
        Base { tree: &tree, ownership: &ownership, facets: &facets, rules: &rules, comm: &Solo };
    let nodes = Nodes::new(&tree, &ownership);
    let mut local = components::merge(&nodes, &ownership);
    let faces = std::mem::take(&mut local.faces);
    let merged = local.merged.numbered();
    let labels = global::labels(&base, &nodes, faces, &merged);
    let found = vote::candidates(&base, &nodes, &merged, &labels);
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
            // The leaf that contains the neighbour's minimum corner. If it is finer, it will find this leaf.
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
        list.truncate(32);
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
    fn candidates_are_the_first_leaves_of_each_component(
        case in prop_oneof![small(soup()), thin(), leaky_on_rays()],
    ) {
        prop_assert_eq!(by_mesher(&case), leaf_by_leaf(&case));
    }
}

/// The definition gives a component 32 candidates. Here the component outside the box has more leaves.
#[test]
fn a_large_component_has_thirty_two_candidates() {
    let case = Small {
        facets: cuboid([24.0; 3], [40.0; 3]),
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 4.0,
        layer_cells_min: 1,
        keep: Keep::All,
        keep_crossing: true,
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    };
    let outside = case.solo(true).iter().filter(|w| *w & 3 == 0).count();
    assert!(outside > 32, "{outside} leaves");
    let most = by_mesher(&case).iter().map(Vec::len).max();
    assert_eq!(most, Some(32));
}
