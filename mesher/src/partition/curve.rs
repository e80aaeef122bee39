//! Cutting the Morton curve into parts of equal weight.
//!
//! What lies along the curve is weighed in *bins*: octants of one level, small enough that an equal share need
//! not fall within one.

use crate::comm::Comm;
use crate::lattice::Rules;
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::partition::boxed;
use std::collections::BinaryHeap;
use std::ops::Range;

/// The level-19 Morton code of a bin's minimum corner, and what the bin weighs.
pub type Bin = (u64, u64);

/// The whole curve.
pub const ALL: Range<u64> = 0..1 << (3 * LEVEL_MAX);

/// Sorts bins, and merges those of one place.
pub fn merge(bins: &mut Vec<Bin>) {
    bins.sort_unstable_by_key(|b| b.0);
    bins.dedup_by(|b, before| {
        let same = b.0 == before.0;
        if same {
            before.1 += b.1;
        }
        same
    });
}

/// Where owners change: each bin goes to the rank whose equal share its middle falls in. The bins are this rank's, in
/// order, and all behind those of lower ranks. None where nothing weighs anything. Collective; the same on
/// all ranks.
pub fn cut(bins: &[Bin], comm: &dyn Comm) -> Option<Vec<(u64, usize)>> {
    cut_where(bins, comm, |sums| equal(sums.iter().sum(), comm.size()))
}

/// The same where the ranks own what their bins are in, which is to remain so as far as shares permit that are at most
/// `slack` heavier than equal ones: the least weight moves. What is before a rank's first bin goes with
/// it; `own` is where what this rank owns begins. Collective; the same on all ranks.
pub fn cut_anew(bins: &[Bin], own: u64, slack: f64, comm: &dyn Comm) -> Option<Vec<(u64, usize)>> {
    let mut bins = bins.to_vec();
    if let Some(first) = bins.first_mut() {
        first.0 = own;
    }
    cut_where(&bins, comm, |sums| nearly_equal(sums, slack))
}

/// Cuts where shares are to begin that `begins` tells by what the ranks have.
fn cut_where(
    bins: &[Bin],
    comm: &dyn Comm,
    begins: impl Fn(&[u128]) -> Vec<u128>,
) -> Option<Vec<(u64, usize)>> {
    let sums: Vec<u128> = {
        let mine = bins.iter().map(|b| b.1).sum();
        comm.all_gather(&[mine]).words().iter().map(|&w| u128::from(w)).collect()
    };
    if sums.iter().all(|&s| s == 0) {
        return None;
    }
    let before = sums[..comm.rank()].iter().sum();
    let mine: Vec<u64> = changes(bins, before, &begins(&sums))
        .into_iter()
        .flat_map(|(start, owner)| [start, owner as u64])
        .collect();
    let all = comm.all_gather(&mine);
    let pairs = all.words().as_chunks().0.iter();
    Some(joined(pairs.map(|&[start, owner]| (start, owner as usize))))
}

/// The same as [`cut`] for bins that all ranks have all of.
pub fn cut_known(bins: &[Bin], ranks: usize) -> Option<Vec<(u64, usize)>> {
    let total = bins.iter().map(|b| u128::from(b.1)).sum();
    (total > 0).then(|| joined(changes(bins, 0, &equal(total, ranks)).into_iter()))
}

/// The weight before each rank's share, where shares are equal.
fn equal(total: u128, ranks: usize) -> Vec<u128> {
    (0..ranks as u128).map(|r| total * r / ranks as u128).collect()
}

/// The weight before each rank's share, where ranks have so much and shares become at most `slack` heavier than equal
/// ones: the least possible is moved across the cuts.
///
/// With m the greatest share and s the present cuts, k·m - s[k] may not descend: so the nearest sequence that does not is
/// wanted, by the sum of the differences. That is isotonic regression, here by the heap of breakpoints.
fn nearly_equal(sums: &[u128], slack: f64) -> Vec<u128> {
    let total: u128 = sums.iter().sum();
    let most = (total as f64 * (1.0 + slack) / sums.len() as f64).ceil() as i128;
    let room = most * sums.len() as i128 - total as i128;
    let mut ahead = Vec::with_capacity(sums.len());
    let (mut heap, mut before) = (BinaryHeap::new(), 0);
    for (k, &sum) in (0..).zip(sums) {
        let now = k * most - before;
        before += sum as i128;
        heap.push(now);
        // A lower one takes the place of the greatest before it, twice: once for itself.
        if heap.peek().is_some_and(|&top| top > now) {
            heap.pop();
            heap.push(now);
        }
        ahead.extend(heap.peek().copied());
    }
    for k in (1..ahead.len()).rev() {
        ahead[k - 1] = ahead[k - 1].min(ahead[k]);
    }
    let begin = |(k, at): (i128, i128)| (k * most - at.clamp(0, room)) as u128;
    (0..).zip(ahead).map(begin).collect()
}

/// Where owners change along some bins, `before` of the weight being before them, and before each rank's share what
/// `begins` says.
fn changes(bins: &[Bin], mut before: u128, begins: &[u128]) -> Vec<(u64, usize)> {
    let mut owner = begins.partition_point(|&b| b <= before).saturating_sub(1);
    let mut changes: Vec<(u64, usize)> = Vec::new();
    for &(start, weight) in bins {
        let middle = 2 * before + u128::from(weight);
        before += u128::from(weight);
        while begins.get(owner + 1).is_some_and(|b| 2 * b <= middle) {
            owner += 1;
        }
        if changes.last().is_none_or(|c| c.1 != owner) {
            changes.push((start, owner));
        }
    }
    changes
}

/// Changes along the whole curve: what is before the first bin is its owner's too.
fn joined(changes: impl Iterator<Item = (u64, usize)>) -> Vec<(u64, usize)> {
    let mut all: Vec<(u64, usize)> = changes.collect();
    all.dedup_by_key(|c| c.1);
    if let Some(first) = all.first_mut() {
        first.0 = 0;
    }
    all
}

/// Adds the leaves that the boxes ask for within a stretch of the curve: by octants of `level`, or larger ones where
/// those hold no more than `light`. Each leaf weighs `each`.
pub fn add_boxes(
    bins: &mut Vec<Bin>,
    rules: &Rules,
    level: Level,
    light: u64,
    each: u64,
    within: &Range<u64>,
) {
    if rules.boxes.is_empty() {
        return;
    }
    let mut open = vec![(0, 0)];
    while let Some((l, code)) = open.pop() {
        let span = start57(l, code)..start57(l, code + 1);
        let leaves = boxed(l, code, rules);
        if leaves == 0 || span.end <= within.start || within.end <= span.start {
            continue;
        }
        let inside = within.start <= span.start && span.end <= within.end;
        if l >= level || inside && leaves <= light {
            bins.push((span.start, leaves.saturating_mul(each)));
        } else {
            open.extend((0..8).map(|child| (l + 1, code << 3 | child)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::sim;
    use crate::lattice::{Keep, Root};
    use crate::octant::ROOT_BITS;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    /// Bins of level 3, in order, some without weight.
    fn bins() -> impl Strategy<Value = Vec<Bin>> {
        prop::collection::btree_map(0u64..512, prop_oneof![4 => 0u64..1000, 1 => Just(0)], 1..60)
            .prop_map(|all| all.into_iter().map(|(code, w)| (start57(3, code), w)).collect())
    }

    proptest! {
        #[test]
        fn shares_are_equal_but_for_a_bin(bins in bins(), ranks in 1usize..9) {
            let total: u64 = bins.iter().map(|b| b.1).sum();
            let Some(cuts) = cut_known(&bins, ranks) else {
                prop_assert_eq!(total, 0);
                return Ok(());
            };
            prop_assert_eq!(cuts[0].0, 0);
            prop_assert!(cuts.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
            let heaviest = bins.iter().map(|b| b.1).max().unwrap_or(0) as f64;
            for rank in 0..ranks {
                let owner = |start: u64| cuts[cuts.partition_point(|c| c.0 <= start) - 1].1;
                let ownership: u64 = bins.iter().filter(|b| owner(b.0) == rank).map(|b| b.1).sum();
                prop_assert!((ownership as f64 - total as f64 / ranks as f64).abs() <= heaviest);
            }
        }

        #[test]
        fn stretches_of_the_curve_are_cut_as_all_of_it(
            bins in bins(),
            mut ends in prop::collection::vec(0usize..60, 4),
        ) {
            ends.sort_unstable();
            let all = cut_known(&bins, 5);
            let told = sim::run(5, 3, |comm| {
                let end = |i: usize| ends[i].min(bins.len());
                let from = if comm.rank() == 0 { 0 } else { end(comm.rank() - 1) };
                let to = if comm.rank() == 4 { bins.len() } else { end(comm.rank()) };
                cut(&bins[from..to], comm)
            });
            prop_assert!(told.into_iter().all(|t| t == all));
        }
    }

    /// The least weight that moves across cuts, of all ways to begin shares that none of is heavier than `most`.
    fn least_moved(sums: &[u128], most: u128) -> u128 {
        let total: u128 = sums.iter().sum();
        let mut begins: Vec<u128> =
            sums.iter().scan(0, |s, &w| Some(std::mem::replace(s, *s + w))).collect();
        begins.push(total);
        // By where the latest share begins: what has moved so far.
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
    fn no_more_is_moved_than_shares_ask_for() {
        let drawn =
            (0u128..8).flat_map(|a| (0..8).flat_map(move |b| (0..8).map(move |c| [a, b, c])));
        for sums in drawn.flat_map(|[a, b, c]| [vec![a, b, c], vec![c, a, b, b, c, 0, a]]) {
            for slack in [0.0, 0.2, 1.0] {
                let total: u128 = sums.iter().sum();
                let most = (total as f64 * (1.0 + slack) / sums.len() as f64).ceil() as u128;
                let mut begins = nearly_equal(&sums, slack);
                begins.push(total);
                let shares = begins.windows(2).map(|w| w[1].checked_sub(w[0]));
                let fits = |ownership: Option<u128>| ownership.is_some_and(|w| w <= most);
                assert!(begins[0] == 0 && shares.into_iter().all(fits), "{sums:?}: {begins:?}");
                let before = sums.iter().scan(0, |s, &w| Some(std::mem::replace(s, *s + w)));
                let moved: u128 = before.zip(&begins).map(|(a, b)| a.abs_diff(*b)).sum();
                assert_eq!(moved, least_moved(&sums, most), "{sums:?}, slack {slack}: {begins:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn what_ranks_own_is_cut_anew(
            bins in bins(),
            mut ends in prop::collection::vec(1u64..512, 4),
            slack in prop_oneof![Just(0.0), 0.0..0.5, Just(4.0)],
        ) {
            ends.sort_unstable();
            ends.dedup();
            let ranks = ends.len() + 1;
            let own = |rank: usize| {
                let at = |i: usize| start57(3, ends[i]);
                let begin = rank.checked_sub(1).map_or(0, at);
                begin..if rank == ends.len() { ALL.end } else { at(rank) }
            };
            let told = sim::run(ranks, 3, |comm| {
                let own = own(comm.rank());
                let mine: Vec<Bin> = bins.iter().filter(|b| own.contains(&b.0)).copied().collect();
                cut_anew(&mine, own.start, slack, comm)
            });
            prop_assert!(told.iter().all(|t| *t == told[0]));
            let total: u64 = bins.iter().map(|b| b.1).sum();
            let Some(cuts) = &told[0] else {
                prop_assert_eq!(total, 0);
                return Ok(());
            };
            prop_assert_eq!(cuts[0].0, 0);
            prop_assert!(cuts.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1));
            let owner = |start: u64| cuts[cuts.partition_point(|c| c.0 <= start) - 1].1;
            let heaviest = bins.iter().map(|b| b.1).max().unwrap_or(0) as f64;
            let most = (1.0 + slack) * total as f64 / ranks as f64;
            for rank in 0..ranks {
                let ownership: u64 = bins.iter().filter(|b| owner(b.0) == rank).map(|b| b.1).sum();
                prop_assert!(ownership as f64 <= most + heaviest + 1.0);
                // With so much slack nothing moves, and neither does what no bin tells of behind a cut.
                let mut mine = bins.iter().filter(|b| own(rank).contains(&b.0));
                if slack >= ranks as f64 - 1.0 && let Some(first) = mine.next() && first.1 > 0 {
                    prop_assert_eq!((owner(own(rank).start), owner(first.0)), (rank, rank));
                    prop_assert!(mine.all(|b| b.1 == 0 || owner(b.0) == rank));
                }
            }
        }
    }

    #[test]
    fn bins_of_boxes_hold_what_the_boxes_ask_for() {
        let h = 1i64 << (ROOT_BITS - 6);
        // 5 x 20 x 33 cells of level 6, at odd places.
        let (min, max) = ([h * 3, h * 7, h * 11], [h * 8, h * 27, h * 44]);
        let rules = Rules {
            root: Root { origin: [0.0; 3], edge: 1.0 },
            level_surface: 6,
            layer_cells_min: 1,
            keep: Keep::All,
            keep_crossing: true,
            boxes: vec![crate::lattice::ExtentBox { min, max, level: 6 }],
        };
        let weigh = |level: Level, light: u64, within: &Range<u64>| {
            let mut bins = Vec::new();
            add_boxes(&mut bins, &rules, level, light, 10, within);
            merge(&mut bins);
            bins
        };
        let sum = |bins: &[Bin]| bins.iter().map(|b| b.1).sum::<u64>();
        for (level, light) in [(2, 0), (5, 0), (6, 0), (5, 100), (5, 3300)] {
            let bins = weigh(level, light, &ALL);
            assert_eq!(sum(&bins), 10 * 5 * 20 * 33, "level {level}, light {light}");
            assert!(bins.iter().all(|b| b.0.trailing_zeros() >= 3 * (LEVEL_MAX - level)));
            let middle = start57(5, 12_345);
            let halves = [0..middle, middle..ALL.end].map(|half| sum(&weigh(5, light, &half)));
            assert_eq!(halves[0] + halves[1], 33_000, "each bin belongs to one stretch");
        }
        assert_eq!(weigh(5, 3300, &ALL).len(), 1, "what is light is not told apart");
    }
}
