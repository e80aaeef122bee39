//! Dealing out anew what there is, where the Morton curve is cut.
//!
//! What work a place will make is guessed before refinement, known better when T0 is there, and exactly when the mesh
//! is. So the curve is cut again, twice: after refinement by what sides and gradation take, after gradation by
//! leaves. Each rank weighs what it has; cuts follow from the ranks' sums, and move no further than shares that are
//! nearly equal ask for; and bricks go to their new holders.
//! The paper asks for this in its conclusions.

use crate::brick::{self, Brick};
use crate::brickset::{BrickSet, ones};
use crate::comm::Comm;
use crate::octant::{LEVEL_MAX, Level};
use crate::partition::curve::{self, Bin};
use crate::partition::ownership::{Ownership, brick_start};
use crate::tree::{LEVELS, PerLevel, Tree};
use std::ops::Range;

/// What a brick, a component, a second one in a brick, and a component of a single octant take in sides and gradation
/// together, in units of some 70 ns: fitted to what the ranks of several meshes took. Surfaces that lie obliquely to the axes
/// leave more components; uneven ones leave small ones, and steps that a processor does not foresee.
const COSTS: [u64; 4] = [2, 2, 2, 13];
/// What another rank takes that owns something beside, in the same units: two dozen messages to it and from it, and what is in
/// them. Who owns a corner of the root that is mostly empty has a hundred such, and others two dozen.
const COST_NEIGHBOUR: i64 = 230;
/// Groups of bricks that are looked at to find what the level takes that has most of them, at least where there are so many;
/// of the other levels the same part.
const SAMPLE: usize = 256;
/// Of so many groups one is looked at at least.
const SPARSE: usize = 23;
/// Bricks of which it does not matter where in one of them its octants are.
const BRICKS_MANY: usize = 4096;
/// How much heavier than an equal share one may be by work on T0, which is guessed anyway; to move bricks costs more.
const SLACK_WORK: f64 = 0.02;
/// The same by leaves, which cost little time each.
const SLACK_LEAVES: f64 = 0.05;

/// The ownership that divides the work on T0, once it is refined, into nearly equal parts; `tree` need not be settled.
/// Cuts fall between octants of a level. Collective.
pub fn of_base_tree(
    tree: &Tree,
    ownership: &Ownership,
    level: Level,
    comm: &dyn Comm,
) -> Ownership {
    let mut scale = Scale::new(ownership, level);
    let groups = tree.split.iter().map(BrickSet::len).max().unwrap_or(0);
    // Odd, as bricks come in groups of powers of two.
    let every = (groups / SAMPLE).min(SPARSE) | 1;
    for l in 1..tree.split.len() as Level {
        weigh_level(tree, l, every, &mut scale);
    }
    for (_, at) in ownership.neighbours() {
        scale.add_at(at, COST_NEIGHBOUR);
    }
    scale.cut(comm).unwrap_or_else(|| ownership.clone())
}

/// Weighs the bricks of a level, of which it looks at one group out of so many.
fn weigh_level(tree: &Tree, l: Level, every: usize, scale: &mut Scale) {
    let above = &tree.split[l as usize - 1];
    let (mut split, mut crossing) =
        (tree.split[l as usize].cursor(), tree.crossing[l as usize].cursor());
    for (n, b) in (0..above.len()).step_by(every).map(|at| above.brick(at)).enumerate() {
        // Every other brick of a group, in turns the first or the second: they are much alike.
        for j in ones(u64::from(brick::parents(b.bits))).map(u64::from).skip(n & 1).step_by(2) {
            let key = b.key << 3 | j;
            let leaves = brick::children(brick::byte(b.bits, j)) & !split.get(key);
            scale.add(l, key, 2 * cost(leaves & !crossing.get(key)) * every as i64);
        }
    }
}

/// What a brick with these non-crossing leaves takes.
fn cost(open: u64) -> i64 {
    let (mut components, mut single) = (0, 0);
    for part in brick::components(open) {
        components += 1;
        single += u64::from(part.is_power_of_two());
    }
    let counts = [1, components, u64::from(components > 1), single];
    counts.iter().zip(COSTS).map(|(n, each)| n * each).sum::<u64>() as i64
}

/// What a mesh is made of, level by level.
pub struct Parts<'a> {
    /// Split octants of the graded tree.
    pub split: &'a mut PerLevel,
    /// Crossing leaves of T0.
    pub crossing: &'a mut PerLevel,
    /// Leaves of T0 that are inside.
    pub inside: &'a mut PerLevel,
    /// Those that were deleted.
    pub deleted: &'a mut PerLevel,
}

/// Leaves by place, on this rank.
pub struct Weighed(Vec<Bin>);

impl Weighed {
    /// Weighs the leaves of a mesh in octants of a level; crossing leaves are in it if `with_crossing`.
    pub fn new(parts: &Parts, ownership: &Ownership, level: Level, with_crossing: bool) -> Self {
        let mut scale = Scale::new(ownership, level);
        scale.coarse = parts.split.iter().map(BrickSet::len).sum::<usize>() >= BRICKS_MANY;
        let mut add = |l: Level, sets: &PerLevel, each: i64| {
            scale.add_set(l, &sets[l as usize], each, |key| ownership.owns(l, key));
        };
        for l in 0..LEVELS as Level {
            // A leaf that splits makes eight of one.
            add(l, parts.split, 7);
            add(l, parts.deleted, -1);
            if !with_crossing {
                add(l, parts.crossing, -1);
            }
        }
        Self(scale.bins())
    }

    /// The most that is in one place.
    pub fn heaviest(&self) -> u64 {
        self.0.iter().map(|b| b.1).max().unwrap_or(0)
    }

    /// Deals the leaves out anew, in nearly equal shares. Collective.
    pub fn deal(self, parts: Parts, ownership: &Ownership, comm: &dyn Comm) -> Ownership {
        let own = ownership.intervals().next().map_or(0, |own| own.start);
        let Some(changes) = curve::cut_anew(&self.0, own, SLACK_LEAVES, comm) else {
            return ownership.clone();
        };
        let fresh = Ownership::along(comm.rank(), comm.size(), changes);
        let mut sets = [parts.split, parts.crossing, parts.inside, parts.deleted];
        for set in &mut sets {
            for (l, bricks) in
                (0..).zip(set.iter_mut()).filter(|(l, _)| ownership.is_replicated(*l))
            {
                // Of several equal copies one moves.
                bricks.retain(|b| if ownership.owns(l, b.key) { b.bits } else { 0 });
            }
        }
        fresh.synchronise_replicas(&mut sets, comm);
        fresh
    }
}

/// Weighs what this rank has in octants of a level.
struct Scale {
    /// What this rank owns, as bins have to be in it: shared bricks may begin before, and end behind.
    own: Range<u64>,
    level: Level,
    shift: u32,
    /// Whether bricks that have several bins count as if all of them lay in the first.
    coarse: bool,
    bins: Vec<(u64, i64)>,
}

impl Scale {
    fn new(ownership: &Ownership, level: Level) -> Self {
        let own = ownership.intervals().next().unwrap_or(0..1);
        Self { own, level, shift: 3 * (LEVEL_MAX - level), coarse: false, bins: Vec::new() }
    }

    /// Adds so much for each octant of a set, in bricks that this rank answers for.
    fn add_set(&mut self, l: Level, set: &BrickSet, each: i64, owns: impl Fn(u64) -> bool) {
        let Some(up) = l.checked_sub(self.level + 2) else {
            let mine = set.bricks().filter(|b| owns(b.key));
            return mine.for_each(|b| match self.coarse {
                true => self.add(l, b.key, each * i64::from(b.bits.count_ones())),
                false => self.add_octants(l, b, each),
            });
        };
        // Bricks of one bin have one owner.
        for (key, bricks) in set.groups(3 * up) {
            if owns(key) {
                self.add(l, key, each * set.count_in(bricks) as i64);
            }
        }
    }

    /// Adds so much for each octant of a brick that has several bins, in groups of eight.
    fn add_octants(&mut self, l: Level, brick: Brick, each: i64) {
        for j in ones(u64::from(brick::parents(brick.bits))).map(u64::from) {
            let octants = brick::byte(brick.bits, j).count_ones();
            self.add_at(brick_start(l + 1, brick.key << 3 | j), each * i64::from(octants));
        }
    }

    /// Adds a brick; those of one level come in order.
    #[inline]
    fn add(&mut self, l: Level, key: u64, weight: i64) {
        self.add_at(brick_start(l, key), weight);
    }

    #[inline]
    fn add_at(&mut self, at: u64, weight: i64) {
        let at = at.clamp(self.own.start, self.own.end - 1) >> self.shift << self.shift;
        match self.bins.last_mut().filter(|last| last.0 == at) {
            Some(last) => last.1 += weight,
            None => self.bins.push((at, weight)),
        }
    }

    /// The bins in order. Where leaves that are deleted lie in other bins than the octants that were split for them, a bin
    /// may be negative: it is nothing, and takes the rest from those behind.
    fn bins(mut self) -> Vec<Bin> {
        self.bins.sort_by_key(|b| b.0);
        let mut owed = 0;
        let mut weigh = |all: &[(u64, i64)]| {
            let sum: i64 = owed + all.iter().map(|b| b.1).sum::<i64>();
            owed = sum.min(0);
            (all[0].0, sum.max(0) as u64)
        };
        self.bins.chunk_by(|a, b| a.0 == b.0).map(&mut weigh).collect()
    }

    fn cut(self, comm: &dyn Comm) -> Option<Ownership> {
        let own = self.own.start;
        let changes = curve::cut_anew(&self.bins(), own, SLACK_WORK, comm)?;
        Some(Ownership::along(comm.rank(), comm.size(), changes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::start57;
    use crate::tree::per_level;

    const LEVEL: Level = 5;

    /// All bricks of the level below, the same octants in each, and more of some in the middle.
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

    /// Leaves by bin, told octant by octant.
    fn exact(split: &PerLevel) -> Vec<u64> {
        let mut bins = vec![0; 1 << (3 * LEVEL)];
        split[LEVEL as usize + 1].codes().for_each(|code| bins[code as usize >> 3] += 7);
        bins
    }

    /// The most by which what is before a bin differs from what octants tell, for trees of some bricks.
    fn furthest_off(mut split: PerLevel) -> u64 {
        let exact = exact(&split);
        let [mut crossing, mut inside, mut deleted] = [per_level(), per_level(), per_level()];
        let parts = Parts {
            split: &mut split,
            crossing: &mut crossing,
            inside: &mut inside,
            deleted: &mut deleted,
        };
        let weighed = Weighed::new(&parts, &Ownership::solo(), LEVEL, true);
        let (mut told, mut want, mut off) = (0, 0u64, 0);
        let mut bins = weighed.0.iter().peekable();
        for (bin, leaves) in (0..).zip(exact) {
            want += leaves;
            while let Some(b) = bins.next_if(|b| b.0 <= start57(LEVEL, bin)) {
                told += b.1;
            }
            off = off.max(told.abs_diff(want));
        }
        assert_eq!((told, bins.next()), (want, None));
        off
    }

    #[test]
    fn bricks_weigh_what_they_do_where_their_octants_are_and_many_to_within_a_brick() {
        let many = split();
        let mut few = per_level();
        let l = LEVEL as usize + 1;
        many[l].bricks().take(BRICKS_MANY - 1).for_each(|b| few[l].push(b.key, b.bits));
        assert_eq!(furthest_off(few), 0);
        assert!((1..=7 * 64).contains(&furthest_off(many)));
    }

    #[test]
    fn of_many_bricks_some_stand_for_all() {
        // Alike in wide stretches: whatever is looked at, the sums are about what all make.
        let mut tree = Tree { split: split(), ..Tree::default() };
        for l in 0..=LEVEL as usize {
            tree.split[l] = tree.split[LEVEL as usize + 1].coarsen();
            for _ in l..LEVEL as usize {
                tree.split[l] = tree.split[l].coarsen();
            }
        }
        tree.check_structure();
        let mut some = Scale::new(&Ownership::solo(), LEVEL);
        let mut all = Scale::new(&Ownership::solo(), LEVEL);
        for l in 1..tree.split.len() as Level {
            weigh_level(&tree, l, 7, &mut some);
            for b in Tree::exists(&tree.split, l) {
                all.add(l, b.key, cost(b.bits & !tree.split[l as usize].get(b.key)));
            }
        }
        let (some, all) = (some.bins(), all.bins());
        let sum = |bins: &[Bin]| bins.iter().map(|b| b.1).sum::<u64>();
        assert!(some.len() < all.len() / 5, "{} of {} bins looked at", some.len(), all.len());
        assert!(
            sum(&some).abs_diff(sum(&all)) < sum(&all) / 20,
            "{} for {}",
            sum(&some),
            sum(&all)
        );
        // In every eighth of the curve, too.
        for eighth in 0..8 {
            let within = |bins: &[Bin]| -> Vec<Bin> {
                bins.iter().copied().filter(|b| b.0 >> (3 * LEVEL_MAX - 3) == eighth).collect()
            };
            let (some, all) = (sum(&within(&some)), sum(&within(&all)));
            assert!(some.abs_diff(all) < all / 10, "eighth {eighth}: {some} for {all}");
        }
    }
}
