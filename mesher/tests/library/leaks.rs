//! Regions that are closed at a coarser spacing and open at that of the mesh.

use crate::support::{Facet, Run, Small, closed, config, division, rooms, run, slit, small};
use mesher::input::lattice::Keep;
use mesher::partition::Partitioner;
use proptest::prelude::*;

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
