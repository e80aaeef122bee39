//! The mesher equals independent programs, for any facets and any number of ranks. Its leaves are the reference's, and so are its leaks,
//! regions that are closed at a coarser spacing and open at that of the mesh. The candidates of a component's vote are its first
//! leaves, by level and Morton code, which a search finds here leaf by leaf.

use crate::support::{
    Facet, Run, Small, closed, config, cuboid, division, leaky_on_rays, rooms, run, slit, small,
    soup, thin,
};
use bricks::octant::{LEVEL_MAX, corner, edge, neighbour, position};
use mesher::input::case::BoxSpec;
use mesher::input::lattice::{Bounds, Enclosed, Keep, Root};
use mesher::partition::ownership::Ownership;
use mesher::partition::{Partitioner, curve};
use mesher::refine::{BinnedFacets, refine};
use mesher::sides::{Base, components, global, nodes::Nodes, verdict};
use proptest::prelude::*;
use ranks::Solo;
use std::collections::{BTreeMap, BTreeSet};

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn one_rank_equals_the_reference(case in small(soup())) {
        assert_reference(&case, &Run::SOLO)?;
    }

    #[test]
    fn many_ranks_equal_the_reference(case in small(soup()), run in run()) {
        assert_reference(&case, &run)?;
    }

    /// Layers must not act through the deleted region, which is thin here.
    #[test]
    fn thin_bodies_in_fine_boxes_equal_the_reference(case in thin(), run in run()) {
        assert_reference(&case, &run)?;
    }

    /// Rays that meet edges and vertices must be displaced as defined; otherwise leaks are decided differently.
    #[test]
    fn open_soups_with_edges_on_rays_equal_the_reference(case in leaky_on_rays(), run in run()) {
        assert_reference(&case, &run)?;
    }
}

fn assert_reference(case: &Small, run: &Run) -> Result<(), TestCaseError> {
    for (ungraded, what) in [(true, "base tree"), (false, "final mesh")] {
        let (got, want) = (case.outcome(run, ungraded), case.reference_outcome(ungraded));
        assert_same!(got.words, want.words, "{what}");
        prop_assert_eq!(got.summary, want.summary);
        prop_assert_eq!(got.leaks, want.leaks);
    }
    Ok(())
}

/// The geometry surrounds the root: the outside is in two bodies that the far field does not reach.
#[test]
fn nothing_is_enclosed_if_the_far_field_reaches_no_outside_component() {
    let bodies = [([-8.0; 3], [72.0; 3]), ([9.0; 3], [23.0; 3]), ([41.0; 3], [55.0; 3])];
    let facets = bodies.into_iter().flat_map(|(lo, hi)| cuboid(lo, hi)).collect();
    let case = Small { facets, ..slit(1.0, 10.0, Keep::Outside, vec![]) };
    let summary = case.outcome(&Run::SOLO, false).summary;
    assert_eq!((summary.outside, summary.inside, summary.enclosed.count), (2, 1, 0));
    assert_reference(&case, &Run::SOLO).expect("the same mesh");
}

/// The facet misses an edge of the root by a lattice unit, although its extent meets the root.
#[test]
fn a_facet_outside_the_root_crosses_nothing() {
    let unit = 64.0 / (1 << 27) as f32;
    for level in 0..=3 {
        let case = Small {
            facets: vec![[[0.0, 0.0, -unit], [0.0, -unit, 0.0], [1.0, 0.0, -unit]]],
            root: Root { origin: [0.0; 3], edge: 64.0 },
            spacing_min: 64.0 / f64::from(1 << level),
            layer_cells_min: 1,
            keep: Keep::All,
            keep_crossing: true,
            boxes: vec![],
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        };
        assert_eq!(case.reference(true), [0], "the reference's root is a leaf");
        assert_eq!(case.solo(true), [0]);
        assert_eq!(case.ranks(3, 1, division(Partitioner::Metis, None), true), [0]);
    }
}

/// A plate across the root, three cells thick, of which the middle one is deleted. The extent box covers
/// one side of the plate with cells a quarter as large. Its layer ends before the other side, but twice
/// its layer would not: a sibling group of cells half as large must not act through the plate.
#[test]
fn a_layer_of_fine_cells_does_not_reach_through_a_deleted_plate() {
    for axis in 0..3 {
        let slab = |first: f64, last: f64| {
            let (mut lo, mut hi) = ([-8.0; 3], [72.0; 3]);
            (lo[axis], hi[axis]) = (first, last);
            (lo, hi)
        };
        let (lo, hi) = slab(44.0, 60.0);
        let (min, max) = slab(0.0, 40.0);
        let case = Small {
            facets: cuboid(lo.map(|c| c as f32), hi.map(|c| c as f32)),
            root: Root { origin: [0.0; 3], edge: 64.0 },
            spacing_min: 8.0,
            layer_cells_min: 4,
            keep: Keep::Outside,
            keep_crossing: true,
            boxes: vec![BoxSpec { min, max, spacing: 2.0 }],
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        };
        let words = case.solo(false);
        assert_eq!(words, case.reference(false));
        let far = words.iter().filter(|w| position(*w >> 7)[axis] >= 7 << 16);
        assert!(far.clone().count() > 0 && far.clone().all(|w| w >> 2 & 31 == 3), "axis {axis}");
    }
}

/// Cells of edge 2 leak through slits wider than 4 for certain, those of edge 4 not through slits of 4 or less.
#[test]
fn slits_leak_into_the_spacing_that_they_are_wider_than() {
    let (inside, far) = (vec![[20.0, 20.0, 20.0]], vec![[2.0, 2.0, 2.0]]);
    let mut leaks = [0; 9];
    for (number, width) in (1..=8u8).zip(1..) {
        for at in [20.0, 21.5, 23.0] {
            for (keep, seeds) in [
                (Keep::Outside, vec![]),
                (Keep::All, vec![]),
                (Keep::Inside, vec![]),
                (Keep::Inside, inside.clone()),
                (Keep::Outside, far.clone()),
            ] {
                let case = slit(f32::from(number), at, keep, seeds);
                let want = case.reference_outcome(false).leaks;
                for ranks in [1, 3, 11] {
                    let division = division(Partitioner::Morton, None);
                    let run = Run { ranks, seed: 7, division };
                    assert_eq!(case.outcome(&run, false).leaks, want, "{case:?} on {ranks} ranks");
                }
                // The box is 24 x 24 x 21, without crossing cells of edge 4 or 8. If the inside is kept, the rest of the root may leak into it.
                let volumes = if keep == Keep::Inside { 1e3..3e5 } else { 1e3..1e4 };
                for leak in &want {
                    assert!(volumes.contains(&leak.volume), "{leak:?} of {case:?}");
                    assert_eq!(leak.spacing_fine, 2.0);
                }
                leaks[width] += usize::from(!want.is_empty());
            }
        }
    }
    assert_eq!((&leaks[..3], &leaks[5..8]), (&[0; 3][..], &[15; 3][..]), "{leaks:?}");
}

/// Both rooms are inside by most of their rays; only seeds distinguish them.
#[test]
fn a_room_without_a_seed_leaks_into_the_one_with_a_seed() {
    const IN_ROOM: [f64; 3] = [20.0, 20.0, 20.0];
    // Free at the spacing of the mesh only.
    const AT_WALL: [f64; 3] = [11.0, 20.0, 20.0];
    const OTHER_ROOM: [f64; 3] = [40.0, 20.0, 20.0];
    const FAR: [f64; 3] = [2.0, 2.0, 2.0];
    let other_room = [(4.0, 5120.0), (8.0, 2048.0)];
    for keep in [Keep::Inside, Keep::Outside, Keep::All] {
        for (width, seeds, expected) in [
            (6.0, vec![IN_ROOM], &other_room[..]),
            (6.0, vec![FAR, IN_ROOM], &other_room),
            (6.0, vec![IN_ROOM, OTHER_ROOM], &[]),
            (6.0, vec![AT_WALL, IN_ROOM], &[]),
            (6.0, vec![FAR], &[]),
            (0.0, vec![IN_ROOM], &[]),
        ] {
            let case = rooms(width, 20.0, keep, seeds);
            let want = case.reference_outcome(false).leaks;
            let found: Vec<_> =
                want.iter().map(|leak| (leak.spacing_coarse, leak.volume)).collect();
            // By rays, both rooms are on one side, which is that of the flow only if the inside is kept.
            if keep == Keep::Inside || case.seeds[0] != AT_WALL {
                assert_eq!(found, expected, "{case:?}");
            }
            for ranks in [1, 3, 11] {
                let run = Run { ranks, seed: 7, division: division(Partitioner::Morton, None) };
                assert_eq!(case.outcome(&run, false).leaks, want, "{case:?} on {ranks} ranks");
            }
        }
    }
}

/// One or two bodies without some of their facets.
fn torn() -> impl Strategy<Value = Vec<Facet>> {
    let bodies = prop_oneof![closed(), (closed(), closed()).prop_map(|(a, b)| [a, b].concat())];
    (bodies, prop::collection::vec(any::<prop::sample::Index>(), 1..4)).prop_map(
        |(mut facets, missing)| {
            missing.into_iter().for_each(|i| _ = facets.swap_remove(i.index(facets.len())));
            facets
        },
    )
}

fn seeded(facets: impl Strategy<Value = Vec<Facet>>) -> impl Strategy<Value = Small> {
    let seed = [0.0f64..64.0, 0.0f64..64.0, 0.0f64..64.0];
    let seeds = prop_oneof![Just(vec![]), prop::collection::vec(seed, 1..3)];
    (small(facets), seeds).prop_map(|(case, seeds)| Small { seeds, ..case })
}

/// Two rooms with a slit between them, and seeds anywhere.
fn drawn_rooms() -> impl Strategy<Value = Small> {
    let facets = (0.0f32..12.0, 12.0f32..23.0)
        .prop_map(|(width, at)| rooms(width, at, Keep::Inside, vec![]).facets);
    let seed = [0.0f64..64.0, 0.0f64..64.0, 0.0f64..64.0];
    let in_room = [12.0f64..28.0, 13.0f64..33.0, 12.0f64..29.0];
    let seeds = prop::collection::vec(prop_oneof![seed, in_room], 1..3);
    (small(facets), seeds).prop_map(|(case, seeds)| Small { seeds, ..case })
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn leaks_between_rooms_equal_the_reference(case in drawn_rooms(), run in run()) {
        match case.try_reference_outcome(false) {
            Ok(want) => prop_assert_eq!(case.outcome(&run, false).leaks, want.leaks),
            Err(_) => prop_assert!(case.try_outcome(&run, false).is_err()),
        }
    }

    #[test]
    fn leaks_of_torn_bodies_equal_the_reference(case in seeded(torn()), run in run()) {
        match case.try_reference_outcome(false) {
            Ok(want) => prop_assert_eq!(case.outcome(&run, false).leaks, want.leaks),
            Err(_) => prop_assert!(case.try_outcome(&run, false).is_err()),
        }
    }

    #[test]
    fn closed_bodies_do_not_leak(case in seeded((closed(), closed()).prop_map(|(a, b)| [a, b].concat()))) {
        let Ok(want) = case.try_reference_outcome(false) else { return Ok(()) };
        prop_assert_eq!((case.outcome(&Run::SOLO, false).leaks, want.leaks), (vec![], vec![]));
    }
}

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
    let (nodes, sets) = Nodes::new(&tree, &ownership);
    let mut local = components::merge(&nodes, sets, &ownership);
    let faces = std::mem::take(&mut local.faces);
    let merged = local.merged.numbered();
    let labels = global::labels(&base, &nodes, faces, &merged);
    let found = verdict::candidates(&base, &nodes, &merged, &labels);
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
