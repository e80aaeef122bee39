//! Repartitioning: the boundaries between ranks move along the Morton curve until all ranks have nearly the same load.
//!
//! The leaves in a region are estimated from facet areas before refinement, and counted after it, those of T0 first and those of the mesh
//! after gradation. So boundaries move twice. They move no further than the tolerated imbalance requires, and bricks are redistributed
//! to the ranks that hold them then. The paper names this as an idea in section V.

use crate::partition::curve::{self, Bin};
use crate::partition::ownership::{Ownership, Placement, brick_start};
use bricks::brick::{self, ones};
use bricks::brickset::BrickSet;
use bricks::octant::{LEVEL_MAX, Level};
use bricks::tree::{LEVELS, PerLevel};
use ranks::Comm;

/// Tolerated load imbalance. Balancing more tightly would cost more in migration than it saves.
const TOLERANCE: f64 = 0.05;

/// The partition with nearly equal numbers of leaves of a tree, without those that are `gone`. Collective.
pub fn by_leaves(
    split: &PerLevel,
    gone: &[&PerLevel],
    ownership: &Ownership,
    level: Level,
    comm: &dyn Comm,
) -> Ownership {
    let mut leaves = Loads::new(ownership, level);
    leaves.add_leaves(split, gone);
    let (bins, first_own) = (leaves.into_bins(), ownership.longest().start);
    let boundaries = curve::repartition(&bins, first_own, TOLERANCE, comm);
    Ownership::along(comm.rank(), comm.size(), boundaries)
}

/// Sends the bricks of three sets to the ranks that hold them in another partition. The first, of split octants, may be condensed on some
/// ranks and not on others.
/// Collective.
pub fn migrate(sets: [&mut PerLevel; 3], from: &Ownership, to: &Ownership, comm: &dyn Comm) {
    let [split, crossing, stored] = sets;
    // Bricks that are stored as the octants that they fill move so.
    let mut full = PerLevel::default();
    (2..LEVELS).for_each(|l| full[l - 2] = split[l].replace_full(BrickSet::EMPTY));
    for set in [&mut *split, &mut *crossing, &mut *stored] {
        for (l, bricks) in (0..).zip(set).filter(|(l, _)| from.is_replicated(*l)) {
            // Of the other replicas of a brick, only its owner's is sent.
            bricks.retain(|b| if from.owns(l, b.key) { b.bits } else { 0 });
        }
    }
    to.synchronise_replicas(&mut [split, crossing, stored, &mut full], comm);
    for (l, mut octants) in (0..).zip(full).filter(|(_, octants)| !octants.is_empty()) {
        // Other octants of these fill bricks that this rank does not hold.
        let is_held = |key| !matches!(to.placement(l + 2, key), Placement::Remote(_));
        octants.retain(|b| b.codes().filter(|key| is_held(*key)).map(|key| 1 << (key & 63)).sum());
        // Ranks that had not condensed their part of the level have sent full bricks as such, perhaps the same ones.
        split[l as usize + 2].replace_full(octants);
        split[l as usize + 2].condense();
    }
}

/// Weights of what this rank owns, in bins of one level.
struct Loads<'a> {
    ownership: &'a Ownership,
    level: Level,
    bins: Vec<(u64, i64)>,
}

impl<'a> Loads<'a> {
    fn new(ownership: &'a Ownership, level: Level) -> Self {
        Self { ownership, level, bins: Vec::new() }
    }

    /// Adds the leaves of a tree, without those that are `gone`.
    fn add_leaves(&mut self, split: &PerLevel, gone: &[&PerLevel]) {
        for l in 0..LEVELS as Level {
            // A split replaces one leaf by eight.
            self.add_octants(l, &split[l as usize], 7);
            gone.iter().for_each(|gone| self.add_octants(l, &gone[l as usize], -1));
        }
    }

    /// Adds `each` for every octant of a set that this rank owns.
    fn add_octants(&mut self, l: Level, set: &BrickSet, each: i64) {
        let ownership = self.ownership;
        for b in set.bricks() {
            if l >= self.level + 2 {
                if ownership.owns(l, b.key) {
                    self.add(brick_start(l, b.key), each * i64::from(b.bits.count_ones()));
                }
                continue;
            }
            // A brick spans several bins, and several ranks may own parts of it.
            let groups = ones(brick::parents(b.bits).into()).map(|j| b.key << 3 | u64::from(j));
            for group in groups.filter(|group| ownership.owns(l + 1, *group)) {
                let octants = brick::byte(b.bits, group & 7).count_ones();
                self.add(brick_start(l + 1, group), each * i64::from(octants));
            }
        }
    }

    /// Adds a weight at a position. Replicated bricks may begin before the interval that this rank owns or end after it, but bins lie
    /// within it.
    #[inline]
    fn add(&mut self, start: u64, weight: i64) {
        let (own, shift) = (self.ownership.longest(), 3 * (LEVEL_MAX - self.level));
        let start = start.clamp(own.start, own.end - 1) >> shift << shift;
        match self.bins.last_mut().filter(|last| last.0 == start) {
            Some(last) => last.1 += weight,
            None => self.bins.push((start, weight)),
        }
    }

    /// The bins in order. A sum may be negative where deleted leaves lie in other bins than the octants that were split for them: such
    /// a bin becomes zero, and the deficit is taken from the bins after it.
    fn into_bins(mut self) -> Vec<Bin> {
        self.bins.sort_by_key(|b| b.0);
        let mut deficit = 0;
        let mut sum = |all: &[(u64, i64)]| {
            let sum: i64 = deficit + all.iter().map(|b| b.1).sum::<i64>();
            deficit = sum.min(0);
            [all[0].0, sum.max(0) as u64]
        };
        self.bins.chunk_by(|a, b| a.0 == b.0).map(&mut sum).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::brick::Brick;
    use bricks::octant::start57;
    use ranks::sim;

    const LEVEL: Level = 5;

    /// All bricks of the next level, with the same octants in each and more in some.
    fn split() -> PerLevel {
        let mut split = PerLevel::default();
        let l = LEVEL as usize + 1;
        for key in 0..1 << (3 * (LEVEL - 1)) {
            let more = if key >> 9 == 3 { 0xffff << 20 } else { 0 };
            split[l].push(key, 0x8000_0000_0000_00f1 | more);
        }
        split
    }

    #[test]
    fn leaves_are_counted_by_bin_octant_by_octant() {
        let split = split();
        let mut exact = vec![0; 1 << (3 * LEVEL)];
        split[LEVEL as usize + 1].codes().for_each(|code| exact[code as usize >> 3] += 7);
        let solo = Ownership::solo();
        let mut counts = Loads::new(&solo, LEVEL);
        counts.add_leaves(&split, &[]);
        let bins = (0..).zip(exact).filter(|(_, leaves)| *leaves > 0);
        let want: Vec<Bin> = bins.map(|(bin, leaves)| [start57(LEVEL, bin), leaves]).collect();
        assert_eq!(counts.into_bins(), want);
        // The same at a level whose bins hold whole bricks.
        let mut coarse = Loads::new(&solo, LEVEL - 2);
        coarse.add_leaves(&split, &[]);
        let sum = |bins: &[Bin]| bins.iter().map(|b| b[1]).sum::<u64>();
        let coarse = coarse.into_bins();
        assert_eq!((coarse.len(), sum(&coarse)), (1 << (3 * (LEVEL - 2)), sum(&want)));
    }

    #[test]
    fn each_rank_counts_its_octants_of_a_brick_that_two_hold() {
        let (l, key) = (LEVEL, 5);
        let mut split = PerLevel::default();
        split[l as usize].push(key, u64::MAX);
        let loads = [0, 1].map(|rank| {
            let boundary = (start57(l, key << 6 | 24), 1);
            let ownership = Ownership::along(rank, 2, vec![(0, 0), boundary]);
            let mut counts = Loads::new(&ownership, l);
            counts.add_leaves(&split, &[]);
            counts.into_bins().iter().map(|bin| bin[1]).sum::<u64>()
        });
        assert_eq!(loads, [24 * 7, 40 * 7]);
    }

    #[test]
    fn bricks_that_all_ranks_hold_are_counted_by_their_owners() {
        const RANKS: usize = 64;
        let (mut split, boundaries) =
            (PerLevel::default(), |rank| (start57(2, rank), rank as usize));
        (0..64).for_each(|key| split[4].push(key, u64::MAX));
        let of_rank = |rank| {
            let ownership = Ownership::along(rank, RANKS, (0..64).map(boundaries).collect());
            assert!(ownership.is_everywhere(4), "bins hold whole bricks that all ranks hold");
            let mut counts = Loads::new(&ownership, 2);
            counts.add_leaves(&split, &[]);
            counts.into_bins()
        };
        for rank in 0..RANKS {
            assert_eq!(of_rank(rank), [[start57(2, rank as u64), 64 * 7]]);
        }
    }

    #[test]
    fn bricks_move_whether_ranks_have_condensed_them_or_not() {
        let l = 6;
        // A boundary in a brick, which both ranks hold.
        let along = |rank, key: u64| {
            Ownership::along(rank, 2, vec![(0, 0), (start57(l, key * 64 + 24), 1)])
        };
        for (condensed, [begin, end]) in (0..4)
            .flat_map(|condensed| [[1000, 777], [777, 1000], [5, 5]].map(|at| (condensed, at)))
        {
            let moved = sim::run(2, 1, |comm| {
                let (from, to) = (along(comm.rank(), begin), along(comm.rank(), end));
                let held = |of: &Ownership| -> BrickSet {
                    let is_held =
                        |key: &u64| !matches!(of.placement(l, *key), Placement::Remote(_));
                    let bits = |key| if key % 100 == 77 { 5 } else { u64::MAX };
                    (0..4096).filter(is_held).map(|key| Brick { key, bits: bits(key) }).collect()
                };
                let (mut split, mut other) = (PerLevel::default(), PerLevel::default());
                split[l as usize] = held(&from);
                if condensed >> comm.rank() & 1 == 1 {
                    split[l as usize].condense();
                }
                migrate([&mut split, &mut other, &mut PerLevel::default()], &from, &to, comm);
                split[l as usize].check_invariants();
                split[l as usize].bricks().eq(held(&to).bricks())
            });
            assert_eq!(moved, [true, true], "{condensed:02b} from {begin} to {end}");
        }
    }
}
