use super::*;
use bricks::tree::PerLevel;
use proptest::prelude::*;
use ranks::{Comm, sim};
use std::collections::{BTreeMap, BTreeSet};

/// Level of the octants that have owners here; bricks are tested down to one level below those that fill such an octant.
pub const FINE: Level = 3;
pub const RANKS: usize = 12;
/// Deepest of the levels that so many ranks hold.
const EVERYWHERE: Level = 2;

/// Owners of all octants of level [`FINE`]: one interval for each rank, or many as from METIS.
pub fn owners() -> impl Strategy<Value = Vec<usize>> {
    let octants = 1usize << (3 * FINE);
    let ascending = prop::collection::vec(0..octants, RANKS - 1).prop_map(move |mut boundaries| {
        boundaries.sort_unstable();
        (0..octants).map(|o| boundaries.partition_point(|&b| b <= o)).collect()
    });
    let any = prop::collection::vec((0..RANKS, 1usize..90), octants).prop_map(move |intervals| {
        let all = intervals.into_iter().flat_map(|(owner, n)| std::iter::repeat_n(owner, n));
        all.take(octants).collect()
    });
    prop_oneof![ascending, any]
}

pub fn ownership(rank: usize, owners: &[usize]) -> Ownership {
    let starts = (0..).map(|code| start57(FINE, code));
    Ownership::along(rank, RANKS, starts.zip(owners.iter().copied()).collect())
}

/// All bricks down to one level below the finest that could be replicated, and the owners of the intervals in each.
fn bricks(owners: &[usize]) -> Vec<(Level, u64, Vec<usize>)> {
    let owners_in = |first: usize, n: usize| {
        let mut found = owners[first..first + n].to_vec();
        found.dedup();
        found
    };
    let of_level = |l: Level| {
        let up = (FINE + 2).saturating_sub(l.max(2));
        let n = 1usize << (3 * up);
        (0..owners.len() / n).map(move |key| (l, key as u64, owners_in(key * n, n)))
    };
    (0..=FINE + 2).flat_map(of_level).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn ranks_hold_the_bricks_that_they_own_part_of(owners in owners()) {
        let views: Vec<Ownership> = (0..RANKS).map(|r| ownership(r, &owners)).collect();
        let (mut replicated, mut fully) = (EVERYWHERE, EVERYWHERE);
        for (l, key, owners) in bricks(&owners) {
            let many = l <= EVERYWHERE || owners.len() >= OWNERS_MANY;
            if l >= 2 && owners.len() > 1 { replicated = replicated.max(l); }
            if many { fully = fully.max(l); }
            for (rank, ownership) in views.iter().enumerate() {
                let want = match () {
                    () if many => Placement::FullyReplicated,
                    () if owners == [rank] => Placement::Local,
                    () if owners.contains(&rank) => Placement::PartiallyReplicated,
                    () => Placement::Remote(owners[0]),
                };
                prop_assert_eq!(ownership.placement(l, key), want, "level {} key {}", l, key);
                prop_assert_eq!(ownership.owner(l, key), owners[0]);
                let holds = !matches!(want, Placement::Remote(_));
                prop_assert!(!holds || ownership.owns(l, key) == (owners[0] == rank));
            }
            let place = views[0].non_owning_view().placement(l, key);
            prop_assert_eq!(place, if many { Placement::FullyReplicated } else { Placement::Remote(owners[0]) });
        }
        prop_assert_eq!((views[0].level_replicated, views[0].level_fully_replicated), (replicated, fully));
    }

    #[test]
    fn octants_tile_what_a_rank_owns(owners in owners()) {
        for rank in 0..RANKS {
            let ownership = ownership(rank, &owners);
            let octants = ownership.octants();
            let fine: Vec<u64> = octants
                .iter()
                .flat_map(|&(l, code)| code << (3 * (FINE - l))..(code + 1) << (3 * (FINE - l)))
                .collect();
            let mine = (0..owners.len() as u64).filter(|&o| owners[o as usize] == rank);
            prop_assert!(fine.into_iter().eq(mine));
            // No eight of them are the children of one octant.
            for w in octants.chunk_by(|a, b| a.0 == b.0 && a.1 >> 3 == b.1 >> 3) {
                prop_assert!(w.len() < 8);
            }
        }
    }

    #[test]
    fn redistributed_octants_reach_all_ranks_that_hold_their_bricks(
        owners in owners(),
        few in prop::collection::vec((0..RANKS, 0usize..2, 0..FINE + 3, any::<u64>(), 1u64..8), 0..80),
        // Two ranks send more than a few bricks to some others.
        many in prop::collection::vec((0usize..2, 0usize..2, Just(FINE + 2), any::<u64>(), 1u64..8), 0..800),
    ) {
        let sent = [few, many].concat();
        let all = bricks(&owners);
        let mut keys = [0; FINE as usize + 3];
        all.iter().for_each(|b| keys[b.0 as usize] += 1);
        let key = |l: Level, draw: u64| draw % keys[l as usize];
        let mut sums: BTreeMap<(usize, Level, u64), u64> = BTreeMap::new();
        for &(_, set, l, draw, bits) in &sent {
            *sums.entry((set, l, key(l, draw))).or_default() |= bits;
        }
        let got = sim::run(RANKS, 7, |comm| {
            let mut sets = [PerLevel::default(), PerLevel::default()];
            let mut mine: Vec<_> = sent.iter().filter(|t| t.0 == comm.rank()).collect();
            mine.sort_by_key(|t| key(t.2, t.3));
            for &&(_, set, l, draw, bits) in &mine {
                sets[set][l as usize].push(key(l, draw), bits);
            }
            let [a, b] = &mut sets;
            ownership(comm.rank(), &owners).synchronise_replicas(&mut [a, b], comm);
            sets
        });
        for (rank, sets) in got.iter().enumerate() {
            let ownership = ownership(rank, &owners);
            for (number, set) in sets.iter().enumerate() {
                for &(l, brick, _) in &all {
                    let sum = sums.get(&(number, l, brick)).copied().unwrap_or(0);
                    let holds = !matches!(ownership.placement(l, brick), Placement::Remote(_));
                    prop_assert_eq!(set[l as usize].get(brick), if holds { sum } else { 0 });
                }
            }
        }
    }
}

#[test]
fn a_brick_of_many_owners_is_held_by_all_ranks() {
    // Nine contiguous octants with an owner each; one rank owns all others.
    let owners: Vec<usize> = (0..1 << (3 * FINE)).map(|o: usize| o.min(9)).collect();
    let ownership = ownership(11, &owners);
    assert_eq!(ownership.placement(FINE + 1, 0), Placement::Remote(0));
    assert_eq!(ownership.placement(FINE, 0), Placement::FullyReplicated);
    let places: BTreeSet<String> =
        (1..64).map(|key| format!("{:?}", ownership.placement(FINE + 1, key))).collect();
    assert_eq!(places.into_iter().collect::<Vec<_>>(), ["Remote(8)", "Remote(9)"]);
}
