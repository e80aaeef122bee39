//! Intervals of the Morton curve with equal weight, one for each rank.
//!
//! Weights are summed in *bins*: octants of one level, small compared with the load of a rank. A partition of the curve is given by
//! its *boundaries*: positions in ascending order, each with the rank that owns the curve from there to the next, or to one that repeats
//! it; the first rank owns what comes before as well. If all weights are zero, rank 0 owns everything.

use bricks::octant::LEVEL_MAX;
use ranks::{Comm, Entry, gather};
use std::collections::BinaryHeap;
use std::ops::Range;

/// The level-19 Morton code of a bin's minimum corner, and the bin's weight.
pub type Bin = Entry;

/// A position on the curve, as a level-19 Morton code, and the owner from there on.
pub type Boundary = (u64, usize);

/// The whole curve.
pub const ALL: Range<u64> = 0..1 << (3 * LEVEL_MAX);

/// The boundaries of intervals with equal weight, one for each of `ranks`: each bin goes to the rank in whose part its middle lies. The
/// bins of a rank of `comm` are in order, and come after all bins of lower ranks; where every rank knows all bins, it partitions them as
/// a single rank. Collective; the same on all ranks.
pub fn partition(bins: &[Bin], ranks: usize, comm: &dyn Comm) -> Vec<Boundary> {
    cut_at(bins, comm, |loads| equal(loads.iter().sum(), ranks))
}

/// The same for ranks that already own the octants of their bins. The least weight changes owner such that no load exceeds the
/// mean by more than the fraction `tolerance`. `first_own` is the first position that this rank owns; what it owns before its
/// first bin goes with that bin. Collective; the same on all ranks.
pub fn repartition(bins: &[Bin], first_own: u64, tolerance: f64, comm: &dyn Comm) -> Vec<Boundary> {
    let mut bins = bins.to_vec();
    if let Some(first) = bins.first_mut() {
        first[0] = first_own;
    }
    cut_at(&bins, comm, |loads| nearly_equal(loads, tolerance))
}

/// The boundaries at the cumulative weights that `begins` returns, one for each rank, given the loads of the ranks.
fn cut_at(bins: &[Bin], comm: &dyn Comm, begins: impl Fn(&[u128]) -> Vec<u128>) -> Vec<Boundary> {
    // So many leaves that no mesh has them saturate.
    let load = bins.iter().fold(0, |sum: u64, b| sum.saturating_add(b[1]));
    let loads: Vec<u128> = gather(comm, &[load]).into_iter().map(u128::from).collect();
    if loads.iter().all(|&load| load == 0) {
        return vec![(0, 0)];
    }
    let all = gather(comm, &boundaries(bins, loads[..comm.rank()].iter().sum(), &begins(&loads)));
    all.into_iter().map(|[start, owner]| (start, owner as usize)).collect()
}

/// The cumulative weight at which each rank begins, where all loads are equal.
fn equal(total: u128, ranks: usize) -> Vec<u128> {
    (0..ranks as u128).map(|r| total * r / ranks as u128).collect()
}

/// The cumulative weight at which each rank begins, where the loads are `loads` now and may exceed the mean by the fraction
/// `tolerance`: the least possible weight crosses boundaries.
///
/// With m the greatest load allowed and s the present cumulative weights, k·m - s[k] must not decrease. The nearest such sequence
/// by the sum of absolute differences is an isotonic regression, found here with a heap of breakpoints.
fn nearly_equal(loads: &[u128], tolerance: f64) -> Vec<u128> {
    let total: u128 = loads.iter().sum();
    let most = (total as f64 * (1.0 + tolerance) / loads.len() as f64).ceil() as i128;
    let room = most * loads.len() as i128 - total as i128;
    let mut ahead = Vec::with_capacity(loads.len());
    let (mut heap, mut before) = (BinaryHeap::new(), 0);
    for (k, &load) in (0..).zip(loads) {
        let now = k * most - before;
        before += load as i128;
        heap.push(now);
        // A lower value replaces the greatest one before it, and stays as a breakpoint of its own.
        if heap.peek().is_some_and(|&top| top > now) {
            heap.pop();
            heap.push(now);
        }
        ahead.extend(heap.peek().copied());
    }
    for k in (1..ahead.len()).rev() {
        ahead[k - 1] = ahead[k - 1].min(ahead[k]);
    }
    let begin = |(k, ahead): (i128, i128)| (k * most - ahead.clamp(0, room)) as u128;
    (0..).zip(ahead).map(begin).collect()
}

/// The boundaries among some bins, with the weight `before` ahead of them, where ranks begin at the cumulative weights `begins`: each
/// with its owner.
fn boundaries(bins: &[Bin], mut before: u128, begins: &[u128]) -> Vec<[u64; 2]> {
    let mut owner = begins.partition_point(|&b| b <= before).saturating_sub(1);
    let mut found: Vec<[u64; 2]> = Vec::new();
    for &[start, weight] in bins {
        let middle = 2 * before + u128::from(weight);
        before += u128::from(weight);
        while begins.get(owner + 1).is_some_and(|b| 2 * b <= middle) {
            owner += 1;
        }
        if found.last().is_none_or(|b| b[1] != owner as u64) {
            found.push([start, owner as u64]);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::ownership::Ownership;
    use bricks::octant::start57;
    use proptest::prelude::*;
    use ranks::{Solo, sim};
    use std::collections::BTreeMap;

    /// Bins of level 3, in order, some without weight.
    fn bins() -> impl Strategy<Value = Vec<Bin>> {
        prop::collection::btree_map(0u64..512, prop_oneof![4 => 0u64..1000, 1 => Just(0)], 1..60)
            .prop_map(|all| all.into_iter().map(|(code, w)| [start57(3, code), w]).collect())
    }

    /// The boundaries of the whole curve, without those between intervals of one owner.
    fn whole(boundaries: Vec<Boundary>, ranks: usize) -> Vec<Boundary> {
        Ownership::along(0, ranks, boundaries).boundaries().to_vec()
    }

    proptest! {
        #[test]
        fn loads_differ_from_the_mean_by_a_bin_at_most(bins in bins(), ranks in 1usize..9) {
            let total: u64 = bins.iter().map(|b| b[1]).sum();
            let boundaries = whole(partition(&bins, ranks, &Solo), ranks);
            prop_assert_eq!(boundaries[0].0, 0);
            prop_assert!(boundaries.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
            let heaviest = bins.iter().map(|b| b[1]).max().unwrap_or(0) as f64;
            for rank in 0..ranks {
                let owner = |start: u64| boundaries[boundaries.partition_point(|c| c.0 <= start) - 1].1;
                let load: u64 = bins.iter().filter(|b| owner(b[0]) == rank).map(|b| b[1]).sum();
                prop_assert!((load as f64 - total as f64 / ranks as f64).abs() <= heaviest);
            }
        }

        #[test]
        fn the_partition_does_not_depend_on_the_ranks_that_have_the_bins(
            bins in bins(),
            mut ends in prop::collection::vec(0usize..60, 4),
        ) {
            ends.sort_unstable();
            let all = whole(partition(&bins, 5, &Solo), 5);
            let found = sim::run(5, 3, |comm| {
                let end = |i: usize| ends[i].min(bins.len());
                let from = if comm.rank() == 0 { 0 } else { end(comm.rank() - 1) };
                let to = if comm.rank() == 4 { bins.len() } else { end(comm.rank()) };
                whole(partition(&bins[from..to], 5, comm), 5)
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
        let drawn =
            (0u128..8).flat_map(|a| (0..8).flat_map(move |b| (0..8).map(move |c| [a, b, c])));
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
                let mine: Vec<Bin> = bins.iter().filter(|b| own.contains(&b[0])).copied().collect();
                whole(repartition(&mine, own.start, tolerance, comm), ranks)
            });
            prop_assert!(found.iter().all(|f| *f == found[0]));
            let total: u64 = bins.iter().map(|b| b[1]).sum();
            let boundaries = &found[0];
            prop_assume!(total > 0);
            prop_assert_eq!(boundaries[0].0, 0);
            prop_assert!(boundaries.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
            let owner = |start: u64| boundaries[boundaries.partition_point(|c| c.0 <= start) - 1].1;
            let heaviest = bins.iter().map(|b| b[1]).max().unwrap_or(0) as f64;
            let most = (1.0 + tolerance) * total as f64 / ranks as f64;
            for rank in 0..ranks {
                let load: u64 = bins.iter().filter(|b| owner(b[0]) == rank).map(|b| b[1]).sum();
                prop_assert!(load as f64 <= most + heaviest + 1.0);
                // With that much tolerance nothing moves, nor does the curve between the last bin of a rank and its end.
                let mut mine = bins.iter().filter(|b| own(rank).contains(&b[0]));
                if tolerance >= ranks as f64 - 1.0 && let Some(first) = mine.next() && first[1] > 0 {
                    prop_assert_eq!((owner(own(rank).start), owner(first[0])), (rank, rank));
                    prop_assert!(mine.all(|b| b[1] == 0 || owner(b[0]) == rank));
                }
            }
        }
    }
}
