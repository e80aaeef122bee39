//! Repartitioning: the boundaries between ranks move along the Morton curve until all ranks have nearly the same load.
//!
//! The work in a region is estimated from facet areas before refinement, estimated better from T0, and known exactly after
//! gradation. So boundaries move twice: after refinement by the [predicted time](super::cost) of sides and gradation, after
//! gradation by the number of leaves. They move no further than the tolerated imbalance requires, and bricks are redistributed
//! to the ranks that hold them then. The paper names this as an idea in section V.

use crate::partition::cost::{WEIGHT_OF_NEIGHBOUR, weight_of_brick};
use crate::partition::curve::{self, Bin};
use crate::partition::ownership::{Ownership, brick_start};
use bricks::brick::{self, Brick};
use bricks::brickset::{BrickSet, ones};
use bricks::octant::{LEVEL_MAX, Level};
use bricks::tree::{LEVELS, PerLevel, Tree};
use ranks::Comm;
use std::ops::Range;

/// Minimum number of groups of bricks sampled on the most populated level; the same fraction of the other levels.
const SAMPLE: usize = 256;
/// At least one group of this many is sampled.
const SAMPLE_STRIDE_MAX: usize = 23;
/// From this number of bricks on, all octants of a brick are counted at its minimum corner.
const BRICKS_MANY: usize = 4096;
/// Tolerated load imbalance of the work on T0, which is an estimate. Balancing more tightly would cost more in migration than it saves.
const TOLERANCE_WORK: f64 = 0.02;
/// Tolerated load imbalance of the leaves, each of which takes little time.
const TOLERANCE_LEAVES: f64 = 0.05;

/// The partition with nearly equal work on T0 for sides and gradation. Replicas in `tree` need not be equal. Boundaries lie
/// between octants of `level`. Collective.
pub fn after_refinement(
    tree: &Tree,
    ownership: &Ownership,
    level: Level,
    comm: &dyn Comm,
) -> Ownership {
    let mut work = Weighted::new(ownership, level);
    let groups = tree.split.iter().map(BrickSet::len).max().unwrap_or(0);
    // Odd, as bricks come in groups of powers of two.
    let stride = (groups / SAMPLE).min(SAMPLE_STRIDE_MAX) | 1;
    for l in 1..tree.split.len() as Level {
        estimate_level(tree, l, stride, &mut work);
    }
    for (_, start) in ownership.neighbours() {
        work.add_at(start, WEIGHT_OF_NEIGHBOUR);
    }
    let first_own = work.own.start;
    curve::repartition(&work.bins(), first_own, TOLERANCE_WORK, comm)
        .map_or_else(|| ownership.clone(), |b| Ownership::along(comm.rank(), comm.size(), b))
}

/// Adds the estimated work on a level, from every `stride`-th group of bricks.
fn estimate_level(tree: &Tree, l: Level, stride: usize, work: &mut Weighted) {
    let above = &tree.split[l as usize - 1];
    let (mut split, mut crossing) =
        (tree.split[l as usize].cursor(), tree.crossing[l as usize].cursor());
    for (n, b) in (0..above.len()).step_by(stride).map(|i| above.brick(i)).enumerate() {
        // Every other brick of a group, as the bricks of a group are alike; alternately from the first and from the second.
        for j in ones(u64::from(brick::parents(b.bits))).map(u64::from).skip(n & 1).step_by(2) {
            let key = b.key << 3 | j;
            let leaves = brick::children(brick::byte(b.bits, j)) & !split.get(key);
            let weight = weight_of_brick(leaves & !crossing.get(key));
            work.add(l, key, 2 * weight * stride as i64);
        }
    }
}

/// The number of leaves that this rank owns, by octants of one level.
pub struct LeafCounts(Vec<Bin>);

impl LeafCounts {
    /// Counts the leaves of a tree by octants of `level`, without those that are `gone`.
    pub fn new(split: &PerLevel, gone: &[&PerLevel], ownership: &Ownership, level: Level) -> Self {
        let mut counts = Weighted::new(ownership, level);
        counts.coarse = split.iter().map(BrickSet::len).sum::<usize>() >= BRICKS_MANY;
        let mut add = |l: Level, sets: &PerLevel, each: i64| {
            counts.add_set(l, &sets[l as usize], each, |key| ownership.owns(l, key));
        };
        for l in 0..LEVELS as Level {
            // A split replaces one leaf by eight.
            add(l, split, 7);
            gone.iter().for_each(|gone| add(l, gone, -1));
        }
        Self(counts.bins())
    }

    /// Adds weights to bricks that this rank owns, each with its level and key, as if they had so many leaves more.
    pub fn add(
        &mut self,
        weights: impl Iterator<Item = (Level, u64, u64)>,
        ownership: &Ownership,
        level: Level,
    ) {
        let mut sum = Weighted::new(ownership, level);
        sum.bins = self.0.iter().map(|&(start, leaves)| (start, leaves as i64)).collect();
        weights.for_each(|(l, key, weight)| sum.add(l, key, weight as i64));
        self.0 = sum.bins();
    }

    /// Moves the boundaries until ranks have nearly the same number of leaves, and sends the bricks of `sets` to the ranks that hold
    /// them then. Returns the new partition. Collective.
    pub fn after_gradation(
        self,
        sets: &mut [&mut PerLevel],
        ownership: &Ownership,
        comm: &dyn Comm,
    ) -> Ownership {
        let first_own = ownership.intervals().next().map_or(0, |own| own.start);
        let Some(boundaries) = curve::repartition(&self.0, first_own, TOLERANCE_LEAVES, comm)
        else {
            return ownership.clone();
        };
        let new = Ownership::along(comm.rank(), comm.size(), boundaries);
        for set in &mut *sets {
            for (l, bricks) in
                (0..).zip(set.iter_mut()).filter(|(l, _)| ownership.is_replicated(*l))
            {
                // Of the replicas of a brick, only its owner's is sent.
                bricks.retain(|b| if ownership.owns(l, b.key) { b.bits } else { 0 });
            }
        }
        new.synchronise_replicas(sets, comm);
        new
    }
}

/// Weights of what this rank owns, in bins of one level.
struct Weighted {
    /// The interval that this rank owns. Bins lie within it, though replicated bricks may begin before it or end after it.
    own: Range<u64>,
    level: Level,
    shift: u32,
    /// Whether a brick that spans several bins is counted in its first bin.
    coarse: bool,
    bins: Vec<(u64, i64)>,
}

impl Weighted {
    fn new(ownership: &Ownership, level: Level) -> Self {
        let own = ownership.intervals().next().unwrap_or(0..1);
        Self { own, level, shift: 3 * (LEVEL_MAX - level), coarse: false, bins: Vec::new() }
    }

    /// Adds `each` for every octant of a set, in bricks for which `owns` is true.
    fn add_set(&mut self, l: Level, set: &BrickSet, each: i64, owns: impl Fn(u64) -> bool) {
        let Some(up) = l.checked_sub(self.level + 2) else {
            let owned = set.bricks().filter(|b| owns(b.key));
            return owned.for_each(|b| match self.coarse {
                true => self.add(l, b.key, each * i64::from(b.bits.count_ones())),
                false => self.add_octants(l, b, each),
            });
        };
        // The bricks of one bin have one owner.
        for (key, bricks) in set.groups(3 * up) {
            if owns(key) {
                self.add(l, key, each * set.count_in(bricks) as i64);
            }
        }
    }

    /// Adds `each` for every octant of a brick that spans several bins, in groups of eight.
    fn add_octants(&mut self, l: Level, brick: Brick, each: i64) {
        for j in ones(u64::from(brick::parents(brick.bits))).map(u64::from) {
            let octants = brick::byte(brick.bits, j).count_ones();
            self.add_at(brick_start(l + 1, brick.key << 3 | j), each * i64::from(octants));
        }
    }

    /// Adds the weight of a brick.
    #[inline]
    fn add(&mut self, l: Level, key: u64, weight: i64) {
        self.add_at(brick_start(l, key), weight);
    }

    #[inline]
    fn add_at(&mut self, start: u64, weight: i64) {
        let start = start.clamp(self.own.start, self.own.end - 1) >> self.shift << self.shift;
        match self.bins.last_mut().filter(|last| last.0 == start) {
            Some(last) => last.1 += weight,
            None => self.bins.push((start, weight)),
        }
    }

    /// The bins in order. A sum may be negative where deleted leaves lie in other bins than the octants that were split for them: such
    /// a bin becomes zero, and the deficit is taken from the bins after it.
    fn bins(mut self) -> Vec<Bin> {
        self.bins.sort_by_key(|b| b.0);
        let mut deficit = 0;
        let mut sum = |all: &[(u64, i64)]| {
            let sum: i64 = deficit + all.iter().map(|b| b.1).sum::<i64>();
            deficit = sum.min(0);
            (all[0].0, sum.max(0) as u64)
        };
        self.bins.chunk_by(|a, b| a.0 == b.0).map(&mut sum).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::start57;
    use bricks::tree::per_level;

    const LEVEL: Level = 5;

    /// All bricks of the next level, with the same octants in each and more in some.
    fn split() -> PerLevel {
        let mut split = per_level();
        let l = LEVEL as usize + 1;
        for key in 0..1 << (3 * (LEVEL - 1)) {
            let more = if key >> 9 == 3 { 0xffff << 20 } else { 0 };
            split[l].push(key, 0x8000_0000_0000_00f1 | more);
        }
        assert!(split[l].len() >= BRICKS_MANY);
        split
    }

    /// Leaves by bin, counted octant by octant.
    fn exact(split: &PerLevel) -> Vec<u64> {
        let mut bins = vec![0; 1 << (3 * LEVEL)];
        split[LEVEL as usize + 1].codes().for_each(|code| bins[code as usize >> 3] += 7);
        bins
    }

    /// The greatest difference between cumulative counts of leaves by bins and by octants.
    fn error_max(split: PerLevel) -> u64 {
        let exact = exact(&split);
        let counts = LeafCounts::new(&split, &[], &Ownership::solo(), LEVEL);
        let (mut found, mut want, mut error) = (0, 0u64, 0);
        let mut bins = counts.0.iter().peekable();
        for (bin, leaves) in (0..).zip(exact) {
            want += leaves;
            while let Some(b) = bins.next_if(|b| b.0 <= start57(LEVEL, bin)) {
                found += b.1;
            }
            error = error.max(found.abs_diff(want));
        }
        assert_eq!((found, bins.next()), (want, None));
        error
    }

    #[test]
    fn few_bricks_are_counted_octant_by_octant_and_many_to_within_a_brick() {
        let many = split();
        let mut few = per_level();
        let l = LEVEL as usize + 1;
        many[l].bricks().take(BRICKS_MANY - 1).for_each(|b| few[l].push(b.key, b.bits));
        assert_eq!(error_max(few), 0);
        assert!((1..=7 * 64).contains(&error_max(many)));
    }

    #[test]
    fn the_sampled_work_is_near_the_work_of_all_bricks() {
        // Bricks are alike in long intervals, so the sum over a sample is near the sum over all.
        let mut tree = Tree { split: split(), ..Tree::default() };
        for l in 0..=LEVEL as usize {
            tree.split[l] = tree.split[LEVEL as usize + 1].coarsen();
            for _ in l..LEVEL as usize {
                tree.split[l] = tree.split[l].coarsen();
            }
        }
        tree.check_structure();
        let mut some = Weighted::new(&Ownership::solo(), LEVEL);
        let mut all = Weighted::new(&Ownership::solo(), LEVEL);
        for l in 1..tree.split.len() as Level {
            estimate_level(&tree, l, 7, &mut some);
            for b in Tree::exists(&tree.split, l) {
                all.add(l, b.key, weight_of_brick(b.bits & !tree.split[l as usize].get(b.key)));
            }
        }
        let (some, all) = (some.bins(), all.bins());
        let sum = |bins: &[Bin]| bins.iter().map(|b| b.1).sum::<u64>();
        assert!(some.len() < all.len() / 5, "{} of {} bins sampled", some.len(), all.len());
        assert!(
            sum(&some).abs_diff(sum(&all)) < sum(&all) / 20,
            "{} for {}",
            sum(&some),
            sum(&all)
        );
        // The same in every eighth of the curve.
        for eighth in 0..8 {
            let within = |bins: &[Bin]| -> Vec<Bin> {
                bins.iter().copied().filter(|b| b.0 >> (3 * LEVEL_MAX - 3) == eighth).collect()
            };
            let (some, all) = (sum(&within(&some)), sum(&within(&all)));
            assert!(some.abs_diff(all) < all / 10, "eighth {eighth}: {some} for {all}");
        }
    }
}
