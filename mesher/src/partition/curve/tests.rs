use super::*;
use bricks::octant::start57;
use proptest::prelude::*;
use ranks::sim;
use std::collections::BTreeMap;

/// Bins of level 3, in order, some without weight.
fn bins() -> impl Strategy<Value = Vec<Bin>> {
    prop::collection::btree_map(0u64..512, prop_oneof![4 => 0u64..1000, 1 => Just(0)], 1..60)
        .prop_map(|all| all.into_iter().map(|(code, w)| (start57(3, code), w)).collect())
}

proptest! {
    #[test]
    fn loads_differ_from_the_mean_by_a_bin_at_most(bins in bins(), ranks in 1usize..9) {
        let total: u64 = bins.iter().map(|b| b.1).sum();
        let Some(boundaries) = partition_known(&bins, ranks) else {
            prop_assert_eq!(total, 0);
            return Ok(());
        };
        prop_assert_eq!(boundaries[0].0, 0);
        prop_assert!(boundaries.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
        let heaviest = bins.iter().map(|b| b.1).max().unwrap_or(0) as f64;
        for rank in 0..ranks {
            let owner = |start: u64| boundaries[boundaries.partition_point(|c| c.0 <= start) - 1].1;
            let load: u64 = bins.iter().filter(|b| owner(b.0) == rank).map(|b| b.1).sum();
            prop_assert!((load as f64 - total as f64 / ranks as f64).abs() <= heaviest);
        }
    }

    #[test]
    fn the_partition_does_not_depend_on_the_ranks_that_have_the_bins(
        bins in bins(),
        mut ends in prop::collection::vec(0usize..60, 4),
    ) {
        ends.sort_unstable();
        let all = partition_known(&bins, 5);
        let found = sim::run(5, 3, |comm| {
            let end = |i: usize| ends[i].min(bins.len());
            let from = if comm.rank() == 0 { 0 } else { end(comm.rank() - 1) };
            let to = if comm.rank() == 4 { bins.len() } else { end(comm.rank()) };
            partition(&bins[from..to], comm)
        });
        prop_assert!(found.into_iter().all(|t| t == all));
    }
}

/// The least weight that crosses boundaries, over all partitions without a load above `most`, by dynamic programming.
fn least_moved(sums: &[u128], most: u128) -> u128 {
    let total: u128 = sums.iter().sum();
    let mut begins: Vec<u128> =
        sums.iter().scan(0, |s, &w| Some(std::mem::replace(s, *s + w))).collect();
    begins.push(total);
    // The least weight moved so far, by the cumulative weight at which the latest rank begins.
    let mut moved = BTreeMap::from([(0, 0)]);
    for &begin in &begins[1..] {
        let mut next = BTreeMap::new();
        for (&from, &so_far) in &moved {
            for to in from..=(from + most).min(total) {
                let best = next.entry(to).or_insert(u128::MAX);
                *best = (*best).min(so_far + to.abs_diff(begin));
            }
        }
        moved = next;
    }
    moved[&total]
}

#[test]
fn no_more_weight_moves_than_the_tolerance_requires() {
    let drawn = (0u128..8).flat_map(|a| (0..8).flat_map(move |b| (0..8).map(move |c| [a, b, c])));
    for sums in drawn.flat_map(|[a, b, c]| [vec![a, b, c], vec![c, a, b, b, c, 0, a]]) {
        for tolerance in [0.0, 0.2, 1.0] {
            let total: u128 = sums.iter().sum();
            let most = (total as f64 * (1.0 + tolerance) / sums.len() as f64).ceil() as u128;
            let mut begins = nearly_equal(&sums, tolerance);
            begins.push(total);
            let loads = begins.windows(2).map(|w| w[1].checked_sub(w[0]));
            let fits = |load: Option<u128>| load.is_some_and(|w| w <= most);
            assert!(begins[0] == 0 && loads.into_iter().all(fits), "{sums:?}: {begins:?}");
            let before = sums.iter().scan(0, |s, &w| Some(std::mem::replace(s, *s + w)));
            let moved: u128 = before.zip(&begins).map(|(a, b)| a.abs_diff(*b)).sum();
            assert_eq!(
                moved,
                least_moved(&sums, most),
                "{sums:?}, tolerance {tolerance}: {begins:?}"
            );
        }
    }
}

proptest! {
    #[test]
    fn repartitioned_loads_are_within_the_tolerance(
        bins in bins(),
        mut ends in prop::collection::vec(1u64..512, 4),
        tolerance in prop_oneof![Just(0.0), 0.0..0.5, Just(4.0)],
    ) {
        ends.sort_unstable();
        ends.dedup();
        let ranks = ends.len() + 1;
        let own = |rank: usize| {
            let at = |i: usize| start57(3, ends[i]);
            let begin = rank.checked_sub(1).map_or(0, at);
            begin..if rank == ends.len() { ALL.end } else { at(rank) }
        };
        let found = sim::run(ranks, 3, |comm| {
            let own = own(comm.rank());
            let mine: Vec<Bin> = bins.iter().filter(|b| own.contains(&b.0)).copied().collect();
            repartition(&mine, own.start, tolerance, comm)
        });
        prop_assert!(found.iter().all(|f| *f == found[0]));
        let total: u64 = bins.iter().map(|b| b.1).sum();
        let Some(boundaries) = &found[0] else {
            prop_assert_eq!(total, 0);
            return Ok(());
        };
        prop_assert_eq!(boundaries[0].0, 0);
        prop_assert!(boundaries.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
        let owner = |start: u64| boundaries[boundaries.partition_point(|c| c.0 <= start) - 1].1;
        let heaviest = bins.iter().map(|b| b.1).max().unwrap_or(0) as f64;
        let most = (1.0 + tolerance) * total as f64 / ranks as f64;
        for rank in 0..ranks {
            let load: u64 = bins.iter().filter(|b| owner(b.0) == rank).map(|b| b.1).sum();
            prop_assert!(load as f64 <= most + heaviest + 1.0);
            // With that much tolerance nothing moves, nor does the curve between the last bin of a rank and its end.
            let mut mine = bins.iter().filter(|b| own(rank).contains(&b.0));
            if tolerance >= ranks as f64 - 1.0 && let Some(first) = mine.next() && first.1 > 0 {
                prop_assert_eq!((owner(own(rank).start), owner(first.0)), (rank, rank));
                prop_assert!(mine.all(|b| b.1 == 0 || owner(b.0) == rank));
            }
        }
    }
}
